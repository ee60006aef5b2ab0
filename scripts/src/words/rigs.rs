//! Screens of common installations, as nodes.

use glam::Vec3;
use rhai::{Array, Dynamic, Map};

use super::Words;
use super::nodes::make_with;
use super::vectors::component;
use crate::error::{Outcome, fail};
use crate::stage::Stage;

/// Lower left, lower right, upper left.
type Corners = [Vec3; 3];

pub(super) fn teach(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "cylinder_screens(channels: int, angle: number, radius: number, height: number, middle: number) -> array",
        "Flat Screens around the origin from left to right, edge to edge, over an angle in radians; `middle` is the height of their \
         middle. Seven over 270 degrees are the ship simulator of 001.",
        move |channels: i64, angle: Dynamic, radius: Dynamic, height: Dynamic, middle: Dynamic| -> Outcome<Array> {
            let [angle, radius, height, middle] =
                [component(&angle)?, component(&radius)?, component(&height)?, component(&middle)?];
            let step = angle / channels as f32;
            if !(1..=64).contains(&channels) || !(step > 0.0 && step < std::f32::consts::PI) {
                return fail("a cylinder has from 1 to 64 screens of less than 180 degrees each");
            }
            let edge = |i: i64| {
                let at = step * i as f32 - angle * 0.5;
                Vec3::new(radius * at.sin(), middle - height * 0.5, -radius * at.cos())
            };
            let corners = |i: i64| [edge(i), edge(i + 1), edge(i) + Vec3::Y * height];
            (0..channels).map(|i| screen(&stage, corners(i))).collect()
        },
    );
    let stage = words.stage.clone();
    words.word(
        "room_screens(width: number, height: number, depth: number) -> array",
        "Four Screens: left, front and right wall and the floor of a room that is open to the back, its floor around the origin.",
        move |width: Dynamic, height: Dynamic, depth: Dynamic| -> Outcome<Array> {
            let (x, y, z) = (component(&width)? * 0.5, component(&height)?, component(&depth)? * 0.5);
            let [front_left, front_right] = [Vec3::new(-x, 0.0, -z), Vec3::new(x, 0.0, -z)];
            let [back_left, back_right] = [Vec3::new(-x, 0.0, z), Vec3::new(x, 0.0, z)];
            let wall = |a: Vec3, b: Vec3| [a, b, a + Vec3::Y * y];
            let walls = [wall(back_left, front_left), wall(front_left, front_right), wall(front_right, back_right)];
            walls.into_iter().chain([[back_left, back_right, front_left]]).map(|corners| screen(&stage, corners)).collect()
        },
    );
}

fn screen(stage: &Stage, [lower_left, lower_right, upper_left]: Corners) -> Outcome<Dynamic> {
    let corners = [("lower_left", lower_left), ("lower_right", lower_right), ("upper_left", upper_left)];
    let fields: Map = corners.into_iter().map(|(name, corner)| (name.into(), Dynamic::from(corner))).collect();
    make_with(stage, "Screen", &fields).map(Dynamic::from)
}
