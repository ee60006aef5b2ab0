//! Where a view is seen from.

use glam::{Vec2, Vec3};
use umbriel_scene::View;

/// What a view tells about where it is seen from, in the room.
pub(super) struct Standpoint {
    pub(super) position: Vec3,
    pub(super) right: Vec3,
    pub(super) up: Vec3,
    pub(super) ahead: Vec3,
    /// Height of a pixel at a distance of one metre.
    pub(super) pixel_at_1m: f32,
    pub(super) near: f32,
}

impl Standpoint {
    pub(super) fn of(view: &View) -> Standpoint {
        let room_from_view = view.view_from_world.inverse();
        let axis = |v: Vec3| room_from_view.transform_vector3(v).normalize_or_zero();
        Standpoint {
            position: room_from_view.w_axis.truncate(),
            right: axis(Vec3::X),
            up: axis(Vec3::Y),
            ahead: axis(Vec3::NEG_Z),
            pixel_at_1m: (view.frustum.top - view.frustum.bottom) / (view.frustum.near * view.size[1].max(1) as f32),
            near: view.frustum.near,
        }
    }

    /// The way in the room at a distance of one metre that is seen as `pixels` (y down).
    pub(super) fn across(&self, pixels: Vec2) -> Vec3 {
        (self.right * pixels.x - self.up * pixels.y) * self.pixel_at_1m
    }
}
