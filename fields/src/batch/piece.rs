//! Pieces: nodes of a level that one thread evaluates and copies from, one after the other, and all that this may write.

use std::collections::HashMap;

use crossbeam::deque::{Injector, Steal};
use slotmap::SlotMap;

use crate::changes::Revision;
use crate::column::Stretches;
use crate::evaluation::{Evaluation, Store};
use crate::frame::Problem;
use crate::graph::Node;
use crate::program::Programs;
use crate::schedule::{ROUTED, SILENCED, Turn, is_news};
use crate::{Evaluator, FieldId, NodeId};

/// So many nodes are evaluated before their values are copied, which are still in the first cache then.
const CHUNK: usize = 64;

/// What all threads read.
pub(super) struct View<'a> {
    pub(super) nodes: &'a SlotMap<NodeId, Node>,
    pub(super) ids: &'a [NodeId],
    pub(super) silenced: &'a HashMap<FieldId, Revision>,
    pub(super) flags: &'a [u8],
    pub(super) programs: &'a Programs,
    pub(super) time_s: f64,
    pub(super) frame: u64,
    /// Nodes that were not written since are added to the change log.
    pub(super) boundary: Revision,
    /// The evaluation of the node at place p of the batch writes with this revision plus p; what is copied from it, with the number of
    /// nodes more.
    pub(super) revision: Revision,
    pub(super) count: usize,
    /// What pieces are there for.
    pub(super) does: Does,
}

/// What is done with the nodes of a piece.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Does {
    Evaluate,
    Copy,
    Both,
}

/// Nodes that one thread has for itself, in the order of their slots.
pub(super) struct Piece<'a> {
    pub(super) number: usize,
    pub(super) slots: &'a [u32],
    /// The place of the first one in the batch.
    pub(super) place: usize,
    pub(super) values: Stretches<'a>,
    /// The node that the following start with.
    pub(super) first: u32,
    pub(super) turns: &'a mut [Turn],
    pub(super) node_revisions: &'a mut [Revision],
}

/// What a piece leaves for others to be told of.
#[derive(Default)]
pub(super) struct Done {
    number: usize,
    pub(super) problems: Vec<Problem>,
    pub(super) again: Vec<u32>,
    /// Nodes that must be added to the change log: evaluated ones, and those to which values were copied.
    pub(super) evaluated: Vec<u32>,
    pub(super) written: Vec<u32>,
    pub(super) copied: usize,
    /// Nodes that want a turn now.
    pub(super) marked: Vec<u32>,
    /// Nodes whose routes are more than one copy.
    pub(super) rest: Vec<u32>,
}

impl View<'_> {
    /// Does all pieces, on as many threads; what they leave is in the order of the pieces.
    pub(super) fn run_all(&self, queue: &Injector<Piece<'_>>, threads: usize) -> Vec<Done> {
        if threads == 1 {
            return self.work(queue);
        }
        let done = crossbeam::thread::scope(|scope| {
            let others: Vec<_> = (1..threads).map(|_| scope.spawn(|_| self.work(queue))).collect();
            let mut done = self.work(queue);
            for other in others {
                done.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            }
            done
        });
        let mut done = done.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        done.sort_unstable_by_key(|done| done.number);
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

    fn run(&self, mut piece: Piece<'_>) -> Done {
        let mut done = Done { number: piece.number, ..Done::default() };
        let slots = piece.slots;
        for (slots, place) in slots.chunks(CHUNK).zip((piece.place..).step_by(CHUNK)) {
            if self.does != Does::Copy {
                self.evaluate(&mut piece, slots, self.revision + place as u64, &mut done);
            }
            if self.does != Does::Evaluate {
                self.copy(&mut piece, slots, self.revision + (self.count + place) as u64, &mut done);
            }
        }
        done
    }

    /// Evaluates nodes, each with the next revision.
    fn evaluate(&self, piece: &mut Piece<'_>, slots: &[u32], revision: Revision, done: &mut Done) {
        let mut values = piece.values.reborrow();
        let Some(first) = slots.first() else { return };
        let id = self.ids[*first as usize];
        // One for all: it borrows the values for good.
        let mut evaluation = Evaluation {
            id,
            slot: *first,
            node: &self.nodes[id],
            store: Store::Apart { values: &mut values, revision, wrote: false },
            silenced: self.silenced,
            problems: &mut done.problems,
            time_s: self.time_s,
            evaluated: 0,
            again: false,
        };
        for (slot, next) in slots.iter().zip(revision..) {
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
                    done.evaluated.push(*slot);
                }
            }
        }
    }

    /// Copies along the routes of nodes that have one, each with the next revision.
    fn copy(&self, piece: &mut Piece<'_>, slots: &[u32], revision: Revision, done: &mut Done) {
        // No later write is older than the last evaluation.
        let last = self.revision + self.count as u64 - 1;
        for (slot, next) in slots.iter().zip(revision..) {
            let flags = self.flags[*slot as usize];
            let propagated = &mut piece.turns[(slot - piece.first) as usize].propagated;
            if flags & ROUTED == 0 {
                *propagated = last;
                continue;
            }
            let Some(hop) = self.programs.hop(*slot).filter(|_| flags & SILENCED == 0) else {
                done.rest.push(*slot);
                continue;
            };
            let before = std::mem::replace(propagated, last);
            if !piece.values.copy(&hop, before, next) {
                continue;
            }
            done.copied += 1;
            let node = (hop.node - piece.first) as usize;
            if std::mem::replace(&mut piece.node_revisions[node], next) <= self.boundary {
                done.written.push(hop.node);
            }
            if is_news(self.flags[hop.node as usize]) {
                done.marked.push(hop.node);
            }
        }
    }
}
