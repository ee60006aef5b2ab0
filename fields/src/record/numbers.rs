//! Numbers for what a file cannot point to: nodes, routes, observers, types, images, long values. Both sides keep the same numbers.

use std::collections::HashMap;
use std::sync::{Arc, Weak};

use slotmap::KeyData;
use xxhash_rust::xxh3::{xxh3_64, xxh3_128};

use super::blocks::{Place, TypeRecord, ValueRecord};
use crate::codec::{Find, Name, PlainField, Ref, from_bytes, to_bytes};
use crate::{Evaluator, Field, FieldId, FieldType, Image, Mode, NodeId, NodeType, ObserverId, RouteId, Value};

/// Values of more bytes are kept once for the whole file.
const LONG: usize = 1024;

/// Numbers both ways.
pub(super) struct Pairs<K> {
    pub(super) numbers: HashMap<K, u64>,
    pub(super) keys: HashMap<u64, K>,
    next: u64,
}

impl<K: Copy + Eq + std::hash::Hash> Pairs<K> {
    fn new() -> Self {
        Self { numbers: HashMap::new(), keys: HashMap::new(), next: 1 }
    }

    /// The key's number; a new one if it has none.
    pub(super) fn number(&mut self, key: K) -> u64 {
        if let Some(number) = self.numbers.get(&key) {
            return *number;
        }
        let number = self.next;
        self.bind(number, key);
        number
    }

    pub(super) fn bind(&mut self, number: u64, key: K) {
        self.next = self.next.max(number.saturating_add(1));
        self.numbers.insert(key, number);
        self.keys.insert(number, key);
    }

    pub(super) fn forget(&mut self, key: K) {
        if let Some(number) = self.numbers.remove(&key) {
            self.keys.remove(&number);
        }
    }
}

/// What was numbered and must be written before what refers to it.
pub(super) enum Definition {
    Type(TypeRecord),
    Image(Arc<Image>),
    Blob(Vec<u8>),
}

/// All numbers of one recording.
pub(super) struct Numbers {
    pub(super) nodes: Pairs<NodeId>,
    pub(super) routes: Pairs<RouteId>,
    pub(super) observers: Pairs<ObserverId>,
    types: HashMap<*const NodeType, (Arc<NodeType>, u32)>,
    /// A weak reference keeps the address from being used again.
    images: HashMap<*const Image, (Weak<Image>, u64)>,
    blobs: HashMap<u128, u32>,
    contents: HashMap<*const Image, (Weak<Image>, u64)>,
    /// While replaying: images and long values by number.
    pub(super) known_images: Vec<Arc<Image>>,
    pub(super) known_blobs: Vec<Vec<u8>>,
    pub(super) definitions: Vec<Definition>,
    /// Stands for fields that may not exist any more: enums go by number.
    any: Arc<Field>,
}

impl Numbers {
    pub(super) fn new() -> Self {
        Self {
            nodes: Pairs::new(),
            routes: Pairs::new(),
            observers: Pairs::new(),
            types: HashMap::new(),
            images: HashMap::new(),
            blobs: HashMap::new(),
            contents: HashMap::new(),
            known_images: Vec::new(),
            known_blobs: Vec::new(),
            definitions: Vec::new(),
            any: Arc::new(Field::new("any", false)),
        }
    }

    pub(super) fn place(&mut self, field: FieldId) -> Place {
        (self.nodes.number(field.node), field.index)
    }

    pub(super) fn node_type(&mut self, node_type: &Arc<NodeType>) -> u32 {
        if let Some((_, number)) = self.types.get(&Arc::as_ptr(node_type)) {
            return *number;
        }
        let number = self.types.len() as u32;
        self.types.insert(Arc::as_ptr(node_type), (node_type.clone(), number));
        let record = self.type_record(node_type);
        self.definitions.push(Definition::Type(record));
        number
    }

    pub(super) fn type_record(&mut self, node_type: &NodeType) -> TypeRecord {
        let evaluator = match node_type.evaluator {
            Evaluator::None => 0,
            Evaluator::Native(_) => 1,
            Evaluator::Host => 2,
        };
        let fields = node_type.fields.iter().map(|field| PlainField::of(field, self)).collect();
        TypeRecord { name: node_type.name.to_string(), fields, evaluator, mode: mode_number(node_type.mode) }
    }

    /// The bytes of a value.
    pub(super) fn bytes(&mut self, value: &Value) -> Vec<u8> {
        let any = self.any.clone();
        to_bytes(value, &any, self, Vec::new())
    }

