//! What is always true of a graph, for tests and for hosts that suspect a bug.

use crate::Graph;
use crate::graph::slot_of;
use crate::program::Program;
use crate::schedule::{NO_RANK, OBSERVED, ROUTED};
use crate::{FieldId, NodeId, Strength};

impl Graph {
    /// Checks every structure against every other. Slow: looks at everything.
    pub fn verify_invariants(&self) -> Result<(), String> {
        self.changes.check()?;
        for (id, node) in &self.nodes {
            self.verify_node(id).map_err(|fault| format!("{}: {fault}", self.describe(id)))?;
            if let Some(name) = &node.name
                && self.find(name) != Some(id)
            {
                return Err(format!("the name `{name}` does not lead to its node"));
            }
        }
        let names = self.names().count();
        let named = self.nodes.values().filter(|node| node.name.is_some()).count();
        if names != named {
            return Err(format!("{names} names for {named} named nodes"));
        }
        self.verify_routes()?;
        self.verify_order()
    }

    fn verify_node(&self, id: NodeId) -> Result<(), String> {
        let node = &self.nodes[id];
        let slot = slot_of(id);
        if self.ids[slot as usize] != id {
            return Err("its slot belongs to another node".into());
        }
        for (index, field) in node.fields() {
            let place = node.slots[index as usize] as usize;
            if self.columns.owners(field.field_type)[place] != (slot, index) {
                return Err(format!("the value of `{}` belongs to another field", field.name));
            }
            let (written, last) = (self.columns.revisions(field.field_type)[place], self.changes.node(slot));
            if written > last || last > self.changes.last() {
                return Err(format!("`{}` was written at {written}, the node at {last}", field.name));
            }
            if self.columns.value(field.field_type, place as u32).field_type() != field.field_type {
                return Err(format!("`{}` holds a value of another type", field.name));
            }
        }
        let flags = self.schedule.flags[slot as usize];
        if (flags & ROUTED != 0) == node.outgoing.is_empty() {
            return Err("its flag of outgoing routes is wrong".into());
        }
        if (flags & OBSERVED != 0) == self.observers.of(slot).is_empty() {
            return Err("its flag of observers is wrong".into());
        }
        Ok(())
    }

    fn verify_routes(&self) -> Result<(), String> {
        let alive = |field: FieldId| self.nodes.get(field.node).is_some_and(|node| node.field(field.index).is_some());
        for (id, route) in &self.routes.all {
            if !alive(route.from) || !alive(route.to) {
                return Err("a route leads to or from a field that does not exist".into());
            }
            let listed = self.nodes[route.from.node].outgoing.get(route.from_place as usize) == Some(&id)
                && self.nodes[route.to.node].incoming.get(route.to_place as usize) == Some(&id);
            if !listed {
                return Err("a route is not where its nodes list it".into());
            }
        }
        let listed: usize = self.nodes.values().map(|node| node.outgoing.len() + node.incoming.len()).sum();
        if listed != 2 * self.routes.all.len() {
            return Err(format!("{listed} ends of {} routes", self.routes.all.len()));
        }
        for id in self.nodes.keys() {
            let program = self.programs.get(slot_of(id));
            let hop = self.programs.hop(slot_of(id)).map(Program::Hop);
            if *program != Program::Unmade && *hop.as_ref().unwrap_or(program) != self.compile(id) {
                return Err(format!("the copy list of {} is out of date", self.describe(id)));
            }
        }
        Ok(())
    }

    fn verify_order(&self) -> Result<(), String> {
        if self.schedule.stale {
            return Ok(());
        }
        let rank = |field: FieldId| self.schedule.turns[slot_of(field.node) as usize].rank;
        for route in self.routes.all.values().filter(|route| route.strength == Strength::Strong) {
            if rank(route.from) == NO_RANK || rank(route.to) == NO_RANK || rank(route.from) >= rank(route.to) {
                let (from, to) = (self.describe_field(route.from), self.describe_field(route.to));
                return Err(format!("{from} -> {to} contradicts the order"));
            }
        }
        for (place, slot) in self.schedule.by_rank.iter().enumerate().filter(|(_, slot)| **slot != NO_RANK) {
            if self.schedule.turns[*slot as usize].rank != place as u32 {
                return Err(format!("the node at rank {place} does not know it"));
            }
        }
        Ok(())
    }
}
