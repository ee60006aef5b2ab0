//! Keyframes: all of a graph, also what no reader sees but what decides over the next frame: revisions, ranks, who waits, what is on its way.
//!
//! Nodes take the same places as in the recorded graph, free places in the same order: where the order of places decides, it decides alike.

use serde::{Deserialize, Serialize};
use slotmap::Key;

use super::RecordError;
use super::blocks::{Place, ValueRecord};
use super::numbers::{Numbers, mode_number, mode_of};
use super::types::Types;
use crate::codec::PlainField;
use crate::column::FREE;
use crate::graph::{Node, slot_of};
use crate::observe::Observer;
use crate::propagate::Carried;
use crate::route::{Arrival, Route};
use crate::schedule::{NO_RANK, Turn};
use crate::{FieldId, Graph, NodeId, RouteId, Same, Strength};

#[derive(Serialize, Deserialize)]
pub(super) struct StateRecord {
    /// How many frames came before.
    pub(super) frame: u64,
    pub(super) hash: u64,
    time_s: f64,
    revision: u64,
    node_revisions: Vec<u64>,
    /// Places of nodes that do not exist any more, the next to be used first.
    free: Vec<u32>,
    nodes: Vec<NodeState>,
    routes: Vec<RouteState>,
    routes_made: u64,
    arrivals: Vec<(Place, (u64, u64), u64)>,
    silenced: Vec<(Place, u64)>,
    observers: Vec<ObserverState>,
    carried: Vec<CarriedState>,
    always: Vec<u32>,
    asked: Vec<u32>,
    dependencies: Vec<(u64, u64)>,
    flags: Vec<u8>,
    turns: Vec<(u64, u64, u64, u32, u32)>,
    by_rank: Vec<u32>,
    stale: bool,
    holes: u64,
    pending: Vec<u32>,
    schedule_frame: u64,
}

#[derive(Serialize, Deserialize)]
struct NodeState {
    number: u64,
    slot: u32,
    node_type: u32,
    name: String,
    created: u64,
    mode: u8,
    dynamic: Vec<Option<PlainField>>,
    /// By field; none where a declared field holds its default since the node was created, and where no field is.
    values: Vec<Option<(ValueRecord, u64)>>,
    incoming: Vec<u64>,
    outgoing: Vec<u64>,
}

#[derive(Serialize, Deserialize)]
struct RouteState {
    number: u64,
    from: Place,
    to: Place,
    weak: bool,
    ordinal: u64,
    places: (u32, u32),
}

#[derive(Serialize, Deserialize)]
struct ObserverState {
    number: u64,
    field: Place,
    token: u64,
    seen: u64,
}

#[derive(Serialize, Deserialize)]
struct CarriedState {
    /// Zero for a route that does not exist any more.
    route: u64,
    field_type: String,
    value: ValueRecord,
    written: u64,
}

/// Free places of nodes in the order in which they will be used, found by using them.
fn probe_free(graph: &mut Graph, any: &Node) -> Vec<u32> {
    let free = graph.ids.len().saturating_sub(1).saturating_sub(graph.nodes.len());
    let probes: Vec<NodeId> = (0..free).map(|_| graph.nodes.insert(any.stand_in())).collect();
    probes.iter().rev().for_each(|probe| drop(graph.nodes.remove(*probe)));
    probes.into_iter().map(slot_of).collect()
}

impl Node {
    /// A node without anything, for a moment.
    fn stand_in(&self) -> Node {
        Node {
            node_type: self.node_type.clone(),
            name: None,
            slots: Vec::new(),
            dynamic: Vec::new(),
            incoming: Vec::new(),
            outgoing: Vec::new(),
            created: 0,
            mode: self.mode,
        }
    }

    fn blank(graph: &Graph) -> Node {
        let node_type = graph.type_of(NodeId::default()).clone();
        let mode = node_type.mode;
        Node {
            node_type,
            name: None,
            slots: Vec::new(),
            dynamic: Vec::new(),
            incoming: Vec::new(),
            outgoing: Vec::new(),
            created: 0,
            mode,
        }
    }
}

