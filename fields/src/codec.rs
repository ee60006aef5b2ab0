//! Values as plain data that serde can write and read: for saves as text, saves as bytes, and recordings.

use std::fmt;
use std::sync::Arc;

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use serde::de::{DeserializeOwned, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::kind::for_each_kind;
use crate::{Color, ColorA, EnumValue, Field, FieldType, Image, Kind, NodeId, Rotation, Time, Value};

/// How a file names what is not in the value itself: a node or an image. Text files write a name, others a number; zero and the empty
/// name are nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Ref {
    Number(u64),
    Name(String),
}

impl Serialize for Ref {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Ref::Number(number) => serializer.serialize_u64(*number),
            Ref::Name(name) => serializer.serialize_str(name),
        }
    }
}

impl<'de> Deserialize<'de> for Ref {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;
        impl Visitor<'_> for Name {
            type Value = String;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a name in quotes")
            }
            fn visit_str<E>(self, name: &str) -> Result<String, E> {
                Ok(name.into())
            }
        }
        if deserializer.is_human_readable() {
            deserializer.deserialize_str(Name).map(Ref::Name)
        } else {
            u64::deserialize(deserializer).map(Ref::Number)
        }
    }
}

/// Names nodes and images while values are written.
pub(crate) trait Name {
    fn node(&mut self, node: Option<NodeId>) -> Ref;
    fn image(&mut self, image: Option<&Arc<Image>>) -> Ref;
}

/// Finds nodes and images by their names while values are read. What cannot be found is the reader's to report.
pub(crate) trait Find {
    fn node(&mut self, name: &Ref) -> Option<NodeId>;
    fn image(&mut self, name: &Ref) -> Option<Arc<Image>>;
}

/// An element type of a field as plain data.
trait Plain: Sized {
    type Stored: Serialize + DeserializeOwned;
    fn store(&self, field: &Field, names: &mut dyn Name) -> Self::Stored;
    fn restore(stored: Self::Stored, field: &Field, find: &mut dyn Find) -> Result<Self, String>;
}

macro_rules! plain {
    ($($type:ty, $stored:ty: $value:ident => $store:expr, $back:ident => $restore:expr;)*) => { $(
        impl Plain for $type {
            type Stored = $stored;
            fn store(&self, _: &Field, _: &mut dyn Name) -> $stored { let $value = self; $store }
            fn restore($back: $stored, _: &Field, _: &mut dyn Find) -> Result<Self, String> { Ok($restore) }
        }
    )* };
}
plain! {
    bool, bool: value => *value, stored => stored;
    i32, i32: value => *value, stored => stored;
    i64, i64: value => *value, stored => stored;
    f32, f32: value => *value, stored => stored;
    f64, f64: value => *value, stored => stored;
    Arc<str>, String: value => value.to_string(), stored => stored.into();
    Vec2, [f32; 2]: value => value.to_array(), stored => stored.into();
    Vec3, [f32; 3]: value => value.to_array(), stored => stored.into();
    Vec4, [f32; 4]: value => value.to_array(), stored => stored.into();
    Quat, [f32; 4]: value => value.to_array(), stored => Quat::from_array(stored);
    Rotation, [f32; 4]: value => value.axis.extend(value.angle_rad).to_array(),
        stored => Rotation { axis: Vec3::new(stored[0], stored[1], stored[2]), angle_rad: stored[3] };
    Mat4, [f32; 16]: value => value.to_cols_array(), stored => Mat4::from_cols_array(&stored);
    Color, [f32; 3]: value => value.0.to_array(), stored => Color(stored.into());
    ColorA, [f32; 4]: value => value.0.to_array(), stored => ColorA(stored.into());
    Time, f64: value => value.0, stored => Time(stored);
}

