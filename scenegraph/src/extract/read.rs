//! Reading fields of nodes. A field that is not there (a foreign node type) reads as its type's empty value.

use glam::Vec3;
use std::sync::Arc;
use umbriel_fields::{Color, EnumValue, FieldId, FieldValue, Graph, NodeId, Revision};

/// The fields of one node.
#[derive(Clone, Copy)]
pub(super) struct Reader<'a> {
    pub(super) graph: &'a Graph,
    pub(super) node: NodeId,
}

impl<'a> Reader<'a> {
    pub(super) fn new(graph: &'a Graph, node: NodeId) -> Reader<'a> {
        Reader { graph, node }
    }

    pub(super) fn get<T: FieldValue>(&self, name: &str) -> T {
        self.graph.get_named::<T>(self.node, name).unwrap_or_else(|_| T::empty())
    }

    pub(super) fn at<T: FieldValue>(&self, index: u16) -> T {
        self.graph.get::<T>(FieldId { node: self.node, index }).unwrap_or_else(|_| T::empty())
    }

    pub(super) fn color(&self, name: &str) -> Vec3 {
        self.get::<Color>(name).0
    }

    /// Place of the chosen word in the list of the field's choices.
    pub(super) fn choice(&self, name: &str) -> u16 {
        self.get::<EnumValue>(name).0
    }

    /// The node that a field names, if it is alive.
    pub(super) fn node(&self, name: &str) -> Option<NodeId> {
        self.get::<Option<NodeId>>(name).filter(|id| self.graph.contains(*id))
    }

    /// The living nodes that a field names, with their places in it.
    pub(super) fn nodes(&self, name: &str) -> Vec<(usize, NodeId)> {
        let list: Arc<[Option<NodeId>]> = self.get(name);
        list.iter().enumerate().filter_map(|(i, id)| Some((i, (*id)?))).filter(|(_, id)| self.graph.contains(*id)).collect()
    }
}

/// The name of a node for messages: its own, or what it is.
pub(super) fn label(graph: &Graph, node: NodeId) -> String {
    match name_of(graph, node) {
        name if !name.is_empty() => name,
        _ if graph.contains(node) => format!("unnamed {}", type_name(graph, node)),
        _ => "deleted node".to_owned(),
    }
}

/// The name of a node's type; empty if the node is dead.
pub(super) fn type_name(graph: &Graph, node: NodeId) -> String {
    if graph.contains(node) { graph.type_of(node).name.to_string() } else { String::new() }
}

/// The own name of a node, or nothing.
pub(super) fn name_of(graph: &Graph, node: NodeId) -> String {
    graph.name(node).map(|n| n.to_string()).unwrap_or_default()
}

/// What tells whether anything that was made of these nodes is stale: the newest write, and how many live.
pub(super) fn stamp(graph: &Graph, nodes: &[NodeId]) -> (Revision, usize) {
    let living = nodes.iter().filter(|id| graph.contains(**id));
    living.fold((0, 0), |(newest, count), id| (newest.max(graph.node_revision(*id)), count + 1))
}
