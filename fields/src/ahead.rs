//! Evaluation on several threads: nodes of one level that wait for their turn are evaluated ahead of it, side by side, on the graph as it is;
//! what they write is kept. Turns stay where they are, one after the other: a node takes over what was computed if nobody has touched it since,
//! and is evaluated anew if somebody has. So the number of threads changes nothing but the time.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;

use crossbeam::deque::{Injector, Steal};

use crate::changes::{ChangeLog, Revision};
use crate::column::Columns;
use crate::evaluation::{Evaluation, Store};
use crate::frame::Problem;
use crate::graph::{Node, slot_of};
use crate::kept::Kept;
use crate::schedule::{EVALUATES, Schedule};
use crate::{Evaluator, FieldId, Graph, NodeId, NodeType};

/// Starting threads and collecting what they did takes about this long, so less work is done sooner by one.
const PAYS_FROM_NS: f32 = 150_000.0;
/// What an evaluation of a type that was never measured is taken for.
const GUESS_NS: f32 = 100.0;
/// One in so many evaluations is measured.
const MEASURED: usize = 256;
/// Work is handed out in pieces of about this long.
const PIECE_NS: f32 = 50_000.0;

/// What an evaluation ahead of its turn came to.
#[derive(Debug)]
struct Outcome {
    id: NodeId,
    /// The node's last write and last evaluation when it was evaluated ahead: others since then make it void.
    seen: (Revision, Revision),
    /// Where its writes and problems end in the piece's lists.
    writes_end: usize,
    problems_end: usize,
    again: bool,
}

/// Nodes that one thread evaluates one after the other.
#[derive(Debug, Default)]
struct Piece {
    number: usize,
    slots: Vec<u32>,
    outcomes: Vec<Outcome>,
    writes: Kept,
    problems: Vec<Problem>,
    /// How far the turns are.
    next: usize,
}

/// What is kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Ahead {
    /// One or none: no evaluation ahead of turns.
    pub(crate) threads: usize,
    /// Levels that end here or before were looked at in this frame.
    until: usize,
    pieces: Vec<Piece>,
    /// The piece that the turns have come to.
    at: usize,
    /// Pieces to be used again, for their memory.
    spare: Vec<Piece>,
    /// Time of an evaluation by the address of the node type.
    costs: HashMap<usize, f32>,
    since_measured: usize,
}

impl Ahead {
    pub(crate) fn end_frame(&mut self) {
        self.until = 0;
        self.drop_pieces();
    }

    fn drop_pieces(&mut self) {
        self.at = 0;
        for mut piece in self.pieces.drain(..) {
            piece.slots.clear();
            piece.outcomes.clear();
            piece.writes.clear();
            piece.problems.clear();
            piece.next = 0;
            self.spare.push(piece);
        }
    }

    fn cost(&self, node_type: &Arc<NodeType>) -> Option<f32> {
        self.costs.get(&(Arc::as_ptr(node_type) as usize)).copied()
    }
}

/// The parts of a graph that evaluations ahead of their turn read.
struct View<'a> {
    nodes: &'a slotmap::SlotMap<NodeId, Node>,
    ids: &'a [NodeId],
    columns: &'a Columns,
    changes: &'a ChangeLog,
    schedule: &'a Schedule,
    silenced: &'a HashMap<FieldId, Revision>,
    time_s: f64,
}

impl View<'_> {
    fn run(&self, piece: &mut Piece) {
        for slot in &piece.slots {
            let id = self.ids[*slot as usize];
            let node = &self.nodes[id];
            let Evaluator::Native(evaluate) = &node.node_type.evaluator else { continue };
            let evaluated = self.schedule.turns[*slot as usize].evaluated;
            let first = piece.writes.len();
            let mut evaluation = Evaluation {
                id,
                slot: *slot,
                node,
                store: Store::Ahead { columns: self.columns, writes: &mut piece.writes, first },
                silenced: self.silenced,
                problems: &mut piece.problems,
                time_s: self.time_s,
                evaluated,
                again: false,
            };
            evaluate(&mut evaluation);
            let again = evaluation.again;
            let (writes_end, problems_end) = (piece.writes.len(), piece.problems.len());
            piece.outcomes.push(Outcome { id, seen: (self.changes.node(*slot), evaluated), writes_end, problems_end, again });
        }
    }

    fn work(&self, queue: &Injector<Piece>) -> Vec<Piece> {
        let mut done = Vec::new();
        loop {
            match queue.steal() {
                Steal::Success(mut piece) => {
                    self.run(&mut piece);
                    done.push(piece);
                }
                Steal::Retry => {}
                Steal::Empty => return done,
            }
        }
    }
}

impl Graph {
    /// How many threads evaluate nodes that do not depend on each other, where that pays; 0 is as many as there are cores, 1 is the default.
    /// Values, revisions and reports are the same for any number. Only types that a function evaluates ([`NodeType::evaluate`]) take part.
    pub fn set_threads(&mut self, threads: usize) {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        self.ahead.threads = if threads == 0 { cores() } else { threads };
    }