impl Plain for Option<NodeId> {
    type Stored = Ref;
    fn store(&self, _: &Field, names: &mut dyn Name) -> Ref {
        names.node(*self)
    }
    fn restore(stored: Ref, _: &Field, find: &mut dyn Find) -> Result<Self, String> {
        Ok(find.node(&stored))
    }
}

impl Plain for Option<Arc<Image>> {
    type Stored = Ref;
    fn store(&self, _: &Field, names: &mut dyn Name) -> Ref {
        names.image(self.as_ref())
    }
    fn restore(stored: Ref, _: &Field, find: &mut dyn Find) -> Result<Self, String> {
        Ok(find.image(&stored))
    }
}

impl Plain for EnumValue {
    /// By name: the order of choices may change. By number where the field is not known, as in recordings.
    type Stored = String;
    fn store(&self, field: &Field, _: &mut dyn Name) -> String {
        field.choice_name(*self).map_or_else(|| format!("#{}", self.0), String::from)
    }
    fn restore(stored: String, field: &Field, _: &mut dyn Find) -> Result<Self, String> {
        if let Some(number) = stored.strip_prefix('#').and_then(|number| number.parse().ok())
            && field.choices.is_empty()
        {
            return Ok(EnumValue(number));
        }
        field.choice_value(&stored).ok_or_else(|| {
            let choices = field.choices.iter().map(|choice| &**choice);
            format!("takes one of {}; there is no `{stored}`{}", field.choices.join(", "), crate::naming::hint(&stored, choices))
        })
    }
}

fn ron_of(stored: &impl Serialize) -> String {
    ron::to_string(stored).unwrap_or_default()
}

fn ron_from<T: DeserializeOwned>(text: &str) -> Result<T, (usize, String)> {
    ron::from_str(text).map_err(|error| (error.span.start.line.saturating_sub(1), error.code.to_string()))
}

fn taken<T: DeserializeOwned>(bytes: &mut &[u8]) -> Result<T, String> {
    let (stored, rest) = postcard::take_from_bytes(bytes).map_err(|error| format!("cannot be read: {error}"))?;
    *bytes = rest;
    Ok(stored)
}

/// Reads a value of a type that was written as bytes, and nothing else.
pub(crate) fn from_bytes(mut bytes: &[u8], field_type: FieldType, field: &Field, find: &mut dyn Find) -> Result<Value, String> {
    let value = take_value(&mut bytes, field_type, field, find)?;
    if bytes.is_empty() { Ok(value) } else { Err(format!("is followed by {} bytes too many", bytes.len())) }
}

macro_rules! codec {
    ($(($one:ident, $many:ident, $type:ty, $one_column:ident, $many_column:ident, $name:literal, $default:expr))*) => {
        /// Each element of a value as RON; a single value has one.
        pub(crate) fn to_ron(value: &Value, field: &Field, names: &mut dyn Name) -> Vec<String> {
            match value { $(
                Value::$one(one) => vec![ron_of(&one.store(field, names))],
                Value::$many(many) => many.iter().map(|one| ron_of(&one.store(field, names))).collect(),
            )* }
        }

        /// Reads the value of a field; the error is the line within the text, from zero, and what is wrong.
        pub(crate) fn from_ron(text: &str, field: &Field, find: &mut dyn Find) -> Result<Value, (usize, String)> {
            let plain = |message| (0, message);
            match (field.field_type.kind, field.field_type.multiple) { $(
                (Kind::$one, false) => {
                    <$type>::restore(ron_from(text)?, field, find).map(Value::$one).map_err(plain)
                }
                (Kind::$one, true) => ron_from::<Vec<<$type as Plain>::Stored>>(text)?
                    .into_iter()
                    .map(|stored| <$type>::restore(stored, field, find).map_err(plain))
                    .collect::<Result<Arc<[$type]>, _>>()
                    .map(Value::$many),
            )* }
        }

        /// Appends a value as bytes, floats by their bits.
        pub(crate) fn to_bytes(value: &Value, field: &Field, names: &mut dyn Name, bytes: Vec<u8>) -> Vec<u8> {
            match value { $(
                Value::$one(one) => postcard::to_extend(&one.store(field, names), bytes),
                Value::$many(many) => {
                    let stored: Vec<_> = many.iter().map(|one| one.store(field, names)).collect();
                    postcard::to_extend(&stored, bytes)
                }
            )* }.unwrap_or_default()
        }

        /// Takes a value of a type off the front of bytes.
        pub(crate) fn take_value(
            bytes: &mut &[u8],
            field_type: FieldType,
            field: &Field,
            find: &mut dyn Find,
        ) -> Result<Value, String> {
            match (field_type.kind, field_type.multiple) { $(
                (Kind::$one, false) => <$type>::restore(taken(bytes)?, field, find).map(Value::$one),
                (Kind::$one, true) => taken::<Vec<<$type as Plain>::Stored>>(bytes)?
                    .into_iter()
                    .map(|stored| <$type>::restore(stored, field, find))
                    .collect::<Result<Arc<[$type]>, _>>()
                    .map(Value::$many),
            )* }
        }
    };
}
for_each_kind!(codec);

