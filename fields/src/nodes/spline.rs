//! Interpolators that go through their keys without corners (X3D 4 sections 19.2.4 and 19.4), and easing of a fraction.

use std::ops::Mul;
use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};

use super::blend::{Blend, Glide, hermite, unit};
use super::keys::{Span, fault, span};
use crate::{Evaluation, Field, FieldValue, NodeType, SetRule};

const SET_FRACTION: u16 = 0;
const KEY: u16 = 1;
const KEY_VALUE: u16 = 2;
const CLOSED: u16 = 3;
const VALUE_CHANGED: u16 = 4;
const KEY_VELOCITY: u16 = 5;
const NORMALIZE_VELOCITY: u16 = 6;

pub(super) fn types() -> Vec<NodeType> {
    vec![
        spline::<f32>("SplineScalarInterpolator", "A number that follows key frames without corners."),
        spline::<Vec2>("SplinePositionInterpolator2D", "A place in a plane that follows key frames without corners."),
        spline::<Vec3>("SplinePositionInterpolator", "A place that follows key frames without corners."),
        squad(),
        ease(),
    ]
}

fn fraction() -> Field {
    Field::new("set_fraction", 0.0f32)
        .on_set(SetRule::Pulse)
        .doc("Where between the keys; beyond the ends the end's value holds.")
}

fn key() -> Field {
    Field::many::<f32>("key").doc("Fractions or seconds, ascending.")
}

fn declare<T: FieldValue>(name: &str, doc: &str) -> NodeType
where
    Arc<[T]>: FieldValue,
{
    NodeType::new(name, doc)
        .field(fraction())
        .field(key())
        .field(Field::many::<T>("key_value").doc("The value at each key."))
        .field(Field::new("closed", false).doc("The end goes on into the beginning, if both have the same value."))
        .field(Field::new("value_changed", T::empty()).output().doc("The value; written from the first `set_fraction` on."))
}

fn spline<T: FieldValue + Glide<Step = T> + Mul<f32, Output = T> + Default>(name: &str, doc: &str) -> NodeType
where
    Arc<[T]>: FieldValue,
{
    declare::<T>(name, doc)
        .field(
            Field::many::<T>("key_velocity")
                .doc("The velocity at each key, or at the first and the last, or none: then as of Catmull and Rom."),
        )
        .field(
            Field::new("normalize_velocity", false).doc("Velocities give directions only; the speed is the length of the way."),
        )
        .evaluate(|evaluation| {
            let value = prepare::<T>(evaluation, true).and_then(|span| {
                let path = Path {
                    keys: evaluation.read::<Arc<[f32]>>(KEY)?,
                    values: evaluation.read::<Arc<[T]>>(KEY_VALUE)?,
                    velocities: evaluation.read::<Arc<[T]>>(KEY_VELOCITY)?,
                    closed: *evaluation.read(CLOSED)?,
                    normalized: *evaluation.read(NORMALIZE_VELOCITY)?,
                };
                Some(path.sample(span))
            });
            if let Some(value) = value {
                evaluation.set(VALUE_CHANGED, value);
            }
        })
}

/// Where the fraction lies, if there is anything to compute. What is wrong with keys is reported when they were written.
fn prepare<T>(evaluation: &mut Evaluation<'_>, velocities: bool) -> Option<Span>
where
    Arc<[T]>: FieldValue,
{
    let last = if velocities { NORMALIZE_VELOCITY } else { CLOSED };
    let new_keys = (KEY..=last).any(|index| index != VALUE_CHANGED && evaluation.changed(index));
    let fraction: f32 = evaluation.get(SET_FRACTION);
    let keys = evaluation.read::<Arc<[f32]>>(KEY)?;
    let values = evaluation.read::<Arc<[T]>>(KEY_VALUE)?.len();
    let given = if velocities { evaluation.read::<Arc<[T]>>(KEY_VELOCITY)?.len() } else { 0 };
    let few = !matches!(given, 0 | 2) && given != keys.len();
    let count = keys.len();
    let wrong = fault(keys, values, Some(1), 1).map(|wrong| (KEY, wrong)).or_else(|| {
        few.then(|| (KEY_VELOCITY, format!("there are {given} velocities for {count} keys: give none, two, or {count}")))
    });
    let span = span(keys, fraction);
    if let Some((field, wrong)) = wrong {
        if new_keys {
            evaluation.report_field(field, wrong);
        }
        return None;
    }
    span.filter(|_| evaluation.written(SET_FRACTION) && (new_keys || evaluation.changed(SET_FRACTION)))
}

/// Values at keys, and how fast they are passed.
struct Path<'a, T> {
    keys: &'a [f32],
    values: &'a [T],
    velocities: &'a [T],
    closed: bool,
    normalized: bool,
}

