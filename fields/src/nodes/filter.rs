//! Filters of trackers' input: the one-euro filter, which is steady at rest and quick in motion (Casiez, Roussel, Vogel, CHI 2012, algorithm 1).
//! The speed is taken from what was measured, not from the filtered value as printed there: that lags, and so would seem to be overtaken.

use std::f64::consts::TAU;

use glam::{Quat, Vec3};

use super::blend::Glide;
use crate::{Evaluation, Field, FieldValue, NodeType, SetRule, Time};

const SET_VALUE: u16 = 0;
const MIN_CUTOFF: u16 = 1;
const BETA: u16 = 2;
const VALUE_CHANGED: u16 = 3;
const VELOCITY_CUTOFF: u16 = 4;
const VELOCITY: u16 = 5;
const TIME: u16 = 6;
const MEASURED: u16 = 7;

pub(super) fn types() -> Vec<NodeType> {
    vec![
        filter::<f32>("ScalarFilter", "A number without jitter."),
        filter::<Vec3>("PositionFilter", "A tracker's place without jitter."),
        filter::<Quat>("OrientationFilter", "A tracker's rotation without jitter."),
    ]
}

fn filter<T: FieldValue + Glide>(name: &str, doc: &str) -> NodeType
where
    T::Step: FieldValue,
{
    let cutoff = |name: &str, doc: &str| Field::new(name, 1.0f32).unit("Hz").range(1e-4, 1e6).doc(doc);
    NodeType::new(name, format!("{doc} Steady at rest, quick in motion."))
        .field(Field::new("set_value", T::empty()).on_set(SetRule::Pulse).doc("What is measured."))
        .field(cutoff("min_cutoff", "What is faster than this is taken for jitter at rest; lower is steadier."))
        .field(
            Field::new("beta", 0.5f32)
                .range(0.0, 1e6)
                .doc("By so much the cutoff rises with the speed, in Hz per unit and second; higher lags less."),
        )
        .field(Field::new("value_changed", T::empty()).on_set(SetRule::Pulse).output().doc("What it is taken for."))
        .field(cutoff("velocity_cutoff", "The same for the speed."))
        .field(
            Field::new("velocity", T::Step::empty())
                .output()
                .doc("How fast it is taken to move, per second; of rotations in radians."),
        )
        .field(Field::new("time", Time(0.0)).unit("s").output().doc("When it was measured last."))
        .field(Field::new("measured", T::empty()).output().doc("What was measured last."))
        .evaluate(evaluate::<T>)
}

fn evaluate<T: FieldValue + Glide>(evaluation: &mut Evaluation<'_>)
where
    T::Step: FieldValue,
{
    if !evaluation.changed(SET_VALUE) {
        return;
    }
    let (now, measured): (f64, T) = (evaluation.time(), evaluation.get(SET_VALUE));
    if !T::length(measured.minus(measured)).is_finite() {
        return evaluation.report_field(SET_VALUE, "what is measured is not finite; it is left out");
    }
    let passed_s = now - evaluation.get::<Time>(TIME).0;
    let first = !evaluation.written(VALUE_CHANGED);
    let measured_before: T = evaluation.get(MEASURED);
    evaluation.set(TIME, Time(now));
    evaluation.set(MEASURED, measured);
    if first {
        return evaluation.set(VALUE_CHANGED, measured);
    }
    if passed_s <= 0.0 {
        return;
    }
    // The share of what is new that a low pass lets through.
    let through = |cutoff_hz: f32| (1.0 / (1.0 + 1.0 / (TAU * cutoff_hz as f64 * passed_s))) as f32;
    let (value, velocity): (T, T::Step) = (evaluation.get(VALUE_CHANGED), evaluation.get(VELOCITY));
    let off = measured.minus(value);
    let share = through(evaluation.get(VELOCITY_CUTOFF));
    let velocity = velocity * (1.0 - share) + measured.minus(measured_before) * ((1.0 / passed_s) as f32 * share);
    let cutoff_hz = evaluation.get::<f32>(MIN_CUTOFF) + evaluation.get::<f32>(BETA) * T::length(velocity);
    evaluation.set(VELOCITY, velocity);
    evaluation.set(VALUE_CHANGED, value.plus(off * through(cutoff_hz)));
}
