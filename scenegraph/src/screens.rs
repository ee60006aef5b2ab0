//! Screens in a room, and those of common installations. Neighbouring screens share their corners bit by bit.

use glam::Vec3;

/// A flat rectangular screen, by three of its corners in the room, metres. Seen from the front, `lower_right` is to the
/// right of `lower_left`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenCorners {
    /// Lower left corner.
    pub lower_left: Vec3,
    /// Lower right corner.
    pub lower_right: Vec3,
    /// Upper left corner.
    pub upper_left: Vec3,
}

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

    #[test]
    fn no_sensible_channels_are_none() {
        for (channels, angle) in [(0, 1.0), (1, 3.2), (2, 0.0), (2, f32::NAN), (3, -1.0)] {
            assert!(cylinder_screens(channels, angle, 1.0, 1.0, Vec3::ZERO).is_empty(), "{channels} {angle}");
        }
    }
}
