//! Batches: the nodes of one level that wait for their turn and are evaluated by functions have it together, since none of them can hear of the
//! others: first all are evaluated, on several threads where that pays, then their values are copied along routes.
//!
//! Whether nodes form a batch is decided by what waits, never by the number of threads; each node's writes have the revision of its place in
//! the batch. So the number of threads changes nothing but the time. Each thread works on stretches of the columns that are its own.

use std::collections::HashMap;
use std::time::Instant;

use crossbeam::deque::{Injector, Steal};

use crate::changes::Revision;
use crate::column::{Places, Stretches};
use crate::evaluation::{Evaluation, Store};
use crate::frame::Problem;
use crate::graph::Node;
use crate::schedule::{EVALUATES, NATIVE, NO_RANK, OBSERVED, Turn};
use crate::{Evaluator, FieldId, Graph, NoHost, NodeId};

/// Fewer nodes have their turns one by one.
const BATCH_FROM: usize = 32;
/// Starting threads takes about this long, so less work is done sooner by one.
const PAYS_FROM_NS: f64 = 100_000.0;
/// What an evaluation is taken for before any of its level was measured.
const GUESS_NS: f64 = 100.0;
/// Nodes between places where a level may be cut.
const BLOCK: usize = 16;
/// Pieces for each thread: the others go on while one is kept from working.
const PIECES: usize = 8;

/// What is known of a level.
#[derive(Debug)]
struct Level {
    /// Where it may be cut.
    cuts: Vec<Cut>,
    /// The layout that they are for.
    layout: u64,
    /// Of an evaluation.
    cost_ns: f64,
}

/// A place where all that belongs to the nodes of a level lies on either side: nodes before it and their values, and those after.
#[derive(Clone, Debug)]
struct Cut {
    node: u32,
    places: Places,
}

/// What is kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Batches {
    /// One or none: no threads but the caller's.
    pub(crate) threads: usize,
    /// Levels that end here or before were looked at in this frame.
    until: usize,
    slots: Vec<u32>,
    /// By the rank of a level's end.
    levels: HashMap<usize, Level>,
}

impl Batches {
    pub(crate) fn end_frame(&mut self) {
        self.until = 0;
    }
}

/// What evaluations read that is not theirs alone.
struct View<'a> {
    nodes: &'a slotmap::SlotMap<NodeId, Node>,
    ids: &'a [NodeId],
    silenced: &'a HashMap<FieldId, Revision>,
    time_s: f64,
    frame: u64,
    boundary: Revision,
}

/// Nodes that one thread evaluates one after the other, and all that they may write.
struct Piece<'a> {
    number: usize,
    slots: &'a [u32],
    /// The revision of the first one's writes; each has the next.
    revision: Revision,
    values: Stretches<'a>,
    /// The node that the following start with.
    first: u32,
    turns: &'a mut [Turn],
    node_revisions: &'a mut [Revision],
}

/// What a piece leaves for others to be told of.
#[derive(Default)]
struct Done {
    number: usize,
    problems: Vec<Problem>,
    again: Vec<u32>,
    /// Nodes that must be added to the change log.
    unlogged: Vec<u32>,
}

impl View<'_> {
    fn run(&self, piece: Piece<'_>) -> Done {
        let mut done = Done { number: piece.number, ..Done::default() };
        let (mut problems, mut values) = (Vec::new(), piece.values);
        let Some(first) = piece.slots.first() else { return done };
        let id = self.ids[*first as usize];
        // One for all nodes of the piece: it borrows the piece's values for good.
        let mut evaluation = Evaluation {
            id,
            slot: *first,
            node: &self.nodes[id],
            store: Store::Apart { values: &mut values, revision: piece.revision, wrote: false },
            silenced: self.silenced,
            problems: &mut problems,
            time_s: self.time_s,
            evaluated: 0,
            again: false,
        };
        for (slot, next) in piece.slots.iter().zip(piece.revision..) {
            let id = self.ids[*slot as usize];
            let node = &self.nodes[id];
            let Evaluator::Native(evaluate) = &node.node_type.evaluator else { continue };
            let at = (slot - piece.first) as usize;
            let turn = &mut piece.turns[at];
            (evaluation.id, evaluation.slot, evaluation.node) = (id, *slot, node);
            (evaluation.evaluated, evaluation.again) = (turn.evaluated, false);
            if let Store::Apart { revision, wrote, .. } = &mut evaluation.store {
                (*revision, *wrote) = (next, false);
            }
            evaluate(&mut evaluation);
            if evaluation.again {
                done.again.push(*slot);
            }
            turn.had(self.frame, next);
            if let Store::Apart { wrote: true, .. } = evaluation.store {
                let last = std::mem::replace(&mut piece.node_revisions[at], next);
                if last <= self.boundary {
                    done.unlogged.push(*slot);
                }
            }
        }
        done.problems = problems;
        done
    }

    fn work(&self, queue: &Injector<Piece<'_>>) -> Vec<Done> {
        let mut done = Vec::new();
        loop {
            match queue.steal() {
                Steal::Success(piece) => done.push(self.run(piece)),
                Steal::Retry => {}
                Steal::Empty => return done,
            }
        }
    }

    fn work_on_threads(&self, queue: Injector<Piece<'_>>, threads: usize) -> Vec<Done> {
        let done = crossbeam::thread::scope(|scope| {
            let others: Vec<_> = (1..threads).map(|_| scope.spawn(|_| self.work(&queue))).collect();
            let mut done = self.work(&queue);
            for other in others {
                done.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            }
            done
        });
        let mut done = done.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        done.sort_unstable_by_key(|done| done.number);
        done
    }
}

