//! Values: the statically typed ones that code reads and writes, and the dynamic `Value` that files, scripts and the wire use.

use std::sync::Arc;

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};

use crate::column::{Column, Columns, Stretch, Stretches};
use crate::kind::for_each_kind;
use crate::{Color, ColorA, EnumValue, FieldType, Image, Kind, NodeId, Rotation, Time};

/// A type that a field can hold. Implemented for the element type of every [`Kind`] and for `Arc<[T]>` of each; sealed.
pub trait FieldValue: Clone + Same + Send + Sync + Into<Value> + 'static {
    /// The field type that holds such values.
    const TYPE: FieldType;
    /// What a field holds that was declared without a default.
    fn empty() -> Self;
    /// The value if it is exactly of this type.
    fn from_value(value: &Value) -> Option<Self>;
    #[doc(hidden)]
    fn column(columns: &Columns) -> &Column<Self>;
    #[doc(hidden)]
    fn column_mut(columns: &mut Columns) -> &mut Column<Self>;
    #[doc(hidden)]
    fn stretch<'a, 'b>(stretches: &'b Stretches<'a>) -> &'b Stretch<'a, Self>;
    #[doc(hidden)]
    fn stretch_mut<'a, 'b>(stretches: &'b mut Stretches<'a>) -> &'b mut Stretch<'a, Self>;
}

/// Equality of bits: a NaN is the same as itself and -0 differs from 0, so that "not changed" never loses anything.
pub trait Same {
    /// True if no reader could tell the two apart.
    fn same(&self, other: &Self) -> bool;
}

macro_rules! same_by_eq { ($($type:ty)*) => { $(impl Same for $type {
    #[inline]
    fn same(&self, other: &Self) -> bool { self == other }
})* } }
same_by_eq! { bool i32 i64 Arc<str> Option<NodeId> EnumValue }

macro_rules! same_by_bits { ($($type:ty, $value:ident => $floats:expr;)*) => { $(impl Same for $type {
    #[inline]
    fn same(&self, other: &Self) -> bool {
        let bits = |$value: &Self| $floats.map(f32::to_bits);
        bits(self) == bits(other)
    }
})* } }
same_by_bits! {
    f32, value => [*value];
    Vec2, value => value.to_array();
    Vec3, value => value.to_array();
    Vec4, value => value.to_array();
    Quat, value => value.to_array();
    Mat4, value => value.to_cols_array();
    Color, value => value.0.to_array();
    ColorA, value => value.0.to_array();
    Rotation, value => value.axis.extend(value.angle_rad).to_array();
}

impl Same for f64 {
    fn same(&self, other: &Self) -> bool {
        self.to_bits() == other.to_bits()
    }
}

impl Same for Time {
    fn same(&self, other: &Self) -> bool {
        self.0.same(&other.0)
    }
}

impl Same for Option<Arc<Image>> {
    fn same(&self, other: &Self) -> bool {
        match (self, other) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        }
    }
}

impl<T: Same> Same for Arc<[T]> {
    fn same(&self, other: &Self) -> bool {
        Arc::ptr_eq(self, other) || self.len() == other.len() && self.iter().zip(other.iter()).all(|(a, b)| a.same(b))
    }
}

