//! What shadow maps are fitted to: what all views see, and what casts.

use crate::cull::{CentredBox, Planes};
use crate::draws::{Casting, Draws};
use crate::maps::{Eye, Surroundings};
use umbriel_scene::{Aabb, Picture, Scene};

/// Looks at all views of the frame.
pub(crate) fn of(scene: &Scene, pictures: &[Picture], draws: &Draws) -> Surroundings {
    let mut around = Surroundings { eyes: Vec::new(), receivers: Aabb::EMPTY, casters: Aabb::EMPTY };
    for (index, casting) in draws.drawn() {
        if casting != Casting::Nothing {
            around.casters = around.casters.union(scene.drawables[index].bounds_in_world);
        }
    }
    for view in pictures.iter().flat_map(|p| &p.views) {
        let frustum = &view.frustum;
        let window = [frustum.left, frustum.right, frustum.bottom, frustum.top].map(|v| v / frustum.near);
        if !window.iter().all(|v| v.is_finite()) {
            continue;
        }
        let planes = Planes::new(&(frustum.clip_from_view() * view.view_from_world));
        let ahead = -view.view_from_world.row(2);
        let mut eye = Eye { world_from_view: view.view_from_world.inverse(), window, near: f32::INFINITY, far: 0.0 };
        for (index, _) in draws.drawn() {
            let b = CentredBox { ..draws.boxes[index] };
            if !planes.may_see(&b) {
                continue;
            }
            let bounds = scene.drawables[index].bounds_in_world;
            around.receivers = around.receivers.union(bounds);
            let middle = ahead.truncate().dot(b.centre) + ahead.w;
            let reach = ahead.truncate().abs().dot(b.half);
            let [mut near, mut far] = [middle - reach, middle + reach];
            if near >= eye.near && far <= eye.far {
                continue;
            }
            // Of a ground that reaches to the horizon only what is in sight counts.
            if !planes.see_all_of(&b) && far > frustum.near {
                let ray = Eye { near: frustum.near, far, ..eye.clone() };
                let Some(seen) = ray.depths_of(&bounds) else { continue };
                [near, far] = seen;
            }
            (eye.near, eye.far) = (eye.near.min(near), eye.far.max(far));
        }
        if eye.far > 0.0 {
            eye.near = on_step(eye.near.max(frustum.near), f32::floor).max(frustum.near);
            eye.far = on_step(eye.far, f32::ceil);
            around.eyes.push(eye);
        }
    }
    around
}

/// The next of four distances per doubling, so that maps are not divided anew whenever a head moves.
fn on_step(distance: f32, round: fn(f32) -> f32) -> f32 {
    (round(distance.log2() * 4.0) * 0.25).exp2()
}