impl Graph {
    /// How many threads evaluate nodes that do not depend on each other, where that pays; 0 is as many as there are cores, 1 is the default.
    /// Values, revisions and reports are the same for any number. Only types that a function evaluates ([`crate::NodeType::evaluate`]) take part.
    pub fn set_threads(&mut self, threads: usize) {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        self.batches.threads = if threads == 0 { cores() } else { threads };
    }

    /// Has the turns of those nodes of the next level that can have them together, if that was not tried in this frame and they are many.
    #[inline]
    pub(crate) fn run_batch(&mut self) {
        if self.schedule.waiting() >= BATCH_FROM {
            self.run_large_batch();
        }
    }

    fn run_large_batch(&mut self) {
        let lowest = self.schedule.lowest_waiting();
        if lowest < self.batches.until {
            return;
        }
        let Some(end) = self.schedule.level_end(lowest) else { return };
        self.batches.until = end;
        let mut slots = std::mem::take(&mut self.batches.slots);
        self.schedule.take_together(
            end,
            &mut slots,
            |flags| flags & (EVALUATES | NATIVE | OBSERVED) == EVALUATES | NATIVE,
            BATCH_FROM,
        );
        if !slots.is_empty() {
            self.evaluate_together(&slots, end);
            for slot in &slots {
                self.finish_turn(*slot);
            }
        }
        slots.clear();
        self.batches.slots = slots;
    }

    /// Evaluates the nodes of a level that ends at a rank.
    fn evaluate_together(&mut self, slots: &[u32], end: usize) {
        self.frame.report.evaluated += slots.len();
        if self.explain.is_some() {
            return self.evaluate_by_turns(slots);
        }
        let cost_ns = self.batches.levels.get(&end).map_or(GUESS_NS, |level| level.cost_ns);
        let threads = if cost_ns * slots.len() as f64 > PAYS_FROM_NS { self.batches.threads.max(1) } else { 1 };
        let start = Instant::now();
        let used = if threads > 1 { self.evaluate_on_threads(slots, end, threads) } else { 1 };
        if used == 1 {
            self.evaluate_by_turns(slots);
        }
        let ns = start.elapsed().as_nanos() as f64 * used as f64 / slots.len() as f64;
        let empty = Level { cuts: Vec::new(), layout: u64::MAX, cost_ns: ns };
        let level = self.batches.levels.entry(end).or_insert(empty);
        // Much longer than ever means that somebody else had the processor.
        level.cost_ns += (ns.min(4.0 * level.cost_ns) - level.cost_ns) / 8.0;
    }

    fn evaluate_by_turns(&mut self, slots: &[u32]) {
        let first = self.changes.last() + 1;
        for (slot, revision) in slots.iter().zip(first..) {
            let id = self.ids[*slot as usize];
            match self.explain {
                Some(_) => drop(self.evaluate_explained(id, &mut NoHost)),
                None => self.evaluate_native(id),
            }
            self.changes.catch_up(revision);
            self.schedule.turns[*slot as usize].had(self.schedule.frame, revision);
        }
    }

