//! Random values of every type, among them the odd ones.

use std::sync::Arc;

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use proptest::prelude::*;
use proptest::test_runner::TestRng;
use umbriel_fields::{Color, ColorA, EnumValue, FieldType, Image, Kind, NodeId, Rotation, Time, Value};

/// Dice from proptest's seed, so that a graph can be made step by step.
pub(crate) struct Dice(pub(crate) TestRng);

impl Dice {
    pub(crate) fn below(&mut self, end: usize) -> usize {
        self.0.random_range(0..end.max(1))
    }

    fn float(&mut self) -> f32 {
        const ODD: [f32; 10] =
            [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE, 1e-45, f32::MAX, 0.1, -1.0 / 3.0];
        match self.below(3) {
            0 => ODD[self.below(ODD.len())],
            _ => canonical_nan(f32::from_bits(self.0.random())),
        }
    }

    fn double(&mut self) -> f64 {
        const ODD: [f64; 8] = [-0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324, f64::MAX, 0.1, 1e300];
        match self.below(3) {
            0 => ODD[self.below(ODD.len())],
            _ => {
                let value = f64::from_bits(self.0.random());
                if value.is_nan() { f64::NAN } else { value }
            }
        }
    }

    pub(crate) fn text(&mut self) -> String {
        const PARTS: [&str; 16] =
            ["a", "\"", "\\", "\0", "\n", "\r", "\t", "Größe", "\u{1F319}", "//", "/*", "\u{2028}", "'", "{}", "\u{7f}", "r#\""];
        (0..self.below(5)).map(|_| PARTS[self.below(PARTS.len())]).collect()
    }

    fn floats<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| self.float())
    }

    fn image(&mut self) -> Option<Arc<Image>> {
        let (width, height) = (self.below(9) as u32, self.below(4) as u32);
        let rgba = (0..4 * width * height).map(|_| self.0.random()).collect();
        (self.below(3) > 0).then(|| Arc::new(Image { width, height, rgba }))
    }

    fn node(&mut self, nodes: &[NodeId]) -> Option<NodeId> {
        (!nodes.is_empty() && self.below(5) > 0).then(|| nodes[self.below(nodes.len())])
    }

    pub(crate) fn value(&mut self, field_type: FieldType, choices: usize, nodes: &[NodeId]) -> Value {
        if field_type.multiple {
            let count = [0, 1, 3, 40][self.below(4)];
            let elements: Vec<Value> = (0..count).map(|_| self.value(FieldType::one(field_type.kind), choices, nodes)).collect();
            return Value::collect(field_type.kind, elements.into_iter()).unwrap();
        }
        match field_type.kind {
            Kind::Bool => (self.below(2) == 0).into(),
            Kind::I32 => [i32::MIN, i32::MAX, 0, self.0.random()][self.below(4)].into(),
            Kind::I64 => [i64::MIN, i64::MAX, -1, self.0.random()][self.below(4)].into(),
            Kind::F32 => self.float().into(),
            Kind::F64 => self.double().into(),
            Kind::String => self.text().into(),
            Kind::Vec2 => Vec2::from(self.floats::<2>()).into(),
            Kind::Vec3 => Vec3::from(self.floats::<3>()).into(),
            Kind::Vec4 => Vec4::from(self.floats::<4>()).into(),
            Kind::Quat => Quat::from_array(self.floats()).into(),
            Kind::Rotation => Rotation { axis: Vec3::from(self.floats::<3>()), angle_rad: self.float() }.into(),
            Kind::Mat4 => Mat4::from_cols_array(&self.floats()).into(),
            Kind::Color => Color(Vec3::from(self.floats::<3>())).into(),
            Kind::ColorA => ColorA(Vec4::from(self.floats::<4>())).into(),
            Kind::Time => Time(self.double()).into(),
            Kind::Node => Value::Node(self.node(nodes)),
            Kind::Enum => EnumValue(self.below(choices) as u16).into(),
            Kind::Image => Value::Image(self.image()),
        }
    }
}

fn canonical_nan(value: f32) -> f32 {
    if value.is_nan() { f32::NAN } else { value }
}
