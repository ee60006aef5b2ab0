//! Storage: one growable vector per field type, so that a route copies between two places of one array.

use crate::kind::for_each_kind;
use crate::program::Hop;
use crate::{FieldType, FieldValue, Kind, Revision, Value};

/// No node owns the slot.
pub(crate) const FREE: u32 = u32::MAX;

/// All values of one field type. Slots of deleted fields are used again.
#[doc(hidden)]
#[derive(Debug)]
pub struct Column<T> {
    pub(crate) values: Vec<T>,
    /// The revision of the last write of each slot.
    pub(crate) revisions: Vec<Revision>,
    /// The node's slot and the field's index, or `FREE`.
    pub(crate) owners: Vec<(u32, u16)>,
    free: Vec<u32>,
}

impl<T> Default for Column<T> {
    fn default() -> Self {
        Self { values: Vec::new(), revisions: Vec::new(), owners: Vec::new(), free: Vec::new() }
    }
}

impl<T: FieldValue> Column<T> {
    fn insert(&mut self, value: T, owner: (u32, u16), revision: Revision) -> u32 {
        if let Some(slot) = self.free.pop() {
            let at = slot as usize;
            (self.values[at], self.revisions[at], self.owners[at]) = (value, revision, owner);
            return slot;
        }
        self.values.push(value);
        self.revisions.push(revision);
        self.owners.push(owner);
        (self.values.len() - 1) as u32
    }

    fn remove(&mut self, slot: u32) {
        self.values[slot as usize] = T::empty();
        self.owners[slot as usize] = (FREE, 0);
        self.free.push(slot);
    }

    /// All of it.
    #[inline]
    pub(crate) fn whole(&mut self) -> Stretch<'_, T> {
        Stretch { first: 0, values: &mut self.values, revisions: &mut self.revisions }
    }

    /// See [`Stretch::write`].
    #[inline(always)]
    pub(crate) fn write(&mut self, slot: u32, value: T, compare: bool, revision: Revision) -> bool {
        self.whole().write(slot, value, compare, revision)
    }
}

/// A part of a column that somebody has for himself. Slots are those of the column.
#[doc(hidden)]
#[derive(Debug)]
pub struct Stretch<'a, T> {
    first: usize,
    values: &'a mut [T],
    revisions: &'a mut [Revision],
}

impl<T> Default for Stretch<'_, T> {
    fn default() -> Self {
        Self { first: 0, values: &mut [], revisions: &mut [] }
    }
}

impl<'a, T: FieldValue> Stretch<'a, T> {
    #[inline]
    pub(crate) fn value(&self, slot: u32) -> &T {
        &self.values[slot as usize - self.first]
    }

    #[inline]
    fn revision(&self, slot: u32) -> Revision {
        self.revisions[slot as usize - self.first]
    }

    /// Writes unless `compare` and nothing would change; says whether it wrote.
    // Inlined, so that a value comes in registers: floats that lie on the stack one by one are read together only after a stall.
    #[inline(always)]
    pub(crate) fn write(&mut self, slot: u32, value: T, compare: bool, revision: Revision) -> bool {
        let at = slot as usize - self.first;
        let place = &mut self.values[at];
        if compare && place.same(&value) {
            return false;
        }
        *place = value;
        self.revisions[at] = revision;
        true
    }

    /// Copies from slot to slot what was written after a revision, unless the target was written later, or `compare` and nothing would change.
    #[inline]
    fn copy(&mut self, hop: &Hop, before: Revision, revision: Revision) -> bool {
        let (source, target) = (hop.source as usize - self.first, hop.target as usize - self.first);
        let written = self.revisions[source];
        if written <= before || self.revisions[target] >= written {
            return false;
        }
        let value = self.values[source].clone();
        self.write(hop.target, value, hop.compare, revision)
    }

    fn reborrow(&mut self) -> Stretch<'_, T> {
        Stretch { first: self.first, values: self.values, revisions: self.revisions }
    }

    /// Gives away what lies from a slot on.
    fn split_off(&mut self, slot: u32) -> Stretch<'a, T> {
        let length = (slot as usize).saturating_sub(self.first).min(self.values.len());
        let (values, rest) = std::mem::take(&mut self.values).split_at_mut(length);
        let (revisions, rest_revisions) = std::mem::take(&mut self.revisions).split_at_mut(length);
        (self.values, self.revisions) = (values, revisions);
        Stretch { first: self.first + length, values: rest, revisions: rest_revisions }
    }
}

