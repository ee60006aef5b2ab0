//! Which values may go into which fields (F2), and how they change on the way.

use std::sync::Arc;

use glam::{Quat, Vec2};

use crate::{Color, ColorA, FieldType, Kind, Rotation, Time, Value};

/// True if a route may go from a field of the one type to a field of the other.
///
/// Numbers, times and bools among each other; vec3 and color; vec4 and color_a; color and color_a; quat and rotation; an enum into numbers.
/// A multiple field converts element by element; one element never becomes many, nor many one.
pub fn converts(from: FieldType, to: FieldType) -> bool {
    from == to || from.multiple == to.multiple && kind_converts(from.kind, to.kind)
}

fn is_number(kind: Kind) -> bool {
    matches!(kind, Kind::Bool | Kind::I32 | Kind::I64 | Kind::F32 | Kind::F64 | Kind::Time)
}

fn kind_converts(from: Kind, to: Kind) -> bool {
    use Kind::{Color, ColorA, Enum, Quat, Rotation, Vec3, Vec4};
    from == to
        || (is_number(from) || from == Enum) && is_number(to)
        || matches!(
            (from, to),
            (Vec3, Color)
                | (Color, Vec3)
                | (Vec4, ColorA)
                | (ColorA, Vec4)
                | (Color, ColorA)
                | (ColorA, Color)
                | (Quat, Rotation)
                | (Rotation, Quat)
        )
}

/// Numbers, and what consists of numbers that each may be held to a range; see [`Value::outside`].
pub(crate) fn takes_range(kind: Kind) -> bool {
    use Kind::{Color, ColorA, Vec2, Vec3, Vec4};
    kind != Kind::Bool && is_number(kind) || matches!(kind, Vec2 | Vec3 | Vec4 | Color | ColorA)
}

/// A number on its way: integers stay exact.
#[derive(Clone, Copy)]
enum Number {
    Int(i64),
    Float(f64),
}

impl Number {
    fn of(value: &Value) -> Option<Self> {
        Some(match value {
            Value::Bool(value) => Number::Int(*value as i64),
            Value::I32(value) => Number::Int(*value as i64),
            Value::I64(value) => Number::Int(*value),
            Value::F32(value) => Number::Float(*value as f64),
            Value::F64(value) => Number::Float(*value),
            Value::Time(value) => Number::Float(value.0),
            Value::Enum(value) => Number::Int(value.0 as i64),
            _ => return None,
        })
    }

    fn float(self) -> f64 {
        match self {
            Number::Int(int) => int as f64,
            Number::Float(float) => float,
        }
    }

    /// Towards zero; the nearest that fits for what is too large, zero for NaN.
    fn int(self) -> i64 {
        match self {
            Number::Int(int) => int,
            Number::Float(float) => float as i64,
        }
    }

    fn is_true(self) -> bool {
        match self {
            Number::Int(int) => int != 0,
            Number::Float(float) => float != 0.0 && !float.is_nan(),
        }
    }
}

impl Value {
    /// This value as one of the type, by the rule of [`converts`]; None where that forbids it.
    pub fn convert(&self, to: FieldType) -> Option<Value> {
        let from = self.field_type();
        if from == to {
            return Some(self.clone());
        }
        if !converts(from, to) {
            return None;
        }
        if to.multiple {
            let elements: Option<Vec<Value>> = (0..self.len()).map(|index| self.element(index)?.convert_one(to.kind)).collect();
            return Value::collect(to.kind, elements?.into_iter());
        }
        self.convert_one(to.kind)
    }

