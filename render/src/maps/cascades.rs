//! Maps of a directional light: nested boxes fitted once to all views of the frame.

use super::fit::{Fit, MARGIN_TEXELS, Projection, light_from_world, parallel};
use glam::{Mat4, Vec3};
use umbriel_scene::{Aabb, Light};

/// A view as the fit sees it: its rays, and how far along them something receives.
#[derive(Clone, Debug)]
pub(crate) struct Eye {
    pub(crate) world_from_view: Mat4,
    /// Left, right, bottom, top at distance 1.
    pub(crate) window: [f32; 4],
    /// Distance along -z of the nearest receiver in sight, that of the view's own near plane at least.
    pub(crate) near: f32,
    /// Distance along -z of the farthest receiver in sight.
    pub(crate) far: f32,
}

impl Eye {
    /// Nearest and farthest distance along -z of what the view sees of a box; none where it sees nothing of it.
    pub(crate) fn depths_of(&self, bounds: &Aabb) -> Option<[f32; 2]> {
        // A flat floor is a box without height; rounding must not make it vanish.
        let slack = 1e-6 * (1.0 + bounds.min.abs().max(bounds.max.abs()).max_element());
        let bounds = Aabb { min: bounds.min - slack, max: bounds.max + slack };
        let ahead = -self.world_from_view.z_axis.truncate();
        let start = ahead.dot(self.world_from_view.w_axis.truncate());
        let depths = slice_of(self, 0.0, self.far, &bounds).into_iter().map(|p| ahead.dot(p) - start);
        depths.fold(None, |range: Option<[f32; 2]>, d| Some(range.map_or([d, d], |[near, far]| [near.min(d), far.max(d)])))
    }
}

/// The maps of a directional light, the finest first. `receivers` and `casters` are boxes in the world.
pub(crate) fn cascades(light: &Light, size: u32, eyes: &[Eye], receivers: Aabb, casters: Aabb) -> Vec<Fit> {
    let direction = light.direction.normalize_or(Vec3::NEG_Z);
    let light_from_world = light_from_world(direction, light.up);
    let make = |window: [f32; 4], near: f32, far: f32, origin: Vec3| {
        let [l, r, b, t] = window;
        let map_from_world = parallel(window, near, far) * light_from_world * Mat4::from_translation(-origin);
        let texel = (r - l).max(t - b) / size as f32;
        Projection { map_from_world, eye: (-direction).extend(0.0), texel, depth: [far - near, 0.0] }
    };
    let casters_in_light = casters.transformed(&light_from_world);
    let all = receivers.union(casters).transformed(&light_from_world);
    if casters.is_empty() || receivers.is_empty() {
        return Vec::new();
    }
    // Light travels along -z. Nothing that casts may be cut off in front. Ends lie on steps, so that a bird that rises
    // does not ask for other maps in every frame.
    let slack = 1e-3 * (1.0 + all.radius());
    let step = (all.max.z - all.min.z + 2.0 * slack).log2().ceil().exp2() / 16.0;
    let near = ((-all.max.z - slack) / step).floor() * step;
    let far = ((-all.min.z + slack) / step).ceil() * step;
    // By hand, distances count from the light's place.
    let at = light_from_world.transform_point3(light.position).z;
    let [by_hand_near, by_hand_far] = light.map.near_far.unwrap_or([f32::NEG_INFINITY, f32::INFINITY]);
    let near = if by_hand_near.is_finite() { by_hand_near - at } else { near };
    let far = if by_hand_far.is_finite() { by_hand_far - at } else { far };
    let far = if far > near { far } else { near + 1.0 };
    if let Some(window) = light.map.frustum.filter(|[l, r, b, t]| r > l && t > b) {
        let [near, far] = [near + at, far + at];
        return vec![Fit { projection: make(window, near, far, light.position), needed: None }];
    }
    // A flat floor is a box without height; rounding must not make it vanish.
    let receivers = Aabb { min: receivers.min - slack, max: receivers.max + slack };
    let mut found: Vec<Fit> = Vec::new();
    let world_from_light = light_from_world.transpose();
    for (from, to) in slices(eyes) {
        let mut seen = Aabb::EMPTY;
        for eye in eyes {
            let corners = slice_of(eye, from, to, &receivers);
            seen = seen.union(Aabb::from_points(corners.into_iter().map(|p| light_from_world.transform_point3(p))));
        }
        let min = seen.min.max(casters_in_light.min).truncate();
        let max = seen.max.min(casters_in_light.max).truncate();
        if seen.is_empty() || !min.cmplt(max).all() {
            continue;
        }
        let (x, y) = (snapped(min.x, max.x, size), snapped(min.y, max.y, size));
        let projection = make([x.0, x.1, y.0, y.1], near, far, Vec3::ZERO);
        let needed = Aabb { min: min.extend(all.min.z), max: max.extend(all.max.z) };
        let needed = Some(needed.corners().map(|c| world_from_light.transform_point3(c)));
        if found.last().is_none_or(|f| f.projection != projection) {
            found.push(Fit { projection, needed });
        }
    }
    found
}

