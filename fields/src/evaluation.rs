//! What a node type's evaluate sees: the node's own fields, the time, and nothing else, so that it can run anywhere.

use std::collections::HashMap;

use crate::changes::{ChangeLog, Revision};
use crate::column::{Columns, Stretches};
use crate::frame::Problem;
use crate::graph::Node;
use crate::kind::for_each_kind;
use crate::{Field, FieldId, FieldType, FieldValue, NodeId, SetRule, Value};

/// Where an evaluation reads and writes. All that it writes is one write: it has one revision.
pub(crate) enum Store<'a> {
    /// All columns.
    All { columns: &'a mut Columns, changes: &'a mut ChangeLog, revision: Revision },
    /// Stretches of them in which the node's fields lie; who gave them will note that it wrote.
    Apart { values: &'a mut Stretches<'a>, revision: Revision, wrote: bool },
}

impl Store<'_> {
    /// The value of a field of this type.
    #[inline]
    fn read<T: FieldValue>(&self, slot: u32) -> &T {
        match self {
            Store::All { columns, .. } => &T::column(columns).values[slot as usize],
            Store::Apart { values, .. } => T::stretch(values).value(slot),
        }
    }

    fn value(&self, field_type: FieldType, slot: u32) -> Value {
        match self {
            Store::All { columns, .. } => columns.value(field_type, slot),
            Store::Apart { values, .. } => values.value(field_type, slot),
        }
    }

    /// When a field was written.
    #[inline]
    fn revision(&self, field_type: FieldType, slot: u32) -> Revision {
        match self {
            Store::All { columns, .. } => columns.revisions(field_type)[slot as usize],
            Store::Apart { values, .. } => values.revision(field_type, slot),
        }
    }

    #[inline]
    fn write<T: FieldValue>(&mut self, (node, slot): (u32, u32), value: T, compare: bool) {
        match self {
            Store::All { columns, changes, revision } => {
                if T::column_mut(columns).write(slot, value, compare, *revision) {
                    changes.wrote(node, *revision);
                }
            }
            Store::Apart { values, revision, wrote } => {
                *wrote |= T::stretch_mut(values).write(slot, value, compare, *revision);
            }
        }
    }

    fn write_value(&mut self, place: (u32, u32), value: Value, compare: bool) {
        write_typed(self, place, value, compare);
    }
}

macro_rules! write_typed {
    ($(($one:ident, $many:ident, $type:ty, $one_column:ident, $many_column:ident, $name:literal, $default:expr))*) => {
        fn write_typed(store: &mut Store<'_>, place: (u32, u32), value: Value, compare: bool) {
            match value { $(
                Value::$one(one) => store.write(place, one, compare),
                Value::$many(many) => store.write(place, many, compare),
            )* }
        }
    };
}
for_each_kind!(write_typed);

/// One evaluation of one node. Fields are addressed by their place in the declaration.
pub struct Evaluation<'a> {
    pub(crate) id: NodeId,
    pub(crate) slot: u32,
    pub(crate) node: &'a Node,
    pub(crate) store: Store<'a>,
    pub(crate) silenced: &'a HashMap<FieldId, Revision>,
    pub(crate) problems: &'a mut Vec<Problem>,
    pub(crate) time_s: f64,
    /// Writes up to this revision were seen by the last evaluation.
    pub(crate) evaluated: Revision,
    pub(crate) again: bool,
}

impl Evaluation<'_> {
    /// The node.
    pub fn node(&self) -> NodeId {
        self.id
    }

    /// The time of the frame in seconds, the same for all nodes.
    pub fn time(&self) -> f64 {
        self.time_s
    }

    /// The value of a field of exactly this type, where it lies; for lists, which need not be counted as held then.
    #[inline]
    pub fn read<T: FieldValue>(&self, index: u16) -> Option<&T> {
        self.node.field(index).filter(|field| field.field_type == T::TYPE)?;
        Some(self.store.read(self.node.slots[index as usize]))
    }

    /// The value of a field, converted if it is asked for as another type that converts. What cannot be read is reported and reads as empty.
    pub fn get<T: FieldValue>(&mut self, index: u16) -> T {
        if let Some(field) = self.node.field(index) {
            let slot = self.node.slots[index as usize];
            if field.field_type == T::TYPE {
                return self.store.read::<T>(slot).clone();
            }
            let value = self.store.value(field.field_type, slot);
            if let Some(value) = value.convert(T::TYPE).as_ref().and_then(T::from_value) {
                return value;
            }
            let message = format!("`{}` is of type {}, which cannot be read as {}", field.name, field.field_type, T::TYPE);
            self.report_field(index, message);
        } else {
            self.report(format!("there is no field number {index} to be read as {}", T::TYPE));
        }
        T::empty()
    }

    /// Writes a field, moved into its range. What cannot be written is reported.
    pub fn set<T: FieldValue>(&mut self, index: u16, value: T) {
        let Some(field) = self.node.field(index) else {
            return self.report(format!("field number {index} cannot be written: there is none"));
        };
        let slot = self.node.slots[index as usize];
        let compare = field.on_set == SetRule::Compare;
        let place = (self.slot, slot);
        if field.field_type == T::TYPE && field.range.is_none() {
            return self.store.write(place, value, compare);
        }
        let Some(value) = value.into().convert(field.field_type) else {
            let expected = field.field_type;
            return self.report(format!("{} does not convert to {expected}, the type of `{}`", T::TYPE, field.name));
        };
        let value = field.range.map_or(value.clone(), |(smallest, largest)| value.clamped(smallest, largest));
        self.store.write_value(place, value, compare);
    }

    /// True if the field was written since the last evaluation, or since the node was created.
    pub fn changed(&self, index: u16) -> bool {
        let Some(field) = self.node.field(index) else { return false };
        let revision = self.store.revision(field.field_type, self.node.slots[index as usize]);
        revision > self.evaluated && self.silenced.get(&FieldId { node: self.id, index }) != Some(&revision)
    }

    /// True if the field was ever written, since the node was created.
    pub fn written(&self, index: u16) -> bool {
        let Some(field) = self.node.field(index) else { return false };
        self.store.revision(field.field_type, self.node.slots[index as usize]) > self.node.created
    }

    /// The declarations of the node's fields with their places.
    pub fn fields(&self) -> impl Iterator<Item = (u16, &Field)> {
        self.node.fields()
    }

    /// Fields have places below this; those of removed fields are empty.
    pub fn places(&self) -> u16 {
        self.node.slots.len() as u16
    }

    /// True if there is a field at a place.
    pub fn has(&self, index: u16) -> bool {
        self.node.field(index).is_some()
    }

    /// The place of a field by its name; for dynamic fields.
    pub fn index(&self, name: &str) -> Option<u16> {
        self.node.fields().find(|(_, field)| field.is_named(name)).map(|(index, _)| index)
    }

    /// Asks for an evaluation in the next frame, changed or not; for nodes in motion.
    pub fn again(&mut self) {
        self.again = true;
    }

    /// Tells the author what is wrong; see [`crate::FrameReport::problems`].
    pub fn report(&mut self, message: impl Into<String>) {
        self.problems.push(Problem { node: self.id, field: None, message: message.into() });
    }

    /// Tells the author what is wrong with a field.
    pub fn report_field(&mut self, index: u16, message: impl Into<String>) {
        let field = Some(FieldId { node: self.id, index });
        self.problems.push(Problem { node: self.id, field, message: message.into() });
    }
}
