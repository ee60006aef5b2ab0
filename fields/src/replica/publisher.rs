//! From a graph to packets.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::ops::Range;
use std::sync::Arc;

use slotmap::Key;

use super::bulk::{ImageHashes, LONG, Offered, hash_of_value, message_of_image, message_of_value};
use super::flat::{put_flat, share_of_flat};
use super::gather::{Written, gather_flat};
use super::herd::{Herds, Seat};
use super::packet::{Draft, FieldOf, Place, TypeRecord, seal};
use super::routes::KnownRoutes;
use super::shares::field_share;
use crate::changes::append_run;
use crate::codec::{Name, PlainField, Ref, to_bytes};
use crate::column::FREE;
use crate::graph::Node;
use crate::{Changes, Field, FieldId, FieldType, Graph, Image, NodeId, NodeType, Revision};

/// What makes a dynamic field the same one: name, type, choices.
type Declared = (Arc<str>, FieldType, Arc<[Arc<str>]>);

/// What replicas know of a node.
#[derive(Default)]
struct Known {
    number: u64,
    name: Option<Arc<str>>,
    /// Dynamic fields by index.
    dynamic: Vec<Option<Declared>>,
}

/// Names nodes by their numbers and images by their content, and remembers the images.
struct Names<'a> {
    hashes: &'a mut ImageHashes,
    images: Vec<(u64, Arc<Image>)>,
}

impl Name for Names<'_> {
    fn node(&mut self, node: Option<NodeId>) -> Ref {
        Ref::Number(node.map_or(0, |node| node.data().as_ffi()))
    }

    fn image(&mut self, image: Option<&Arc<Image>>) -> Ref {
        let Some(image) = image else { return Ref::Number(0) };
        let hash = self.hashes.of(image);
        self.images.push((hash, image.clone()));
        Ref::Number(hash)
    }
}

/// Makes packets of what happens to one graph.
#[derive(Default)]
pub struct Publisher {
    /// Writes up to this one were sent.
    mark: Revision,
    frame: u64,
    known: Vec<Option<Known>>,
    /// By number; the reference keeps their addresses from being used again.
    types: Vec<Arc<NodeType>>,
    /// Numbers of types, by address.
    type_numbers: HashMap<usize, u32>,
    routes: KnownRoutes,
    /// By the same numbers.
    herds: Herds,
    /// Nodes with fields of their own, by slot.
    with_dynamic: BTreeSet<u32>,
    /// Slots of nodes that came with this frame: all of them was told already.
    new: HashSet<u32>,
    /// Places of nodes of each herd that were written, those side by side together; here so that the memory is used again.
    written: Vec<Vec<Range<u32>>>,
    /// Bytes of the last packet.
    usual_length: usize,
    /// Memory of one that is not needed any more.
    spare: Vec<u8>,
    hashes: ImageHashes,
    offered: Offered,
    /// What fields hold of what is offered.
    held: HashMap<Place, Vec<u64>>,
}

impl Publisher {
    /// Nothing sent yet: the first packet holds everything.
    pub fn new() -> Self {
        Self::default()
    }

    /// The hash of all that replicas know.
    pub fn hash(&self) -> u64 {
        self.herds.sum()
    }

    /// The number of the last frame.
    pub fn last_frame(&self) -> u64 {
        self.frame
    }

    /// A long value or an image that a packet referred to.
    pub fn bulk(&self, hash: u64) -> Option<Arc<[u8]>> {
        self.offered.get(hash)
    }

    /// Takes a packet back that was sent, so that the next one lies where it lay.
    pub fn reuse(&mut self, packet: Vec<u8>) {
        self.spare = packet;
    }

    /// The next frame: what was written since the last one. To be called between evaluations.
    pub fn frame(&mut self, graph: &Graph) -> Vec<u8> {
        let mut packet = self.unsealed_frame(graph);
        seal(&mut packet);
        packet
    }

