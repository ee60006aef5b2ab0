//! Cameras of a desktop: from a viewpoint, or from where a model is seen well.

use super::{Eye, ScreenCorners, off_axis};
use crate::rig::RigError;
use glam::{Mat4, Quat, Vec3};
use umbriel_scene::{Aabb, Frustum};

/// A camera that stands in the room, as a desktop window shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands; rigid.
    pub room_from_camera: Mat4,
    /// Whole vertical angle.
    pub fov_rad: f32,
    /// Distance of the near plane, metres.
    pub near: f32,
}

/// Distance of the window of a stereo camera in eye distances: the thirtieth of stereo photography.
const WINDOW_IN_EYE_DISTANCES: f32 = 30.0;

impl Camera {
    /// What it sees through a window of `size` pixels with both eyes together.
    pub fn frustum(&self, size: [u32; 2]) -> Frustum {
        Frustum::symmetric(self.fov_rad, size[0].max(1) as f32 / size[1].max(1) as f32, self.near)
    }

    /// `view_from_room` and frustum of one eye. The eyes are `eye_distance` metres apart and look through one window, thirty
    /// times as far away.
    ///
    /// # Errors
    /// Numbers that are not finite, a near plane that is not positive, a field of view that is none.
    pub fn eye(&self, eye: Eye, eye_distance: f32, size: [u32; 2]) -> Result<(Mat4, Frustum), RigError> {
        if !self.room_from_camera.is_finite() {
            return Err(RigError::NotFinite);
        }
        if !(self.fov_rad > 0.0 && self.fov_rad < std::f32::consts::PI) {
            return Err(RigError::FieldOfView { fov_rad: self.fov_rad });
        }
        if !(self.near.is_finite() && self.near > 0.0) {
            return Err(RigError::Near { near: self.near });
        }
        let side = match eye {
            Eye::Middle => return Ok((self.room_from_camera.inverse(), self.frustum(size))),
            Eye::Left => -0.5,
            Eye::Right => 0.5,
        };
        let window = eye_distance * WINDOW_IN_EYE_DISTANCES;
        let f = self.frustum(size);
        let corner = |x: f32, y: f32| self.room_from_camera.transform_point3(Vec3::new(x, y, -self.near) * (window / self.near));
        let screen = ScreenCorners {
            lower_left: corner(f.left, f.bottom),
            lower_right: corner(f.right, f.bottom),
            upper_left: corner(f.left, f.top),
        };
        off_axis(self.room_from_camera.transform_point3(Vec3::X * (side * eye_distance)), &screen, self.near)
    }
}

/// A three-quarter view of everything in `bounds` from a little above, for a window of `aspect` (width over height). The
/// camera is never below the floor of the box. Nothing to see: a person at the origin's edge, looking at it.
pub fn fit_camera(bounds: &Aabb, fov_rad: f32, aspect: f32) -> Camera {
    let bounds =
        if bounds.is_empty() { Aabb { min: Vec3::new(-1.0, 0.0, -1.0), max: Vec3::new(1.0, 2.0, 1.0) } } else { *bounds };
    let size = bounds.max - bounds.min;
    let footprint = size.x.hypot(size.z);
    // Flat things are seen from higher up than tall ones.
    let elevation_rad = if footprint > 0.0 { (0.6 - 0.35 * size.y / footprint).clamp(0.2, 0.6) } else { 0.2 };
    let rotation = Quat::from_rotation_y(0.55) * Quat::from_rotation_x(-elevation_rad);
    let tan_y = (fov_rad * 0.5).tan();
    let tan_x = tan_y * aspect;
    let centre = bounds.centre();
    let room = bounds.corners().map(|c| rotation.inverse() * (c - centre));
    // Each corner tells how far away the camera must be for it to be inside the frustum; a tenth is left as a margin.
    let distance = room.iter().map(|p| p.z + (p.x.abs() / tan_x).max(p.y.abs() / tan_y) * 1.1).fold(0.0, f32::max).max(1e-3);
    let nearest = room.iter().map(|p| distance - p.z).fold(f32::INFINITY, f32::min);
    Camera {
        room_from_camera: Mat4::from_rotation_translation(rotation, centre + rotation * Vec3::Z * distance),
        fov_rad,
        // Close enough that zooming in cuts nothing for a long time.
        near: (nearest * 0.02).clamp(distance * 1e-4, 0.1_f32.max(distance * 1e-3)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_inside_and_large() {
        let boxes = [
            ([-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]),
            ([100.0, 5.0, -3.0], [100.1, 5.02, -2.9]),
            ([-5000.0, -10.0, -300.0], [5000.0, 80.0, 300.0]),
            ([-50.0, 0.0, -50.0], [50.0, 0.0, 50.0]),
            ([0.0, 0.0, 0.0], [0.2, 40.0, 0.2]),
        ];
        for (min, max) in boxes {
            for size in [[1280, 720], [256, 256], [400, 900]] {
                let bounds = Aabb { min: min.into(), max: max.into() };
                let camera = fit_camera(&bounds, 0.8, size[0] as f32 / size[1] as f32);
                let (view, frustum) = camera.eye(Eye::Middle, 0.0, size).unwrap();
                let clip = frustum.clip_from_view() * view;
                let mut reach: f32 = 0.0;
                for corner in bounds.corners() {
                    let p = clip * corner.extend(1.0);
                    assert!(p.w > camera.near, "{min:?} {size:?}: behind the near plane");
                    reach = reach.max((p.x / p.w).abs()).max((p.y / p.w).abs());
                }
                assert!((0.7..1.0).contains(&reach), "{min:?} {size:?}: reaches {reach}");
                let eye = camera.room_from_camera.w_axis.y;
                assert!(eye > bounds.centre().y, "{min:?}: looks up");
            }
        }
    }

    #[test]
    fn nothing_is_seen_from_a_finite_place() {
        let camera = fit_camera(&Aabb::EMPTY, 0.8, 1.0);
        assert!(camera.room_from_camera.is_finite() && camera.near > 0.0);
    }

    #[test]
    fn stereo_eyes_meet_in_the_window() {
        let camera = Camera { room_from_camera: Mat4::from_rotation_y(0.5), fov_rad: 1.0, near: 0.05 };
        let at = |eye: Eye, z: f32| {
            let (view, f) = camera.eye(eye, 0.06, [300, 200]).unwrap();
            (f.clip_from_view() * view).project_point3(camera.room_from_camera.transform_point3(Vec3::new(0.1, 0.2, z)))
        };
        assert!((at(Eye::Left, -1.8).x - at(Eye::Right, -1.8).x).abs() < 1e-5);
        assert!(at(Eye::Left, -0.9).x > at(Eye::Right, -0.9).x + 1e-3);
        assert!(at(Eye::Left, -9.0).x < at(Eye::Right, -9.0).x - 1e-3);
    }
}
