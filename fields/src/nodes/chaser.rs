//! Chasers: a value that reaches each destination a fixed time after it was told of it (X3D 4 section 39).
//!
//! Each new destination starts a step of its own, from the destination before it, as half a wave of the cosine; the value is the sum of all
//! steps that are under way.

use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};

use super::blend::Glide;
use super::followed::{Followed, start};
use crate::{Color, Evaluation, Field, FieldValue, NodeType, SetRule, Time};

const SET_DESTINATION: u16 = 0;
const DURATION: u16 = 1;
const SET_VALUE: u16 = 2;
const VALUE_CHANGED: u16 = 3;
const IS_ACTIVE: u16 = 4;
const INITIAL_VALUE: u16 = 5;
const INITIAL_DESTINATION: u16 = 6;
const STEPS: u16 = 7;
const STEP_TIMES: u16 = 8;

/// A destination that comes sooner than this share of the duration after another takes its place: it has hardly begun. So there are never more
/// steps than the inverse.
const SHORTEST: f64 = 1.0 / 64.0;

pub(super) fn types() -> Vec<NodeType> {
    vec![
        chaser::<f32>("ScalarChaser", "A number that arrives in a fixed time."),
        chaser::<Vec2>("PositionChaser2D", "A place in a plane that arrives in a fixed time."),
        chaser::<Vec3>("PositionChaser", "A place that arrives in a fixed time."),
        chaser::<Quat>("OrientationChaser", "A rotation that arrives in a fixed time."),
        chaser::<Color>("ColorChaser", "A color that arrives in a fixed time."),
        chaser::<Arc<[Vec3]>>("CoordinateChaser", "Vertices that arrive in a fixed time."),
        chaser::<Arc<[Vec2]>>("TexCoordChaser2D", "Texture coordinates that arrive in a fixed time."),
    ]
}

fn chaser<V: Followed>(name: &str, doc: &str) -> NodeType {
    NodeType::new(name, doc)
        .field(
            Field::new("set_destination", V::empty())
                .on_set(SetRule::Pulse)
                .doc("Where to go; without an initial value the first is taken at once."),
        )
        .field(Field::new("duration", Time(1.0)).unit("s").range(0.0, 1e6).doc("How long after its destination it arrives."))
        .field(Field::new("set_value", V::empty()).on_set(SetRule::Pulse).doc("Jumps there, and goes on from there."))
        .field(Field::new("value_changed", V::empty()).on_set(SetRule::Pulse).output().doc("Where it is."))
        .field(Field::new("is_active", false).output().doc("Whether it moves."))
        .field(Field::new("initial_value", V::empty()).on_set(SetRule::Pulse).doc("Where it is at first."))
        .field(Field::new("initial_destination", V::empty()).on_set(SetRule::Pulse).doc("Where it goes at first."))
        .field(
            Field::new("steps", V::Items::empty())
                .output()
                .doc("Where it comes from, and the destinations that it has not reached."),
        )
        .field(Field::many::<Time>("step_times").unit("s").output().doc("When it was told of each of them."))
        .evaluate(evaluate::<V>)
}

fn evaluate<V: Followed>(evaluation: &mut Evaluation<'_>) {
    let Some((destination, jump)) =
        start::<V>(evaluation, [SET_DESTINATION, SET_VALUE, INITIAL_VALUE, INITIAL_DESTINATION, VALUE_CHANGED])
    else {
        return;
    };
    let now = evaluation.time();
    let duration = evaluation.get::<Time>(DURATION).0;
    let goal = destination.items();
    let (held, times): (V::Items, Arc<[Time]>) = (evaluation.get(STEPS), evaluation.get(STEP_TIMES));
    let told = jump.is_some() || evaluation.changed(SET_DESTINATION);
    let (mut steps, mut times) = match &jump {
        Some(from) => (from.items().to_vec(), Vec::new()),
        None => (held.to_vec(), times.to_vec()),
    };
    if steps.len() != (times.len() + 1) * goal.len() {
        // Another number of items, or none yet: there is no way from the one to the other.
        (steps, times) = (goal.to_vec(), Vec::new());
    } else if told {
        if times.last().is_some_and(|last| now - last.0 < duration * SHORTEST) {
            steps.truncate(times.len() * goal.len());
        } else {
            times.push(Time(now));
        }
        steps.extend_from_slice(goal);
    }
    let reached = times.iter().take_while(|time| now - time.0 >= duration).count();
    steps.drain(..reached * goal.len());
    times.drain(..reached);
    let value = sum(&steps, goal.len(), times.iter().map(|time| ((now - time.0) / duration) as f32));
    evaluation.set(VALUE_CHANGED, V::of(&value));
    evaluation.set(IS_ACTIVE, !times.is_empty());
    if !times.is_empty() {
        evaluation.again();
    }
    evaluation.set::<V::Items>(STEPS, steps.into());
    evaluation.set::<Arc<[Time]>>(STEP_TIMES, times.into());
}

/// Where the steps lead together, each of which is under way for a share of its time.
fn sum<T: Glide>(steps: &[T], items: usize, shares: impl Iterator<Item = f32>) -> Vec<T> {
    let mut value = steps[..items].to_vec();
    for (number, share) in shares.enumerate() {
        let way = 0.5 - 0.5 * (std::f32::consts::PI * share.clamp(0.0, 1.0)).cos();
        let (from, to) = (&steps[number * items..], &steps[(number + 1) * items..]);
        for (item, value) in value.iter_mut().enumerate() {
            *value = value.plus(to[item].minus(from[item]) * way);
        }
    }
    value
}
