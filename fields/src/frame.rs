//! A frame: every node that has something to do gets its turn, sources first.

use std::collections::{BTreeSet, HashSet};

use crate::graph::slot_of;
use crate::propagate::Carried;
use crate::record::Event;
use crate::schedule::{EVALUATES, IN_TURN, NATIVE, OBSERVED, ROUTED, SILENCED};
use crate::{Changes, Error, Evaluator, FieldId, Graph, Mode, NodeId, Revision, Strength};

/// What the graph asks for while a frame is evaluated. Everything is allowed in these calls but to evaluate the graph: what is created,
/// connected or written for nodes that had their turn takes part from the next frame on.
pub trait Host {
    /// An observed field was written; see [`Graph::observe`].
    fn field_changed(&mut self, graph: &mut Graph, field: FieldId, token: u64) {
        let _ = (graph, field, token);
    }

    /// It is the turn of a node whose type is evaluated by the host.
    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        let _ = (graph, node);
    }
}

/// A host for graphs without script types and observers.
pub struct NoHost;

impl Host for NoHost {}

/// Something that an author should know of.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Where.
    pub node: NodeId,
    /// Which field, if it is about one.
    pub field: Option<FieldId>,
    /// What is wrong.
    pub message: String,
}

/// What happened in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameReport {
    /// Evaluations of nodes.
    pub evaluated: usize,
    /// Values written by routes.
    pub copied: usize,
    /// What nodes and hosts reported, since the last frame.
    pub problems: Vec<Problem>,
}

/// What is kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct FrameState {
    pub(crate) always: BTreeSet<u32>,
    pub(crate) dependencies: Vec<(NodeId, NodeId)>,
    /// Nodes that are evaluated only when asked for, and were.
    pub(crate) asked: HashSet<u32>,
    pub(crate) carried: Vec<Carried>,
    pub(crate) time_s: f64,
    pub(crate) report: FrameReport,
    /// Counts the calls of `evaluate`.
    pub(crate) number: u64,
    /// From the first delivery of a frame to its last turn.
    pub(crate) begun: bool,
}

impl FrameState {
    pub(crate) fn forget(&mut self, slot: u32) {
        self.always.remove(&slot);
        self.asked.remove(&slot);
    }
}

impl Graph {
    /// Evaluates one frame: every node that was written, or that asked for it, has one turn, after all nodes from which strong routes lead to it.
    ///
    /// A turn tells the node's observers what was written, evaluates the node, tells what that wrote, and copies along routes what was written.
    pub fn evaluate(&mut self, time_s: f64, host: &mut dyn Host) -> FrameReport {
        if self.schedule.running {
            let message = "the graph cannot be evaluated while it is being evaluated".to_string();
            return FrameReport {
                problems: vec![Problem { node: NodeId::default(), field: None, message }],
                ..FrameReport::default()
            };
        }
        self.frame.time_s = time_s;
        self.frame.number += 1;
        if let Some(explain) = &mut self.explain {
            explain.frame_begins(self.frame.number, time_s);
        }
        self.note(|| Event::Frame(time_s));
        let idle = self.schedule.is_idle() && self.frame.always.is_empty() && self.frame.carried.is_empty();
        if !idle {
            self.run_frame(host);
        }
        self.frame.dependencies.clear();
        self.note(|| Event::Leave);
        std::mem::take(&mut self.frame.report)
    }

    /// Tells observers of what was written after a revision, and has the host evaluate its nodes of those. Nothing goes along routes and no
    /// native node is evaluated: for a copy of a graph that another process evaluates.
    pub fn tell(&mut self, since: Revision, host: &mut dyn Host) {
        let nodes = match self.changes_since(since) {
            Changes::Nodes(nodes) => nodes,
            Changes::All => self.nodes.keys().collect(),
        };
        for id in nodes {
            let is_there = self.contains(id) && self.tell_observers(id, host);
            if is_there && matches!(self.nodes[id].node_type.evaluator, Evaluator::Host) {
                host.evaluate(self, id);
            }
        }
    }

    fn run_frame(&mut self, host: &mut dyn Host) {
        self.frame.begun = true;
        self.deliver_carried();
        for slot in &self.frame.always {
            self.schedule.mark(*slot);
        }
        self.schedule.rank_pending();
        self.refresh_order();
        self.schedule.start();
        while let Some(slot) = self.next_turn() {
            self.turn(slot, host);
        }
        self.batches.end_frame();
        self.frame.begun = false;
        self.schedule.running = false;
        self.frame.asked.clear();
    }

    #[inline]
    fn next_turn(&mut self) -> Option<u32> {
        self.run_batch();
        self.schedule.next()
    }

    /// The time of the frame that is or was last evaluated, in seconds.
    pub fn time(&self) -> f64 {
        self.frame.time_s
    }

    /// Adds to the report of this frame, or of the next if none is being evaluated.
    pub fn report(&mut self, node: NodeId, field: Option<FieldId>, message: impl Into<String>) {
        self.frame.report.problems.push(Problem { node, field, message: message.into() });
    }

    /// How often the node was evaluated; 0 for a deleted node.
    pub fn evaluation_count(&self, id: NodeId) -> u32 {
        if self.contains(id) { self.schedule.turns[slot_of(id) as usize].count } else { 0 }
    }

