//! What is wrong with a scene, told once.

use super::read::{label, type_name};
use std::collections::{HashMap, HashSet};
use std::fmt;
use umbriel_fields::{Graph, NodeId};

/// Something in the graph that cannot be shown as it is. Everything else is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// The node that has to be mended.
    pub node: NodeId,
    /// Its name, or what it is.
    pub name: String,
    /// Its type.
    pub type_name: String,
    /// The field, or the part of the node, that is wrong.
    pub field: &'static str,
    /// What is wrong, and what is shown instead.
    pub message: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} '{}', {}: {}", self.type_name, self.name, self.field, self.message)
    }
}

/// Problems that stand, and those not yet told.
#[derive(Default)]
pub(super) struct Problems {
    standing: HashMap<(NodeId, &'static str), String>,
    untold: Vec<Problem>,
}

impl Problems {
    /// Tells a problem, unless the same already stands.
    pub(super) fn report(&mut self, graph: &Graph, node: NodeId, field: &'static str, message: impl Into<String>) {
        let message = message.into();
        if self.standing.get(&(node, field)) == Some(&message) {
            return;
        }
        self.standing.insert((node, field), message.clone());
        self.untold.push(Problem { node, name: label(graph, node), type_name: type_name(graph, node), field, message });
    }

    /// The problem is gone; it is told again should it come back.
    pub(super) fn mend(&mut self, node: NodeId, field: &'static str) {
        if !self.standing.is_empty() {
            self.standing.remove(&(node, field));
        }
    }

    /// Reports if there is a problem, mends if there is none.
    pub(super) fn set(&mut self, graph: &Graph, node: NodeId, field: &'static str, problem: Option<String>) {
        match problem {
            Some(message) => self.report(graph, node, field, message),
            None => self.mend(node, field),
        }
    }

    /// All problems of a kind that stand now; those of before that are not among them are gone.
    pub(super) fn replace_all(&mut self, graph: &Graph, field: &'static str, now: Vec<(NodeId, String)>) {
        let nodes: HashSet<NodeId> = now.iter().map(|(node, _)| *node).collect();
        self.standing.retain(|(node, of), _| *of != field || nodes.contains(node));
        let mut told = HashSet::new();
        for (node, message) in now.into_iter().filter(|(node, _)| told.insert(*node)) {
            self.report(graph, node, field, message);
        }
    }

    /// Forgets problems of dead nodes.
    pub(super) fn sweep(&mut self, graph: &Graph) {
        self.standing.retain(|(node, _), _| graph.contains(*node));
    }

    /// The problems that were not told yet.
    pub(super) fn drain(&mut self) -> Vec<Problem> {
        std::mem::take(&mut self.untold)
    }
}
