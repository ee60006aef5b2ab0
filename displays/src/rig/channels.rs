//! Corners of common installations. Neighbouring screens share their corners bit by bit.

use super::ScreenCorners;
use glam::Vec3;

/// Three walls and the floor of a room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Left wall.
    pub left: ScreenCorners,
    /// Front wall.
    pub front: ScreenCorners,
    /// Right wall.
    pub right: ScreenCorners,
    /// Floor; its upper edge is at the front wall.
    pub floor: ScreenCorners,
}

/// A room open to the back, metres: the floor is centred at the origin, the front wall is at `z = -depth / 2`.
pub fn room_screens(width: f32, height: f32, depth: f32) -> Room {
    let (x, z) = (width * 0.5, depth * 0.5);
    let wall = |a: Vec3, b: Vec3| ScreenCorners { lower_left: a, lower_right: b, upper_left: a + Vec3::Y * height };
    let [front_left, front_right] = [Vec3::new(-x, 0.0, -z), Vec3::new(x, 0.0, -z)];
    let [back_left, back_right] = [Vec3::new(-x, 0.0, z), Vec3::new(x, 0.0, z)];
    Room {
        left: wall(back_left, front_left),
        front: wall(front_left, front_right),
        right: wall(front_right, back_right),
        floor: ScreenCorners { lower_left: back_left, lower_right: back_right, upper_left: front_left },
    }
}

/// A cylinder of flat `channels`, from left to right over `total_angle_rad`, the middle one ahead (-z): chords of a circle of
/// `radius` about `centre`, which is the middle of the cylinder's height; metres. Seven channels over 270 degrees are the ship
/// simulator of 001. No channel, or channels of 180 degrees and more, give no screens.
pub fn cylinder_screens(channels: usize, total_angle_rad: f32, radius: f32, height: f32, centre: Vec3) -> Vec<ScreenCorners> {
    let step = total_angle_rad / channels as f32;
    if !(step > 0.0 && step < std::f32::consts::PI) {
        return Vec::new();
    }
    let edge = |i: usize| {
        let angle = step * i as f32 - total_angle_rad * 0.5;
        centre + Vec3::new(radius * angle.sin(), -height * 0.5, -radius * angle.cos())
    };
    let up = Vec3::Y * height;
    (0..channels).map(|i| ScreenCorners { lower_left: edge(i), lower_right: edge(i + 1), upper_left: edge(i) + up }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::off_axis;

    #[test]
    fn seven_channels_look_outwards_from_the_centre() {
        let centre = Vec3::new(1.0, 1.2, -2.0);
        let screens = cylinder_screens(7, 270f32.to_radians(), 3.0, 2.0, centre);
        assert_eq!(screens.len(), 7);
        let half = (270f32 / 14.0).to_radians();
        for (i, screen) in screens.iter().enumerate() {
            let (view, f) = off_axis(centre, screen, 0.1).unwrap();
            // Each channel is symmetric from the centre and spans its share of the angle.
            assert!((f.right / f.near - half.tan()).abs() < 1e-5 && (f.left + f.right).abs() < 1e-6);
            let yaw = (i as f32 - 3.0) * half * 2.0;
            let ahead = centre + Vec3::new(yaw.sin(), 0.0, -yaw.cos());
            assert!(view.transform_point3(ahead).abs_diff_eq(Vec3::NEG_Z, 1e-5), "channel {i}");
        }
    }

    #[test]
    fn no_sensible_channels_are_none() {
        for (channels, angle) in [(0, 1.0), (1, 3.2), (2, 0.0), (2, f32::NAN), (3, -1.0)] {
            assert!(cylinder_screens(channels, angle, 1.0, 1.0, Vec3::ZERO).is_empty(), "{channels} {angle}");
        }
    }
}