    fn convert_one(&self, kind: Kind) -> Option<Value> {
        if let Some(number) = Number::of(self) {
            return Some(match kind {
                Kind::Bool => Value::Bool(number.is_true()),
                Kind::I32 => Value::I32(number.int().clamp(i32::MIN as i64, i32::MAX as i64) as i32),
                Kind::I64 => Value::I64(number.int()),
                Kind::F32 => Value::F32(number.float() as f32),
                Kind::F64 => Value::F64(number.float()),
                Kind::Time => Value::Time(Time(number.float())),
                _ => return None,
            });
        }
        Some(match (self, kind) {
            (Value::Vec3(value), Kind::Color) => Value::Color(Color(*value)),
            (Value::Color(value), Kind::Vec3) => Value::Vec3(value.0),
            (Value::Vec4(value), Kind::ColorA) => Value::ColorA(ColorA(*value)),
            (Value::ColorA(value), Kind::Vec4) => Value::Vec4(value.0),
            (Value::Color(value), Kind::ColorA) => Value::ColorA(ColorA(value.0.extend(1.0))),
            (Value::ColorA(value), Kind::Color) => Value::Color(Color(value.0.truncate())),
            (Value::Quat(value), Kind::Rotation) => Value::Rotation(Rotation::from(*value)),
            (Value::Rotation(value), Kind::Quat) => Value::Quat(Quat::from(*value)),
            _ => return None,
        })
    }

    /// The first number or component outside of a range, NaN included; None for what is no number.
    pub(crate) fn outside(&self, smallest: f64, largest: f64) -> Option<f64> {
        let bad = |value: f64| (!(smallest..=largest).contains(&value)).then_some(value);
        // Bounds rounded as the values are: 0.1f32 is inside of 0 to 0.1.
        let bad_f32 = |value: &f32| (!(smallest as f32..=largest as f32).contains(value)).then_some(*value as f64);
        let bad_of = |values: &[f32]| values.iter().find_map(bad_f32);
        match self {
            Value::I32(value) => bad(*value as f64),
            Value::I64(value) => bad(*value as f64),
            Value::F32(value) => bad_f32(value),
            Value::F64(value) => bad(*value),
            Value::Time(value) => bad(value.0),
            Value::Vec2(value) => bad_of(&value.to_array()),
            Value::Vec3(value) => bad_of(&value.to_array()),
            Value::Vec4(value) => bad_of(&value.to_array()),
            Value::Color(value) => bad_of(&value.0.to_array()),
            Value::ColorA(value) => bad_of(&value.0.to_array()),
            Value::F32s(values) => bad_of(values),
            many if many.field_type().multiple => {
                (0..many.len()).find_map(|index| many.element(index)?.outside(smallest, largest))
            }
            _ => None,
        }
    }

    /// Every number or component moved into a range, NaN to its smallest; what is no number stays as it is.
    pub(crate) fn clamped(self, smallest: f64, largest: f64) -> Value {
        let to = |value: f64| if value.is_nan() { smallest } else { value.clamp(smallest, largest) };
        let near = |value: f32| if value.is_nan() { smallest as f32 } else { value.clamp(smallest as f32, largest as f32) };
        match self {
            value if value.outside(smallest, largest).is_none() => value,
            Value::I32(value) => Value::I32(to(value as f64) as i32),
            Value::I64(value) => Value::I64(to(value as f64) as i64),
            Value::F32(value) => Value::F32(near(value)),
            Value::F64(value) => Value::F64(to(value)),
            Value::Time(value) => Value::Time(Time(to(value.0))),
            Value::Vec2(value) => Value::Vec2(Vec2::from_array(value.to_array().map(near))),
            Value::Vec3(value) => Value::Vec3(value.to_array().map(near).into()),
            Value::Vec4(value) => Value::Vec4(value.to_array().map(near).into()),
            Value::Color(value) => Value::Color(Color(value.0.to_array().map(near).into())),
            Value::ColorA(value) => Value::ColorA(ColorA(value.0.to_array().map(near).into())),
            many => {
                let kind = many.field_type().kind;
                let elements: Arc<[Value]> =
                    (0..many.len()).filter_map(|index| many.element(index)).map(|one| one.clamped(smallest, largest)).collect();
                Value::collect(kind, elements.iter().cloned()).unwrap_or(many)
            }
        }
    }
}
