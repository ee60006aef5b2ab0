//! From a graph to packets.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use slotmap::Key;

use super::bulk::{ImageHashes, LONG, Offered, hash_of_value, message_of_image, message_of_value};
use super::flat::flat_bytes;
use super::packet::{Group, Head, Place, TypeRecord, write};
use super::routes::KnownRoutes;
use super::shares::{Shares, field_share};
use crate::codec::{Name, PlainField, Ref, to_bytes};
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

/// A packet in the making.
#[derive(Default)]
struct Draft {
    head: Head,
    groups: BTreeMap<FieldType, Group>,
}

/// Makes packets of what happens to one graph.
#[derive(Default)]
pub struct Publisher {
    /// Writes up to this one were sent.
    mark: Revision,
    frame: u64,
    known: Vec<Option<Known>>,
    /// Types that have a number, by address; the reference keeps it from being used again.
    types: HashMap<usize, (Arc<NodeType>, u32)>,
    routes: KnownRoutes,
    shares: Shares,
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
        self.shares.sum()
    }

    /// The number of the last frame.
    pub fn last_frame(&self) -> u64 {
        self.frame
    }

    /// A long value or an image that a packet referred to.
    pub fn bulk(&self, hash: u64) -> Option<Arc<[u8]>> {
        self.offered.get(hash)
    }

    /// The next frame: what was written since the last one. To be called between evaluations.
    pub fn frame(&mut self, graph: &Graph) -> Vec<u8> {
        self.frame += 1;
        let mut draft = Draft::default();
        let nodes = match graph.changes_since(self.mark) {
            Changes::Nodes(nodes) => nodes,
            Changes::All => {
                let gone = self.known.iter().flatten().map(|known| number_to_id(known.number)).filter(|id| !graph.contains(*id));
                gone.chain(graph.nodes()).collect()
            }
        };
        let mut fields_changed = false;
        for id in &nodes {
            let is_shown = graph.nodes.get(*id).is_some_and(|node| !node.local);
            let number = id.data().as_ffi();
            if !is_shown && self.known_node(number).is_some() {
                self.forget(number);
                draft.head.removed.push(number);
                fields_changed = true;
            }
        }
        for id in &nodes {
            let Some(node) = graph.nodes.get(*id).filter(|node| !node.local) else { continue };
            fields_changed |= self.node(graph, *id, node, &mut draft);
        }
        let known = &self.known;
        let is_known = |field: FieldId| {
            let number = field.node.data().as_ffi();
            let is_node_known =
                known.get(number as u32 as usize).and_then(Option::as_ref).is_some_and(|known| known.number == number);
            is_node_known && graph.declaration(field).is_ok_and(|field| !field.local)
        };
        (draft.head.unrouted, draft.head.routes) = self.routes.update(graph, &mut self.shares, fields_changed, is_known);
        self.mark = graph.revision();
        self.finish(graph, draft)
    }

    /// Everything as of the last frame; `None` if the graph was written since.
    pub fn snapshot(&mut self, graph: &Graph) -> Option<Vec<u8>> {
        if graph.revision() != self.mark {
            return None;
        }
        let mut draft = Draft::default();
        draft.head.is_snapshot = true;
        let mut types: Vec<_> = self.types.values().cloned().collect();
        types.sort_unstable_by_key(|(_, number)| *number);
        draft.head.types = types.iter().map(|(node_type, number)| (*number, self.type_record(node_type))).collect();
        let numbers: Vec<u64> = self.known.iter().flatten().map(|known| known.number).collect();
        for number in numbers {
            let Some(node) = graph.nodes.get(number_to_id(number)) else { continue };
            let node_type = self.types.get(&(Arc::as_ptr(&node.node_type) as usize)).map_or(0, |(_, number)| *number);
            draft.head.created.push((number, node_type));
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
        Some(self.finish(graph, draft))
    }

    fn finish(&self, graph: &Graph, mut draft: Draft) -> Vec<u8> {
        draft.head.frame = self.frame;
        draft.head.time_s = graph.time();
        draft.head.hash = self.hash();
        draft.head.needs.sort_unstable();
        draft.head.needs.dedup();
        write(&draft.head, &draft.groups)
    }

    fn known_node(&self, number: u64) -> Option<&Known> {
        self.known.get(number as u32 as usize)?.as_ref().filter(|known| known.number == number)
    }

    fn forget(&mut self, number: u64) {
        self.known[number as u32 as usize] = None;
        // Held values of a node are few; they are found by its fields.
        let fields = self.shares.nodes[number as u32 as usize].as_ref().map_or(0, |node| node.fields.len());
        (0..fields as u16).for_each(|index| self.let_go((number, index)));
        self.shares.remove(number);
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
            self.shares.insert(number);
        }
        let mut fields_changed = is_new;
        if is_new || self.known_node(number).is_some_and(|known| known.name != node.name) {
            if node.name.is_some() || !is_new {
                draft.head.names.push((number, node.name.as_deref().unwrap_or_default().into()));
            }
            self.shares.set_own(number, &node.node_type.name, node.name.as_deref().unwrap_or_default());
            if let Some(known) = &mut self.known[number as u32 as usize] {
                known.name = node.name.clone();
            }
        }
        let has_dynamic = !node.dynamic.is_empty() || self.known_node(number).is_some_and(|known| !known.dynamic.is_empty());
        let added = if has_dynamic { self.dynamic(number, node, draft) } else { Vec::new() };
        fields_changed |= has_dynamic;
        for (index, field) in node.fields() {
            let slot = node.slots[index as usize];
            let revision = graph.columns.revisions(field.field_type)[slot as usize];
            let is_unknown = is_new || (has_dynamic && added.contains(&index));
            if field.local || !(is_unknown || revision > self.mark) {
                continue;
            }
            let purpose = if is_new && revision <= node.created { Purpose::HashOnly } else { Purpose::Frame };
            self.value(graph, (number, index), field, slot, draft, purpose);
        }
        fields_changed
    }

    /// Brings dynamic fields up to date; gives the indices of new ones.
    fn dynamic(&mut self, number: u64, node: &Node, draft: &mut Draft) -> Vec<u16> {
        let Some(known) = &mut self.known[number as u32 as usize] else { return Vec::new() };
        let before = std::mem::take(&mut known.dynamic);
        let is_shown = |field: &&Field| !field.local;
        let declared = |field: &Field| (field.name.clone(), field.field_type, field.choices.clone());
        let now: Vec<Option<Declared>> = node.dynamic.iter().map(|field| field.as_ref().filter(is_shown).map(declared)).collect();
        known.dynamic = now.clone();
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
                self.shares.set_field(number, index, 0);
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
        if let Some((_, number)) = self.types.get(&(Arc::as_ptr(node_type) as usize)) {
            return *number;
        }
        let number = self.types.len() as u32;
        self.types.insert(Arc::as_ptr(node_type) as usize, (node_type.clone(), number));
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
        let group = draft.groups.entry(field.field_type).or_default();
        if let Some(flat) = flat_bytes(&graph.columns, field.field_type, slot) {
            if purpose != Purpose::Snapshot {
                self.shares.set_field(place.0, place.1, field_share(place.0, place.1, flat.as_slice()));
            }
            if purpose != Purpose::HashOnly {
                group.bytes.extend_from_slice(flat.as_slice());
                group.places.push((place.0 as u32, place.1));
            }
            return;
        }
        let value = graph.columns.value(field.field_type, slot);
        let start = group.bytes.len();
        let mut names = Names { hashes: &mut self.hashes, images: Vec::new() };
        group.bytes = to_bytes(&value, field, &mut names, std::mem::take(&mut group.bytes));
        let images = names.images;
        let bytes = &group.bytes[start..];
        if purpose != Purpose::Snapshot {
            self.shares.set_field(place.0, place.1, field_share(place.0, place.1, bytes));
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
            group.bytes.truncate(start);
        } else if let Some(hash) = long.filter(|_| by_content) {
            group.bytes.truncate(start);
            draft.head.long.push((place, hash));
        } else {
            group.places.push((place.0 as u32, place.1));
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
