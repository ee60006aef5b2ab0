//! Which nodes are evaluated how often, and how long that takes; and the graph as a picture.

use std::fmt::Write;
use std::time::Duration;

use crate::{Evaluator, Graph, NodeId, Strength};

/// What a node's evaluations come to.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// The node.
    pub node: NodeId,
    /// Its name and type, as messages call it.
    pub name: String,
    /// How often it was evaluated in its life.
    pub evaluations: u32,
    /// How long that took in sum, while the graph explained itself ([`Graph::explain`]).
    pub time: Duration,
}

impl Graph {
    /// The nodes that were evaluated at all: those that took longest first, then those that were evaluated most often.
    pub fn costs(&self) -> Vec<Cost> {
        let time = |node| self.explain.as_ref().and_then(|explain| explain.times.get(&node).copied()).unwrap_or_default();
        let cost = |node| Cost { node, name: self.describe(node), evaluations: self.evaluation_count(node), time: time(node) };
        let mut costs: Vec<Cost> = self.nodes().filter(|node| self.evaluation_count(*node) > 0).map(cost).collect();
        costs.sort_by(|a, b| (b.time, b.evaluations, a.node).cmp(&(a.time, a.evaluations, b.node)));
        costs
    }

    /// The graph in the language of Graphviz: `dot -Tsvg`. Nodes that are evaluated are rounded, weak routes dashed.
    pub fn dot(&self) -> String {
        let mut dot = String::from("digraph umbriel {\n  rankdir = LR;\n  node [shape = box];\n");
        let id = |node: NodeId| format!("n{}", crate::graph::slot_of(node));
        for node in self.nodes() {
            let style = if matches!(self.type_of(node).evaluator, Evaluator::None) { "" } else { ", style = rounded" };
            let _ = writeln!(dot, "  {} [label = {}{style}];", id(node), quoted(&self.describe(node).replace('`', "")));
        }
        let mut routes: Vec<_> = self.routes().map(|(_, route)| route).collect();
        routes.sort_by_key(|route| route.ordinal);
        for route in routes {
            let name = |field| self.declaration(field).map_or("", |field| &*field.name).to_string();
            let label = quoted(&format!("{} to {}", name(route.from), name(route.to)));
            let style = if route.strength == Strength::Weak { ", style = dashed" } else { "" };
            let _ = writeln!(dot, "  {} -> {} [label = {label}{style}];", id(route.from.node), id(route.to.node));
        }
        dot.push_str("}\n");
        dot
    }
}

/// A text in quotes, as Graphviz reads it.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}
