//! What mouse and keys can do.

use glam::{Vec2, Vec3};
use umbriel_scene::View;

/// How mouse and keys are understood.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Not at all.
    None,
    /// The world turns about a centre: drag to orbit, drag with the right or middle button to pan, wheel to zoom.
    #[default]
    Examine,
    /// Keys fly where the view looks; drag to look around.
    Fly,
    /// Keys walk on the level; drag to look around.
    Walk,
}

impl Input<'_> {
    pub(super) fn is_finite(&self) -> bool {
        match *self {
            Input::Drag { pixels, .. } => pixels.is_finite(),
            Input::Wheel { notches, .. } => notches.is_finite(),
            Input::Keys { direction, haste, dt_s, .. } => direction.is_finite() && haste.is_finite() && dt_s.is_finite(),
        }
    }
}

impl Mode {
    /// The choices of the field `mode`, as they are spelled.
    pub const NAMES: [(&'static str, Mode); 4] =
        [("none", Mode::None), ("examine", Mode::Examine), ("fly", Mode::Fly), ("walk", Mode::Walk)];
}

/// A button of the mouse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    /// Orbits, or looks around.
    Left,
    /// Pans.
    Middle,
    /// Pans.
    Right,
}

/// What was done with mouse or keys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input<'a> {
    /// The mouse moved by `pixels` (x to the right, y down) with a button held.
    Drag {
        /// Which button.
        button: Button,
        /// How far.
        pixels: Vec2,
        /// Over what.
        view: &'a View,
    },
    /// The wheel turned; up is positive.
    Wheel {
        /// How far.
        notches: f32,
        /// Over what.
        view: &'a View,
    },
    /// Keys are held since `dt_s` seconds.
    Keys {
        /// Each from -1 to 1: x to the right, y up, z back.
        direction: Vec3,
        /// Times the usual speed.
        haste: f32,
        /// Since when, seconds.
        dt_s: f32,
        /// What leads ahead.
        view: &'a View,
    },
}