    /// How many threads did it; one, if the nodes' values lie so mixed that nothing can be cut: then nothing is done.
    fn evaluate_on_threads(&mut self, slots: &[u32], end: usize, threads: usize) -> usize {
        self.plan(end);
        let Some(level) = self.batches.levels.get(&end) else { return 1 };
        let least = (slots.len() / (threads * PIECES)).max(1);
        let mut cuts: Vec<(usize, &Cut)> = Vec::new();
        for cut in &level.cuts {
            let place = slots.partition_point(|slot| *slot < cut.node);
            let before = cuts.last().map_or(0, |(place, _)| *place);
            if place - before >= least && slots.len() - place >= least {
                cuts.push((place, cut));
            }
        }
        if cuts.is_empty() {
            return 1;
        }
        let revision = self.changes.last() + 1;
        let (boundary, mut node_revisions) = self.changes.parts();
        let mut values = self.columns.stretches();
        let mut turns = &mut self.schedule.turns[..];
        let (mut from, mut first) = (0, 0);
        let queue = Injector::new();
        let pieces = cuts.len() + 1;
        let ends = cuts.into_iter().map(|(place, cut)| (place, Some(cut))).chain([(slots.len(), None)]);
        for (number, (to, cut)) in ends.enumerate() {
            // What is behind the cut is for the next ones.
            let (node, rest_values) = match cut {
                Some(cut) => (cut.node, values.split_off(&cut.places)),
                None => (first + turns.len() as u32, Stretches::default()),
            };
            let length = (node - first) as usize;
            let (own_turns, rest_turns) = turns.split_at_mut(length);
            let (own_revisions, rest_revisions) = node_revisions.split_at_mut(length);
            queue.push(Piece {
                number,
                slots: &slots[from..to],
                revision: revision + from as u64,
                values: std::mem::replace(&mut values, rest_values),
                first,
                turns: own_turns,
                node_revisions: own_revisions,
            });
            (turns, node_revisions, from, first) = (rest_turns, rest_revisions, to, node);
        }
        let (nodes, ids, silenced) = (&self.nodes, &self.ids[..], &self.silenced);
        let view = View { nodes, ids, silenced, time_s: self.frame.time_s, frame: self.schedule.frame, boundary };
        let used = threads.min(pieces);
        for done in view.work_on_threads(queue, used) {
            self.frame.report.problems.extend(done.problems);
            done.again.into_iter().for_each(|slot| self.schedule.again(slot));
            self.changes.log(&done.unlogged);
        }
        self.changes.catch_up(revision + slots.len() as u64 - 1);
        used
    }

    /// Finds where a level may be cut, unless that is known.
    fn plan(&mut self, end: usize) {
        let layout = self.schedule.layout;
        if self.batches.levels.get(&end).is_some_and(|level| level.layout == layout) {
            return;
        }
        let (nodes, ids) = (&self.nodes, &self.ids);
        let native = |slot: &u32| matches!(nodes[ids[*slot as usize]].node_type.evaluator, Evaluator::Native(_));
        let slots: Vec<u32> = self.schedule.level(end).iter().copied().filter(|slot| *slot != NO_RANK).filter(native).collect();
        // By block, the lowest place in each column, and the one behind the highest.
        let bounds = |block: &[u32]| {
            let (mut low, mut high) = (Places::filled(u32::MAX), Places::filled(0));
            for slot in block {
                let node = &nodes[ids[*slot as usize]];
                for (index, field) in node.fields() {
                    let place = node.slots[index as usize];
                    let (low, high) = (low.of_mut(field.field_type), high.of_mut(field.field_type));
                    (*low, *high) = ((*low).min(place), (*high).max(place + 1));
                }
            }
            (low, high)
        };
        let blocks: Vec<(Places, Places)> = slots.chunks(BLOCK).map(bounds).collect();
        let mut lowest_after = vec![Places::filled(u32::MAX); blocks.len() + 1];
        for (at, (low, _)) in blocks.iter().enumerate().rev() {
            lowest_after[at] = low.clone().each(&lowest_after[at + 1], u32::min);
        }
        let mut highest = Places::filled(0);
        let mut cuts = Vec::new();
        for (at, (_, high)) in blocks.iter().enumerate().take(blocks.len().saturating_sub(1)) {
            highest = highest.each(high, u32::max);
            if highest.all_up_to(&lowest_after[at + 1]) {
                cuts.push(Cut { node: slots[(at + 1) * BLOCK], places: highest.clone() });
            }
        }
        if let Some(level) = self.batches.levels.get_mut(&end) {
            (level.cuts, level.layout) = (cuts, layout);
        } else {
            self.batches.levels.insert(end, Level { cuts, layout, cost_ns: GUESS_NS });
        }
    }
}