/// A first slice never has to reach farther than this many metres; wide worlds get more maps instead.
const FIRST_SLICE_M: f32 = 2.0;

/// Through a lens, a range this many times as long as it is wide where it begins has texels as fine as those of a wide view.
const LONGEST_RANGE: f32 = 1.6;
/// Views narrower than this, as share of the distance, are seen through a lens.
const NARROW: f32 = 0.8;
/// No more maps than this, whatever the lens.
const MOST_BY_LENS: f32 = 8.0;

/// Ranges of distance, one per map: between equal steps and equal ratios (Zhang et al. 2006, Parallel-split shadow
/// maps, section 3); where sight is far, equal steps would leave nothing for what is near, so they weigh less.
fn slices(eyes: &[Eye]) -> Vec<(f32, f32)> {
    let far = eyes.iter().map(|e| e.far).fold(0.0, f32::max) * 1.001;
    let near = eyes.iter().map(|e| e.near).fold(f32::INFINITY, f32::min).max((far * 0.01).min(FIRST_SLICE_M));
    if far <= 0.0 || near >= far {
        return Vec::new();
    }
    let most = if far > 400.0 * near { 5.0 } else { 4.0 };
    let mut count = ((far / near).log2() * 1.2).ceil().clamp(1.0, most);
    let width = width_of(eyes);
    if width < NARROW {
        count = count.max(((far / near).ln() / (LONGEST_RANGE * width).ln_1p()).ceil().min(MOST_BY_LENS));
    }
    let steps = 0.3 * (100.0 * FIRST_SLICE_M / far).min(1.0);
    let split = |i: f32| {
        let share = i / count;
        let (by_ratio, by_step) = (near * (far / near).powf(share), near + (far - near) * share);
        (1.0 - steps) * by_ratio + steps * by_step
    };
    let mut from = 0.0;
    let mut ranges = Vec::new();
    for i in 1..=count as u32 {
        let to = if i as f32 == count { far } else { split(i as f32) };
        ranges.push((from, to));
        from = to;
    }
    ranges
}

/// How wide all that is seen is at distance 1.
fn width_of(eyes: &[Eye]) -> f32 {
    let ray = |eye: &Eye, x: f32, y: f32| eye.world_from_view.transform_vector3(Vec3::new(x, y, -1.0));
    let corners = eyes.iter().flat_map(|eye| {
        let [l, r, b, t] = eye.window;
        [ray(eye, l, b), ray(eye, r, b), ray(eye, r, t), ray(eye, l, t)]
    });
    let all = Aabb::from_points(corners);
    (all.max - all.min).max_element()
}

/// Corners of the part of a view between two distances that lies in a box, in the world.
fn slice_of(eye: &Eye, from: f32, to: f32, bounds: &Aabb) -> Vec<Vec3> {
    let [l, r, b, t] = eye.window;
    let corner = |d: f32, x: f32, y: f32| eye.world_from_view.transform_point3(Vec3::new(x * d, y * d, -d));
    let ring = |d: f32| [corner(d, l, b), corner(d, r, b), corner(d, r, t), corner(d, l, t)];
    let (n, f) = (ring(from.max(eye.near.min(to))), ring(to));
    let faces = [
        vec![n[0], n[1], n[2], n[3]],
        vec![f[0], f[1], f[2], f[3]],
        vec![n[0], n[1], f[1], f[0]],
        vec![n[1], n[2], f[2], f[1]],
        vec![n[2], n[3], f[3], f[2]],
        vec![n[3], n[0], f[0], f[3]],
    ];
    let middle = (n.iter().sum::<Vec3>() + f.iter().sum::<Vec3>()) / 8.0;
    let inside = |face: &[Vec3]| {
        let normal = (face[1] - face[0])
            .cross(face[3] - face[0])
            .try_normalize()
            .or_else(|| (face[2] - face[1]).cross(face[3] - face[1]).try_normalize())?;
        let normal = if normal.dot(middle - face[0]) < 0.0 { -normal } else { normal };
        Some((normal, -normal.dot(face[0])))
    };
    let frustum: Vec<(Vec3, f32)> = faces.iter().filter_map(|face| inside(face)).collect();
    let walls: Vec<(Vec3, f32)> = [Vec3::X, Vec3::Y, Vec3::Z]
        .into_iter()
        .flat_map(|axis| [(axis, -axis.dot(bounds.min)), (-axis, axis.dot(bounds.max))])
        .collect();
    let c = bounds.corners();
    let sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let mut corners = Vec::new();
    for face in &faces {
        corners.extend(clipped(face.clone(), &walls));
    }
    for side in sides {
        corners.extend(clipped(side.map(|i| c[i]).to_vec(), &frustum));
    }
    corners
}

