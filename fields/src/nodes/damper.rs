//! Dampers: a value that glides to where it should be, at any frame rate in the same time (X3D 4 section 39, first order).

use glam::{Quat, Vec3};

use super::blend::Blend;
use crate::{Field, FieldValue, NodeType, SetRule, Time};

const SET_DESTINATION: u16 = 0;
const TAU: u16 = 1;
const TOLERANCE: u16 = 2;
const VALUE_CHANGED: u16 = 3;
const IS_ACTIVE: u16 = 4;
const TIME: u16 = 5;

pub(super) fn types() -> Vec<NodeType> {
    vec![
        damper::<f32>("ScalarDamper", "A number that glides.").alias("Damper"),
        damper::<Vec3>("PositionDamper", "A place that glides; for trackers that jitter."),
        damper::<Quat>("OrientationDamper", "A rotation that glides; for trackers that jitter."),
    ]
}

fn damper<T: FieldValue + Blend>(name: &str, doc: &str) -> NodeType {
    NodeType::new(name, doc)
        .field(
            Field::new("set_destination", T::empty())
                .on_set(SetRule::Pulse)
                .doc("Where to glide to; the first is taken at once."),
        )
        .field(
            Field::new("tau", 0.3f32).unit("s").range(0.0, 1e6).doc("After this time 1/e of the way is left; 0 does not glide."),
        )
        .field(Field::new("tolerance", 1e-4f32).range(0.0, f64::INFINITY).doc("So near it jumps to the destination and rests."))
        .field(Field::new("value_changed", T::empty()).on_set(SetRule::Pulse).output().doc("Where it is."))
        .field(Field::new("is_active", false).output().doc("Whether it moves."))
        .field(Field::new("time", Time(0.0)).unit("s").output().doc("When it last moved."))
        .evaluate(|evaluation| {
            let now = evaluation.time();
            let destination: T = evaluation.get(SET_DESTINATION);
            if !evaluation.written(SET_DESTINATION) {
                return;
            }
            let was_active = evaluation.get::<bool>(IS_ACTIVE);
            let value: T = evaluation.get(VALUE_CHANGED);
            let passed_s = if was_active { (now - evaluation.get::<Time>(TIME).0).max(0.0) } else { 0.0 };
            let tau: f32 = evaluation.get(TAU);
            let left = if tau > 0.0 { (-passed_s / tau as f64).exp() as f32 } else { 0.0 };
            let glided = T::blend(destination, value, left);
            let moves = evaluation.written(VALUE_CHANGED) && glided.distance(destination) > evaluation.get(TOLERANCE);
            evaluation.set(VALUE_CHANGED, if moves { glided } else { destination });
            evaluation.set(IS_ACTIVE, moves);
            evaluation.set(TIME, Time(now));
            if moves {
                evaluation.again();
            }
        })
}
