//! From packets to a graph.

use std::collections::{HashMap, HashSet};

use super::bulk::{Bulk, ImageHashes};
use super::flat::share_of_flat;
use super::herd::Herds;
use super::learn::{Finder, LocalType, NONE, Namer, Nodes, local_type};
use super::packet::{FieldOf, GroupRead, Head, Packet, Place};
use super::runs::Run;
use super::scatter::scatter_flat;
use super::shares::{field_share, route_share};
use super::{ReplicaError, damaged};
use crate::codec::{take_value, to_bytes};
use crate::column::{Columns, FREE};
use crate::graph::slot_of;
use crate::{Changes, Field, FieldId, FieldType, Graph, Kind, NodeId, Revision, Strength, TypeRegistry, Value};

/// A node of the application, here.
pub(super) struct Held {
    pub(super) number: u64,
    pub(super) id: NodeId,
    pub(super) node_type: u32,
    /// Fields that are dynamic here: the application's index and ours.
    pub(super) dynamic: Vec<(u16, u16)>,
}

/// A copy of a graph. It is never evaluated: packets bring what evaluation gave.
pub struct Replica {
    pub(super) graph: Graph,
    frame: u64,
    time_s: f64,
    /// Hash of the application's world after the last frame.
    expected: u64,
    /// By the slot in the application.
    pub(super) held: Vec<Option<Held>>,
    nodes: Nodes,
    pub(super) types: HashMap<u32, LocalType>,
    pub(super) herds: Herds,
    hashes: ImageHashes,
    /// Writes up to this one are in the hash.
    mark: Revision,
    unknown: Vec<String>,
    /// So many dead nodes are remembered before those are forgotten that nothing refers to.
    sweep_at: usize,
}

const SWEEP: usize = 4096;

impl Replica {
    /// A replica as a snapshot says, in a graph that can create `types`.
    pub fn new(packet: &Packet<'_>, types: impl Into<TypeRegistry>, bulk: &Bulk) -> Result<Replica, ReplicaError> {
        if !packet.is_snapshot() {
            return Err(ReplicaError::OtherKind { expected: "snapshot" });
        }
        let mut replica = Replica {
            graph: Graph::new(types),
            frame: packet.frame(),
            time_s: 0.0,
            expected: 0,
            held: Vec::new(),
            nodes: Nodes::default(),
            types: HashMap::new(),
            herds: Herds::default(),
            hashes: ImageHashes::default(),
            mark: 0,
            unknown: Vec::new(),
            sweep_at: SWEEP,
        };
        replica.take(packet, bulk)?;
        Ok(replica)
    }

    /// Applies the next frame. After an error the replica is not to be used any more.
    pub fn apply(&mut self, packet: &Packet<'_>, bulk: &Bulk) -> Result<(), ReplicaError> {
        if packet.is_snapshot() {
            return Err(ReplicaError::OtherKind { expected: "frame" });
        }
        if packet.frame() != self.frame + 1 {
            return Err(ReplicaError::Gap { last: self.frame, found: packet.frame() });
        }
        self.take(packet, bulk)
    }

    /// The graph, to be read. What is written to it shows as a difference after the next frame.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The graph, to be changed by whoever tests what happens then.
    pub fn graph_mut(&mut self) -> &mut Graph {
        &mut self.graph
    }

    /// The number of the last frame.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// The time of the last frame, in seconds.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The hash of all values here.
    pub fn hash(&self) -> u64 {
        self.herds.sum()
    }

    /// The same, with what was written to the graph since the last frame.
    pub fn hash_now(&mut self) -> u64 {
        self.update_hash();
        self.hash()
    }

    /// True if all values are those of the application.
    pub fn agrees(&self) -> bool {
        self.hash() == self.expected
    }

    /// The node that has this number in the application.
    pub fn node(&self, number: u64) -> Option<NodeId> {
        self.held(number).map(|held| held.id)
    }

    /// The number that a node has in the application.
    pub fn number(&self, node: NodeId) -> Option<u64> {
        self.nodes.numbers.get(&node).copied()
    }

    /// Types of the application that are not known here, each told once: their nodes are held, and nothing is made of them.
    pub fn unknown_types(&mut self) -> Vec<String> {
        std::mem::take(&mut self.unknown)
    }

    fn held(&self, number: u64) -> Option<&Held> {
        self.held.get(number as u32 as usize)?.as_ref().filter(|held| held.number == number)
    }

    fn finder<'a>(&'a mut self, bulk: &'a Bulk) -> Finder<'a> {
        Finder { nodes: &mut self.nodes, held: &self.held, bulk, missed: 0 }
    }

