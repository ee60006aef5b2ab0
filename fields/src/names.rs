//! Names of nodes, paths of names, and what messages call nodes and fields.

use std::sync::Arc;

use crate::graph::{Node, slot_of};
use crate::record::Event;
use crate::{Error, FieldId, Graph, NodeId, Value};

impl Graph {
    /// Names a node; the empty name takes its name away. Names are unique in a graph.
    pub fn set_name(&mut self, id: NodeId, name: &str) -> Result<(), Error> {
        self.node(id)?;
        if let Some(other) = self.names.get(name).copied().filter(|other| *other != id) {
            let (node, other) = (self.describe(id), self.describe(other));
            return Err(Error::DuplicateName { node, name: name.into(), other });
        }
        let node = &mut self.nodes[id];
        if let Some(old) = node.name.take() {
            self.names.remove(&old);
        }
        if !name.is_empty() {
            let name: Arc<str> = name.into();
            node.name = Some(name.clone());
            self.names.insert(name, id);
        }
        let revision = self.changes.next();
        self.changes.reshaped(slot_of(id), revision);
        if self.journal.is_some() {
            let name = self.nodes[id].name.clone();
            self.note(|| Event::Named(id, name));
        }
        Ok(())
    }

    /// The node's name, if it has one.
    pub fn name(&self, id: NodeId) -> Option<&str> {
        self.nodes.get(id)?.name.as_deref()
    }

    /// The node of a name.
    pub fn find(&self, name: &str) -> Option<NodeId> {
        self.names.get(name).copied()
    }

    /// All names, in no particular order; for messages.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.names.keys().map(|name| &**name)
    }

    /// The node at the end of a path of names, such as `/world/house/door`: each is among the `children` of the one before.
    pub fn find_path(&self, path: &str) -> Option<NodeId> {
        let mut names = path.split('/').filter(|name| !name.is_empty());
        let mut at = self.find(names.next()?)?;
        for name in names {
            let next = self.find(name)?;
            let children = self.value(self.field(at, "children").ok()?).ok()?;
            let Value::Nodes(children) = children else { return None };
            if !children.contains(&Some(next)) {
                return None;
            }
            at = next;
        }
        Some(at)
    }

    /// Name and type of a node, for messages.
    pub fn describe(&self, id: NodeId) -> String {
        match self.nodes.get(id) {
            None => "a deleted node".into(),
            Some(Node { name: Some(name), node_type, .. }) => format!("`{name}` ({})", node_type.name),
            Some(node) => format!("an unnamed {}", node.node_type.name),
        }
    }

    /// Node and field, for messages: `` `door`.angle ``.
    pub fn describe_field(&self, field: FieldId) -> String {
        let name = self.nodes.get(field.node).and_then(|node| node.field(field.index)).map_or("(removed)", |field| &field.name);
        match self.name(field.node) {
            Some(node) => format!("`{node}.{name}`"),
            None => format!("`{name}` of {}", self.describe(field.node)),
        }
    }

    pub(crate) fn dead_field(&self, field: FieldId) -> Error {
        Error::DeadField { node: self.describe(field.node), index: field.index }
    }
}
