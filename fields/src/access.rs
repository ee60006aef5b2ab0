//! Reading and writing values.

use std::sync::Arc;

use crate::graph::slot_of;
use crate::naming::hint;
use crate::record::Event;
use crate::schedule::SILENCED;
use crate::{EnumValue, Error, Field, FieldId, FieldType, FieldValue, Graph, Kind, NodeId, Revision, SetRule, Value};

impl Graph {
    /// Where a field's value is.
    #[inline]
    pub(crate) fn place(&self, field: FieldId) -> Result<(&Field, u32), Error> {
        let Some(node) = self.nodes.get(field.node) else { return Err(Error::DeadNode) };
        match node.field(field.index) {
            Some(declared) => Ok((declared, node.slots[field.index as usize])),
            None => Err(self.dead_field(field)),
        }
    }

    /// The value of a field, converted if it is asked for as another type that [`crate::converts`] allows. An enum reads as its name too.
    pub fn get<T: FieldValue>(&self, field: FieldId) -> Result<T, Error> {
        let (declared, slot) = self.place(field)?;
        if declared.field_type == T::TYPE {
            return Ok(T::column(&self.columns).values[slot as usize].clone());
        }
        let value = self.columns.value(declared.field_type, slot);
        let value = match (&value, T::TYPE) {
            (Value::Enum(choice), FieldType { kind: Kind::String, multiple: false }) => {
                declared.choice_name(*choice).map(Value::from)
            }
            _ => value.convert(T::TYPE),
        };
        value.as_ref().and_then(T::from_value).ok_or_else(|| self.wrong_type(field, declared.field_type, T::TYPE))
    }

    /// The value of a field by its name.
    pub fn get_named<T: FieldValue>(&self, id: NodeId, name: &str) -> Result<T, Error> {
        self.get(self.field(id, name)?)
    }

    /// The value of a field, of whatever type it is.
    pub fn value(&self, field: FieldId) -> Result<Value, Error> {
        let (declared, slot) = self.place(field)?;
        Ok(self.columns.value(declared.field_type, slot))
    }

    /// The value of a field by its name, of whatever type it is.
    pub fn value_named(&self, id: NodeId, name: &str) -> Result<Value, Error> {
        self.value(self.field(id, name)?)
    }

    /// Writes a field. A value of another type is converted where [`crate::converts`] allows it; an enum takes its names and numbers too.
    // Where the type is known to the compiler one arm is left, and the value stays in registers: floats that lie on the stack one by one
    // are read together only after a stall.
    #[inline(always)]
    pub fn set(&mut self, field: FieldId, value: impl Into<Value>) -> Result<(), Error> {
        macro_rules! one_by_one { ($($kind:ident)*) => {
            match value.into() {
                $(value @ Value::$kind(plain) => {
                    // It has nothing to drop, which the compiler does not see.
                    std::mem::forget(value);
                    self.set_plain(field, plain)
                })*
                value => self.set_value(field, value),
            }
        } }
        one_by_one! { Bool I32 I64 F32 F64 Vec2 Vec3 Vec4 Quat Rotation Mat4 Color ColorA Time Node }
    }

    /// Writes a field by its name.
    pub fn set_named(&mut self, id: NodeId, name: &str, value: impl Into<Value>) -> Result<(), Error> {
        self.set_value(self.field(id, name)?, value.into())
    }

    /// Writes a field; see [`Graph::set`].
    pub fn set_value(&mut self, field: FieldId, value: Value) -> Result<(), Error> {
        if self.write(field, &value)? {
            self.wrote(field);
        }
        Ok(())
    }

    /// The consequences of a write.
    #[inline(always)]
    fn wrote(&mut self, field: FieldId) {
        self.schedule.mark(slot_of(field.node));
        if self.journal.is_some() || self.explain.is_some() {
            self.is_watched(field);
        }
    }

    #[cold]
    fn is_watched(&mut self, field: FieldId) {
        self.note_write(field, false);
        self.explain_write(field);
    }

    /// Writes as nearly all writes are: to a declared field, whose type the value has, with nothing to be checked. What is not like that
    /// goes the long way.
    #[inline(always)]
    fn set_plain<T: FieldValue>(&mut self, field: FieldId, value: T) -> Result<(), Error> {
        let declared = self.nodes.get(field.node).and_then(|node| {
            let declared = node.node_type.fields.get(field.index as usize).filter(|declared| declared.takes_all_of(T::TYPE))?;
            Some((declared.on_set == SetRule::Compare, *node.slots.get(field.index as usize)?))
        });
        let Some((compare, slot)) = declared else { return self.set_value(field, value.into()) };
        let revision = self.changes.last() + 1;
        if T::column_mut(&mut self.columns).write(slot, value, compare, revision) {
            self.changes.next();
            self.changes.wrote(slot_of(field.node), revision);
            self.wrote(field);
        }
        Ok(())
    }

