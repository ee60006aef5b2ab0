//! Writes that wait for the turn of their node, close together: a column for each type, and what goes where.

use crate::changes::Revision;
use crate::column::Columns;
use crate::kind::for_each_kind;
use crate::{FieldType, FieldValue, Kind, Value};

/// A write for later.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Write {
    index: u16,
    field_type: FieldType,
    /// The field's place in the graph's column.
    slot: u32,
    /// The value's place in the column here.
    place: u32,
}

/// Writes in the order in which they were made.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    writes: Vec<Write>,
    values: Values,
}

impl Kept {
    pub(crate) fn len(&self) -> usize {
        self.writes.len()
    }

    pub(crate) fn clear(&mut self) {
        self.writes.clear();
        self.values.clear();
    }

    /// The last write of a field among those from a place on.
    #[inline]
    pub(crate) fn last(&self, first: usize, index: u16) -> Option<Write> {
        self.writes[first..].iter().rev().find(|write| write.index == index).copied()
    }

    #[inline]
    pub(crate) fn push<T: FieldValue>(&mut self, index: u16, slot: u32, value: T) {
        let column = T::kept_mut(&mut self.values);
        self.writes.push(Write { index, field_type: T::TYPE, slot, place: column.len() as u32 });
        column.push(value);
    }

    /// The value of a write, if it is of this type.
    pub(crate) fn get<T: FieldValue>(&self, write: Write) -> Option<&T> {
        if write.field_type == T::TYPE { T::kept(&self.values).get(write.place as usize) } else { None }
    }

    pub(crate) fn value(&self, write: Write) -> Value {
        self.values.value(write)
    }

    /// Makes one of the writes.
    #[inline]
    pub(crate) fn write(&self, at: usize, columns: &mut Columns, revision: Revision) {
        self.values.write(self.writes[at], columns, revision);
    }
}

macro_rules! values {
    ($(($one:ident, $many:ident, $type:ty, $one_column:ident, $many_column:ident, $name:literal, $default:expr))*) => {
        /// One list per field type.
        #[doc(hidden)]
        #[derive(Debug, Default)]
        pub struct Values { $(
            pub(crate) $one_column: Vec<$type>,
            pub(crate) $many_column: Vec<std::sync::Arc<[$type]>>,
        )* }

        impl Values {
            fn clear(&mut self) {
                $(self.$one_column.clear(); self.$many_column.clear();)*
            }

            fn value(&self, write: Write) -> Value {
                let place = write.place as usize;
                match (write.field_type.kind, write.field_type.multiple) { $(
                    (Kind::$one, false) => Value::$one(self.$one_column[place].clone()),
                    (Kind::$one, true) => Value::$many(self.$many_column[place].clone()),
                )* }
            }

            #[inline]
            fn write(&self, write: Write, columns: &mut Columns, revision: Revision) {
                let place = write.place as usize;
                match (write.field_type.kind, write.field_type.multiple) { $(
                    (Kind::$one, false) => {
                        columns.$one_column.write(write.slot, self.$one_column[place].clone(), false, revision);
                    }
                    (Kind::$one, true) => {
                        columns.$many_column.write(write.slot, self.$many_column[place].clone(), false, revision);
                    }
                )* }
            }
        }
    };
}
for_each_kind!(values);
