//! Keyframes: all of a graph, also what no reader sees but what decides over the next frame: revisions, ranks, who waits, what is on its way.
//!
//! Nodes take the same places as in the recorded graph, free places in the same order: where the order of places decides, it decides alike.

use serde::{Deserialize, Serialize};

use super::blocks::{Place, ValueRecord};
use super::numbers::{Numbers, mode_number};
use crate::codec::PlainField;
use crate::graph::{Node, slot_of};
use crate::observe::Observer;
use crate::propagate::Carried;
use crate::schedule::Turn;
use crate::{Graph, NodeId, Same, Strength};

#[derive(Serialize, Deserialize)]
pub(super) struct StateRecord {
    /// How many frames came before.
    pub(super) frame: u64,
    pub(super) hash: u64,
    pub(super) time_s: f64,
    pub(super) revision: u64,
    pub(super) node_revisions: Vec<u64>,
    /// Places of nodes that do not exist any more, the next to be used first.
    pub(super) free: Vec<u32>,
    pub(super) nodes: Vec<NodeState>,
    pub(super) routes: Vec<RouteState>,
    pub(super) routes_made: u64,
    pub(super) arrivals: Vec<(Place, (u64, u64), u64)>,
    pub(super) silenced: Vec<(Place, u64)>,
    pub(super) observers: Vec<ObserverState>,
    pub(super) carried: Vec<CarriedState>,
    pub(super) always: Vec<u32>,
    pub(super) asked: Vec<u32>,
    pub(super) dependencies: Vec<(u64, u64)>,
    pub(super) flags: Vec<u8>,
    pub(super) turns: Vec<(u64, u64, u64, u32, u32)>,
    pub(super) by_rank: Vec<u32>,
    pub(super) levels: Vec<u32>,
    pub(super) stale: bool,
    pub(super) holes: u64,
    pub(super) pending: Vec<u32>,
    pub(super) schedule_frame: u64,
}