    fn take(&mut self, packet: &Packet<'_>, bulk: &Bulk) -> Result<(), ReplicaError> {
        let head = &packet.head;
        let count = packet.missing(bulk).len();
        if count > 0 {
            return Err(ReplicaError::MissingBulk { count });
        }
        self.declare(head, bulk)?;
        self.remove(head)?;
        self.create(head, bulk)?;
        self.connect(head)?;
        // What was made, and what somebody else wrote since the last frame, is in the hash before values come: those bring it along.
        self.update_hash();
        self.values(packet, bulk)?;
        (self.frame, self.time_s, self.expected) = (head.frame, head.time_s, head.hash);
        self.mark = self.graph.revision();
        self.sweep();
        Ok(())
    }

    fn declare(&mut self, head: &Head, bulk: &Bulk) -> Result<(), ReplicaError> {
        for (number, record) in &head.types {
            let mut find = Finder { nodes: &mut self.nodes, held: &self.held, bulk, missed: 0 };
            let (local, unknown) = local_type(&self.graph, &mut self.herds, record, &mut find)?;
            self.types.insert(*number, local);
            self.unknown.extend(unknown);
        }
        Ok(())
    }

    fn remove(&mut self, head: &Head) -> Result<(), ReplicaError> {
        for (from, to) in &head.unrouted {
            // Both may be gone with their nodes later in this frame, but not yet.
            let route = self.graph.route_between(self.place(*from)?, self.place(*to)?);
            let route = route.ok_or_else(|| damaged("it removes a route that is not there"))?;
            let is_weak = self.graph.route(route).is_some_and(|route| route.strength == Strength::Weak);
            self.graph.disconnect(route);
            self.herds.subtract(route_share(*from, *to, is_weak));
        }
        for place in &head.fields_removed {
            let field = self.place(*place)?;
            if self.herds.is_declared(*place) {
                return Err(damaged("it removes a field that belongs to a type"));
            }
            self.graph.remove_field(field).map_err(|error| damaged(error.to_string()))?;
            if let Some(Some(held)) = self.held.get_mut(place.0 as u32 as usize) {
                held.dynamic.retain(|(index, _)| *index != place.1);
            }
            self.herds.set_field(place.0, place.1, 0);
        }
        for number in &head.removed {
            let id = self.node(*number).ok_or_else(|| damaged("it removes a node that is not there"))?;
            self.graph.delete(id).map_err(|error| damaged(error.to_string()))?;
            self.held[*number as u32 as usize] = None;
            self.nodes.dead.insert(*number, id);
            self.herds.remove(*number);
        }
        Ok(())
    }

    fn create(&mut self, head: &Head, bulk: &Bulk) -> Result<(), ReplicaError> {
        for (number, node_type) in &head.created {
            let local = self.types.get(node_type).ok_or_else(|| damaged("it makes a node of a type that was not declared"))?;
            let id = self.graph.create_of(local.node_type.clone());
            let slot = *number as u32 as usize;
            if slot >= self.held.len() {
                // A slot is an index into the application's nodes: one far beyond all others is none.
                if slot > self.held.len() + head.created.len() + (1 << 24) {
                    return Err(damaged("a node's number makes no sense"));
                }
                self.held.resize_with(slot + 1, || None);
            }
            if self.held[slot].is_some() {
                return Err(damaged("it makes a node that is there"));
            }
            let mut dynamic = Vec::new();
            for (index, field) in &local.extra {
                let added = self.graph.add_field(id, field.clone()).map_err(|error| damaged(error.to_string()))?;
                dynamic.push((*index, added.index));
            }
            for (index, value) in &local.defaults {
                put(&mut self.graph, FieldId { node: id, index: *index }, value.clone())?;
            }
            let slots = &self.graph.nodes[id].slots;
            let added = |index: u16| dynamic.iter().find(|(there, _)| *there == index).map(|(_, here)| *here);
            let here =
                |index: u16| local.to_local.get(index as usize).copied().filter(|here| *here != NONE).or_else(|| added(index));
            self.herds.insert(*number, slot_of(id), local.herd, |index| here(index).map_or(FREE, |here| slots[here as usize]));
            self.held[slot] = Some(Held { number: *number, id, node_type: *node_type, dynamic });
            self.nodes.numbers.insert(id, *number);
            if let Some(nobody) = self.nodes.dead.remove(number) {
                self.nodes.numbers.remove(&nobody);
                replace_references(&mut self.graph, nobody, id);
            }
        }
        for (place, plain) in &head.fields_added {
            let field = plain.field(&mut self.finder(bulk)).map_err(damaged)?;
            let id = self.node(place.0).ok_or_else(|| damaged("it adds a field to a node that is not there"))?;
            let added = self.graph.add_field(id, field).map_err(|error| damaged(error.to_string()))?;
            if let Some(Some(held)) = self.held.get_mut(place.0 as u32 as usize) {
                held.dynamic.push((place.1, added.index));
            }
        }
        // First all names go, so that nodes may change names with each other.
        for rename in [false, true] {
            for (number, name) in &head.names {
                let id = self.node(*number).ok_or_else(|| damaged("it names a node that is not there"))?;
                let name = if rename { name } else { "" };
                self.graph.set_name(id, name).map_err(|error| damaged(error.to_string()))?;
            }
        }
        Ok(())
    }

