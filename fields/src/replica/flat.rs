//! Values that are nothing but a few floats, which most of what changes every frame is: their bytes are those of the codec, but they go
//! to and from columns without a [`Value`](crate::Value) and without serde.

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};

use super::packet::Place;
use super::shares::flat_share;
use crate::column::Columns;
use crate::{Color, ColorA, FieldType, FieldValue};

/// A value of `COUNT` floats.
pub(super) trait Flat<const COUNT: usize>: FieldValue {
    fn floats(&self) -> [f32; COUNT];
    fn of_floats(floats: [f32; COUNT]) -> Self;
}

macro_rules! flat { ($($type:ty, $count:literal: $value:ident => $floats:expr, $back:ident => $of_floats:expr;)*) => { $(
    impl Flat<$count> for $type {
        #[inline]
        fn floats(&self) -> [f32; $count] { let $value = self; $floats }
        #[inline]
        fn of_floats($back: [f32; $count]) -> Self { $of_floats }
    }
)* } }
flat! {
    f32, 1: value => [*value], floats => floats[0];
    Vec2, 2: value => value.to_array(), floats => floats.into();
    Vec3, 3: value => value.to_array(), floats => floats.into();
    Vec4, 4: value => value.to_array(), floats => floats.into();
    Quat, 4: value => value.to_array(), floats => Quat::from_array(floats);
    Mat4, 16: value => value.to_cols_array(), floats => Mat4::from_cols_array(&floats);
    Color, 3: value => value.0.to_array(), floats => Color(floats.into());
    ColorA, 4: value => value.0.to_array(), floats => ColorA(floats.into());
}

/// Floats as bytes, little end first.
#[inline]
pub(super) fn put_floats<const COUNT: usize>(bytes: &mut Vec<u8>, floats: [f32; COUNT]) {
    bytes.extend_from_slice(floats.map(f32::to_le_bytes).as_flattened());
}

/// Values of so many floats, from their bytes.
#[inline]
pub(super) fn values_of<const COUNT: usize>(bytes: &[u8]) -> &[[[u8; 4]; COUNT]] {
    bytes.as_chunks::<4>().0.as_chunks::<COUNT>().0
}

/// The same, each as its bits.
#[inline]
pub(super) fn bits_of<const COUNT: usize>(bytes: &[u8]) -> impl Iterator<Item = [u32; COUNT]> {
    values_of::<COUNT>(bytes).iter().map(|value| value.map(u32::from_le_bytes))
}

/// Calls a function for the type of fields that hold nothing but a few floats; None for other types.
macro_rules! for_flat {
    ($field_type:expr, $function:ident $arguments:tt) => {
        match $field_type {
            $crate::FieldType { multiple: true, .. } => None,
            $crate::FieldType { kind: $crate::Kind::F32, .. } => Some($function::<f32, 1> $arguments),
            $crate::FieldType { kind: $crate::Kind::Vec2, .. } => Some($function::<glam::Vec2, 2> $arguments),
            $crate::FieldType { kind: $crate::Kind::Vec3, .. } => Some($function::<glam::Vec3, 3> $arguments),
            $crate::FieldType { kind: $crate::Kind::Vec4, .. } => Some($function::<glam::Vec4, 4> $arguments),
            $crate::FieldType { kind: $crate::Kind::Quat, .. } => Some($function::<glam::Quat, 4> $arguments),
            $crate::FieldType { kind: $crate::Kind::Mat4, .. } => Some($function::<glam::Mat4, 16> $arguments),
            $crate::FieldType { kind: $crate::Kind::Color, .. } => Some($function::<$crate::Color, 3> $arguments),
            $crate::FieldType { kind: $crate::Kind::ColorA, .. } => Some($function::<$crate::ColorA, 4> $arguments),
            _ => None,
        }
    };
}
pub(super) use for_flat;

/// Appends the bytes of a value in its column, if it is flat; false if it is not.
pub(super) fn put_flat(columns: &Columns, field_type: FieldType, slot: u32, bytes: &mut Vec<u8>) -> bool {
    fn put<T: Flat<COUNT>, const COUNT: usize>(columns: &Columns, slot: u32, bytes: &mut Vec<u8>) {
        put_floats(bytes, T::column(columns).values[slot as usize].floats());
    }
    for_flat!(field_type, put(columns, slot, bytes)).is_some()
}

/// What a value in its column adds to the hash, if it is flat.
pub(super) fn share_of_flat(columns: &Columns, field_type: FieldType, slot: u32, (number, index): Place) -> Option<u64> {
    fn share<T: Flat<COUNT>, const COUNT: usize>(columns: &Columns, slot: u32, number: u64, index: u16) -> u64 {
        flat_share(number, index, T::column(columns).values[slot as usize].floats().map(f32::to_bits))
    }
    for_flat!(field_type, share(columns, slot, number, index))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::{Name, Ref, to_bytes};
    use crate::{Field, Graph, Image, NodeId, NodeType, Value};
    use std::sync::Arc;

    struct Nameless;

    impl Name for Nameless {
        fn node(&mut self, _: Option<NodeId>) -> Ref {
            Ref::Number(0)
        }
        fn image(&mut self, _: Option<&Arc<Image>>) -> Ref {
            Ref::Number(0)
        }
    }

    #[test]
    fn flat_values_have_the_bytes_of_the_codec() {
        let values: [Value; 8] = [
            (-1.5f32).into(),
            Vec2::new(f32::NAN, 2.0).into(),
            Vec3::new(1.0, -0.0, 3.0).into(),
            Vec4::new(1.0, 2.0, 3.0, f32::INFINITY).into(),
            Quat::from_rotation_x(0.3).into(),
            Mat4::from_rotation_y(1.0).into(),
            Color(Vec3::new(0.1, 0.2, 0.3)).into(),
            ColorA(Vec4::new(0.1, 0.2, 0.3, 0.4)).into(),
        ];
        for value in values {
            let field_type = value.field_type();
            let mut graph = Graph::new(vec![NodeType::new("Box", "").field(Field::of_type("value", field_type))]);
            let node = graph.create("Box").unwrap();
            let field = graph.field(node, "value").unwrap();
            graph.set_value(field, value.clone()).unwrap();
            let (declared, slot) = graph.place(field).unwrap();
            let by_codec = to_bytes(&value, declared, &mut Nameless, Vec::new());
            let mut flat = Vec::new();
            assert!(put_flat(&graph.columns, field_type, slot, &mut flat));
            assert_eq!(flat, by_codec, "{field_type}");
        }
        let mut bytes = Vec::new();
        put_floats(&mut bytes, [1.0, -2.0, 3.5]);
        assert_eq!(bits_of::<3>(&bytes).next(), Some([1.0f32, -2.0, 3.5].map(f32::to_bits)));
    }
}
