//! The declaration of one field: everything that code, scripts, files and the inspector know about it.

use std::sync::Arc;

use crate::convert::takes_range;
use crate::naming::canonical;
use crate::{EnumValue, FieldType, FieldValue, Kind, NodeId, Value};

/// What a write of a value does that the field already has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SetRule {
    /// Nothing: the write is dropped.
    #[default]
    Compare,
    /// What any write does; for events, where being written is the message.
    Pulse,
}

/// Declares a field; see [`crate::NodeType::field`].
#[derive(Clone, Debug)]
pub struct Field {
    /// The canonical name, `snake_case`.
    pub name: Arc<str>,
    /// What it holds.
    pub field_type: FieldType,
    /// What it holds in a new node.
    pub default: Value,
    /// What it is for, in a sentence.
    pub doc: Arc<str>,
    /// `m`, `rad`, `s`, ... or empty.
    pub unit: Arc<str>,
    /// Smallest and largest value of a number, or of each component. A write outside is an error; a route delivers the nearest value inside.
    pub range: Option<(f64, f64)>,
    /// Other canonical names.
    pub aliases: Vec<Arc<str>>,
    /// What writing an equal value does.
    pub on_set: SetRule,
    /// The names of an enum's values; empty for every other kind.
    pub choices: Arc<[Arc<str>]>,
    /// Written by the node itself: not to be set by authors. Saved all the same: it may be what the node remembers.
    pub output: bool,
    /// Stays in this process: replicas never learn of it, nor of routes to and from it.
    pub local: bool,
}

impl Field {
    /// A field with a default, which gives it its type.
    pub fn new(name: impl AsRef<str>, default: impl Into<Value>) -> Self {
        let default = default.into();
        Self {
            name: canonical(name.as_ref()).into(),
            field_type: default.field_type(),
            default,
            doc: "".into(),
            unit: "".into(),
            range: None,
            aliases: Vec::new(),
            on_set: SetRule::Compare,
            choices: Arc::from([]),
            output: false,
            local: false,
        }
    }

    /// True if every value of a type can be written as it is.
    #[inline]
    pub(crate) fn takes_all_of(&self, field_type: FieldType) -> bool {
        self.field_type == field_type && field_type.kind != Kind::Enum && self.range.is_none()
    }

    /// A field of a type that is known only at run time. For an enum use [`Field::choice`].
    pub fn of_type(name: impl AsRef<str>, field_type: FieldType) -> Self {
        Self::new(name, Value::empty(field_type))
    }

    /// A multiple field, empty: `Field::many::<f32>("range")`.
    pub fn many<T>(name: impl AsRef<str>) -> Self
    where
        Arc<[T]>: FieldValue,
    {
        Self::new(name, <Arc<[T]>>::empty())
    }

    /// An enum: one of the names. Registration refuses a default that is not among them.
    pub fn choice(name: impl AsRef<str>, choices: &[impl AsRef<str>], default: &str) -> Self {
        let default = choices.iter().position(|choice| choice.as_ref() == default).map_or(u16::MAX, |index| index as u16);
        let mut field = Self::new(name, EnumValue(default));
        field.choices = choices.iter().map(|choice| Arc::from(choice.as_ref())).collect();
        field
    }

    /// A reference to a node, empty.
    pub fn node(name: impl AsRef<str>) -> Self {
        Self::new(name, None::<NodeId>)
    }

    /// References to any number of nodes.
    pub fn nodes(name: impl AsRef<str>) -> Self {
        Self::of_type(name, FieldType::many(Kind::Node))
    }

    /// What it is for, in a sentence.
    pub fn doc(mut self, doc: impl Into<Arc<str>>) -> Self {
        self.doc = doc.into();
        self
    }

    /// The unit: `m`, `rad`, `s`, ...
    pub fn unit(mut self, unit: impl Into<Arc<str>>) -> Self {
        self.unit = unit.into();
        self
    }

    /// Smallest and largest value, both allowed.
    pub fn range(mut self, smallest: f64, largest: f64) -> Self {
        self.range = Some((smallest, largest));
        self
    }

    /// Another name, in any spelling.
    pub fn alias(mut self, alias: impl AsRef<str>) -> Self {
        self.aliases.push(canonical(alias.as_ref()).into());
        self
    }

    /// What writing an equal value does; by default nothing.
    pub fn on_set(mut self, rule: SetRule) -> Self {
        self.on_set = rule;
        self
    }

    /// Marks it as written by the node itself.
    pub fn output(mut self) -> Self {
        self.output = true;
        self
    }

    /// Keeps it from replicas.
    pub fn local(mut self) -> Self {
        self.local = true;
        self
    }

    /// True for the canonical name or an alias.
    pub fn is_named(&self, canonical_name: &str) -> bool {
        &*self.name == canonical_name || self.aliases.iter().any(|alias| &**alias == canonical_name)
    }

    /// The name of an enum's value.
    pub fn choice_name(&self, value: EnumValue) -> Option<&str> {
        self.choices.get(value.0 as usize).map(|name| &**name)
    }

    /// The value of an enum's name, in any spelling.
    pub fn choice_value(&self, name: &str) -> Option<EnumValue> {
        let wanted = canonical(name);
        let index = self.choices.iter().position(|choice| &**choice == name || canonical(choice) == wanted)?;
        Some(EnumValue(index as u16))
    }

    /// What is wrong with the declaration itself.
    pub(crate) fn fault(&self) -> Option<String> {
        let name = &self.name;
        if name.is_empty() {
            return Some("a field has no name".into());
        }
        if self.field_type.kind == Kind::Enum {
            if self.choices.is_empty() {
                return Some(format!("enum field `{name}` has no choices"));
            }
            if let Some(at) = (1..self.choices.len()).find(|at| self.choices[..*at].contains(&self.choices[*at])) {
                return Some(format!("enum field `{name}` has the choice `{}` twice", self.choices[at]));
            }
            let inside = |value: &EnumValue| (value.0 as usize) < self.choices.len();
            let valid = match &self.default {
                Value::Enum(value) => inside(value),
                Value::Enums(values) => values.iter().all(inside),
                _ => false,
            };
            if !valid {
                return Some(format!("the default of field `{name}` is none of its choices: {}", self.choices.join(", ")));
            }
        }
        if let Some((smallest, largest)) = self.range {
            if smallest.is_nan() || largest.is_nan() || smallest > largest {
                return Some(format!("field `{name}` has the empty range {smallest} to {largest}"));
            }
            if !takes_range(self.field_type.kind) {
                return Some(format!("field `{name}` has a range, which fields of type {} do not have", self.field_type));
            }
            if let Some(value) = self.default.outside(smallest, largest) {
                return Some(format!("the default {value} of field `{name}` is outside of its range {smallest} to {largest}"));
            }
        }
        None
    }
}