    /// Evaluates those nodes of the next level that wait for their turn, if that was not tried in this frame and pays.
    pub(crate) fn evaluate_ahead(&mut self) {
        let lowest = self.schedule.lowest_waiting();
        if lowest < self.ahead.until || lowest == usize::MAX || self.explain.is_some() {
            return;
        }
        let Some(end) = self.schedule.level_end(lowest) else { return };
        self.ahead.until = end;
        self.ahead.drop_pieces();
        let queue = self.pieces_below(end);
        if queue.is_empty() {
            return;
        }
        let view = View {
            nodes: &self.nodes,
            ids: &self.ids,
            columns: &self.columns,
            changes: &self.changes,
            schedule: &self.schedule,
            silenced: &self.silenced,
            time_s: self.frame.time_s,
        };
        let mut pieces = run_on_threads(&view, &queue, self.ahead.threads.min(queue.len()));
        pieces.sort_unstable_by_key(|piece| piece.number);
        self.ahead.pieces = pieces;
    }

    /// What waits below a rank, in pieces; none if there is too little.
    fn pieces_below(&mut self, end: usize) -> Injector<Piece> {
        let queue = Injector::new();
        let (mut total, mut in_piece) = (0.0, 0.0);
        let mut last_type: Option<(&Arc<NodeType>, f32)> = None;
        let mut unknown = false;
        let mut pieces = Vec::new();
        let mut piece = self.ahead.spare.pop().unwrap_or_default();
        for slot in self.schedule.waiting_below(end) {
            if self.schedule.flags[slot as usize] & EVALUATES == 0 {
                continue;
            }
            let node_type = &self.nodes[self.ids[slot as usize]].node_type;
            let cost = match last_type {
                Some((known, cost)) if Arc::ptr_eq(known, node_type) => cost,
                _ if !matches!(node_type.evaluator, Evaluator::Native(_)) => continue,
                _ => self.ahead.cost(node_type).unwrap_or_else(|| {
                    unknown = true;
                    GUESS_NS
                }),
            };
            last_type = Some((node_type, cost));
            piece.slots.push(slot);
            (total, in_piece) = (total + cost, in_piece + cost);
            if in_piece >= PIECE_NS {
                in_piece = 0.0;
                piece.number = pieces.len();
                pieces.push(std::mem::replace(&mut piece, self.ahead.spare.pop().unwrap_or_default()));
            }
        }
        piece.number = pieces.len();
        pieces.push(piece);
        if unknown {
            self.ahead.since_measured = MEASURED;
        }
        if total < PAYS_FROM_NS {
            self.ahead.pieces = pieces;
            self.ahead.drop_pieces();
        } else {
            pieces.into_iter().for_each(|piece| queue.push(piece));
        }
        queue
    }

    /// Takes over what was computed ahead of the node's turn; false if nothing was, or if the node was touched since.
    pub(crate) fn take_from_ahead(&mut self, id: NodeId) -> bool {
        let slot = slot_of(id);
        let Some(place) = self.ahead.find(slot) else { return false };
        let piece = &mut self.ahead.pieces[self.ahead.at];
        let outcome = &piece.outcomes[place];
        let seen = (self.changes.node(slot), self.schedule.turns[slot as usize].evaluated);
        if outcome.id != id || outcome.seen != seen {
            return false;
        }
        let before = place.checked_sub(1).map(|before| &piece.outcomes[before]);
        let (writes_start, problems_start) = before.map_or((0, 0), |before| (before.writes_end, before.problems_end));
        for write in writes_start..outcome.writes_end {
            let revision = self.changes.next();
            piece.writes.write(write, &mut self.columns, revision);
            self.changes.wrote(slot, revision);
        }
        if problems_start < outcome.problems_end {
            self.frame.report.problems.extend_from_slice(&piece.problems[problems_start..outcome.problems_end]);
        }
        if outcome.again {
            self.schedule.again(slot);
        }
        true
    }

    /// Evaluates a node now, and now and then measures how long that takes.
    pub(crate) fn evaluate_measured(&mut self, id: NodeId) {
        self.ahead.since_measured += 1;
        if self.ahead.since_measured < MEASURED {
            return self.evaluate_native(id);
        }
        self.ahead.since_measured = 0;
        let start = Instant::now();
        self.evaluate_native(id);
        let ns = start.elapsed().as_nanos() as f32;
        let cost = self.ahead.costs.entry(Arc::as_ptr(&self.nodes[id].node_type) as usize).or_insert(ns);
        *cost += (ns - *cost) / 8.0;
    }
}

impl Ahead {
    /// Where the outcome of a slot is in the piece `at`, which moves on: turns come in the order of the pieces.
    fn find(&mut self, slot: u32) -> Option<usize> {
        let mut skipped = 0;
        let (mut at, mut next) = (self.at, self.pieces.get(self.at)?.next);
        while let Some(piece) = self.pieces.get(at) {
            match piece.slots.get(next) {
                Some(found) if *found == slot => {
                    (self.at, self.pieces[at].next) = (at, next + 1);
                    return Some(next);
                }
                // A node that is not here must not cost a search of all; nodes that lost their turn are few.
                Some(_) if skipped == 64 => return None,
                Some(_) => (skipped, next) = (skipped + 1, next + 1),
                None => (at, next) = (at + 1, 0),
            }
        }
        None
    }
}

fn run_on_threads(view: &View<'_>, queue: &Injector<Piece>, threads: usize) -> Vec<Piece> {
    let done = crossbeam::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(|_| view.work(queue))).collect();
        let mut done = view.work(queue);
        for other in others {
            done.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        done
    });
    done.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