    fn connect(&mut self, head: &Head) -> Result<(), ReplicaError> {
        for (from, to, weak) in &head.routes {
            let strength = if *weak { Strength::Weak } else { Strength::Strong };
            let (source, target) = (self.place(*from)?, self.place(*to)?);
            self.graph.link(source, target, strength).map_err(|error| damaged(error.to_string()))?;
            self.herds.add(route_share(*from, *to, *weak));
        }
        Ok(())
    }

    fn values(&mut self, packet: &Packet<'_>, bulk: &Bulk) -> Result<(), ReplicaError> {
        for (place, hash) in &packet.head.long {
            let bytes = bulk.value(*hash).ok_or(ReplicaError::MissingBulk { count: 1 })?;
            let field = self.place(*place)?;
            let field_type = self.graph.declaration(field).map_err(|error| damaged(error.to_string()))?.field_type;
            self.value(*place, field, field_type, &mut &bytes[..], bulk)?;
        }
        for group in packet.groups() {
            let group = group?;
            let flat = match group.field {
                FieldOf::Type(index) => scatter_flat(&mut self.graph, &mut self.herds, index, group),
                FieldOf::Node(_) => None,
            };
            match flat {
                Some(done) => done?,
                None => self.group(group, bulk)?,
            }
        }
        Ok(())
    }

    fn group(&mut self, group: GroupRead<'_>, bulk: &Bulk) -> Result<(), ReplicaError> {
        let (FieldOf::Type(index) | FieldOf::Node(index)) = group.field;
        let mut rest = group.values;
        for slot in group.runs.iter().flat_map(Run::slots) {
            let held = self.held.get(slot).and_then(Option::as_ref);
            let held = held.ok_or_else(|| damaged("it writes to a node that is not there"))?;
            let (place, field) = ((held.number, index), self.field_of(held, index)?);
            self.value(place, field, group.field_type, &mut rest, bulk)?;
        }
        if rest.is_empty() { Ok(()) } else { Err(damaged("values are left over")) }
    }

    fn value(
        &mut self,
        place: Place,
        field: FieldId,
        field_type: FieldType,
        bytes: &mut &[u8],
        bulk: &Bulk,
    ) -> Result<(), ReplicaError> {
        let (declared, _) = self.graph.place(field).map_err(|error| damaged(error.to_string()))?;
        let mut find = Finder { nodes: &mut self.nodes, held: &self.held, bulk, missed: 0 };
        let value = take_value(bytes, field_type, declared, &mut find).map_err(damaged)?;
        if find.missed > 0 {
            return Err(ReplicaError::MissingBulk { count: find.missed });
        }
        put(&mut self.graph, field, value)?;
        let (declared, slot) = self.graph.place(field).map_err(|error| damaged(error.to_string()))?;
        let mut namer = Namer { numbers: &self.nodes.numbers, hashes: &mut self.hashes };
        let share = share_there(&self.graph.columns, declared, slot, place, &mut namer);
        self.herds.set_field(place.0, place.1, share);
        Ok(())
    }

    pub(super) fn place(&self, (number, index): Place) -> Result<FieldId, ReplicaError> {
        let held = self.held(number).ok_or_else(|| damaged("it refers to a node that is not there"))?;
        self.field_of(held, index)
    }

    fn field_of(&self, held: &Held, index: u16) -> Result<FieldId, ReplicaError> {
        field_here(self.types.get(&held.node_type), held, index)
    }

