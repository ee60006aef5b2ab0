//! What stays in its process.

use crate::graph::slot_of;
use crate::{Error, Graph, NodeId};

impl Graph {
    /// Keeps one node from replicas, or lets them have it; see [`crate::NodeType::local`] and [`crate::Field::local`] for more than one.
    pub fn set_local(&mut self, id: NodeId, local: bool) -> Result<(), Error> {
        let node = self.nodes.get_mut(id).ok_or(Error::DeadNode)?;
        if node.local != local {
            node.local = local;
            let revision = self.changes.next();
            self.changes.reshaped(slot_of(id), revision);
        }
        Ok(())
    }

    /// True if replicas do not learn of the node.
    pub fn is_local(&self, id: NodeId) -> bool {
        self.nodes.get(id).is_some_and(|node| node.local)
    }
}