    /// Writes a field without consequences: no evaluation, no callback, no route. Readers of revisions see it.
    pub fn set_silent(&mut self, field: FieldId, value: impl Into<Value>) -> Result<(), Error> {
        if self.write(field, &value.into())? {
            self.schedule.flags[slot_of(field.node) as usize] |= SILENCED;
            self.silenced.insert(field, self.changes.last());
            self.note_write(field, true);
            self.explain_write(field);
        }
        Ok(())
    }

    /// Has the consequences of a write, without one.
    pub fn touch(&mut self, field: FieldId) -> Result<(), Error> {
        let (declared, slot) = self.place(field)?;
        let field_type = declared.field_type;
        let revision = self.changes.next();
        self.columns.revisions_mut(field_type)[slot as usize] = revision;
        self.changes.wrote(slot_of(field.node), revision);
        self.schedule.mark(slot_of(field.node));
        self.note(|| Event::Touched(field));
        self.explain_write(field);
        Ok(())
    }

    /// The revision of the field's last write, or of its creation; 0 if it does not exist.
    pub fn field_revision(&self, field: FieldId) -> Revision {
        self.place(field).map_or(0, |(declared, slot)| self.columns.revisions(declared.field_type)[slot as usize])
    }

    /// Writes without asking for a turn; says whether anything was written.
    fn write(&mut self, field: FieldId, value: &Value) -> Result<bool, Error> {
        let (declared, slot) = self.place(field)?;
        let compare = declared.on_set == SetRule::Compare;
        let converted = if declared.takes_all_of(value.field_type()) { None } else { self.fitting(field, declared, value)? };
        let revision = self.changes.last() + 1;
        let written = self.columns.write(slot, converted.as_ref().unwrap_or(value), compare, revision);
        if written {
            self.changes.next();
            self.changes.wrote(slot_of(field.node), revision);
        }
        Ok(written)
    }

    /// Checks a value for a field; what it becomes on the way, or None if it fits as it is.
    fn fitting(&self, field: FieldId, declared: &Field, value: &Value) -> Result<Option<Value>, Error> {
        let found = value.field_type();
        let expected = declared.field_type;
        let converted = if expected.kind == Kind::Enum {
            self.fitting_choice(field, declared, value)?
        } else if found == expected {
            None
        } else {
            Some(value.convert(expected).ok_or_else(|| self.wrong_type(field, expected, found))?)
        };
        if let Some((smallest, largest)) = declared.range
            && let Some(found) = converted.as_ref().unwrap_or(value).outside(smallest, largest)
        {
            return Err(Error::OutOfRange { field: self.describe_field(field), smallest, largest, found });
        }
        Ok(converted)
    }

    /// An enum field takes names, numbers and enum values, none outside of its choices.
    fn fitting_choice(&self, field: FieldId, declared: &Field, value: &Value) -> Result<Option<Value>, Error> {
        let unknown = |found: String| {
            let hint = hint(&found, declared.choices.iter().map(|choice| &**choice));
            Error::UnknownChoice { field: self.describe_field(field), choices: declared.choices.join(", "), found, hint }
        };
        let one = |value: &Value| -> Result<EnumValue, Error> {
            let number = match value {
                Value::Enum(choice) => choice.0 as i64,
                Value::String(name) => return declared.choice_value(name).ok_or_else(|| unknown(name.to_string())),
                other => match other.convert(FieldType::one(Kind::I64)) {
                    Some(Value::I64(number)) => number,
                    _ => return Err(self.wrong_type(field, declared.field_type, value.field_type())),
                },
            };
            let choice = u16::try_from(number).ok().filter(|choice| (*choice as usize) < declared.choices.len());
            choice.map(EnumValue).ok_or_else(|| unknown(number.to_string()))
        };
        if !declared.field_type.multiple {
            return one(value).map(|choice| Some(Value::Enum(choice)));
        }
        if !value.field_type().multiple {
            return Err(self.wrong_type(field, declared.field_type, value.field_type()));
        }
        let choices: Result<Arc<[EnumValue]>, Error> =
            (0..value.len()).filter_map(|index| value.element(index)).map(|element| one(&element)).collect();
        Ok(Some(Value::Enums(choices?)))
    }

    /// The value of an enum's name in this field; the error lists the valid names.
    pub fn choice(&self, field: FieldId, name: &str) -> Result<EnumValue, Error> {
        let declared = self.declaration(field)?;
        match self.fitting_choice(field, declared, &Value::from(name))? {
            Some(Value::Enum(choice)) => Ok(choice),
            _ => Err(self.wrong_type(field, declared.field_type, FieldType::one(Kind::Enum))),
        }
    }

    pub(crate) fn wrong_type(&self, field: FieldId, expected: FieldType, found: FieldType) -> Error {
        Error::WrongType { field: self.describe_field(field), expected, found }
    }
}