    /// Brings the hash up to date with all that was written to the graph, by packets or by others.
    fn update_hash(&mut self) {
        let nodes = match self.graph.changes_since(self.mark) {
            Changes::Nodes(nodes) => nodes,
            Changes::All => self.graph.nodes().collect(),
        };
        for id in nodes {
            let Some(node) = self.graph.nodes.get(id) else { continue };
            let Some(number) = self.nodes.numbers.get(&id).copied() else { continue };
            let Some(held) = self.held(number) else { continue };
            let Some(local) = self.types.get(&held.node_type) else { continue };
            self.herds.set_own(number, &node.node_type.name, node.name.as_deref().unwrap_or_default());
            let declared = local.to_local.iter().enumerate().map(|(index, local)| (index as u16, *local));
            let fields = declared.filter(|(_, local)| *local != NONE);
            let held = self.held[number as u32 as usize].as_ref();
            for (index, local) in fields.chain(held.into_iter().flat_map(|held| held.dynamic.iter().copied())) {
                let Some(field) = node.field(local) else { continue };
                let slot = node.slots[local as usize];
                let revision = self.graph.columns.revisions(field.field_type)[slot as usize];
                if revision <= self.mark && self.herds.field(number, index) != 0 {
                    continue;
                }
                let mut namer = Namer { numbers: &self.nodes.numbers, hashes: &mut self.hashes };
                let share = share_there(&self.graph.columns, field, slot, (number, index), &mut namer);
                self.herds.set_field(number, index, share);
            }
        }
        self.mark = self.graph.revision();
    }

    /// Forgets the dead that nothing refers to, once there are many.
    fn sweep(&mut self) {
        if self.nodes.dead.len() < self.sweep_at {
            return;
        }
        let columns = &self.graph.columns;
        let one = columns.node_one.values.iter().flatten();
        let many = columns.node_many.values.iter().flat_map(|many| many.iter().flatten());
        let referred: HashSet<NodeId> = one.chain(many).copied().collect();
        self.nodes.sweep(&referred);
        self.sweep_at = SWEEP.max(2 * self.nodes.dead.len()).max(self.graph.node_count());
    }
}

/// What a field adds to the hash by what stands in it.
fn share_there(columns: &Columns, field: &Field, slot: u32, place: Place, namer: &mut Namer<'_>) -> u64 {
    let by_bytes = || {
        let bytes = to_bytes(&columns.value(field.field_type, slot), field, namer, Vec::new());
        field_share(place.0, place.1, &bytes)
    };
    share_of_flat(columns, field.field_type, slot, place).unwrap_or_else(by_bytes)
}

/// The field of a node that has an index in the application.
fn field_here(local: Option<&LocalType>, held: &Held, index: u16) -> Result<FieldId, ReplicaError> {
    let declared = local.and_then(|local| local.to_local.get(index as usize)).copied().filter(|local| *local != NONE);
    let dynamic = || held.dynamic.iter().find(|(there, _)| *there == index).map(|(_, here)| *here);
    let index = declared.or_else(dynamic).ok_or_else(|| damaged("it refers to a field that is not there"))?;
    Ok(FieldId { node: held.id, index })
}

/// Writes a value that was right where it came from.
pub(super) fn put(graph: &mut Graph, field: FieldId, value: Value) -> Result<(), ReplicaError> {
    let (declared, slot) = graph.place(field).map_err(|error| damaged(error.to_string()))?;
    if declared.field_type != value.field_type() {
        return Err(damaged(format!("{} does not hold a {}", graph.describe_field(field), value.field_type())));
    }
    let revision = graph.changes.next();
    graph.columns.write(slot, &value, false, revision);
    graph.changes.wrote(slot_of(field.node), revision);
    Ok(())
}

/// Has fields that referred to a node before it came refer to it.
fn replace_references(graph: &mut Graph, nobody: NodeId, id: NodeId) {
    let refers = |value: &Value| match value {
        Value::Node(node) => *node == Some(nobody),
        Value::Nodes(nodes) => nodes.contains(&Some(nobody)),
        _ => false,
    };
    let fields: Vec<FieldId> = graph
        .nodes()
        .flat_map(|node| graph.field_ids(node))
        .filter(|(field, declared)| {
            declared.field_type.kind == Kind::Node && graph.value(*field).is_ok_and(|value| refers(&value))
        })
        .map(|(field, _)| field)
        .collect();
    for field in fields {
        let replaced = match graph.value(field) {
            Ok(Value::Nodes(nodes)) => {
                Value::Nodes(nodes.iter().map(|node| if *node == Some(nobody) { Some(id) } else { *node }).collect())
            }
            _ => Value::Node(Some(id)),
        };
        let _ = put(graph, field, replaced);
    }
}
