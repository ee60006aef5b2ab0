//! The evaluation of one node in its turn.

use crate::evaluation::{Evaluation, Store};
use crate::graph::slot_of;
use crate::record::Event;
use crate::{Evaluator, Graph, Host, NodeId};

impl Graph {
    /// False if the node was deleted on the way.
    #[inline]
    pub(crate) fn evaluate_node(&mut self, id: NodeId, host: &mut dyn Host) -> bool {
        let slot = slot_of(id);
        self.frame.report.evaluated += 1;
        let count = &mut self.schedule.turns[slot as usize].count;
        *count = count.wrapping_add(1);
        if self.explain.is_some() {
            return self.evaluate_explained(id, host);
        }
        self.run_evaluator(id, host)
    }

    /// False if the node was deleted on the way.
    #[inline]
    pub(crate) fn run_evaluator(&mut self, id: NodeId, host: &mut dyn Host) -> bool {
        let slot = slot_of(id);
        match &self.nodes[id].node_type.evaluator {
            Evaluator::None => {}
            Evaluator::Native(_) => self.evaluate_native(id),
            Evaluator::Host => {
                self.note(|| Event::HostEvaluates(id));
                host.evaluate(self, id);
                self.note(|| Event::Leave);
                if !self.contains(id) {
                    return false;
                }
            }
        }
        self.schedule.turns[slot as usize].evaluated = self.changes.last();
        true
    }

    #[inline]
    pub(crate) fn evaluate_native(&mut self, id: NodeId) {
        let slot = slot_of(id);
        let node = &self.nodes[id];
        let Evaluator::Native(evaluate) = &node.node_type.evaluator else { return };
        let revision = self.changes.last() + 1;
        let mut evaluation = Evaluation {
            id,
            slot,
            node,
            store: Store::All { columns: &mut self.columns, changes: &mut self.changes, revision },
            silenced: &self.silenced,
            problems: &mut self.frame.report.problems,
            time_s: self.frame.time_s,
            evaluated: self.schedule.turns[slot as usize].evaluated,
            again: false,
        };
        evaluate(&mut evaluation);
        if evaluation.again {
            self.schedule.again(slot);
        }
        if self.changes.node(slot) == revision {
            self.changes.catch_up(revision);
        }
    }
}
