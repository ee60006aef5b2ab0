//! Which routes came and went. Costs nothing while no route does.

use std::collections::HashMap;

use slotmap::Key;

use super::herd::Herds;
use super::packet::Place;
use super::shares::route_share;
use crate::{FieldId, Graph, RouteId, Strength};

/// A route as replicas know it: from, to, weak.
pub(super) type Wire = (Place, Place, bool);

fn place(field: FieldId) -> Place {
    (field.node.data().as_ffi(), field.index)
}

/// Routes that replicas know.
#[derive(Default)]
pub(super) struct KnownRoutes {
    all: HashMap<RouteId, Wire>,
    /// The ordinal of the last one that was looked at.
    made: u64,
    /// Routes that were there then, local ones as well.
    count: usize,
}

impl KnownRoutes {
    /// Brings the list up to date; gives those that went, and those that came. `is_known` says whether replicas know a field.
    pub(super) fn update(
        &mut self,
        graph: &Graph,
        herds: &mut Herds,
        fields_changed: bool,
        is_known: impl Fn(FieldId) -> bool,
    ) -> (Vec<(Place, Place)>, Vec<Wire>) {
        let routes = &graph.routes;
        let is_same = routes.made == self.made && routes.all.len() == self.count;
        if is_same && !fields_changed {
            return (Vec::new(), Vec::new());
        }
        let is_shown = |route: &crate::Route| is_known(route.from) && is_known(route.to);
        let mut gone = Vec::new();
        self.all.retain(|id, (from, to, weak)| {
            let stays = routes.all.get(*id).is_some_and(is_shown);
            if !stays {
                gone.push((*from, *to));
                herds.subtract(route_share(*from, *to, *weak));
            }
            stays
        });
        let mut came = Vec::new();
        for (id, route) in routes.all.iter().filter(|(_, route)| is_shown(route)) {
            if self.all.contains_key(&id) {
                continue;
            }
            let wire = (place(route.from), place(route.to), route.strength == Strength::Weak);
            herds.add(route_share(wire.0, wire.1, wire.2));
            self.all.insert(id, wire);
            came.push((route.ordinal, wire));
        }
        came.sort_unstable_by_key(|(ordinal, _)| *ordinal);
        gone.sort_unstable();
        (self.made, self.count) = (routes.made, routes.all.len());
        (gone, came.into_iter().map(|(_, wire)| wire).collect())
    }

    /// All of them, for a snapshot.
    pub(super) fn all(&self) -> Vec<Wire> {
        let mut all: Vec<Wire> = self.all.values().copied().collect();
        all.sort_unstable();
        all
    }
}