    /// The same without a checksum, for who stays on this machine; [`seal`] it for others.
    pub fn unsealed_frame(&mut self, graph: &Graph) -> Vec<u8> {
        self.frame += 1;
        let mut draft = Draft::new(std::mem::take(&mut self.spare), self.usual_length);
        self.new.clear();
        let is_reshaped = graph.changes.shape() > self.mark || self.frame == 1;
        let fields_changed = is_reshaped && self.reshape(graph, &mut draft);
        self.values(graph, &mut draft);
        if !is_reshaped {
            self.dynamic_values(graph, &mut draft);
        }
        let known = &self.known;
        let is_known = |field: FieldId| {
            let number = field.node.data().as_ffi();
            let is_node_known =
                known.get(number as u32 as usize).and_then(Option::as_ref).is_some_and(|known| known.number == number);
            is_node_known && graph.declaration(field).is_ok_and(|field| !field.local)
        };
        (draft.head.unrouted, draft.head.routes) = self.routes.update(graph, &mut self.herds, fields_changed, is_known);
        self.mark = graph.revision();
        let bytes = self.finish(graph, draft);
        self.usual_length = bytes.len();
        bytes
    }

    /// Nodes that came, went, or are made of something else now; true if fields came or went.
    fn reshape(&mut self, graph: &Graph, draft: &mut Draft) -> bool {
        let nodes = match graph.changes_since(self.mark) {
            Changes::Nodes(nodes) => nodes,
            Changes::All => {
                self.find_again(graph);
                let gone = self.known.iter().flatten().map(|known| number_to_id(known.number)).filter(|id| !graph.contains(*id));
                gone.chain(graph.nodes()).collect()
            }
        };
        let mut fields_changed = false;
        for id in &nodes {
            let is_shown = graph.nodes.get(*id).is_some_and(|node| !node.local && !self.is_of_other_type(*id, node));
            let number = id.data().as_ffi();
            if !is_shown && self.known_node(number).is_some() {
                self.forget(number);
                draft.head.removed.push(number);
                fields_changed = true;
            }
        }
        for id in &nodes {
            let Some(node) = graph.nodes.get(*id).filter(|node| !node.local) else { continue };
            fields_changed |= self.node(graph, *id, node, draft);
        }
        fields_changed
    }

    /// The graph was restored: values of known nodes may lie elsewhere.
    fn find_again(&mut self, graph: &Graph) {
        self.herds.move_slots(|number, index| {
            let node = graph.nodes.get(number_to_id(number))?;
            Some(node.slots.get(index as usize).copied().unwrap_or(FREE))
        });
    }

    /// A restored graph may hold another node of that number.
    fn is_of_other_type(&self, id: NodeId, node: &Node) -> bool {
        let seat = self.herds.seat(id.data().as_ffi());
        seat.is_some_and(|seat| !Arc::ptr_eq(&self.types[seat.herd as usize], &node.node_type))
    }

    /// What was written to fields that nodes have by their types.
    fn values(&mut self, graph: &Graph, draft: &mut Draft) {
        self.find_written(graph);
        let places = std::mem::take(&mut self.written);
        for (herd, places) in places.iter().enumerate().filter(|(_, places)| !places.is_empty()) {
            let written = Written::of(&self.herds.herds[herd], places, self.mark);
            for index in 0..self.herds.herds[herd].strands.len() as u16 {
                if gather_flat(&graph.columns, &mut self.herds, herd, index, &written, draft).is_none() {
                    self.others(graph, herd, index, &written, draft);
                }
            }
        }
        self.written = places;
    }

    /// Notes which nodes of each herd were written that did not come with this frame.
    fn find_written(&mut self, graph: &Graph) {
        self.written.resize_with(self.types.len(), Vec::new);
        self.written.iter_mut().for_each(Vec::clear);
        for Range { start: mut slot, end } in graph.changes.slots_since(self.mark) {
            while slot < end {
                let seat = self.herds.seats.get(slot as usize).filter(|seat| seat.number > 0 && !self.new.contains(&slot));
                let Some(Seat { herd, place, .. }) = seat else {
                    slot += 1;
                    continue;
                };
                let in_a_row = if self.new.is_empty() { self.herds.herds[*herd as usize].in_a_row(*place) } else { 1 };
                let count = in_a_row.min(end - slot);
                append_run(&mut self.written[*herd as usize], *place..place + count);
                slot += count;
            }
        }
    }

