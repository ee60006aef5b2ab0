//! Finds the nodes of rigs in a graph, and reads their fields.

use crate::Error;
use crate::rig::RigError;
use std::collections::BTreeSet;
use std::sync::Arc;
use umbriel_fields::{Changes, EnumValue, FieldValue, Graph, NodeId, Revision};

/// The types that are found by what they are, wherever they stand in the graph.
#[derive(Clone, Debug, Default)]
pub(crate) struct RigNodes {
    seen: Option<Revision>,
    pub(crate) displays: BTreeSet<NodeId>,
    pub(crate) users: BTreeSet<NodeId>,
    pub(crate) pointers: BTreeSet<NodeId>,
}

impl RigNodes {
    /// Takes in what was created and deleted since the last time.
    pub(crate) fn update(&mut self, graph: &Graph) {
        match self.seen.map_or(Changes::All, |seen| graph.changes_since(seen)) {
            Changes::Nodes(nodes) => nodes.into_iter().for_each(|node| self.note(graph, node)),
            Changes::All => {
                *self = RigNodes::default();
                graph.nodes().for_each(|node| self.note(graph, node));
            }
        }
        self.seen = Some(graph.revision());
    }

    fn note(&mut self, graph: &Graph, node: NodeId) {
        let alive = graph.contains(node);
        let type_name = if alive { graph.type_of(node).name.clone() } else { Arc::from("") };
        let lists = [("Display", &mut self.displays), ("User", &mut self.users), ("Pointer", &mut self.pointers)];
        for (name, nodes) in lists {
            if *type_name == *name {
                nodes.insert(node);
            } else if !alive {
                nodes.remove(&node);
            }
        }
    }
}

/// A node of the rig.
pub(crate) struct RigNode<'a> {
    graph: &'a Graph,
    pub(crate) node: NodeId,
    type_name: &'static str,
}

impl<'a> RigNode<'a> {
    /// `node` as a `type_name`.
    pub(crate) fn new(graph: &'a Graph, node: NodeId, type_name: &'static str) -> Option<RigNode<'a>> {
        let fits = graph.contains(node) && *graph.type_of(node).name == *type_name;
        fits.then_some(RigNode { graph, node, type_name })
    }

    /// The value of a field.
    pub(crate) fn get<T: FieldValue>(&self, name: &str) -> Result<T, Error> {
        Ok(self.graph.get_named(self.node, name)?)
    }

    /// The chosen name of an enum.
    pub(crate) fn choice(&self, name: &str) -> Result<String, Error> {
        let value = self.get::<EnumValue>(name)?;
        let node_type = self.graph.type_of(self.node);
        Ok(node_type.field_named(name).and_then(|f| f.choice_name(value)).unwrap_or_default().to_owned())
    }

    /// The node of type `type_name` that a field refers to; None for an empty field.
    pub(crate) fn node(&self, name: &'static str, type_name: &'static str) -> Result<Option<RigNode<'a>>, Error> {
        self.get::<Option<NodeId>>(name)?.map(|node| self.typed(name, node, type_name)).transpose()
    }

    /// The nodes of type `type_name` that a field refers to; empty places are left out.
    pub(crate) fn nodes(&self, name: &'static str, type_name: &'static str) -> Result<Vec<RigNode<'a>>, Error> {
        let nodes = self.get::<Arc<[Option<NodeId>]>>(name)?;
        nodes.iter().flatten().map(|node| self.typed(name, *node, type_name)).collect()
    }

    fn typed(&self, field: &'static str, node: NodeId, expected: &'static str) -> Result<RigNode<'a>, Error> {
        RigNode::new(self.graph, node, expected).ok_or_else(|| {
            let alive = self.graph.contains(node);
            let found = if alive { self.graph.type_of(node).name.to_string() } else { "a deleted node".to_owned() };
            self.error(field, RigError::WrongNode { expected, found })
        })
    }

    /// A value that must be finite.
    pub(crate) fn finite<T: FieldValue>(&self, field: &'static str, is_finite: fn(&T) -> bool) -> Result<T, Error> {
        let value = self.get::<T>(field)?;
        if is_finite(&value) { Ok(value) } else { Err(self.error(field, RigError::NotFinite)) }
    }

    /// Its own name, or what it is.
    pub(crate) fn label(&self) -> String {
        label(self.graph, self.node, self.type_name)
    }

    /// A complaint about one of its fields.
    pub(crate) fn error(&self, field: &'static str, reason: RigError) -> Error {
        Error::Rig { type_name: self.type_name, node: self.label(), field, reason }
    }
}

/// The name of a node; those without one are called by their type.
pub(crate) fn label(graph: &Graph, node: NodeId, type_name: &str) -> String {
    let name = graph.name(node).map(|n| n.to_string()).unwrap_or_default();
    if name.is_empty() { type_name.to_lowercase() } else { name }
}