macro_rules! values {
    ($(($one:ident, $many:ident, $type:ty, $one_column:ident, $many_column:ident, $name:literal, $default:expr))*) => {
        /// A value of any field type.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Value { $(
            #[doc = concat!("One `", $name, "`.")] $one($type),
            #[doc = concat!("Any number of `", $name, "`.")] $many(Arc<[$type]>),
        )* }

        impl Value {
            /// The type of the field that holds this value without conversion.
            #[inline]
            pub const fn field_type(&self) -> FieldType {
                match self { $(
                    Value::$one(_) => FieldType::one(Kind::$one),
                    Value::$many(_) => FieldType::many(Kind::$one),
                )* }
            }

            /// What a field of the type holds that was declared without a default.
            pub fn empty(field_type: FieldType) -> Value {
                match (field_type.kind, field_type.multiple) { $(
                    (Kind::$one, false) => Value::$one($default),
                    (Kind::$one, true) => Value::$many(Arc::from([])),
                )* }
            }

            /// The number of elements; one for a single value.
            pub fn len(&self) -> usize {
                match self { $(Value::$one(_) => 1, Value::$many(many) => many.len(),)* }
            }

            /// True for a multiple value without elements.
            pub fn is_empty(&self) -> bool {
                self.len() == 0
            }

            /// One element as a single value.
            pub fn element(&self, index: usize) -> Option<Value> {
                match self { $(
                    Value::$one(one) => (index == 0).then(|| Value::$one(one.clone())),
                    Value::$many(many) => many.get(index).map(|one| Value::$one(one.clone())),
                )* }
            }

            /// A multiple value of the kind from single values of that same kind; None if one of them is of another kind.
            pub fn collect(kind: Kind, elements: impl Iterator<Item = Value>) -> Option<Value> {
                match kind { $(Kind::$one => elements
                    .map(|element| match element { Value::$one(one) => Some(one), _ => None })
                    .collect::<Option<Arc<[_]>>>()
                    .map(Value::$many),)* }
            }
        }

        impl Same for Value {
            fn same(&self, other: &Self) -> bool {
                match (self, other) {
                    $((Value::$one(a), Value::$one(b)) => a.same(b), (Value::$many(a), Value::$many(b)) => a.same(b),)*
                    _ => false,
                }
            }
        }

        $(
            impl From<$type> for Value {
                #[inline]
                fn from(value: $type) -> Value { Value::$one(value) }
            }
            impl From<Arc<[$type]>> for Value {
                fn from(value: Arc<[$type]>) -> Value { Value::$many(value) }
            }
            impl From<Vec<$type>> for Value {
                fn from(value: Vec<$type>) -> Value { Value::$many(value.into()) }
            }
            impl From<&[$type]> for Value {
                fn from(value: &[$type]) -> Value { Value::$many(value.into()) }
            }
            impl<const N: usize> From<[$type; N]> for Value {
                fn from(value: [$type; N]) -> Value { Value::$many(Arc::from(value)) }
            }
            impl FieldValue for $type {
                const TYPE: FieldType = FieldType::one(Kind::$one);
                fn empty() -> Self { $default }
                fn from_value(value: &Value) -> Option<Self> {
                    match value { Value::$one(one) => Some(one.clone()), _ => None }
                }
                #[inline]
                fn column(columns: &Columns) -> &Column<Self> { &columns.$one_column }
                #[inline]
                fn column_mut(columns: &mut Columns) -> &mut Column<Self> { &mut columns.$one_column }
                fn stretch<'a, 'b>(stretches: &'b Stretches<'a>) -> &'b Stretch<'a, Self> { &stretches.$one_column }
                #[inline]
                fn stretch_mut<'a, 'b>(stretches: &'b mut Stretches<'a>) -> &'b mut Stretch<'a, Self> { &mut stretches.$one_column }
            }
            impl FieldValue for Arc<[$type]> {
                const TYPE: FieldType = FieldType::many(Kind::$one);
                fn empty() -> Self { Arc::from([]) }
                fn from_value(value: &Value) -> Option<Self> {
                    match value { Value::$many(many) => Some(many.clone()), _ => None }
                }
                #[inline]
                fn column(columns: &Columns) -> &Column<Self> { &columns.$many_column }
                #[inline]
                fn column_mut(columns: &mut Columns) -> &mut Column<Self> { &mut columns.$many_column }
                fn stretch<'a, 'b>(stretches: &'b Stretches<'a>) -> &'b Stretch<'a, Self> { &stretches.$many_column }
                #[inline]
                fn stretch_mut<'a, 'b>(stretches: &'b mut Stretches<'a>) -> &'b mut Stretch<'a, Self> { &mut stretches.$many_column }
            }
        )*
    };
}
for_each_kind!(values);

impl From<&str> for Value {
    fn from(value: &str) -> Value {
        Value::String(value.into())
    }
}

impl From<String> for Value {
    fn from(value: String) -> Value {
        Value::String(value.into())
    }
}

impl From<Vec<String>> for Value {
    fn from(value: Vec<String>) -> Value {
        Value::Strings(value.into_iter().map(Arc::from).collect())
    }
}

impl From<NodeId> for Value {
    fn from(value: NodeId) -> Value {
        Value::Node(Some(value))
    }
}

impl From<Vec<NodeId>> for Value {
    fn from(value: Vec<NodeId>) -> Value {
        Value::Nodes(value.into_iter().map(Some).collect())
    }
}

impl From<&[NodeId]> for Value {
    fn from(value: &[NodeId]) -> Value {
        Value::Nodes(value.iter().copied().map(Some).collect())
    }
}

impl<const N: usize> From<[NodeId; N]> for Value {
    fn from(value: [NodeId; N]) -> Value {
        Value::from(&value[..])
    }
}

impl From<Arc<Image>> for Value {
    fn from(value: Arc<Image>) -> Value {
        Value::Image(Some(value))
    }
}

impl From<Image> for Value {
    fn from(value: Image) -> Value {
        Value::Image(Some(Arc::new(value)))
    }
}