    /// Tells of a field that is not a few floats.
    fn others(&mut self, graph: &Graph, herd: usize, index: u16, written: &Written, draft: &mut Draft) {
        let Some((numbers, strand)) = self.herds.herds[herd].strand_mut(index) else { return };
        let revisions = graph.columns.revisions(strand.field_type);
        let mut found: Vec<(u64, u32)> = Vec::new();
        written.each(strand, revisions, |place| found.push((numbers[place], strand.slots[place])));
        let node_type = self.types[herd].clone();
        for (number, slot) in found {
            self.value(graph, (number, index), &node_type.fields[index as usize], slot, draft, Purpose::Frame);
        }
    }

    /// What was written to fields that single nodes have, while none came or went.
    fn dynamic_values(&mut self, graph: &Graph, draft: &mut Draft) {
        for slot in self.with_dynamic.iter().copied().filter(|slot| graph.changes.node(*slot) > self.mark).collect::<Vec<_>>() {
            let Some(node) = graph.nodes.get(graph.ids[slot as usize]) else { continue };
            self.dynamic_of(graph, self.herds.seats[slot as usize].number, node, &[], draft);
        }
    }

    /// Values of fields of one node's own: new ones, and those that were written.
    fn dynamic_of(&mut self, graph: &Graph, number: u64, node: &Node, added: &[u16], draft: &mut Draft) {
        for (index, field) in node.fields().skip_while(|(index, _)| (*index as usize) < node.node_type.fields.len()) {
            let slot = node.slots[index as usize];
            let revision = graph.columns.revisions(field.field_type)[slot as usize];
            if !field.local && (revision > self.mark || added.contains(&index)) {
                self.value(graph, (number, index), field, slot, draft, Purpose::Frame);
            }
        }
    }

    /// Everything as of the last frame; `None` if the graph was written since.
    pub fn snapshot(&mut self, graph: &Graph) -> Option<Vec<u8>> {
        if graph.revision() != self.mark {
            return None;
        }
        let mut draft = Draft::new(Vec::new(), self.usual_length);
        draft.head.is_snapshot = true;
        for (number, node_type) in self.types.clone().iter().enumerate() {
            draft.head.types.push((number as u32, self.type_record(node_type)));
        }
        let numbers: Vec<u64> = self.known.iter().flatten().map(|known| known.number).collect();
        for number in numbers {
            let Some(node) = graph.nodes.get(number_to_id(number)) else { continue };
            let herd = self.herds.seat(number).map_or(0, |seat| seat.herd);
            draft.head.created.push((number, herd));
            if let Some(name) = &node.name {
                draft.head.names.push((number, name.to_string()));
            }
            for (index, field) in node.fields().filter(|(_, field)| !field.local) {
                let is_dynamic = index as usize >= node.node_type.fields.len();
                if is_dynamic {
                    draft.head.fields_added.push(((number, index), self.plain(field)));
                }
                let slot = node.slots[index as usize];
                if graph.columns.revisions(field.field_type)[slot as usize] > node.created {
                    self.value(graph, (number, index), field, slot, &mut draft, Purpose::Snapshot);
                }
            }
        }
        draft.head.routes = self.routes.all();
        let mut packet = self.finish(graph, draft);
        seal(&mut packet);
        Some(packet)
    }

    fn finish(&self, graph: &Graph, mut draft: Draft) -> Vec<u8> {
        draft.head.frame = self.frame;
        draft.head.time_s = graph.time();
        draft.head.hash = self.hash();
        draft.head.needs.sort_unstable();
        draft.head.needs.dedup();
        draft.finish()
    }

    fn known_node(&self, number: u64) -> Option<&Known> {
        self.known.get(number as u32 as usize)?.as_ref().filter(|known| known.number == number)
    }