    /// True if the field was written since its node was last evaluated; for hosts that evaluate nodes.
    pub fn changed(&self, field: FieldId) -> bool {
        let revision = self.field_revision(field);
        revision > 0
            && revision > self.schedule.turns[slot_of(field.node) as usize].evaluated
            && self.silenced.get(&field) != Some(&revision)
    }

    /// Changes when a node is evaluated; its type says when at first.
    pub fn set_mode(&mut self, id: NodeId, mode: Mode) -> Result<(), Error> {
        self.node(id)?;
        self.note(|| Event::ModeSet(id, mode));
        let slot = slot_of(id);
        self.nodes[id].mode = mode;
        self.frame.always.remove(&slot);
        if mode == Mode::Always {
            self.frame.always.insert(slot);
        }
        let flags = self.nodes[id].base_flags();
        let at = &mut self.schedule.flags[slot as usize];
        *at = *at & !(EVALUATES | NATIVE) | flags;
        if mode == Mode::OnChange && self.changes.node(slot) > self.schedule.turns[slot as usize].evaluated {
            self.schedule.mark(slot);
        }
        Ok(())
    }

    /// Has a node evaluated in the next frame, or in this one if it has not had its turn, changed or not.
    pub fn wake(&mut self, id: NodeId) -> Result<(), Error> {
        self.node(id)?;
        self.note(|| Event::Woken(id));
        self.schedule.mark(slot_of(id));
        Ok(())
    }

    /// Evaluates a node of [`Mode::Pull`] now, if anything was written since its last evaluation, and before it those nodes of the same mode from
    /// which strong routes lead to it.
    pub fn pull(&mut self, id: NodeId, host: &mut dyn Host) -> Result<(), Error> {
        self.node(id)?;
        if self.schedule.flags[slot_of(id) as usize] & IN_TURN != 0 {
            return Err(Error::Evaluating { what: "pulling a node out of its own evaluation" });
        }
        self.note(|| Event::Pulled(id));
        for source in self.pulled_with(id) {
            let slot = slot_of(source);
            let Some(turn) = self.contains(source).then(|| self.schedule.turns[slot as usize]) else { continue };
            if turn.count == 0 || self.changes.node(slot) > turn.evaluated {
                self.frame.asked.insert(slot);
                self.turn(slot, host);
                self.frame.asked.remove(&slot);
            }
        }
        Ok(())
    }

    /// Asks for the turn of a node of [`Mode::Pull`], and of those that it needs.
    pub(crate) fn ask(&mut self, id: NodeId) {
        for source in self.pulled_with(id) {
            let slot = slot_of(source);
            self.frame.asked.insert(slot);
            if !self.schedule.waits(slot) {
                self.schedule.ranked(slot);
                self.schedule.enqueue(slot);
            }
        }
    }

    /// The node and its sources, all of [`Mode::Pull`], sources first; empty if the node is of another mode.
    fn pulled_with(&self, id: NodeId) -> Vec<NodeId> {
        let pulled = |node: NodeId| self.nodes[node].mode == Mode::Pull;
        let mut seen = HashSet::new();
        let mut order = Vec::new();
        let mut open = vec![(id, false)];
        while let Some((node, sources_done)) = open.pop() {
            if sources_done {
                order.push(node);
            } else if pulled(node) && seen.insert(node) {
                open.push((node, true));
                let incoming = self.nodes[node].incoming.iter().map(|route| &self.routes.all[*route]);
                open.extend(incoming.filter(|route| route.strength == Strength::Strong).map(|route| (route.from.node, false)));
            }
        }
        order
    }

    #[inline]
    fn turn(&mut self, slot: u32, host: &mut dyn Host) {
        let flags = self.schedule.flags[slot as usize];
        let asked = !self.frame.asked.is_empty() && self.frame.asked.contains(&slot);
        if (flags & !(ROUTED | SILENCED) != 0 || asked) && !self.live_turn(slot, asked, host) {
            return;
        }
        self.finish_turn(slot);
    }

    /// The part of a turn that follows the evaluation.
    #[inline]
    pub(crate) fn finish_turn(&mut self, slot: u32) {
        if self.schedule.flags[slot as usize] & ROUTED != 0 {
            self.copy_out(slot);
        } else {
            self.schedule.turns[slot as usize].propagated = self.changes.last();
        }
    }

    /// The part of a turn in which others have a say; false if the node was deleted on the way.
    fn live_turn(&mut self, slot: u32, asked: bool, host: &mut dyn Host) -> bool {
        let id = self.ids[slot as usize];
        let at = slot as usize;
        self.schedule.flags[at] |= IN_TURN;
        if self.schedule.flags[at] & OBSERVED != 0 && !self.tell_observers(id, host) {
            return false;
        }
        let evaluates = self.schedule.flags[at] & EVALUATES != 0 || asked;
        if evaluates && !self.evaluate_node(id, host) {
            return false;
        }
        self.schedule.flags[at] &= !IN_TURN;
        self.schedule.flags[at] & OBSERVED == 0 || self.tell_observers(id, host)
    }

    /// False if the node was deleted on the way.
    fn tell_observers(&mut self, id: NodeId, host: &mut dyn Host) -> bool {
        for due in self.observers_due(id) {
            let Some(observer) = self.observers.all.get(due).copied() else { continue };
            self.observers.all[due].seen = self.field_revision(observer.field);
            self.note(|| Event::Told(observer.field, observer.token));
            self.tell_explained(observer.field, observer.token, host);
            self.note(|| Event::Leave);
            if !self.contains(id) {
                return false;
            }
        }
        true
    }
}
