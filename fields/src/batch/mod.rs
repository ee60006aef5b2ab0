//! Batches: the nodes of one level that wait for their turn and are evaluated by functions have it together, since none of them can hear of the
//! others: they are evaluated and their values are copied along routes, on several threads where that pays.
//!
//! Whether nodes form a batch is decided by what waits, never by the number of threads; each node's writes have the revision of its place in
//! the batch, and so has what is copied from it. So the number of threads changes nothing but the time. Each thread works on stretches of the
//! columns that are its own.

mod piece;
mod plan;

use std::collections::HashMap;
use std::time::Instant;

use crossbeam::deque::Injector;

use crate::changes::Revision;
use crate::column::Stretches;
use crate::program::Program;
use crate::schedule::{EVALUATES, NATIVE, OBSERVED, ROUTED, SILENCED};
use crate::{Graph, NoHost};
use piece::{Does, Done, Piece, View};
use plan::{Cut, Plan};

/// Fewer nodes have their turns one by one.
const BATCH_FROM: usize = 32;
/// Starting threads takes about this long, so less work is done sooner by one.
const PAYS_FROM_NS: f64 = 100_000.0;
/// What an evaluation is taken for before any of its level was measured.
const GUESS_NS: f64 = 100.0;
/// Pieces for each thread: the others go on while one is kept from working.
const PIECES: usize = 8;

/// What is known of a level.
#[derive(Debug, Default)]
struct Level {
    plan: Plan,
    /// Of an evaluation with its copy, once it was measured.
    cost_ns: Option<f64>,
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
        // Levels are as old as the order.
        if self.schedule.waiting() >= BATCH_FROM && !self.schedule.stale {
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
            self.frame.report.evaluated += slots.len();
            self.make_programs(&slots);
            if self.explain.is_some() {
                self.explain_together(&slots);
            } else {
                self.run_together(&slots, end);
            }
        }
        slots.clear();
        self.batches.slots = slots;
    }

    /// So that all know beforehand who copies what.
    fn make_programs(&mut self, slots: &[u32]) {
        for slot in slots {
            if self.schedule.flags[*slot as usize] & ROUTED != 0 && *self.programs.get(*slot) == Program::Unmade {
                let program = self.make_program(*slot);
                self.programs.put(*slot, program);
            }
        }
    }

    /// The turns of nodes of a level that ends at a rank.
    fn run_together(&mut self, slots: &[u32], end: usize) {
        let cost_ns = self.batches.levels.get(&end).and_then(|level| level.cost_ns).unwrap_or(GUESS_NS);
        let threads = if cost_ns * slots.len() as f64 > PAYS_FROM_NS { self.batches.threads.max(1) } else { 1 };
        if threads > 1 {
            self.plan(end);
        }
        let start = Instant::now();
        let level = self.batches.levels.remove(&end).unwrap_or_default();
        let cuts = if threads > 1 { chosen(&level.plan.cuts, slots, threads * PIECES) } else { Vec::new() };
        let used = threads.min(cuts.len() + 1);
        let revision = self.changes.last() + 1;
        // Values that go to the other side of a cut are copied when all are evaluated.
        if used == 1 || level.plan.copies {
            self.run_pieces(slots, cuts, used, revision, Does::Both);
        } else {
            self.run_pieces(slots, cuts, used, revision, Does::Evaluate);
            self.run_pieces(slots, Vec::new(), 1, revision, Does::Copy);
        }
        let ns = start.elapsed().as_nanos() as f64 * used as f64 / slots.len() as f64;
        // Much longer than ever means that somebody else had the processor.
        let cost_ns = Some(level.cost_ns.map_or(ns, |known| known + (ns.min(4.0 * known) - known) / 8.0));
        self.batches.levels.insert(end, Level { cost_ns, ..level });
    }

    fn run_pieces(&mut self, slots: &[u32], cuts: Vec<(usize, &Cut)>, threads: usize, revision: Revision, does: Does) {
        let (boundary, mut node_revisions) = self.changes.parts();
        let mut values = self.columns.stretches();
        let mut turns = &mut self.schedule.turns[..];
        let (mut place, mut first) = (0, 0);
        let queue = Injector::new();
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
            let values = std::mem::replace(&mut values, rest_values);
            let slots = &slots[place..to];
            queue.push(Piece { number, slots, place, values, first, turns: own_turns, node_revisions: own_revisions });
            (turns, node_revisions, place, first) = (rest_turns, rest_revisions, to, node);
        }
        let view = View {
            nodes: &self.nodes,
            ids: &self.ids,
            silenced: &self.silenced,
            flags: &self.schedule.flags,
            programs: &self.programs,
            time_s: self.frame.time_s,
            frame: self.schedule.frame,
            boundary,
            revision,
            count: slots.len(),
            does,
        };
        let done = view.run_all(&queue, threads);
        // What pieces borrowed is free now.
        drop(queue);
        self.finish_together(done, revision + 2 * slots.len() as u64 - 1);
    }

    /// Tells others what pieces left.
    fn finish_together(&mut self, done: Vec<Done>, last: Revision) {
        done.iter().for_each(|done| self.changes.log(&done.evaluated));
        done.iter().for_each(|done| self.changes.log(&done.written));
        self.changes.catch_up(last);
        for done in &done {
            done.again.iter().for_each(|slot| self.schedule.again(*slot));
            self.frame.report.copied += done.copied;
        }
        done.iter().flat_map(|done| &done.marked).for_each(|slot| self.schedule.mark(*slot));
        for done in done {
            self.frame.report.problems.extend(done.problems);
            done.rest.into_iter().for_each(|slot| self.finish_turn(slot));
        }
    }

    /// The same, one by one and noting why; with the same revisions.
    fn explain_together(&mut self, slots: &[u32]) {
        let first = self.changes.last() + 1;
        let copies = first + slots.len() as u64;
        for (slot, revision) in slots.iter().zip(first..) {
            let _alive = self.evaluate_explained(self.ids[*slot as usize], &mut NoHost);
            self.changes.catch_up(revision);
            self.schedule.turns[*slot as usize].had(self.schedule.frame, revision);
        }
        let is_hop = |graph: &Graph, slot: u32| {
            let flags = graph.schedule.flags[slot as usize];
            flags & ROUTED == 0 || flags & SILENCED == 0 && graph.programs.hop(slot).is_some()
        };
        for (slot, revision) in slots.iter().zip(copies..) {
            if is_hop(self, *slot) {
                self.changes.catch_up(revision - 1);
                self.finish_turn(*slot);
            }
        }
        self.changes.catch_up(copies + slots.len() as u64 - 1);
        for slot in slots {
            if !is_hop(self, *slot) {
                self.finish_turn(*slot);
            }
        }
    }
}

/// Cuts that part nodes into about so many equal pieces, each with the place of the first node behind it.
fn chosen<'a>(cuts: &'a [Cut], slots: &[u32], pieces: usize) -> Vec<(usize, &'a Cut)> {
    let mut chosen: Vec<(usize, &Cut)> = Vec::new();
    for piece in 1..pieces {
        let wanted = slots[piece * slots.len() / pieces];
        let Some(cut) = cuts.get(cuts.partition_point(|cut| cut.node < wanted)) else { break };
        let place = slots.partition_point(|slot| *slot < cut.node);
        if place > chosen.last().map_or(0, |(place, _)| *place) && place < slots.len() {
            chosen.push((place, cut));
        }
    }
    chosen
}
