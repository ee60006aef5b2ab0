//! Routes: which field's value goes to which field.

use std::collections::HashMap;
use std::fmt::Write;

use slotmap::SlotMap;

use crate::changes::Revision;
use crate::graph::slot_of;
use crate::order::closes_loop;
use crate::record::Event;
use crate::schedule::ROUTED;
use crate::{Error, FieldId, Graph, Kind, NodeId, converts};

slotmap::new_key_type! {
    /// A route. Ids of removed routes are never valid again.
    pub struct RouteId;
}

/// Whether a route orders evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Strength {
    /// The source is evaluated before the target. Strong routes never form a loop.
    Strong,
    /// The value that the source has after its turn arrives before the first turn of the next frame; for feedback.
    Weak,
}

/// A route from a field to a field.
#[derive(Clone, Copy, Debug)]
pub struct Route {
    /// The source.
    pub from: FieldId,
    /// The target.
    pub to: FieldId,
    /// Whether it orders evaluation.
    pub strength: Strength,
    /// Counts the routes in the order in which they were made; decides ties between routes into one field.
    pub ordinal: u64,
    /// Places in the nodes' lists of routes.
    pub(crate) from_place: u32,
    pub(crate) to_place: u32,
}

/// A node, or one of its fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Endpoint {
    /// Any field of the node.
    Node(NodeId),
    /// This field.
    Field(FieldId),
}

impl From<NodeId> for Endpoint {
    fn from(node: NodeId) -> Self {
        Endpoint::Node(node)
    }
}

impl From<FieldId> for Endpoint {
    fn from(field: FieldId) -> Self {
        Endpoint::Field(field)
    }
}

impl Endpoint {
    fn node(self) -> NodeId {
        match self {
            Endpoint::Node(node) | Endpoint::Field(FieldId { node, .. }) => node,
        }
    }

    fn covers(self, field: FieldId) -> bool {
        match self {
            Endpoint::Node(node) => node == field.node,
            Endpoint::Field(this) => this == field,
        }
    }
}

/// Which of several routes into a field was the last to deliver.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Arrival {
    /// The revision of the source's write, and the route's ordinal.
    pub(crate) won: (Revision, u64),
    /// The target's revision after the delivery: another one means that somebody else wrote since.
    pub(crate) delivered: Revision,
}

/// All routes.
#[derive(Debug, Default)]
pub(crate) struct Routes {
    pub(crate) all: SlotMap<RouteId, Route>,
    pub(crate) made: u64,
    /// Of fields into which several routes go.
    pub(crate) arrivals: HashMap<FieldId, Arrival>,
}

impl Graph {
    /// Connects a field to a field. If the source was ever written, the target takes its value at once.
    ///
    /// Errors: types that do not convert, a route that exists, and strong routes that would form a loop.
    pub fn connect(&mut self, from: FieldId, to: FieldId, strength: Strength) -> Result<RouteId, Error> {
        let route = self.link(from, to, strength)?;
        self.deliver_at_once(route);
        if self.journal.is_some() {
            let held = self.value(to)?;
            self.note(|| Event::Connected { route, from, to, strength, held });
        }
        Ok(route)
    }

    /// Makes a route that delivers nothing before its source is written again; for files, whose values are as they should be.
    pub(crate) fn link(&mut self, from: FieldId, to: FieldId, strength: Strength) -> Result<RouteId, Error> {
        self.check_types(from, to)?;
        if self.route_between(from, to).is_some() {
            return Err(Error::DuplicateRoute { from: self.describe_field(from), to: self.describe_field(to) });
        }
        if strength == Strength::Strong {
            if let Some(routes) = closes_loop(self, from.node, to.node) {
                return Err(self.loop_error(from, to, &routes));
            }
            self.order_strong(from.node, to.node);
        }
        self.routes.made += 1;
        let (from_place, to_place) = (self.nodes[from.node].outgoing.len() as u32, self.nodes[to.node].incoming.len() as u32);
        let route = self.routes.all.insert(Route { from, to, strength, ordinal: self.routes.made, from_place, to_place });
        if from_place == 0 {
            // What was written while nobody listened is no news later.
            self.schedule.turns[slot_of(from.node) as usize].propagated = self.changes.last();
        }
        self.nodes[from.node].outgoing.push(route);
        self.nodes[to.node].incoming.push(route);
        self.schedule.flags[slot_of(from.node) as usize] |= ROUTED;
        self.programs.forget(slot_of(from.node));
        self.forget_program_of_other_route(to, route);
        Ok(route)
    }

