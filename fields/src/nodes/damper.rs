//! Dampers: a value that glides to where it should be, at any frame rate in the same time (X3D 4 section 39).
//!
//! A damper of order n is n low passes behind each other. What they do in a time without a new destination is computed exactly:
//! with x = t / tau, stage i is off by exp(-x) times the sum over k < i of x^k / k! times what stage i - k was off by.

use std::sync::Arc;

use glam::{Quat, Vec2, Vec3};

use super::blend::{Blend, Glide};
use super::followed::{Followed, start};
use crate::{Color, Evaluation, Field, FieldValue, NodeType, SetRule, Time};

const SET_DESTINATION: u16 = 0;
const TAU: u16 = 1;
const TOLERANCE: u16 = 2;
const VALUE_CHANGED: u16 = 3;
const IS_ACTIVE: u16 = 4;
const TIME: u16 = 5;
const ORDER: u16 = 6;
const SET_VALUE: u16 = 7;
const INITIAL_VALUE: u16 = 8;
const INITIAL_DESTINATION: u16 = 9;
const STAGES: u16 = 10;

pub(super) fn types() -> Vec<NodeType> {
    vec![
        damper::<f32>("ScalarDamper", "A number that glides.").alias("Damper"),
        damper::<Vec2>("PositionDamper2D", "A place in a plane that glides."),
        damper::<Vec3>("PositionDamper", "A place that glides; for trackers that jitter."),
        damper::<Quat>("OrientationDamper", "A rotation that glides; for trackers that jitter."),
        damper::<Color>("ColorDamper", "A color that glides."),
        damper::<Arc<[Vec3]>>("CoordinateDamper", "Vertices that glide."),
        damper::<Arc<[Vec2]>>("TexCoordDamper2D", "Texture coordinates that glide."),
    ]
}

fn damper<V: Followed>(name: &str, doc: &str) -> NodeType {
    NodeType::new(name, doc)
        .field(
            Field::new("set_destination", V::empty())
                .on_set(SetRule::Pulse)
                .doc("Where to glide to; without an initial value the first is taken at once."),
        )
        .field(
            Field::new("tau", 0.3f32)
                .unit("s")
                .range(0.0, 1e6)
                .doc("After this time 1/e of the way is left, for each order; 0 does not glide."),
        )
        .field(Field::new("tolerance", 1e-4f32).range(0.0, f64::INFINITY).doc("So near it jumps to the destination and rests."))
        .field(Field::new("value_changed", V::empty()).on_set(SetRule::Pulse).output().doc("Where it is."))
        .field(Field::new("is_active", false).output().doc("Whether it moves."))
        .field(Field::new("time", Time(0.0)).unit("s").output().doc("When it last moved."))
        .field(
            Field::new("order", 3i32)
                .range(0.0, 5.0)
                .doc("How smoothly it sets out: 0 jumps, 1 starts at full speed, 2 and more slowly."),
        )
        .field(Field::new("set_value", V::empty()).on_set(SetRule::Pulse).doc("Jumps there, and glides on from there."))
        .field(Field::new("initial_value", V::empty()).on_set(SetRule::Pulse).doc("Where it is at first."))
        .field(Field::new("initial_destination", V::empty()).on_set(SetRule::Pulse).doc("Where it glides to at first."))
        .field(Field::new("stages", V::Items::empty()).output().doc("Where each order is, one after the other."))
        .evaluate(evaluate::<V>)
}

fn evaluate<V: Followed>(evaluation: &mut Evaluation<'_>) {
    let Some((destination, jump)) =
        start::<V>(evaluation, [SET_DESTINATION, SET_VALUE, INITIAL_VALUE, INITIAL_DESTINATION, VALUE_CHANGED])
    else {
        return;
    };
    let now = evaluation.time();
    let goal = destination.items();
    let order = evaluation.get::<i32>(ORDER).clamp(0, 5) as usize;
    let (tau, tolerance): (f32, f32) = (evaluation.get(TAU), evaluation.get(TOLERANCE));
    let was_active = evaluation.get::<bool>(IS_ACTIVE);
    let passed_s = if was_active { (now - evaluation.get::<Time>(TIME).0).max(0.0) } else { 0.0 };
    let value: V = jump.unwrap_or_else(|| evaluation.get(VALUE_CHANGED));
    let held: V::Items = evaluation.get(STAGES);
    let fits = value.items().len() == goal.len() && order > 0 && tau > 0.0;
    // The stages that stand where the value is, if they are those of this value.
    let current = held.len() == order * goal.len() && same_place(held.get((order.max(1) - 1) * goal.len()..), value.items());
    let stages: Vec<V::Item> = match (fits, current) {
        (false, _) => Vec::new(),
        (true, true) => held.to_vec(),
        (true, false) => value.items().repeat(order),
    };
    let glided = glide(&stages, goal, order, (passed_s / tau as f64) as f32);
    let pairs = glided.chunks(goal.len().max(1)).flat_map(|stage| stage.iter().zip(goal));
    let mut away = pairs.map(|(item, goal)| item.distance(*goal));
    // No way leads to or from infinity: there it jumps.
    let moves = away.any(|away| away > tolerance && away < f32::INFINITY);
    if moves {
        evaluation.set(VALUE_CHANGED, V::of(&glided[(order - 1) * goal.len()..]));
        evaluation.set::<V::Items>(STAGES, glided.into());
        evaluation.again();
    } else {
        evaluation.set(STAGES, V::Items::from(goal.repeat(order)));
        evaluation.set(VALUE_CHANGED, destination);
    }
    evaluation.set(IS_ACTIVE, moves);
    evaluation.set(TIME, Time(now));
}

fn same_place<T: Blend>(stage: Option<&[T]>, value: &[T]) -> bool {
    stage.is_some_and(|stage| stage.len() == value.len() && stage.iter().zip(value).all(|(a, b)| a.distance(*b) == 0.0))
}

/// All stages after a time, in which the goal stood still; `x` in units of tau.
fn glide<T: Glide>(stages: &[T], goal: &[T], order: usize, x: f32) -> Vec<T> {
    let items = goal.len();
    let left = (-x).exp();
    let glided = |stage: usize, item: usize| {
        let mut share = left;
        let mut off = T::Step::default();
        for back in 0..=stage {
            off = off + stages[(stage - back) * items + item].minus(goal[item]) * share;
            share *= x / (back + 1) as f32;
        }
        goal[item].plus(off)
    };
    if stages.is_empty() {
        return Vec::new();
    }
    (0..order).flat_map(|stage| (0..items).map(move |item| (stage, item))).map(|(stage, item)| glided(stage, item)).collect()
}
