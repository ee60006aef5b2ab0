//! What shadow maps are fitted to: what all views see, and what casts.

use crate::cull::{CentredBox, Planes};
use crate::draws::{Draws, Lies};
use crate::maps::{Eye, Surroundings};
use glam::Mat4;
use umbriel_scene::{Aabb, Frustum, Picture, View};

/// The answer of the frame before, which is good as long as eyes and drawables are at rest.
#[derive(Default)]
pub(crate) struct Kept {
    /// Revision of the drawables, and the views.
    asked: (u64, Vec<(Mat4, Frustum)>),
    around: Surroundings,
}

impl Kept {
    /// Looks at all views of the frame.
    pub(crate) fn of(&mut self, pictures: &[Picture], draws: &Draws) -> &Surroundings {
        let views = || pictures.iter().flat_map(|p| &p.views);
        let asked = (draws.revision, views().map(|v| (v.view_from_world, v.frustum)).collect());
        if self.asked != asked {
            self.asked = asked;
            self.around = Surroundings { eyes: Vec::new(), receivers: Aabb::EMPTY, casters: draws.casters_box() };
            views().for_each(|view| look(view, draws, &mut self.around));
        }
        &self.around
    }
}

/// Adds what one view sees.
fn look(view: &View, draws: &Draws, around: &mut Surroundings) {
    let frustum = &view.frustum;
    let window = [frustum.left, frustum.right, frustum.bottom, frustum.top].map(|v| v / frustum.near);
    if !window.iter().all(|v| v.is_finite()) {
        return;
    }
    let planes = Planes::new(&(frustum.clip_from_view() * view.view_from_world));
    let ahead = -view.view_from_world.row(2);
    let range_of = |b: &CentredBox| {
        let middle = ahead.truncate().dot(b.centre) + ahead.w;
        let reach = ahead.truncate().abs().dot(b.half);
        [middle - reach, middle + reach]
    };
    let mut eye = Eye { world_from_view: view.view_from_world.inverse(), window, near: f32::INFINITY, far: 0.0 };
    for (group, members) in draws.groups() {
        let adds_nothing = |b: &CentredBox| {
            let [near, far] = range_of(b);
            near >= eye.near && far <= eye.far && around.receivers.union(group.bounds) == around.receivers
        };
        if group.lies(&planes) == Lies::Outside || group.around().is_some_and(adds_nothing) {
            continue;
        }
        for (b, bounds) in members {
            if !planes.may_see(b) {
                continue;
            }
            around.receivers = around.receivers.union(*bounds);
            let [mut near, mut far] = range_of(b);
            if near >= eye.near && far <= eye.far {
                continue;
            }
            // Of a ground that reaches to the horizon only what is in sight counts.
            if !planes.see_all_of(b) && far > frustum.near {
                let ray = Eye { near: frustum.near, far, ..eye.clone() };
                let Some(seen) = ray.depths_of(bounds) else { continue };
                [near, far] = seen;
            }
            (eye.near, eye.far) = (eye.near.min(near), eye.far.max(far));
        }
    }
    if eye.far > 0.0 {
        eye.near = on_step(eye.near.max(frustum.near), f32::floor).max(frustum.near);
        eye.far = on_step(eye.far, f32::ceil);
        around.eyes.push(eye);
    }
}

/// The next of four distances per doubling, so that maps are not divided anew whenever a head moves.
fn on_step(distance: f32, round: fn(f32) -> f32) -> f32 {
    (round(distance.log2() * 4.0) * 0.25).exp2()
}