    /// Removes a route; false if it does not exist any more.
    pub fn disconnect(&mut self, route: RouteId) -> bool {
        let Some(removed) = self.routes.all.remove(route) else { return false };
        let outgoing = &mut self.nodes[removed.from.node].outgoing;
        outgoing.swap_remove(removed.from_place as usize);
        if let Some(moved) = outgoing.get(removed.from_place as usize) {
            self.routes.all[*moved].from_place = removed.from_place;
        }
        let no_more = outgoing.is_empty();
        let incoming = &mut self.nodes[removed.to.node].incoming;
        incoming.swap_remove(removed.to_place as usize);
        if let Some(moved) = incoming.get(removed.to_place as usize) {
            self.routes.all[*moved].to_place = removed.to_place;
        }
        if no_more {
            self.schedule.flags[slot_of(removed.from.node) as usize] &= !ROUTED;
        }
        self.programs.forget(slot_of(removed.from.node));
        self.forget_program_of_other_route(removed.to, route);
        self.note(|| Event::Disconnected(route));
        true
    }

    /// A route by its id.
    pub fn route(&self, route: RouteId) -> Option<&Route> {
        self.routes.all.get(route)
    }

    /// All routes.
    pub fn routes(&self) -> impl Iterator<Item = (RouteId, &Route)> {
        self.routes.all.iter()
    }

    /// The routes that leave a field or node.
    pub fn routes_from(&self, from: impl Into<Endpoint>) -> impl Iterator<Item = RouteId> {
        let from = from.into();
        let routes = self.nodes.get(from.node()).map_or(&[][..], |node| &node.outgoing);
        routes.iter().copied().filter(move |route| from.covers(self.routes.all[*route].from))
    }

    /// The routes that arrive at a field or node.
    pub fn routes_to(&self, to: impl Into<Endpoint>) -> impl Iterator<Item = RouteId> {
        let to = to.into();
        let routes = self.nodes.get(to.node()).map_or(&[][..], |node| &node.incoming);
        routes.iter().copied().filter(move |route| to.covers(self.routes.all[*route].to))
    }

    /// The route between two fields, if there is one.
    pub fn route_between(&self, from: FieldId, to: FieldId) -> Option<RouteId> {
        let (outgoing, incoming) = (&self.nodes.get(from.node)?.outgoing, &self.nodes.get(to.node)?.incoming);
        let fewer = if outgoing.len() < incoming.len() { outgoing } else { incoming };
        fewer.iter().copied().find(|route| {
            let route = &self.routes.all[*route];
            route.from == from && route.to == to
        })
    }

    /// True if two or more routes go into the field.
    pub(crate) fn is_fan_in(&self, to: FieldId) -> bool {
        self.routes_to(to).nth(1).is_some()
    }

    fn check_types(&self, from: FieldId, to: FieldId) -> Result<(), Error> {
        let (source, target) = (self.declaration(from)?, self.declaration(to)?);
        let (from_type, to_type) = (source.field_type, target.field_type);
        let reason = if !converts(from_type, to_type) {
            match (from_type.multiple, to_type.multiple) {
                (false, true) => ": one value does not become a list",
                (true, false) => ": a list does not become one value",
                _ => ": the types do not convert",
            }
        } else if from_type.kind == Kind::Enum && to_type.kind == Kind::Enum && source.choices != target.choices {
            ": the enums have different choices"
        } else {
            return Ok(());
        };
        Err(Error::Unroutable { from: self.describe_field(from), from_type, to: self.describe_field(to), to_type, reason })
    }

    /// The way a route delivers depends on whether it is alone: the program of the only other one is wrong once a second comes or goes.
    fn forget_program_of_other_route(&mut self, to: FieldId, this: RouteId) {
        let others: Vec<RouteId> = self.routes_to(to).filter(|route| *route != this).take(2).collect();
        if let [other] = others[..] {
            let source = self.routes.all[other].from.node;
            self.programs.forget(slot_of(source));
            self.routes.arrivals.remove(&to);
        }
    }

    /// "A.x -> B.y, B.y -> A.x", long loops cut in the middle.
    fn loop_error(&self, from: FieldId, to: FieldId, routes: &[RouteId]) -> Error {
        const SHOWN: usize = 6;
        let arrow = |from, to| format!("{} -> {}", self.describe_field(from), self.describe_field(to));
        let mut loop_text = arrow(from, to);
        for (index, route) in routes.iter().enumerate() {
            let hidden = routes.len() - SHOWN.min(routes.len());
            if hidden > 0 && index == SHOWN / 2 {
                let _ = write!(loop_text, ", ... {hidden} more ...");
            }
            if index < SHOWN / 2 || index >= SHOWN / 2 + hidden {
                let route = &self.routes.all[*route];
                let _ = write!(loop_text, ", {}", arrow(route.from, route.to));
            }
        }
        Error::Loop { loop_text, weak: arrow(from, to) }
    }
}
