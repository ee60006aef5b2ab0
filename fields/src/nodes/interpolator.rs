//! Interpolators: a value that follows key frames (X3D 4 section 19, glTF 2.0 section 3.11 and appendix C).

use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};

use super::blend::{Blend, Normal, hermite};
use super::keys::{Span, fault, span};
use crate::{Color, EnumValue, Evaluation, Field, FieldValue, NodeType, SetRule, Value};

const SET_FRACTION: u16 = 0;
const KEY: u16 = 1;
const KEY_VALUE: u16 = 2;
const INTERPOLATION: u16 = 3;
const VALUE_CHANGED: u16 = 4;
const KEYS_FIT: u16 = 5;

const LINEAR: EnumValue = EnumValue(0);
const STEP: EnumValue = EnumValue(1);
const CUBIC_SPLINE: EnumValue = EnumValue(2);

pub(super) fn types() -> Vec<NodeType> {
    let same = |vertex: Vec3| vertex;
    vec![
        one::<f32>("ScalarInterpolator", "A number that follows key frames."),
        one::<Vec2>("PositionInterpolator2D", "A place in a plane that follows key frames."),
        one::<Vec3>("PositionInterpolator", "A place or any other vector that follows key frames."),
        one::<Quat>("OrientationInterpolator", "A rotation that follows key frames, along the shorter arc."),
        one::<Color>("ColorInterpolator", "A color that follows key frames, blended as linear RGB."),
        many("CoordinateInterpolator", "Vertices that follow key frames; each key has the same number of them.", same, same),
        many(
            "CoordinateInterpolator2D",
            "Points of a plane that follow key frames; each key has the same number of them.",
            |point: Vec2| point,
            |point| point,
        ),
        many(
            "NormalInterpolator",
            "Directions that follow key frames on the unit sphere; each key has the same number of them.",
            Normal,
            |normal| normal.0,
        ),
        many(
            "ScalarArrayInterpolator",
            "Numbers, such as morph weights, that follow key frames; each key has the same number of them.",
            |number: f32| number,
            |number| number,
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
        .field(
            Field::new("keys_fit", true)
                .output()
                .doc("Whether `key` ascends and `key_value` has as many values as it needs; nothing is computed while not."),
        )
}

fn one<T: FieldValue + Blend>(name: &str, doc: &str) -> NodeType
where
    Arc<[T]>: FieldValue,
{
    declare::<T>(name, doc, T::empty().into()).evaluate(|evaluation| {
        let value = prepare::<T>(evaluation, Some(1)).map(|ready| sample(|at| ready.values[at], 1, 0, ready.mode, ready.span));
        if let Some(value) = value {
            evaluation.set(VALUE_CHANGED, value);
        }
    })
}

/// Items that are blended as something else. The ways there and back are known when it is compiled: they are gone for each item.
fn many<T, B>(
    name: &str,
    doc: &str,
    blended: impl Fn(T) -> B + Copy + Send + Sync + 'static,
    plain: impl Fn(B) -> T + Copy + Send + Sync + 'static,
) -> NodeType
where
    T: FieldValue + Copy,
    B: Blend + 'static,
    Arc<[T]>: FieldValue,
{
    declare::<T>(name, doc, <Arc<[T]>>::empty().into()).evaluate(move |evaluation| {
        let list = prepare::<T>(evaluation, None).map(|Ready { values, keys, mode, span }| {
            let per_key = values.len() / (keys * stride(mode));
            // Twice as fast as to ask for mode and span at each item.
            if mode == LINEAR && span.from != span.to {
                let [from, to] = [span.from, span.to].map(|key| &values[key * per_key..][..per_key]);
                let pairs = from.iter().zip(to);
                return pairs.map(|(from, to)| plain(B::blend(blended(*from), blended(*to), span.share))).collect::<Arc<[T]>>();
            }
            let at = |item| plain(sample(|at| blended(values[at]), per_key, item, mode, span));
            (0..per_key).map(at).collect::<Arc<[T]>>()
        });
        if let Some(list) = list {
            evaluation.set(VALUE_CHANGED, list);
        }
    })
}

/// Values per key and item.
fn stride(mode: EnumValue) -> usize {
    if mode == CUBIC_SPLINE { 3 } else { 1 }
}

/// What there is to compute from.
struct Ready<'a, T> {
    values: &'a [T],
    /// How many keys there are.
    keys: usize,
    mode: EnumValue,
    span: Span,
}

/// Where the fraction lies, if there is anything to compute. Bad keys are reported when they were written, and not used.
fn prepare<'a, T>(evaluation: &'a mut Evaluation<'_>, per_key: Option<usize>) -> Option<Ready<'a, T>>
where
    Arc<[T]>: FieldValue,
{
    let mode: EnumValue = evaluation.get(INTERPOLATION);
    let new_keys = evaluation.changed(KEY) || evaluation.changed(KEY_VALUE) || evaluation.changed(INTERPOLATION);
    if new_keys {
        let values = evaluation.read::<Arc<[T]>>(KEY_VALUE)?.len();
        let fault = fault(evaluation.read::<Arc<[f32]>>(KEY)?, values, per_key, stride(mode));
        // Kept, because to look at all keys in every frame would cost more than to compute the value.
        evaluation.set(KEYS_FIT, fault.is_none());
        fault.into_iter().for_each(|fault| evaluation.report_field(KEY, fault));
    }
    // Without any fraction the value stays: what follows this node keeps its own place until the clock starts.
    if !evaluation.written(SET_FRACTION) || !(new_keys || evaluation.changed(SET_FRACTION)) {
        return None;
    }
    let fraction: f32 = evaluation.get(SET_FRACTION);
    let (keys, values) = (evaluation.read::<Arc<[f32]>>(KEY)?, evaluation.read::<Arc<[T]>>(KEY_VALUE)?);
    let group = keys.len() * stride(mode);
    // Counted again: keys may be written silently, or come from a file.
    let fits = *evaluation.read(KEYS_FIT)?
        && group > 0
        && !values.is_empty()
        && values.len().is_multiple_of(group)
        && per_key.is_none_or(|per_key| values.len() == group * per_key);
    let span = span(keys, fraction)?;
    fits.then_some(Ready { values, keys: keys.len(), mode, span })
}

/// One item of the values at a place between keys.
fn sample<T: Blend>(value: impl Fn(usize) -> T, per_key: usize, item: usize, mode: EnumValue, span: Span) -> T {
    if mode == CUBIC_SPLINE {
        let at = |key: usize, part: usize| value((3 * key + part) * per_key + item);
        if span.from == span.to {
            return at(span.from, 1);
        }
        return hermite([at(span.from, 1), at(span.from, 2), at(span.to, 1), at(span.to, 0)], span.share, span.length);
    }
    let at = |key: usize| value(key * per_key + item);
    if span.from == span.to {
        at(span.from)
    } else if mode == STEP {
        at(if span.share < 1.0 { span.from } else { span.to })
    } else {
        T::blend(at(span.from), at(span.to), span.share)
    }
}
