//! Interpolators: a value that follows key frames (X3D 4 section 19, glTF 2.0 section 3.11 and appendix C).

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::blend::Blend;
use super::keys::{Span, fault, span};
use crate::{Color, EnumValue, Evaluation, Field, FieldValue, NodeType, SetRule, Value};

const SET_FRACTION: u16 = 0;
const KEY: u16 = 1;
const KEY_VALUE: u16 = 2;
const INTERPOLATION: u16 = 3;
const VALUE_CHANGED: u16 = 4;

const STEP: EnumValue = EnumValue(1);
const CUBIC_SPLINE: EnumValue = EnumValue(2);

pub(super) fn types() -> Vec<NodeType> {
    vec![
        one::<f32>("ScalarInterpolator", "A number that follows key frames."),
        one::<Vec3>("PositionInterpolator", "A place or any other vector that follows key frames."),
        one::<Quat>("OrientationInterpolator", "A rotation that follows key frames, along the shorter arc."),
        one::<Color>("ColorInterpolator", "A color that follows key frames, blended as linear RGB."),
        many::<Vec3>("CoordinateInterpolator", "Vertices that follow key frames; each key has the same number of them."),
        many::<f32>(
            "ScalarArrayInterpolator",
            "Numbers, such as morph weights, that follow key frames; each key has the same number of them.",
        ),
    ]
}

fn declare<T>(name: &str, doc: &str, value_changed: Value) -> NodeType
where
    Arc<[T]>: FieldValue,
{
    NodeType::new(name, doc)
        .field(
            Field::new("set_fraction", 0.0f32)
                .on_set(SetRule::Pulse)
                .doc("Where between the keys; beyond the ends the end's value holds."),
        )
        .field(Field::many::<f32>("key").doc("Fractions or seconds, ascending."))
        .field(
            Field::many::<T>("key_value")
                .doc("The values at each key; for cubic_spline in-tangent, value, out-tangent, as in glTF."),
        )
        .field(Field::choice("interpolation", &["linear", "step", "cubic_spline"], "linear").doc("What lies between the keys."))
        .field(Field::new("value_changed", value_changed).output().doc("The value; written from the first `set_fraction` on."))
}

fn one<T: FieldValue + Blend>(name: &str, doc: &str) -> NodeType
where
    Arc<[T]>: FieldValue,
{
    declare::<T>(name, doc, T::empty().into()).evaluate(|evaluation| {
        if let Some((span, values, mode)) = prepare::<T>(evaluation, Some(1)) {
            evaluation.set(VALUE_CHANGED, sample(&values, 1, 0, mode, span));
        }
    })
}

fn many<T: FieldValue + Blend>(name: &str, doc: &str) -> NodeType
where
    Arc<[T]>: FieldValue,
{
    declare::<T>(name, doc, <Arc<[T]>>::empty().into()).evaluate(|evaluation| {
        if let Some((span, values, mode)) = prepare::<T>(evaluation, None) {
            let per_key = values.len() / (evaluation.get::<Arc<[f32]>>(KEY).len() * stride(mode));
            let blended: Arc<[T]> = (0..per_key).map(|item| sample(&values, per_key, item, mode, span)).collect();
            evaluation.set(VALUE_CHANGED, blended);
        }
    })
}

/// Values per key and item.
fn stride(mode: EnumValue) -> usize {
    if mode == CUBIC_SPLINE { 3 } else { 1 }
}

/// Where the fraction lies, if there is anything to compute. Bad keys are reported when they were written, and not used.
fn prepare<T>(evaluation: &mut Evaluation<'_>, per_key: Option<usize>) -> Option<(Span, Arc<[T]>, EnumValue)>
where
    Arc<[T]>: FieldValue,
{
    let keys: Arc<[f32]> = evaluation.get(KEY);
    let values: Arc<[T]> = evaluation.get(KEY_VALUE);
    let mode: EnumValue = evaluation.get(INTERPOLATION);
    let new_keys = evaluation.changed(KEY) || evaluation.changed(KEY_VALUE) || evaluation.changed(INTERPOLATION);
    if new_keys && let Some(fault) = fault(&keys, values.len(), per_key, stride(mode)) {
        evaluation.report_field(KEY, fault);
    }
    // Without any fraction the value stays: what follows this node keeps its own place until the clock starts.
    if !evaluation.written(SET_FRACTION) || !(new_keys || evaluation.changed(SET_FRACTION)) {
        return None;
    }
    let group = keys.len() * stride(mode);
    let fits = group > 0
        && !values.is_empty()
        && values.len().is_multiple_of(group)
        && per_key.is_none_or(|per_key| values.len() == group * per_key);
    let span = span(&keys, evaluation.get(SET_FRACTION))?;
    fits.then_some((span, values, mode))
}

/// One item of the values at a place between keys.
fn sample<T: Blend>(values: &[T], per_key: usize, item: usize, mode: EnumValue, span: Span) -> T {
    if mode == CUBIC_SPLINE {
        let at = |key: usize, part: usize| values[(3 * key + part) * per_key + item];
        if span.from == span.to {
            return at(span.from, 1);
        }
        let (t, t2, t3) = (span.share, span.share * span.share, span.share * span.share * span.share);
        return T::weigh([
            (at(span.from, 1), 2.0 * t3 - 3.0 * t2 + 1.0),
            (at(span.from, 2), span.length * (t3 - 2.0 * t2 + t)),
            (at(span.to, 1), -2.0 * t3 + 3.0 * t2),
            (at(span.to, 0), span.length * (t3 - t2)),
        ]);
    }
    let at = |key: usize| values[key * per_key + item];
    if span.from == span.to {
        at(span.from)
    } else if mode == STEP {
        at(if span.share < 1.0 { span.from } else { span.to })
    } else {
        T::blend(at(span.from), at(span.to), span.share)
    }
}
