//! The picture of a fixed window: what an eye sees through a screen that stands in the room.

use super::RigError;
use glam::{DMat3, DVec3, Mat4, Quat, Vec3};
use umbriel_scene::Frustum;
use umbriel_scenegraph::screens::ScreenCorners;

/// Sides may differ from a right angle by this much; wall measurements of real installations are not better.
const SKEW_MAX_RAD: f64 = 0.01;

/// Generalised perspective projection (Kooima 2009): `view_from_room` looks straight at the plane of the screen from `eye`
/// (in the room, metres), and the frustum spans exactly the screen at distance `near`.
///
/// Computed in double precision, because the result is a quotient of differences of nearly equal numbers when the eye comes
/// close to the screen.
///
/// # Errors
/// Numbers that are not finite, a near plane that is not positive, a screen without area or with corners that are no
/// rectangle, an eye in or behind the plane of the screen.
pub fn off_axis(eye: Vec3, screen: &ScreenCorners, near: f32) -> Result<(Mat4, Frustum), RigError> {
    let (right, up, normal) = basis(screen)?;
    if !eye.is_finite() {
        return Err(RigError::NotFinite);
    }
    if !(near.is_finite() && near > 0.0) {
        return Err(RigError::Near { near });
    }
    let [eye, lower_left] = [eye, screen.lower_left].map(Vec3::as_dvec3);
    let to_right = (screen.lower_right - screen.lower_left).as_dvec3().length();
    let to_top = (screen.upper_left - screen.lower_left).as_dvec3().length();
    let from_eye = lower_left - eye;
    let distance = -from_eye.dot(normal);
    if distance <= 1e-6 * to_right.max(to_top) {
        return Err(RigError::EyeNotInFront { distance_m: distance });
    }
    let scale = f64::from(near) / distance;
    let (left, bottom) = (from_eye.dot(right), from_eye.dot(up));
    let frustum = Frustum {
        left: (left * scale) as f32,
        right: ((left + to_right) * scale) as f32,
        bottom: (bottom * scale) as f32,
        top: ((bottom + to_top) * scale) as f32,
        near,
    };
    let rotation = DMat3::from_cols(right, up, normal).transpose();
    let translation = (rotation * -eye).as_vec3();
    Ok((Mat4::from_rotation_translation(Quat::from_mat3(&rotation.as_mat3()), translation), frustum))
}