#[derive(Serialize, Deserialize)]
pub(super) struct NodeState {
    pub(super) number: u64,
    pub(super) slot: u32,
    pub(super) node_type: u32,
    pub(super) name: String,
    pub(super) created: u64,
    pub(super) mode: u8,
    pub(super) dynamic: Vec<Option<PlainField>>,
    /// By field; none where a declared field holds its default since the node was created, and where no field is.
    pub(super) values: Vec<Option<(ValueRecord, u64)>>,
    pub(super) incoming: Vec<u64>,
    pub(super) outgoing: Vec<u64>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct RouteState {
    pub(super) number: u64,
    pub(super) from: Place,
    pub(super) to: Place,
    pub(super) weak: bool,
    pub(super) ordinal: u64,
    pub(super) places: (u32, u32),
}

#[derive(Serialize, Deserialize)]
pub(super) struct ObserverState {
    pub(super) number: u64,
    pub(super) field: Place,
    pub(super) token: u64,
    pub(super) seen: u64,
}

#[derive(Serialize, Deserialize)]
pub(super) struct CarriedState {
    /// Zero for a route that does not exist any more.
    pub(super) route: u64,
    pub(super) field_type: String,
    pub(super) value: ValueRecord,
    pub(super) written: u64,
}

/// Free places of nodes in the order in which they will be used, found by using them.
fn probe_free(graph: &mut Graph) -> Vec<u32> {
    let nothing = graph.type_of(NodeId::default()).clone();
    let free = graph.ids.len().saturating_sub(1).saturating_sub(graph.nodes.len());
    let probes: Vec<NodeId> = (0..free).map(|_| graph.nodes.insert(Node::new(nothing.clone(), 0))).collect();
    probes.iter().rev().for_each(|probe| drop(graph.nodes.remove(*probe)));
    probes.into_iter().map(slot_of).collect()
}

/// All of a graph between two frames.
pub(super) fn record(graph: &mut Graph, numbers: &mut Numbers, frame: u64, hash: u64) -> StateRecord {
    let free = probe_free(graph);
    let mut ids: Vec<NodeId> = graph.nodes.keys().collect();
    ids.sort_by_key(|id| slot_of(*id));
    let nodes = ids.into_iter().map(|id| record_node(graph, id, numbers)).collect();
    let mut routes: Vec<_> = graph.routes.all.iter().collect();
    routes.sort_by_key(|(_, route)| route.ordinal);
    let routes = routes.into_iter().map(|(id, route)| RouteState {
        number: numbers.routes.number(id),
        from: numbers.place(route.from),
        to: numbers.place(route.to),
        weak: route.strength == Strength::Weak,
        ordinal: route.ordinal,
        places: (route.from_place, route.to_place),
    });
    let routes = routes.collect();
    let mut arrivals: Vec<_> = graph.routes.arrivals.iter().map(|(to, at)| (numbers.place(*to), at.won, at.delivered)).collect();
    arrivals.sort_unstable();
    let mut silenced: Vec<_> = graph.silenced.iter().map(|(field, at)| (numbers.place(*field), *at)).collect();
    silenced.sort_unstable();
    let mut slots: Vec<u32> = graph.observers.by_slot.keys().copied().collect();
    slots.sort_unstable();
    let mut observers = Vec::new();
    for id in slots.iter().flat_map(|slot| graph.observers.of(*slot)) {
        let Observer { field, token, seen } = graph.observers.all[*id];
        observers.push(ObserverState { number: numbers.observers.number(*id), field: numbers.place(field), token, seen });
    }
    let mut carried = Vec::new();
    for Carried { route, value, written } in &graph.frame.carried {
        let alive = graph.routes.all.contains_key(*route);
        carried.push(CarriedState {
            route: if alive { numbers.routes.number(*route) } else { 0 },
            field_type: value.field_type().to_string(),
            value: numbers.record(value),
            written: *written,
        });
    }
    let mut asked: Vec<u32> = graph.frame.asked.iter().copied().collect();
    asked.sort_unstable();
    let turn = |turn: &Turn| (turn.propagated, turn.evaluated, turn.frame, turn.rank, turn.count);
    let depends = graph.frame.dependencies.iter();
    StateRecord {
        frame,
        hash,
        time_s: graph.frame.time_s,
        revision: graph.changes.last(),
        node_revisions: graph.changes.by_node().to_vec(),
        free,
        nodes,
        routes,
        routes_made: graph.routes.made,
        arrivals,
        silenced,
        observers,
        carried,
        always: graph.frame.always.iter().copied().collect(),
        asked,
        dependencies: depends.map(|(a, b)| (numbers.nodes.number(*a), numbers.nodes.number(*b))).collect(),
        flags: graph.schedule.flags.clone(),
        turns: graph.schedule.turns.iter().map(turn).collect(),
        by_rank: graph.schedule.by_rank.clone(),
        levels: graph.schedule.levels.clone(),
        stale: graph.schedule.stale,
        holes: graph.schedule.holes as u64,
        pending: graph.schedule.pending.clone(),
        schedule_frame: graph.schedule.frame,
    }
}

fn record_node(graph: &Graph, id: NodeId, numbers: &mut Numbers) -> NodeState {
    let node = &graph.nodes[id];
    let mut values: Vec<Option<(ValueRecord, u64)>> = vec![None; node.slots.len()];
    for (index, field) in node.fields() {
        let slot = node.slots[index as usize];
        let (value, written) =
            (graph.columns.value(field.field_type, slot), graph.columns.revisions(field.field_type)[slot as usize]);
        let declared = (index as usize) < node.node_type.fields.len();
        if !declared || written != node.created || !value.same(&field.default) {
            values[index as usize] = Some((numbers.record(&value), written));
        }
    }
    let dynamic = node.dynamic.iter().map(|field| field.as_ref().map(|field| PlainField::of(field, numbers))).collect();
    NodeState {
        number: numbers.nodes.number(id),
        slot: slot_of(id),
        node_type: numbers.node_type(&node.node_type),
        name: node.name.as_deref().unwrap_or_default().into(),
        created: node.created,
        mode: mode_number(node.mode),
        dynamic,
        values,
        incoming: node.incoming.iter().map(|route| numbers.routes.number(*route)).collect(),
        outgoing: node.outgoing.iter().map(|route| numbers.routes.number(*route)).collect(),
    }
}

impl StateRecord {
    /// Number, type, name and dynamic fields of each node.
    pub(super) fn named_nodes(&self) -> impl Iterator<Item = (u64, u32, &str, Vec<(usize, &str)>)> {
        self.nodes.iter().map(|node| {
            let dynamic = node.dynamic.iter().enumerate();
            let dynamic = dynamic.filter_map(|(place, field)| Some((place, field.as_ref()?.name.as_str()))).collect();
            (node.number, node.node_type, node.name.as_str(), dynamic)
        })
    }
}