    /// The bytes of a value in which images go by what they show, so that both sides agree on images that evaluation made.
    pub(super) fn bytes_to_compare(&mut self, value: &Value) -> Vec<u8> {
        let any = self.any.clone();
        to_bytes(value, &any, &mut ByContent(self), Vec::new())
    }

    pub(super) fn record(&mut self, value: &Value) -> ValueRecord {
        let bytes = self.bytes(value);
        if bytes.len() <= LONG {
            return ValueRecord::Here(bytes);
        }
        let next = self.blobs.len() as u32;
        let number = *self.blobs.entry(xxh3_128(&bytes)).or_insert(next);
        if number == next {
            self.definitions.push(Definition::Blob(bytes));
        }
        ValueRecord::Blob(number)
    }

    pub(super) fn value(&mut self, record: &ValueRecord, field_type: FieldType) -> Result<Value, String> {
        let any = self.any.clone();
        match record {
            ValueRecord::Here(bytes) => from_bytes(bytes, field_type, &any, self),
            ValueRecord::Blob(number) => {
                let blobs = std::mem::take(&mut self.known_blobs);
                let value = match blobs.get(*number as usize) {
                    Some(bytes) => from_bytes(bytes, field_type, &any, self),
                    None => Err(format!("the file does not hold long value {number}")),
                };
                self.known_blobs = blobs;
                value
            }
        }
    }

    /// A value from the bytes that were made to compare; for messages.
    pub(super) fn value_seen(&mut self, bytes: &[u8], field_type: FieldType) -> Option<Value> {
        let any = self.any.clone();
        from_bytes(bytes, field_type, &any, self).ok()
    }

    /// Makes an image known by a number: the next one.
    pub(super) fn learn_image(&mut self, image: Arc<Image>) {
        let number = self.known_images.len() as u64 + 1;
        self.images.insert(Arc::as_ptr(&image), (Arc::downgrade(&image), number));
        self.known_images.push(image);
    }
}

pub(super) fn mode_number(mode: Mode) -> u8 {
    match mode {
        Mode::OnChange => 0,
        Mode::Always => 1,
        Mode::Pull => 2,
    }
}

pub(super) fn mode_of(number: u8) -> Mode {
    match number {
        1 => Mode::Always,
        2 => Mode::Pull,
        _ => Mode::OnChange,
    }
}

impl Name for Numbers {
    fn node(&mut self, node: Option<NodeId>) -> Ref {
        Ref::Number(node.map_or(0, |node| self.nodes.number(node)))
    }

    fn image(&mut self, image: Option<&Arc<Image>>) -> Ref {
        let Some(image) = image else { return Ref::Number(0) };
        let next = self.images.len() as u64 + 1;
        let (_, number) = self.images.entry(Arc::as_ptr(image)).or_insert_with(|| (Arc::downgrade(image), next));
        if *number == next {
            self.definitions.push(Definition::Image(image.clone()));
        }
        Ref::Number(*number)
    }
}

impl Find for Numbers {
    /// A node that does not exist any more, and one that never did in this file, is one that no graph has.
    fn node(&mut self, name: &Ref) -> Option<NodeId> {
        let Ref::Number(number @ 1..) = name else { return None };
        if let Some(node) = self.nodes.keys.get(number) {
            return Some(*node);
        }
        let (version, place) = ((number >> 16) << 1 | 1, u32::MAX as u64 - 1 - (number & 0xFFFF));
        let dead = NodeId::from(KeyData::from_ffi(version << 32 | place));
        self.nodes.bind(*number, dead);
        Some(dead)
    }

    fn image(&mut self, name: &Ref) -> Option<Arc<Image>> {
        let Ref::Number(number) = name else { return None };
        self.known_images.get((*number as usize).checked_sub(1)?).cloned()
    }
}

/// Names images by a hash of what they show.
struct ByContent<'a>(&'a mut Numbers);

impl Name for ByContent<'_> {
    fn node(&mut self, node: Option<NodeId>) -> Ref {
        Name::node(self.0, node)
    }

    fn image(&mut self, image: Option<&Arc<Image>>) -> Ref {
        let Some(image) = image else { return Ref::Number(0) };
        let content = || xxh3_64(&image.rgba) ^ ((image.width as u64) << 32 | image.height as u64);
        Ref::Number(self.0.contents.entry(Arc::as_ptr(image)).or_insert_with(|| (Arc::downgrade(image), content())).1)
    }
}
