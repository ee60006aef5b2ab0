//! Places of the eye on a path that leads through casters and their shadows.

use glam::{Vec3, camera::rh::view::look_at_mat4};
use std::f32::consts::TAU;
use umbriel_scene::{Frustum, Scene, View};

/// Pixels where nobody says how many.
pub(super) const SIZE: [u32; 2] = [160, 120];

/// Views along a closed path around the middle of the casters, low and high, in and out of what they shade. Where `from` stands
/// decides which of many such paths it is.
pub(super) fn path(scene: &Scene, from: &View, places: u32) -> Vec<View> {
    let boxes: Vec<_> = scene.drawables.iter().filter(|d| d.visible && d.casts_shadow).map(|d| d.bounds_in_world).collect();
    let count = boxes.len().max(1) as f32;
    let middle = boxes.iter().map(|b| b.centre()).sum::<Vec3>() / count;
    let spread = (boxes.iter().map(|b| (b.centre() - middle).powf(2.0)).sum::<Vec3>() / count).powf(0.5);
    let mut sizes: Vec<f32> = boxes.iter().map(|b| b.radius()).collect();
    sizes.sort_by(f32::total_cmp);
    let least = sizes.get(sizes.len() / 2).copied().unwrap_or(1.0);
    let reach = (1.5 * spread).max(Vec3::splat(0.75 * least));
    let (size, near) = (from.size, from.frustum.near.min(0.02 * reach.max_element()).max(1e-3));
    let stands = from.view_from_world.inverse().w_axis.truncate() - middle;
    let phase = f32::atan2(stands.x, stands.z);
    let at = |t: f32| {
        let turn = TAU * t + phase;
        middle + reach * Vec3::new(turn.sin(), 0.25 + 0.5 * (3.0 * turn).sin(), (2.0 * turn + 0.5).sin())
    };
    let view = |place: u32| {
        let t = place as f32 / places as f32;
        let eye = at(t);
        // Ahead, and now and then to the middle.
        let ahead = at(t + 0.03) - eye;
        let inward = middle - eye;
        let to = ahead.normalize_or(Vec3::Z).lerp(inward.normalize_or(Vec3::Z), 0.5 + 0.5 * (5.0 * TAU * t).sin());
        let up = if to.normalize_or(Vec3::Z).y.abs() > 0.98 { Vec3::X } else { Vec3::Y };
        View {
            name: format!("place {place}"),
            view_from_world: look_at_mat4(eye, eye + to, up),
            frustum: Frustum::symmetric(0.9, size[0] as f32 / size[1] as f32, near),
            size,
        }
    };
    (0..places).map(view).collect()
}
