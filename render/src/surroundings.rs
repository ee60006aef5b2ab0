//! What shadow maps are fitted to: what all views see, and what casts.

use crate::cull::{CentredBox, Planes};
use crate::draws::Draws;
use crate::maps::{Eye, Surroundings};
use umbriel_scene::{Aabb, Picture, Scene};

/// Looks at all views of the frame.
pub(crate) fn of(scene: &Scene, pictures: &[Picture], draws: &Draws) -> Surroundings {
    let mut around = Surroundings { eyes: Vec::new(), receivers: Aabb::EMPTY, casters: Aabb::EMPTY };
    for (index, casts) in draws.drawn() {
        if casts {
            around.casters = around.casters.union(scene.drawables[index].bounds_in_world);
        }
    }
    for view in pictures.iter().flat_map(|p| &p.views) {
        let frustum = &view.frustum;
        let planes = Planes::new(&(frustum.clip_from_view() * view.view_from_world));
        let ahead = -view.view_from_world.row(2);
        let (mut near, mut far) = (f32::INFINITY, 0.0f32);
        for (index, _) in draws.drawn() {
            let b = CentredBox { ..draws.boxes[index] };
            if !planes.may_see(&b) {
                continue;
            }
            let middle = ahead.truncate().dot(b.centre) + ahead.w;
            let reach = ahead.truncate().abs().dot(b.half);
            near = near.min(middle - reach);
            far = far.max(middle + reach);
            around.receivers = around.receivers.union(scene.drawables[index].bounds_in_world);
        }
        let window = [frustum.left, frustum.right, frustum.bottom, frustum.top].map(|v| v / frustum.near);
        if far > 0.0 && window.iter().all(|v| v.is_finite()) {
            let world_from_view = view.view_from_world.inverse();
            around.eyes.push(Eye { world_from_view, window, near: near.max(frustum.near), far });
        }
    }
    around
}