    fn forget(&mut self, number: u64) {
        self.known[number as u32 as usize] = None;
        self.with_dynamic.remove(&(number as u32));
        // Held values of a node are few; they are found by its fields.
        self.herds.fields(number).into_iter().for_each(|index| self.let_go((number, index)));
        self.herds.remove(number);
    }

    fn let_go(&mut self, place: Place) {
        if self.held.is_empty() {
            return;
        }
        for hash in self.held.remove(&place).into_iter().flatten() {
            self.offered.release(hash);
        }
    }

    /// What is new of a node; true if fields came or went.
    fn node(&mut self, graph: &Graph, id: NodeId, node: &Node, draft: &mut Draft) -> bool {
        let number = id.data().as_ffi();
        let is_new = self.known_node(number).is_none();
        if is_new {
            let node_type = self.node_type(&node.node_type, draft);
            draft.head.created.push((number, node_type));
            let slot = number as u32 as usize;
            if self.known.len() <= slot {
                self.known.resize_with(slot + 1, || None);
            }
            self.known[slot] = Some(Known { number, ..Known::default() });
            self.herds.insert(number, number as u32, node_type, |index| node.slots[index as usize]);
        }
        let mut fields_changed = is_new;
        if is_new || self.known_node(number).is_some_and(|known| known.name != node.name) {
            if node.name.is_some() || !is_new {
                draft.head.names.push((number, node.name.as_deref().unwrap_or_default().into()));
            }
            self.herds.set_own(number, &node.node_type.name, node.name.as_deref().unwrap_or_default());
            if let Some(known) = &mut self.known[number as u32 as usize] {
                known.name = node.name.clone();
            }
        }
        let has_dynamic = !node.dynamic.is_empty() || self.known_node(number).is_some_and(|known| !known.dynamic.is_empty());
        let added = if has_dynamic { self.dynamic(number, node, draft) } else { Vec::new() };
        fields_changed |= has_dynamic;
        if has_dynamic {
            self.dynamic_of(graph, number, node, &added, draft);
        }
        if is_new {
            self.all_of_new(graph, number, node, draft);
            self.new.insert(number as u32);
        }
        fields_changed
    }

    /// Values of a new node. Replicas have its defaults from the type.
    fn all_of_new(&mut self, graph: &Graph, number: u64, node: &Node, draft: &mut Draft) {
        for (index, field) in node.node_type.fields.iter().enumerate().filter(|(_, field)| !field.local) {
            let slot = node.slots[index];
            let is_default = graph.columns.revisions(field.field_type)[slot as usize] <= node.created;
            let purpose = if is_default { Purpose::HashOnly } else { Purpose::Frame };
            self.value(graph, (number, index as u16), field, slot, draft, purpose);
        }
    }

    /// Brings dynamic fields up to date; gives the indices of new ones.
    fn dynamic(&mut self, number: u64, node: &Node, draft: &mut Draft) -> Vec<u16> {
        let Some(known) = &mut self.known[number as u32 as usize] else { return Vec::new() };
        let before = std::mem::take(&mut known.dynamic);
        let is_shown = |field: &&Field| !field.local;
        let declared = |field: &Field| (field.name.clone(), field.field_type, field.choices.clone());
        let now: Vec<Option<Declared>> = node.dynamic.iter().map(|field| field.as_ref().filter(is_shown).map(declared)).collect();
        known.dynamic = now.clone();
        if now.is_empty() {
            self.with_dynamic.remove(&(number as u32));
        } else {
            self.with_dynamic.insert(number as u32);
        }
        let mut added = Vec::new();
        for place in 0..before.len().max(now.len()) {
            let (before, now) = (before.get(place).unwrap_or(&None), now.get(place).unwrap_or(&None));
            if before == now {
                continue;
            }
            let index = (node.node_type.fields.len() + place) as u16;
            if before.is_some() {
                draft.head.fields_removed.push((number, index));
                self.let_go((number, index));
                self.herds.set_field(number, index, 0);
            }
            if let (Some(_), Some(field)) = (now, node.field(index)) {
                let plain = self.plain(field);
                draft.head.fields_added.push(((number, index), plain));
                added.push(index);
            }
        }
        added
    }