macro_rules! columns {
    ($(($one:ident, $many:ident, $type:ty, $one_column:ident, $many_column:ident, $name:literal, $default:expr))*) => {
        /// One column per field type.
        #[doc(hidden)]
        #[derive(Debug, Default)]
        pub struct Columns { $(
            pub(crate) $one_column: Column<$type>,
            pub(crate) $many_column: Column<std::sync::Arc<[$type]>>,
        )* }

        /// A stretch of each column.
        #[doc(hidden)]
        #[derive(Debug, Default)]
        pub struct Stretches<'a> { $(
            pub(crate) $one_column: Stretch<'a, $type>,
            pub(crate) $many_column: Stretch<'a, std::sync::Arc<[$type]>>,
        )* }

        impl<'a> Stretches<'a> {
            /// Gives away what lies from these places on.
            pub(crate) fn split_off(&mut self, at: &Places) -> Stretches<'a> {
                Stretches { $(
                    $one_column: self.$one_column.split_off(at.$one_column),
                    $many_column: self.$many_column.split_off(at.$many_column),
                )* }
            }

            /// The same for a while.
            pub(crate) fn reborrow(&mut self) -> Stretches<'_> {
                Stretches { $($one_column: self.$one_column.reborrow(), $many_column: self.$many_column.reborrow(),)* }
            }

            /// Copies a value unless it is old or nothing would change; says whether it did.
            #[inline]
            pub(crate) fn copy(&mut self, hop: &Hop, before: Revision, revision: Revision) -> bool {
                match (hop.field_type.kind, hop.field_type.multiple) { $(
                    (Kind::$one, false) => self.$one_column.copy(hop, before, revision),
                    (Kind::$one, true) => self.$many_column.copy(hop, before, revision),
                )* }
            }

            pub(crate) fn value(&self, field_type: FieldType, slot: u32) -> Value {
                match (field_type.kind, field_type.multiple) { $(
                    (Kind::$one, false) => Value::$one(self.$one_column.value(slot).clone()),
                    (Kind::$one, true) => Value::$many(self.$many_column.value(slot).clone()),
                )* }
            }

            pub(crate) fn revision(&self, field_type: FieldType, slot: u32) -> Revision {
                match (field_type.kind, field_type.multiple) { $(
                    (Kind::$one, false) => self.$one_column.revision(slot),
                    (Kind::$one, true) => self.$many_column.revision(slot),
                )* }
            }
        }

        /// A place in each column.
        #[derive(Clone, Debug)]
        pub(crate) struct Places { $($one_column: u32, $many_column: u32,)* }

        impl Places {
            pub(crate) fn filled(place: u32) -> Self {
                Self { $($one_column: place, $many_column: place,)* }
            }

            pub(crate) fn of_mut(&mut self, field_type: FieldType) -> &mut u32 {
                match (field_type.kind, field_type.multiple) { $(
                    (Kind::$one, false) => &mut self.$one_column,
                    (Kind::$one, true) => &mut self.$many_column,
                )* }
            }

            /// What a function makes of both places in each column.
            pub(crate) fn each(self, other: &Self, one: impl Fn(u32, u32) -> u32) -> Self {
                Self { $(
                    $one_column: one(self.$one_column, other.$one_column),
                    $many_column: one(self.$many_column, other.$many_column),
                )* }
            }

            /// True if none of these places is behind the other's.
            pub(crate) fn all_up_to(&self, other: &Self) -> bool {
                true $(&& self.$one_column <= other.$one_column && self.$many_column <= other.$many_column)*
            }
        }

        impl Columns {
            /// All of each column.
            pub(crate) fn stretches(&mut self) -> Stretches<'_> {
                Stretches { $($one_column: self.$one_column.whole(), $many_column: self.$many_column.whole(),)* }
            }

            /// Takes a slot for a value.
            pub(crate) fn insert(&mut self, value: Value, owner: (u32, u16), revision: Revision) -> u32 {
                match value { $(
                    Value::$one(one) => self.$one_column.insert(one, owner, revision),
                    Value::$many(many) => self.$many_column.insert(many, owner, revision),
                )* }
            }

            /// Gives a slot back.
            pub(crate) fn remove(&mut self, field_type: FieldType, slot: u32) {
                match (field_type.kind, field_type.multiple) { $(
                    (Kind::$one, false) => self.$one_column.remove(slot),
                    (Kind::$one, true) => self.$many_column.remove(slot),
                )* }
            }

            pub(crate) fn value(&self, field_type: FieldType, slot: u32) -> Value {
                match (field_type.kind, field_type.multiple) { $(
                    (Kind::$one, false) => Value::$one(self.$one_column.values[slot as usize].clone()),
                    (Kind::$one, true) => Value::$many(self.$many_column.values[slot as usize].clone()),
                )* }
            }

            /// Writes a value into a slot of the value's own type. A value has the size of a matrix: it is not moved for that.
            pub(crate) fn write(&mut self, slot: u32, value: &Value, compare: bool, revision: Revision) -> bool {
                match value { $(
                    Value::$one(one) => self.$one_column.write(slot, one.clone(), compare, revision),
                    Value::$many(many) => self.$many_column.write(slot, many.clone(), compare, revision),
                )* }
            }

            /// The revisions of all slots of a type.
            #[inline]
            pub(crate) fn revisions(&self, field_type: FieldType) -> &[Revision] {
                match (field_type.kind, field_type.multiple) { $(
                    (Kind::$one, false) => &self.$one_column.revisions,
                    (Kind::$one, true) => &self.$many_column.revisions,
                )* }
            }

            pub(crate) fn revisions_mut(&mut self, field_type: FieldType) -> &mut [Revision] {
                match (field_type.kind, field_type.multiple) { $(
                    (Kind::$one, false) => &mut self.$one_column.revisions,
                    (Kind::$one, true) => &mut self.$many_column.revisions,
                )* }
            }

            pub(crate) fn owners(&self, field_type: FieldType) -> &[(u32, u16)] {
                match (field_type.kind, field_type.multiple) { $(
                    (Kind::$one, false) => &self.$one_column.owners,
                    (Kind::$one, true) => &self.$many_column.owners,
                )* }
            }
        }
    };
}
for_each_kind!(columns);