impl<T: Glide<Step = T> + Mul<f32, Output = T> + Default> Path<'_, T> {
    fn sample(&self, span: Span) -> T {
        if span.from == span.to {
            return self.values[span.from];
        }
        let [leaving, arriving] = [span.from, span.to].map(|key| self.tangent(key, span.length));
        hermite([self.values[span.from], leaving, self.values[span.to], arriving], span.share, 1.0)
    }

    /// The tangent at a key, for a side of it that is so long. Longer spans have longer tangents, so that the speed does not jump at the key.
    fn tangent(&self, key: usize, length: f32) -> T {
        let last = self.keys.len() - 1;
        let inside = key > 0 && key < last;
        let closed = self.closed && self.velocities.is_empty() && self.values[0].distance(self.values[last]) == 0.0;
        let (before, after) = if inside { (key - 1, key + 1) } else { (last - 1, 1) };
        let velocity = match self.velocities.len() {
            count if count == last + 1 => self.velocities[key],
            2 if !inside => self.velocities[(key == last) as usize],
            _ if inside || closed => self.values[after].minus(self.values[before]) * 0.5,
            _ => return T::default(),
        };
        let velocity = if self.normalized && !self.velocities.is_empty() { self.at_even_speed(velocity) } else { velocity };
        let both = if inside {
            self.keys[after] - self.keys[before]
        } else if closed {
            self.keys[1] - self.keys[0] + self.keys[last] - self.keys[last - 1]
        } else {
            2.0 * length
        };
        if both > 0.0 { velocity * (2.0 * length / both) } else { T::default() }
    }

    fn at_even_speed(&self, velocity: T) -> T {
        let way: f32 = self.values.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        let speed = T::length(velocity);
        if speed > 0.0 { velocity * (way / speed) } else { velocity }
    }
}

/// Spherical cubic interpolation (Shoemake 1987).
fn squad() -> NodeType {
    declare::<Quat>("SquadOrientationInterpolator", "A rotation that follows key frames without corners.").evaluate(
        |evaluation| {
            let value = prepare::<Quat>(evaluation, false).and_then(|span| {
                let values = evaluation.read::<Arc<[Quat]>>(KEY_VALUE)?;
                Some(squad_between(values, *evaluation.read(CLOSED)?, span))
            });
            if let Some(value) = value {
                evaluation.set(VALUE_CHANGED, value);
            }
        },
    )
}

fn squad_between(values: &[Quat], closed: bool, span: Span) -> Quat {
    if span.from == span.to || span.share == 0.0 {
        return values[span.from];
    }
    if span.share == 1.0 {
        return values[span.to];
    }
    let last = values.len() - 1;
    let closed = closed && Blend::distance(values[0], values[last]) < 1e-3;
    let inner = |key: usize| {
        let here = unit(values[key]);
        let (before, after) = match key {
            0 if closed => (last - 1, 1),
            _ if key == last && closed => (last - 1, 1),
            0 => return here,
            _ if key == last => return here,
            _ => (key - 1, key + 1),
        };
        let steps = [before, after].map(|other| here.inverse() * near(unit(values[other]), here)).map(Quat::to_scaled_axis);
        here * Quat::from_scaled_axis((steps[0] + steps[1]) * -0.25)
    };
    let from = unit(values[span.from]);
    let to = near(unit(values[span.to]), from);
    let (leaving, arriving) = (inner(span.from), near(inner(span.to), from));
    let t = span.share;
    let (outer, middle) = (from.slerp(to, t), leaving.slerp(near(arriving, leaving), t));
    unit(outer.slerp(near(middle, outer), 2.0 * t * (1.0 - t)))
}

/// Of the two quaternions of a rotation the one that is nearer.
fn near(quat: Quat, other: Quat) -> Quat {
    if quat.dot(other) < 0.0 { -quat } else { quat }
}

/// X3D 4 section 19.4.4.
fn ease() -> NodeType {
    NodeType::new("EaseInEaseOut", "Makes a fraction leave keys slowly and arrive at keys slowly; goes before an interpolator.")
        .field(fraction())
        .field(key())
        .field(
            Field::many::<Vec2>("ease_in_ease_out")
                .doc("For each key the share of the way before it that slows down, and of the way behind it that speeds up."),
        )
        .field(Field::new("modified_fraction_changed", 0.0f32).on_set(SetRule::Pulse).output().doc("The fraction with ease."))
        .evaluate(|evaluation| {
            let new_keys = evaluation.changed(1) || evaluation.changed(2);
            let fraction: f32 = evaluation.get(SET_FRACTION);
            let (Some(keys), Some(eases)) = (evaluation.read::<Arc<[f32]>>(1), evaluation.read::<Arc<[Vec2]>>(2)) else { return };
            if let Some(fault) = fault(keys, eases.len(), Some(1), 1) {
                if new_keys {
                    evaluation.report_field(KEY, fault.replace("key_values", "eases"));
                }
                return;
            }
            let eased = span(keys, fraction).map(|span| {
                let share = if span.from == span.to { 0.0 } else { eased(span.share, eases[span.from].y, eases[span.to].x) };
                keys[span.from] + share * span.length
            });
            if let Some(eased) = eased
                && evaluation.changed(SET_FRACTION)
            {
                evaluation.set(3, eased);
            }
        })
}

/// A way that speeds up over its first share and slows down over its last.
fn eased(share: f32, out: f32, into: f32) -> f32 {
    let (out, into) = (out.max(0.0), into.max(0.0));
    let sum = out + into;
    if sum == 0.0 || !sum.is_finite() {
        return share;
    }
    let (out, into) = if sum > 1.0 { (out / sum, into / sum) } else { (out, into) };
    let speed = 1.0 / (2.0 - out - into);
    if share < out {
        speed / out * share * share
    } else if share <= 1.0 - into {
        speed * (2.0 * share - out)
    } else {
        1.0 - speed / into * (1.0 - share) * (1.0 - share)
    }
}
