//! Where the eyes of a user are.

use glam::{Quat, Vec3};

/// Which eye a view is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Eye {
    /// Between the eyes: one picture for both.
    Middle,
    /// The left one.
    Left,
    /// The right one.
    Right,
}

impl Eye {
    /// One eye, or the left and the right one.
    pub fn of(stereo: bool) -> &'static [Eye] {
        if stereo { &[Eye::Left, Eye::Right] } else { &[Eye::Middle] }
    }

    /// `name`, or `name.left` and `name.right`.
    pub fn name_of_view(self, name: &str) -> String {
        match self {
            Eye::Middle => name.to_owned(),
            Eye::Left => format!("{name}.left"),
            Eye::Right => format!("{name}.right"),
        }
    }
}

/// A head in the room: at its middle between the eyes, looking along -z, with +x to its right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Head {
    /// Metres.
    pub position: Vec3,
    /// `room_from_head`.
    pub orientation: Quat,
    /// From pupil to pupil, metres.
    pub eye_distance: f32,
}

impl Default for Head {
    /// A standing person at the room's origin.
    fn default() -> Head {
        Head { position: Vec3::new(0.0, 1.7, 0.0), orientation: Quat::IDENTITY, eye_distance: 0.064 }
    }
}

impl Head {
    /// Place of an eye in the room.
    pub fn eye(&self, eye: Eye) -> Vec3 {
        let side = match eye {
            Eye::Middle => 0.0,
            Eye::Left => -0.5,
            Eye::Right => 0.5,
        };
        self.position + self.orientation * Vec3::X * (side * self.eye_distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{off_axis, room_screens};
    use glam::{Vec2, Vec3Swizzles};

    #[test]
    fn the_left_eye_sees_what_is_near_further_right() {
        let front = room_screens(3.0, 3.0, 3.0).front;
        let head = Head { position: Vec3::new(0.2, 1.6, 0.4), orientation: Quat::IDENTITY, eye_distance: 0.064 };
        let x_of = |eye: Eye, p: Vec3| {
            let (view, frustum) = off_axis(head.eye(eye), &front, 0.1).unwrap();
            (frustum.clip_from_view() * view).project_point3(p).xy()
        };
        for (p, sign) in [([0.2, 1.6, -0.6], 1.0), ([0.2, 1.6, -1.5], 0.0), ([0.2, 1.6, -9.0], -1.0)] {
            let p = Vec3::from(p);
            let Vec2 { x, y } = x_of(Eye::Left, p) - x_of(Eye::Right, p);
            assert!(if sign == 0.0 { x.abs() < 1e-5 } else { x * sign > 1e-3 }, "{p}: {x}");
            assert!(y.abs() < 1e-5);
        }
    }

    #[test]
    fn a_turned_head_turns_its_eyes() {
        let head =
            Head { position: Vec3::Y, orientation: Quat::from_rotation_y(std::f32::consts::FRAC_PI_2), eye_distance: 0.06 };
        assert!(head.eye(Eye::Left).abs_diff_eq(Vec3::new(0.0, 1.0, 0.03), 1e-6));
        assert!(head.eye(Eye::Right).abs_diff_eq(Vec3::new(0.0, 1.0, -0.03), 1e-6));
        assert_eq!(head.eye(Eye::Middle), Vec3::Y);
    }
}