/// All of a graph between two frames.
pub(super) fn record(graph: &mut Graph, numbers: &mut Numbers, frame: u64, hash: u64) -> StateRecord {
    let blank = Node::blank(graph);
    let free = probe_free(graph, &blank);
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

fn damaged(fault: impl Into<String>) -> RecordError {
    RecordError::Damaged { fault: fault.into() }
}

/// A graph as it was. `graph` must be empty.
pub(super) fn restore(
    mut graph: Graph,
    state: &StateRecord,
    types: &mut Types,
    numbers: &mut Numbers,
) -> Result<Graph, RecordError> {
    check(state)?;
    let slots = state.flags.len();
    let blank = Node::blank(&graph);
    graph.ids.resize(slots, NodeId::default());
    graph.programs.grow(slots);
    graph.schedule.grow(slots);
    graph.changes.restore(state.revision, state.node_revisions.clone());
    let mut nodes = state.nodes.iter().peekable();
    for slot in 1..slots as u32 {
        let made = graph.nodes.insert(blank.stand_in());
        if slot_of(made) != slot {
            return Err(damaged("the graph to restore into is not empty"));
        }
        graph.ids[slot as usize] = made;
        if let Some(node) = nodes.next_if(|node| node.slot == slot) {
            numbers.nodes.bind(node.number, made);
        }
    }
    for node in &state.nodes {
        restore_node(&mut graph, node, types, numbers)?;
    }
    for slot in state.free.iter().rev() {
        let id = std::mem::take(&mut graph.ids[*slot as usize]);
        graph.nodes.remove(id);
    }
    restore_routes(&mut graph, state, numbers)?;
    for observer in &state.observers {
        let field = field_at(observer.field, numbers);
        graph.declaration(field).map_err(|error| damaged(error.to_string()))?;
        let id = graph.observers.all.insert(Observer { field, token: observer.token, seen: observer.seen });
        graph.observers.by_slot.entry(slot_of(field.node)).or_default().push(id);
        numbers.observers.bind(observer.number, id);
    }
    for carried in &state.carried {
        let field_type =
            crate::codec::field_type_named(&carried.field_type).ok_or_else(|| damaged("a value of an unknown type"))?;
        let route = numbers.routes.keys.get(&carried.route).copied().unwrap_or_default();
        let value = numbers.value(&carried.value, field_type).map_err(damaged)?;
        graph.frame.carried.push(Carried { route, value, written: carried.written });
    }
    graph.silenced = state.silenced.iter().map(|(field, at)| (field_at(*field, numbers), *at)).collect();
    graph.frame.always = state.always.iter().copied().collect();
    graph.frame.asked = state.asked.iter().copied().collect();
    let node = |number: &u64| numbers.nodes.keys.get(number).copied().unwrap_or_default();
    graph.frame.dependencies = state.dependencies.iter().map(|(a, b)| (node(a), node(b))).collect();
    graph.frame.time_s = state.time_s;
    restore_schedule(&mut graph, state);
    graph.verify_invariants().map_err(|fault| damaged(format!("a keyframe contradicts itself: {fault}")))?;
    Ok(graph)
}

/// All places are inside of what there is: later steps index by them.
fn check(state: &StateRecord) -> Result<(), RecordError> {
    let slots = state.flags.len();
    let inside = |slot: &u32| (1..slots).contains(&(*slot as usize));
    let mut taken: Vec<u32> = state.nodes.iter().map(|node| node.slot).chain(state.free.iter().copied()).collect();
    taken.sort_unstable();
    let turns_fit = turns_fit(state);
    let all = taken.iter().copied().eq(1..slots.max(1) as u32);
    let ordered = state.nodes.is_sorted_by(|a, b| a.slot < b.slot);
    let fit = state.turns.len() == slots && state.node_revisions.len() == slots;
    let waits = state.pending.iter().chain(&state.always).chain(&state.asked).all(inside);
    // Numbers that only go up must have room to.
    let counts = [state.revision, state.routes_made, state.schedule_frame].into_iter().all(|count| count < u64::MAX / 2);
    let empty = state.free.iter().chain(&[0]).all(|slot| state.flags.get(*slot as usize).is_none_or(|flags| *flags == 0));
    if all && ordered && fit && turns_fit && waits && counts && empty {
        Ok(())
    } else {
        Err(damaged("the places in a keyframe contradict each other"))
    }
}

/// Ranks and places in the order are each other's inverse.
fn turns_fit(state: &StateRecord) -> bool {
    let rank_of = |slot: usize| state.turns.get(slot).map(|turn| turn.3);
    let ranks = state.by_rank.iter().enumerate();
    let mut ranks = ranks.filter(|(_, slot)| **slot != NO_RANK);
    let mut turns = state.turns.iter().enumerate().filter(|(_, turn)| turn.3 != NO_RANK);
    ranks.all(|(rank, slot)| rank_of(*slot as usize) == Some(rank as u32))
        && turns.all(|(slot, turn)| state.by_rank.get(turn.3 as usize) == Some(&(slot as u32)))
}

fn field_at(place: Place, numbers: &Numbers) -> FieldId {
    FieldId { node: numbers.nodes.keys.get(&place.0).copied().unwrap_or_default(), index: place.1 }
}

fn restore_node(graph: &mut Graph, state: &NodeState, types: &mut Types, numbers: &mut Numbers) -> Result<(), RecordError> {
    let node_type = types.get(state.node_type, graph, numbers)?;
    let id = graph.ids[state.slot as usize];
    let dynamic = state.dynamic.iter().map(|field| field.as_ref().map(|field| field.field(numbers)).transpose());
    let dynamic = dynamic.collect::<Result<Vec<_>, _>>().map_err(damaged)?;
    if state.values.len() != node_type.fields.len() + dynamic.len() {
        return Err(damaged(format!("a {} with {} fields", node_type.name, state.values.len())));
    }
    let node = &mut graph.nodes[id];
    (node.node_type, node.dynamic, node.created, node.mode) = (node_type, dynamic, state.created, mode_of(state.mode));
    node.slots = vec![FREE; state.values.len()];
    for (index, value) in state.values.iter().enumerate() {
        let Some(field) = node.field(index as u16) else { continue };
        let (value, written) = match value {
            Some((value, written)) => (numbers.value(value, field.field_type).map_err(damaged)?, *written),
            None => (field.default.clone(), state.created),
        };
        let slot = graph.columns.insert(value, (state.slot, index as u16), written);
        node.slots[index] = slot;
    }
    if !state.name.is_empty() {
        let name: std::sync::Arc<str> = state.name.as_str().into();
        node.name = Some(name.clone());
        graph.names.insert(name, id);
    }
    Ok(())
}

fn restore_routes(graph: &mut Graph, state: &StateRecord, numbers: &mut Numbers) -> Result<(), RecordError> {
    for route in &state.routes {
        let (from, to) = (field_at(route.from, numbers), field_at(route.to, numbers));
        if graph.declaration(from).is_err() || graph.declaration(to).is_err() {
            return Err(damaged("a route between fields that do not exist"));
        }
        let unranked = |field: FieldId| state.turns[slot_of(field.node) as usize].3 == NO_RANK;
        if !route.weak && (unranked(from) || unranked(to)) {
            return Err(damaged("a strong route between nodes without a place in the order"));
        }
        let strength = if route.weak { Strength::Weak } else { Strength::Strong };
        let (from_place, to_place) = route.places;
        let id = graph.routes.all.insert(Route { from, to, strength, ordinal: route.ordinal, from_place, to_place });
        numbers.routes.bind(route.number, id);
    }
    graph.routes.made = state.routes_made;
    let ids = |list: &[u64]| -> Result<Vec<RouteId>, RecordError> {
        let find = |number: &u64| numbers.routes.keys.get(number).copied().filter(|id| !id.is_null());
        list.iter().map(|number| find(number).ok_or_else(|| damaged("a node with a route that does not exist"))).collect()
    };
    for node in &state.nodes {
        let at = &mut graph.nodes[graph.ids[node.slot as usize]];
        (at.incoming, at.outgoing) = (ids(&node.incoming)?, ids(&node.outgoing)?);
    }
    for (to, won, delivered) in &state.arrivals {
        graph.routes.arrivals.insert(field_at(*to, numbers), Arrival { won: *won, delivered: *delivered });
    }
    Ok(())
}

fn restore_schedule(graph: &mut Graph, state: &StateRecord) {
    let schedule = &mut graph.schedule;
    schedule.restore_order(state.by_rank.clone());
    schedule.flags = state.flags.clone();
    let turn = |&(propagated, evaluated, frame, rank, count): &_| Turn { propagated, evaluated, frame, rank, count };
    schedule.turns = state.turns.iter().map(turn).collect();
    schedule.stale = state.stale;
    schedule.holes = state.holes as usize;
    schedule.pending = state.pending.clone();
    schedule.frame = state.schedule_frame;
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