/// A field type as files write it: `vec3`, `vec3[]`.
pub(crate) fn field_type_named(name: &str) -> Option<FieldType> {
    let (name, multiple) = name.strip_suffix("[]").map_or((name, false), |name| (name, true));
    let kind = Kind::ALL.iter().copied().find(|kind| kind.name() == name)?;
    Some(FieldType { kind, multiple })
}

/// A field's declaration as plain data. Its default is written by the codec of values.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct PlainField {
    pub(crate) name: String,
    pub(crate) field_type: String,
    pub(crate) default: Vec<u8>,
    pub(crate) doc: String,
    pub(crate) unit: String,
    pub(crate) range: Option<(f64, f64)>,
    pub(crate) aliases: Vec<String>,
    pub(crate) pulse: bool,
    pub(crate) choices: Vec<String>,
    pub(crate) output: bool,
}

impl PlainField {
    pub(crate) fn of(field: &Field, names: &mut dyn Name) -> Self {
        Self { default: to_bytes(&field.default, field, names, Vec::new()), ..Self::without_default(field) }
    }

    pub(crate) fn without_default(field: &Field) -> Self {
        Self {
            name: field.name.to_string(),
            field_type: field.field_type.to_string(),
            default: Vec::new(),
            doc: field.doc.to_string(),
            unit: field.unit.to_string(),
            range: field.range,
            aliases: field.aliases.iter().map(|alias| alias.to_string()).collect(),
            pulse: field.on_set == crate::SetRule::Pulse,
            choices: field.choices.iter().map(|choice| choice.to_string()).collect(),
            output: field.output,
        }
    }

    /// The field, with an empty default; the error says why it cannot be.
    pub(crate) fn field_without_default(&self) -> Result<Field, String> {
        let field_type = field_type_named(&self.field_type).ok_or_else(|| {
            let kinds = crate::naming::hint(self.field_type.trim_end_matches("[]"), Kind::ALL.iter().map(|kind| kind.name()));
            format!("there is no field type `{}`{kinds}", self.field_type)
        })?;
        let mut field = Field::of_type(&self.name, field_type).doc(self.doc.as_str()).unit(self.unit.as_str());
        field.range = self.range;
        field.aliases = self.aliases.iter().map(|alias| crate::canonical(alias).into()).collect();
        field.choices = self.choices.iter().map(|choice| Arc::from(choice.as_str())).collect();
        field.output = self.output;
        if self.pulse {
            field.on_set = crate::SetRule::Pulse;
        }
        Ok(field)
    }

    /// The field with its default.
    pub(crate) fn field(&self, find: &mut dyn Find) -> Result<Field, String> {
        let mut field = self.field_without_default()?;
        field.default = from_bytes(&self.default, field.field_type, &field, find)?;
        Ok(field)
    }
}
