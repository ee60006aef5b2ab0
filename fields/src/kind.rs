//! What a field can hold: the kinds, and the few value types that glam does not have.

use std::fmt;
use std::sync::Arc;

use glam::{Quat, Vec3, Vec4};

/// The type of a field: what one element is, and whether the field holds one or any number of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FieldType {
    /// What one element is.
    pub kind: Kind,
    /// True for a multiple field (MF): any number of elements, shared and never copied by a route.
    pub multiple: bool,
}

impl FieldType {
    /// A field of one element (SF).
    pub const fn one(kind: Kind) -> Self {
        Self { kind, multiple: false }
    }

    /// A field of any number of elements (MF).
    pub const fn many(kind: Kind) -> Self {
        Self { kind, multiple: true }
    }
}

impl fmt::Display for FieldType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.kind, if self.multiple { "[]" } else { "" })
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A turn about an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation {
    /// The axis; need not have length one, the zero vector means no turn.
    pub axis: Vec3,
    /// The angle in radians, right-handed about the axis.
    pub angle_rad: f32,
}

impl Default for Rotation {
    fn default() -> Self {
        Self { axis: Vec3::Z, angle_rad: 0.0 }
    }
}

impl From<Rotation> for Quat {
    fn from(rotation: Rotation) -> Quat {
        match rotation.axis.try_normalize() {
            Some(axis) => Quat::from_axis_angle(axis, rotation.angle_rad),
            None => Quat::IDENTITY,
        }
    }
}

impl From<Quat> for Rotation {
    fn from(quat: Quat) -> Rotation {
        if !quat.is_finite() || quat.length_squared() == 0.0 {
            return Rotation::default();
        }
        let (axis, angle_rad) = quat.normalize().to_axis_angle();
        Rotation { axis, angle_rad }
    }
}

/// Linear red, green, blue.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Color(pub Vec3);

/// Linear red, green, blue, and opacity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ColorA(pub Vec4);

/// A point in time or a length of time, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Time(pub f64);

/// The index of a name in the list of choices of an enum field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EnumValue(pub u16);

/// A picture of 8-bit RGBA texels, top row first.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `4 * width * height` bytes.
    pub rgba: Arc<[u8]>,
}

impl fmt::Debug for Image {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Image({} x {})", self.width, self.height)
    }
}

macro_rules! kinds {
    ($(($one:ident, $many:ident, $type:ty, $one_column:ident, $many_column:ident, $name:literal, $default:expr))*) => {
        /// What one element of a field is.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Kind { $(#[doc = concat!("`", $name, "`")] $one,)* }

        impl Kind {
            /// Every kind there is.
            pub const ALL: &[Kind] = &[$(Kind::$one,)*];

            /// The name that messages and files use.
            pub const fn name(self) -> &'static str {
                match self { $(Kind::$one => $name,)* }
            }
        }
    };
}

/// Calls a macro with a row for each kind: variant, variant of the multiple, element type, the two columns, name, default.
macro_rules! for_each_kind {
    ($go:ident) => {
        $go! {
            (Bool, Bools, bool, bool_one, bool_many, "bool", false)
            (I32, I32s, i32, i32_one, i32_many, "i32", 0)
            (I64, I64s, i64, i64_one, i64_many, "i64", 0)
            (F32, F32s, f32, f32_one, f32_many, "f32", 0.0)
            (F64, F64s, f64, f64_one, f64_many, "f64", 0.0)
            (String, Strings, std::sync::Arc<str>, string_one, string_many, "string", std::sync::Arc::from(""))
            (Vec2, Vec2s, glam::Vec2, vec2_one, vec2_many, "vec2", glam::Vec2::ZERO)
            (Vec3, Vec3s, glam::Vec3, vec3_one, vec3_many, "vec3", glam::Vec3::ZERO)
            (Vec4, Vec4s, glam::Vec4, vec4_one, vec4_many, "vec4", glam::Vec4::ZERO)
            (Quat, Quats, glam::Quat, quat_one, quat_many, "quat", glam::Quat::IDENTITY)
            (Rotation, Rotations, $crate::Rotation, rotation_one, rotation_many, "rotation", $crate::Rotation::default())
            (Mat4, Mat4s, glam::Mat4, mat4_one, mat4_many, "mat4", glam::Mat4::IDENTITY)
            (Color, Colors, $crate::Color, color_one, color_many, "color", $crate::Color::default())
            (ColorA, ColorAs, $crate::ColorA, color_a_one, color_a_many, "color_a", $crate::ColorA::default())
            (Time, Times, $crate::Time, time_one, time_many, "time", $crate::Time::default())
            (Node, Nodes, Option<$crate::NodeId>, node_one, node_many, "node", None)
            (Enum, Enums, $crate::EnumValue, enum_one, enum_many, "enum", $crate::EnumValue::default())
            (Image, Images, Option<std::sync::Arc<$crate::Image>>, image_one, image_many, "image", None)
        }
    };
}
pub(crate) use for_each_kind;

for_each_kind!(kinds);
