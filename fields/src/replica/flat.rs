//! Values that are nothing but a few floats, which most of what changes every frame is: their bytes are those of the codec, but they go
//! to and from columns without a [`Value`](crate::Value) and without serde.

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};

use crate::column::Columns;
use crate::{Color, ColorA, FieldType, FieldValue, Kind};

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

/// Floats as bytes on the stack.
#[derive(Clone, Copy)]
pub(super) struct FlatBytes {
    bytes: [u8; 64],
    length: usize,
}

impl FlatBytes {
    #[inline]
    pub(super) fn of<const COUNT: usize>(floats: [f32; COUNT]) -> FlatBytes {
        let mut bytes = [0; 64];
        for (place, float) in bytes.chunks_exact_mut(4).zip(floats) {
            place.copy_from_slice(&float.to_le_bytes());
        }
        FlatBytes { bytes, length: 4 * COUNT }
    }

    #[inline]
    pub(super) fn as_slice(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

/// Floats from their bytes, of which there are four for each.
#[inline]
pub(super) fn floats_of<const COUNT: usize>(bytes: &[u8]) -> [f32; COUNT] {
    std::array::from_fn(|place| {
        let bytes = bytes.get(4 * place..4 * place + 4).and_then(|bytes| bytes.try_into().ok());
        f32::from_le_bytes(bytes.unwrap_or_default())
    })
}

/// The bytes of a value in its column, if it is flat.
#[inline]
pub(super) fn flat_bytes(columns: &Columns, field_type: FieldType, slot: u32) -> Option<FlatBytes> {
    #[inline]
    fn of<T: Flat<COUNT>, const COUNT: usize>(columns: &Columns, slot: u32) -> Option<FlatBytes> {
        Some(FlatBytes::of(T::column(columns).values[slot as usize].floats()))
    }
    if field_type.multiple {
        return None;
    }
    match field_type.kind {
        Kind::F32 => of::<f32, 1>(columns, slot),
        Kind::Vec2 => of::<Vec2, 2>(columns, slot),
        Kind::Vec3 => of::<Vec3, 3>(columns, slot),
        Kind::Vec4 => of::<Vec4, 4>(columns, slot),
        Kind::Quat => of::<Quat, 4>(columns, slot),
        Kind::Mat4 => of::<Mat4, 16>(columns, slot),
        Kind::Color => of::<Color, 3>(columns, slot),
        Kind::ColorA => of::<ColorA, 4>(columns, slot),
        _ => None,
    }
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
            let flat = flat_bytes(&graph.columns, field_type, slot).unwrap();
            assert_eq!(flat.as_slice(), by_codec, "{field_type}");
        }
        assert_eq!(floats_of::<3>(FlatBytes::of([1.0, -2.0, 3.5]).as_slice()), [1.0, -2.0, 3.5]);
    }
}