    fn plain(&mut self, field: &Field) -> PlainField {
        PlainField::of(field, &mut Names { hashes: &mut self.hashes, images: Vec::new() })
    }

    /// The number of a type, which is declared where it is new.
    fn node_type(&mut self, node_type: &Arc<NodeType>, draft: &mut Draft) -> u32 {
        let address = Arc::as_ptr(node_type) as usize;
        if let Some(number) = self.type_numbers.get(&address) {
            return *number;
        }
        let shown = node_type.fields.iter().enumerate().filter(|(_, field)| !field.local);
        let number = self.herds.declare(shown.map(|(index, field)| (index as u16, field.field_type)));
        self.types.push(node_type.clone());
        self.type_numbers.insert(address, number);
        let record = self.type_record(node_type);
        draft.head.types.push((number, record));
        number
    }

    fn type_record(&mut self, node_type: &NodeType) -> TypeRecord {
        let shown = node_type.fields.iter().enumerate().filter(|(_, field)| !field.local);
        let fields = shown.map(|(index, field)| (index as u16, self.plain(field))).collect();
        TypeRecord { name: node_type.name.to_string(), fields }
    }

    /// Puts a value into its group, or by its content if it is long.
    fn value(&mut self, graph: &Graph, place: Place, field: &Field, slot: u32, draft: &mut Draft, purpose: Purpose) {
        let (columns, is_declared) = (&graph.columns, self.herds.is_declared(place));
        let field_of = if is_declared { FieldOf::Type(place.1) } else { FieldOf::Node(place.1) };
        let group = draft.groups.entry((field.field_type, field_of)).or_default();
        if let Some(share) = share_of_flat(columns, field.field_type, slot, place) {
            if purpose != Purpose::Snapshot {
                self.herds.set_field(place.0, place.1, share);
            }
            if purpose != Purpose::HashOnly {
                put_flat(columns, field.field_type, slot, &mut group.values);
                group.runs.push(place.0 as u32);
            }
            return;
        }
        let value = columns.value(field.field_type, slot);
        let start = group.values.len();
        let mut names = Names { hashes: &mut self.hashes, images: Vec::new() };
        group.values = to_bytes(&value, field, &mut names, std::mem::take(&mut group.values));
        let images = names.images;
        let bytes = &group.values[start..];
        if purpose != Purpose::Snapshot {
            self.herds.set_field(place.0, place.1, field_share(place.0, place.1, bytes));
        }
        let is_long = bytes.len() > LONG;
        let long = is_long.then(|| hash_of_value(bytes));
        // What was long before and is new again is on its way of changing every frame: it goes as it is, not by its content.
        let by_content = match purpose {
            Purpose::Snapshot => long.is_some_and(|hash| self.held.get(&place).is_some_and(|held| held.contains(&hash))),
            _ => long.is_some_and(|hash| self.offered.has(hash) || !self.held.contains_key(&place)),
        };
        let refers: Vec<u64> = images.iter().map(|(hash, _)| *hash).chain(long.filter(|_| by_content)).collect();
        draft.head.needs.extend(&refers);
        if purpose != Purpose::Snapshot && (!refers.is_empty() || !self.held.is_empty()) {
            for (hash, image) in &images {
                self.offered.hold(*hash, || message_of_image(image));
            }
            if let Some(hash) = long.filter(|_| by_content) {
                self.offered.hold(hash, || message_of_value(bytes));
            }
            self.let_go(place);
            if !refers.is_empty() || is_long {
                self.held.insert(place, refers);
            }
        }
        if purpose == Purpose::HashOnly {
            group.values.truncate(start);
        } else if let Some(hash) = long.filter(|_| by_content) {
            group.values.truncate(start);
            draft.head.long.push((place, hash));
        } else {
            group.runs.push(place.0 as u32);
        }
    }
}

/// What a value is encoded for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Frame,
    Snapshot,
    /// A default: replicas have it from the type.
    HashOnly,
}

/// A node's id back from its number.
fn number_to_id(number: u64) -> NodeId {
    NodeId::from(slotmap::KeyData::from_ffi(number))
}
