//! Screens of common installations, as nodes.

use glam::Vec3;
use rhai::{Array, Dynamic, Map, NativeCallContext};
use umbriel_scenegraph::screens::{ScreenCorners, cylinder_screens, room_screens};

use super::Words;
use super::nodes::make_with;
use super::vectors::component;
use crate::error::{Outcome, fail};
use crate::stage::Stage;

pub(super) fn teach(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "cylinder_screens(channels: int, angle: number, radius: number, height: number, middle: number) -> array",
        "Flat Screens around the origin from left to right, edge to edge, over an angle in radians; `middle` is the height of their \
         middle. Seven over 270 degrees are the ship simulator of 001.",
        move |context: NativeCallContext<'_>, channels: i64, angle: Dynamic, radius: Dynamic, height: Dynamic, middle: Dynamic| -> Outcome<Array> {
            let [angle, radius, height, middle] =
                [component(&angle)?, component(&radius)?, component(&height)?, component(&middle)?];
            let screens = match usize::try_from(channels) {
                Ok(channels @ 1..=64) => cylinder_screens(channels, angle, radius, height, Vec3::Y * middle),
                _ => Vec::new(),
            };
            if screens.is_empty() {
                return fail("a cylinder has from 1 to 64 screens of less than 180 degrees each");
            }
            stage.making_at(context.call_position(), || screens.iter().map(|corners| screen(&stage, corners)).collect())
        },
    );
    let stage = words.stage.clone();
    words.word(
        "room_screens(width: number, height: number, depth: number) -> array",
        "Four Screens: left, front and right wall and the floor of a room that is open to the back, its floor around the origin.",
        move |context: NativeCallContext<'_>, width: Dynamic, height: Dynamic, depth: Dynamic| -> Outcome<Array> {
            let room = room_screens(component(&width)?, component(&height)?, component(&depth)?);
            let screens = [room.left, room.front, room.right, room.floor];
            stage.making_at(context.call_position(), || screens.iter().map(|corners| screen(&stage, corners)).collect())
        },
    );
}

fn screen(stage: &Stage, corners: &ScreenCorners) -> Outcome<Dynamic> {
    let ScreenCorners { lower_left, lower_right, upper_left } = *corners;
    let corners = [("lower_left", lower_left), ("lower_right", lower_right), ("upper_left", upper_left)];
    let fields: Map = corners.into_iter().map(|(name, corner)| (name.into(), Dynamic::from(corner))).collect();
    make_with(stage, "Screen", &fields).map(Dynamic::from)
}