/// The part of a convex polygon on the positive side of all planes (Sutherland and Hodgman 1974).
fn clipped(mut polygon: Vec<Vec3>, planes: &[(Vec3, f32)]) -> Vec<Vec3> {
    for (normal, offset) in planes {
        let height = |p: Vec3| normal.dot(p) + offset;
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, &p) in polygon.iter().enumerate() {
            let next = polygon[(i + 1) % polygon.len()];
            let (a, b) = (height(p), height(next));
            if a >= 0.0 {
                kept.push(p);
            }
            if (a >= 0.0) != (b >= 0.0) {
                kept.push(p + (next - p) * (a / (a - b)));
            }
        }
        polygon = kept;
    }
    polygon
}

/// A range around `min..max` whose ends lie on texels and whose length is one of few, so that maps do not shimmer
/// while heads move.
fn snapped(min: f32, max: f32, size: u32) -> (f32, f32) {
    let texels = (size as f32 - 2.0 * MARGIN_TEXELS).max(size as f32 * 0.5);
    let needed = ((max - min) / (texels - 1.0)).max(1e-6);
    // Eight lengths per doubling.
    let texel = (needed.log2() * 8.0).ceil().mul_add(0.125, 0.0).exp2();
    let margin = (0.5 * (size as f32 * texel - (max - min)) / texel).floor();
    let start = ((min / texel).floor() - margin) * texel;
    (start, start + size as f32 * texel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_is_cut_to_the_box() {
        let eye = Eye { world_from_view: Mat4::from_translation(Vec3::Y), window: [-1.0, 1.0, -1.0, 1.0], near: 0.1, far: 10.0 };
        let floor = Aabb { min: Vec3::new(-5.0, 0.0, -8.0), max: Vec3::new(5.0, 0.5, 8.0) };
        let seen = Aabb::from_points(slice_of(&eye, 0.0, 10.0, &floor));
        // The lower rays run down at 45 degrees: they enter the box 0.5 m ahead.
        assert!((seen.max.z + 0.5).abs() < 1e-4 && (seen.min.z + 8.0).abs() < 1e-4, "{seen:?}");
        assert!((seen.max.x - 5.0).abs() < 1e-4);
        assert!(Aabb::from_points(slice_of(&eye, 9.0, 10.0, &floor)).is_empty());
    }

    #[test]
    fn of_a_wide_floor_only_what_is_in_sight_counts() {
        let floor = Aabb { min: Vec3::new(-2e3, 0.0, -2e3), max: Vec3::new(2e3, 0.0, 2e3) };
        // From 2 m above, the middle of the view 45 degrees down, the window 45 degrees high: 67.5 to 22.5 degrees down.
        let world_from_view = Mat4::from_translation(Vec3::Y * 2.0) * Mat4::from_rotation_x(-std::f32::consts::FRAC_PI_4);
        let edge = std::f32::consts::FRAC_PI_8.tan();
        let eye = Eye { world_from_view, window: [-edge, edge, -edge, edge], near: 0.1, far: 4e3 };
        let [near, far] = eye.depths_of(&floor).unwrap();
        let (expected_near, expected_far) = (2.0, 2.0 / std::f32::consts::FRAC_PI_8.sin() * std::f32::consts::FRAC_PI_8.cos());
        assert!((near - expected_near).abs() < 1e-2 && (far - expected_far).abs() < 1e-2, "{near} {far}");
        let behind = Aabb { min: Vec3::new(-1.0, 0.0, 5.0), max: Vec3::new(1.0, 1.0, 6.0) };
        assert_eq!(eye.depths_of(&behind), None);
    }

    #[test]
    fn a_lens_gets_ranges_as_short_as_it_is_narrow() {
        let eye = |half: f32, turn: f32| Eye {
            world_from_view: Mat4::from_rotation_y(turn),
            window: [-half, half, -half, half],
            near: 8.0,
            far: 500.0,
        };
        for (name, eyes, count) in [
            ("wide", vec![eye(0.6, 0.0)], 4),
            ("a lens of 20 degrees", vec![eye(0.176, 0.0)], 8),
            ("two of them, in other directions", vec![eye(0.176, 0.0), eye(0.176, 1.0)], 4),
        ] {
            let found = slices(&eyes);
            assert_eq!(found.len(), count, "{name}: {found:?}");
            assert!(found.windows(2).all(|pair| pair[0].1 == pair[1].0) && found[count - 1].1 >= 500.0, "{name}: {found:?}");
        }
        // What is near is as long as it is wide, about.
        let (from, to) = slices(&[eye(0.176, 0.0)])[1];
        assert!(to - from < 2.5 * LONGEST_RANGE * 0.352 * from, "{from} {to}");
    }

    #[test]
    fn ranges_hold_what_they_must_and_do_not_follow_small_steps() {
        let mut starts = std::collections::HashSet::new();
        for step in 0..100 {
            let min = 3.0 + step as f32 * 1e-4;
            let (a, b) = snapped(min, min + 10.0, 1024);
            assert!(a <= min && b >= min + 10.0);
            let texel = (b - a) / 1024.0;
            assert!((a / texel - (a / texel).round()).abs() < 1e-2, "{a} is no whole number of texels of {texel}");
            starts.insert(a.to_bits());
        }
        assert!(starts.len() <= 3, "{starts:?}");
    }
}
