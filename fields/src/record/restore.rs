//! From a keyframe back to a graph. A file is not believed: what later steps index by is checked first.

use slotmap::Key;

use super::RecordError;
use super::blocks::Place;
use super::numbers::{Numbers, mode_of};
use super::state::{NodeState, StateRecord};
use super::types::Types;
use crate::column::FREE;
use crate::graph::{Node, slot_of};
use crate::observe::Observer;
use crate::propagate::Carried;
use crate::route::{Arrival, Route};
use crate::schedule::{NO_RANK, Turn};
use crate::{FieldId, Graph, NodeId, RouteId, Strength};

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
    let nothing = graph.type_of(NodeId::default()).clone();
    graph.ids.resize(slots, NodeId::default());
    graph.programs.grow(slots);
    graph.schedule.grow(slots);
    graph.changes.restore(state.revision, state.node_revisions.clone());
    let mut nodes = state.nodes.iter().peekable();
    for slot in 1..slots as u32 {
        let made = graph.nodes.insert(Node::new(nothing.clone(), 0));
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
    let levels = state.levels.last().is_none_or(|end| *end as usize <= state.by_rank.len()) && state.levels.is_sorted();
    let mut turns = state.turns.iter().enumerate().filter(|(_, turn)| turn.3 != NO_RANK);
    levels
        && ranks.all(|(rank, slot)| rank_of(*slot as usize) == Some(rank as u32))
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
    node.slots = smallvec::smallvec![FREE; state.values.len()];
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
    schedule.restore_order(state.by_rank.clone(), state.levels.clone());
    schedule.flags = state.flags.clone();
    let turn = |&(propagated, evaluated, frame, rank, count): &_| Turn { propagated, evaluated, frame, rank, count };
    schedule.turns = state.turns.iter().map(turn).collect();
    schedule.stale = state.stale;
    schedule.holes = state.holes as usize;
    schedule.pending = state.pending.clone();
    schedule.frame = state.schedule_frame;
}