/// Right, up and towards the viewer, each of length one.
fn basis(screen: &ScreenCorners) -> Result<(DVec3, DVec3, DVec3), RigError> {
    let [ll, lr, ul] = [screen.lower_left, screen.lower_right, screen.upper_left].map(Vec3::as_dvec3);
    if !(ll.is_finite() && lr.is_finite() && ul.is_finite()) {
        return Err(RigError::NotFinite);
    }
    let (across, along) = (lr - ll, ul - ll);
    let area = across.cross(along).length();
    if area <= 1e-9 * across.length_squared().max(along.length_squared()) {
        return Err(RigError::NoArea);
    }
    let (right, up) = (across.normalize(), along.normalize());
    let angle = right.dot(up).clamp(-1.0, 1.0).acos();
    if (angle - std::f64::consts::FRAC_PI_2).abs() > SKEW_MAX_RAD {
        return Err(RigError::NotRectangular { angle_deg: angle.to_degrees() });
    }
    let normal = right.cross(up).normalize();
    // What is left of a skew within the tolerance goes out of `up`, so that the basis is orthonormal.
    Ok((right, normal.cross(right), normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{cylinder_screens, room_screens};
    use glam::Vec4Swizzles;

    fn corners(c: [[f32; 3]; 3]) -> ScreenCorners {
        ScreenCorners { lower_left: c[0].into(), lower_right: c[1].into(), upper_left: c[2].into() }
    }

    fn ndc(eye: Vec3, screen: &ScreenCorners, p_in_room: Vec3) -> Vec3 {
        let (view_from_room, frustum) = off_axis(eye, screen, 0.1).unwrap();
        let p = frustum.clip_from_view() * view_from_room * p_in_room.extend(1.0);
        p.xyz() / p.w
    }

    #[test]
    fn walls_of_a_three_metre_room() {
        let rows = [
            ([[-1.5, 0., -1.5], [1.5, 0., -1.5], [-1.5, 3., -1.5]], [-0.105555556, 0.061111111, -0.094444444, 0.072222222]),
            ([[-1.5, 0., 1.5], [-1.5, 0., -1.5], [-1.5, 3., 1.5]], [-0.063157895, 0.094736842, -0.089473684, 0.068421053]),
            ([[1.5, 0., -1.5], [1.5, 0., 1.5], [1.5, 3., -1.5]], [-0.163636364, 0.109090909, -0.154545455, 0.118181818]),
            ([[-1.5, 0., 1.5], [1.5, 0., 1.5], [-1.5, 0., -1.5]], [-0.111764706, 0.064705882, -0.070588235, 0.105882353]),
        ];
        for (screen, want) in rows {
            let (_, f) = off_axis(Vec3::new(0.4, 1.7, 0.3), &corners(screen), 0.1).unwrap();
            for (got, want) in [f.left, f.right, f.bottom, f.top].into_iter().zip(want) {
                assert!((f64::from(got) - want).abs() < 1e-8, "{screen:?}: {got} is not {want}");
            }
        }
    }

    #[test]
    fn the_screen_fills_the_picture_from_anywhere() {
        let screen = corners([[-1.0, 0.5, -1.0], [0.6, 0.5, -2.2], [-1.0, 2.0, -1.0]]);
        let upper_right = screen.lower_right + screen.upper_left - screen.lower_left;
        for eye in [[0.0, 1.7, 0.0], [0.5, 0.2, 1.0], [2.0, 3.0, -1.0], [-0.5, 1.0, -1.3]] {
            let eye = Vec3::from(eye);
            for (corner, want) in [
                (screen.lower_left, [-1.0, -1.0]),
                (screen.lower_right, [1.0, -1.0]),
                (screen.upper_left, [-1.0, 1.0]),
                (upper_right, [1.0, 1.0]),
            ] {
                let got = ndc(eye, &screen, corner);
                assert!((got.truncate() - glam::Vec2::from(want)).length() < 1e-4, "{eye}: {got} is not {want:?}");
            }
        }
    }

    #[test]
    fn neighbours_share_their_edge() {
        let room = room_screens(3.0, 3.0, 3.0);
        let walls = [room.left, room.front, room.right];
        let eye = Vec3::new(0.4, 1.7, 0.3);
        let ring = cylinder_screens(7, 270f32.to_radians(), 2.0, 2.4, Vec3::new(0.0, 1.2, 0.0));
        for pair in walls.windows(2).chain(ring.windows(2)) {
            let (a, b) = (pair[0], pair[1]);
            assert_eq!(a.lower_right, b.lower_left);
            for t in [0.0, 0.3, 1.0] {
                let p = b.lower_left.lerp(b.upper_left, t);
                let (in_a, in_b) = (ndc(eye, &a, p), ndc(eye, &b, p));
                assert!((in_a.x - 1.0).abs() < 1e-5 && (in_b.x + 1.0).abs() < 1e-5, "{in_a} {in_b}");
                assert!((in_a.y - in_b.y).abs() < 1e-5, "{in_a} {in_b}");
            }
        }
        // The floor meets the front wall along its upper edge.
        for t in [0.0, 0.3, 1.0] {
            let p = room.front.lower_left.lerp(room.front.lower_right, t);
            let (on_wall, on_floor) = (ndc(eye, &room.front, p), ndc(eye, &room.floor, p));
            assert!((on_wall.y + 1.0).abs() < 1e-5 && (on_floor.y - 1.0).abs() < 1e-5);
            assert!((on_wall.x - on_floor.x).abs() < 1e-5);
        }
    }

    #[test]
    fn moving_the_world_is_moving_the_room_the_other_way() {
        let world_from_room = Mat4::from_rotation_translation(Quat::from_rotation_y(0.8), Vec3::new(3.0, 1.0, -7.0));
        let eye = Vec3::new(0.4, 1.7, 0.3);
        let in_room = room_screens(3.0, 3.0, 3.0).left;
        let carried = ScreenCorners {
            lower_left: world_from_room.transform_point3(in_room.lower_left),
            lower_right: world_from_room.transform_point3(in_room.lower_right),
            upper_left: world_from_room.transform_point3(in_room.upper_left),
        };
        let (view_from_room, f) = off_axis(eye, &in_room, 0.1).unwrap();
        let (view_from_world, g) = off_axis(world_from_room.transform_point3(eye), &carried, 0.1).unwrap();
        assert!((view_from_room * world_from_room.inverse()).abs_diff_eq(view_from_world, 1e-5));
        assert!((f.left - g.left).abs() + (f.right - g.right).abs() + (f.top - g.top).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_screen_is_told() {
        let ok = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [-1.0, 2.0, -1.0]];
        let eye = [0.0, 1.0, 0.0];
        let rows = [
            (eye, [[0.0; 3]; 3], 0.1, "no area"),
            (eye, [ok[0], ok[1], ok[1]], 0.1, "no area"),
            (eye, [ok[0], ok[1], [-0.5, 2.0, -1.0]], 0.1, "right angle"),
            (eye, [ok[0], [f32::NAN, 0.0, 0.0], ok[2]], 0.1, "not finite"),
            ([f32::INFINITY, 0.0, 0.0], ok, 0.1, "not finite"),
            ([0.0, 1.0, -1.0], ok, 0.1, "in front"),
            ([0.0, 1.0, -2.0], ok, 0.1, "in front"),
            (eye, ok, 0.0, "near"),
            (eye, ok, f32::NAN, "near"),
        ];
        for (eye, screen, near, want) in rows {
            let message = off_axis(Vec3::from(eye), &corners(screen), near).unwrap_err().to_string();
            assert!(message.contains(want), "{screen:?}: {message}");
        }
    }

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
}
