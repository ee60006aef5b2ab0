//! Whose the nodes are, where several applications work on one world.

use std::collections::HashMap;
use std::sync::Arc;

use umbriel_fields::{FieldId, Graph, Kind, NodeId, Value};

use crate::error::{Fault, Outcome};
use crate::stage::{Node, Stage};

/// What a world knows of the other applications that work on it.
#[derive(Clone, Debug, Default)]
pub struct Sharing {
    /// The name of this application.
    pub me: Arc<str>,
    /// Owners of nodes that are not this application's.
    pub owners: HashMap<NodeId, Arc<str>>,
    /// Who holds a lock on a node.
    pub locks: HashMap<NodeId, Arc<str>>,
    /// What the script asked for since it was last looked at.
    pub requests: Vec<Request>,
}

/// What a script asks the application that evaluates the world for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// To be the only one who may write a node.
    Lock(NodeId),
    /// No longer to be.
    Unlock(NodeId),
    /// Whether the nodes stay when the application leaves.
    Keeps(bool),
}

impl Sharing {
    /// True if the node may be written: it is of this application, or locked by it, and nobody else has locked it.
    pub fn may_write(&self, node: NodeId) -> bool {
        match self.locks.get(&node) {
            Some(holder) => *holder == self.me,
            None => !self.owners.contains_key(&node),
        }
    }

    /// Why a field may not be written, in words that follow its name.
    fn refuses(&self, graph: &Graph, node: NodeId, field: Option<FieldId>, value: Option<&Value>) -> Option<String> {
        if self.may_write(node) {
            return None;
        }
        if let Some(holder) = self.locks.get(&node) {
            return Some(format!("`{holder}` has locked it"));
        }
        if let (Some(field), Some(Value::Nodes(now))) = (field, value)
            && graph.declaration(field).is_ok_and(|field| field.field_type.kind == Kind::Node)
            && let Ok(Value::Nodes(before)) = graph.value(field)
        {
            // Lists of others are open for nodes of one's own.
            let changed = before.iter().filter(|id| !now.contains(id)).chain(now.iter().filter(|id| !before.contains(id)));
            let stranger = changed.flatten().find(|id| self.owners.contains_key(id))?;
            let owner = self.owners.get(stranger)?;
            return Some(format!(
                "{} belongs to `{owner}`, and only own nodes come and go in lists of others",
                graph.describe(*stranger)
            ));
        }
        let owner = self.owners.get(&node)?;
        Some(format!("it belongs to `{owner}`; it may be written once `lock(node)` was granted"))
    }
}

impl Stage {
    /// Refuses to change a node that is another application's. The value matters for lists of nodes; no field
    /// name means that the node is to be deleted.
    pub(crate) fn may_write(&self, node: Node, name: &str, value: Option<(FieldId, &Value)>) -> Outcome<()> {
        let sharing = self.sharing.borrow();
        let Some(sharing) = sharing.as_ref() else { return Ok(()) };
        let field = value.map(|(field, _)| field);
        match self.read(|graph| sharing.refuses(graph, node.0, field, value.map(|(_, value)| value))) {
            Some(why) if name.is_empty() => Fault::new(format!("{} cannot be deleted: {why}", self.label(node))).throw(),
            Some(why) => self.fault_at(node, name, format!("`{name}` of {}: {why}", self.label(node))).throw(),
            None => Ok(()),
        }
    }

    /// True if the node is evaluated in this process.
    pub(crate) fn evaluates(&self, node: NodeId) -> bool {
        self.sharing.borrow().as_ref().is_none_or(|sharing| !sharing.owners.contains_key(&node))
    }
}
