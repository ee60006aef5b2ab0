//! Which light gets how many texels, where memory is short.

use super::{Eye, atlas};
use glam::Vec3;
use umbriel_scene::{Light, LightKind};

/// Light that is not worth a shadow, lux: a sixtieth of what makes a white sheet white.
const FAINT_LX: f32 = 0.05;
/// Importance of a light that no view sees, as power of two. It may come into sight.
const UNSEEN: f32 = -6.0;
/// Importance follows only steps of more than this power of two, so that maps do not change size back and forth.
const HYSTERESIS: f32 = 0.75;
/// Maps are not made smaller than this.
const SMALLEST: u32 = 16;

/// What a light asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Demand {
    /// Side of each map, texels.
    pub(crate) size: u32,
    /// Number of maps.
    pub(crate) faces: usize,
    /// Power of two of the share of a view's side that it lights, 0 at most.
    pub(crate) level: i32,
}

/// Sides of each light's maps, within `memory_bytes` and a number of layers: as long as they do not fit, the light with
/// the most texels for its importance gets half of them.
pub(crate) fn sides(demands: &[Demand], memory_bytes: u64, most_layers: u32) -> Vec<u32> {
    let mut sides: Vec<u32> = demands.iter().map(|d| d.size).collect();
    let fits = |sides: &[u32]| {
        let all: Vec<u32> = demands.iter().zip(sides).flat_map(|(d, side)| std::iter::repeat_n(*side, d.faces)).collect();
        let (side, layers, _) = atlas::pack(&all);
        layers <= most_layers && atlas::bytes(side, layers) <= memory_bytes
    };
    while !fits(&sides) {
        let excess = |i: &usize| (f64::from(sides[*i]).log2() - f64::from(demands[*i].level), demands[*i].faces);
        let large = (0..sides.len()).filter(|i| sides[*i] > SMALLEST && demands[*i].faces > 0);
        let Some(most) = large.max_by(|a, b| excess(a).partial_cmp(&excess(b)).unwrap_or(std::cmp::Ordering::Equal)) else {
            break;
        };
        sides[most] = (sides[most] / 2).max(SMALLEST);
    }
    sides
}

/// The importance of a light for the views, near `before` where it changed little.
pub(crate) fn level(light: &Light, eyes: &[Eye], before: Option<i32>) -> i32 {
    let share = eyes.iter().map(|eye| seen_share(light, eye)).fold(0.0, f32::max);
    let now = if eyes.is_empty() { 0.0 } else { share.log2().clamp(UNSEEN, 0.0) };
    match before {
        Some(before) if (now - before as f32).abs() <= HYSTERESIS => before,
        _ => now.round() as i32,
    }
}

/// Share of a view's side that the light reaches, 0..=1.
fn seen_share(light: &Light, eye: &Eye) -> f32 {
    let reach = reach_m(light);
    let (centre, radius) = match light.kind {
        LightKind::Directional => return 1.0,
        LightKind::Spot { outer_rad, .. } if outer_rad < std::f32::consts::FRAC_PI_4 && reach.is_finite() => {
            (light.position + light.direction * (0.5 * reach), 0.5 * reach)
        }
        _ => (light.position, reach),
    };
    let p = eye.world_from_view.inverse().transform_point3(centre);
    let [l, r, b, t] = eye.window;
    let sides = [Vec3::new(1.0, 0.0, l), Vec3::new(-1.0, 0.0, -r), Vec3::new(0.0, 1.0, b), Vec3::new(0.0, -1.0, -t)];
    let is_outside = sides.iter().any(|n| n.normalize().dot(p) < -radius) || p.z > radius;
    if is_outside {
        return 0.0;
    }
    let distance = p.length();
    if distance <= radius {
        return 1.0;
    }
    let tangent = radius / (distance * distance - radius * radius).sqrt();
    (2.0 * tangent / (r - l).min(t - b)).min(1.0)
}

/// Distance at which the light is faint, metres.
fn reach_m(light: &Light) -> f32 {
    let Vec3 { x: constant, y: linear, z: square } = light.attenuation;
    let least = light.intensity * light.color.max_element() / FAINT_LX - constant;
    let reach = if least <= 0.0 {
        0.0
    } else if square > 0.0 {
        ((linear * linear + 4.0 * square * least).sqrt() - linear) / (2.0 * square)
    } else if linear > 0.0 {
        least / linear
    } else {
        f32::INFINITY
    };
    reach.min(light.range)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Mat4;

    #[test]
    fn what_is_least_important_gives_way() {
        let light = |size, faces, level| Demand { size, faces, level };
        let mib = |n: u64| n << 20;
        for (name, demands, memory, expected) in [
            ("nothing", vec![], 0, vec![]),
            ("room enough", vec![light(1024, 1, 0), light(512, 6, -3)], mib(64), vec![1024, 512]),
            ("the far one gives way", vec![light(1024, 1, 0), light(1024, 1, -2)], mib(8), vec![1024, 1024]),
            ("three in two layers", vec![light(1024, 1, 0), light(1024, 1, -2), light(1024, 1, 0)], mib(12), vec![1024; 3]),
            ("three in less", vec![light(1024, 1, 0), light(1024, 1, -2), light(512, 1, 0)], mib(8), vec![1024, 512, 512]),
            ("hardly any", vec![light(64, 1, 0), light(32, 6, -6)], 0, vec![16, 16]),
        ] {
            let found = sides(&demands, memory, 256);
            assert_eq!(found, expected, "{name}");
        }
        // 64 spot lights of 2048 texels want 1 GiB.
        let many: Vec<Demand> = (0..64).map(|i| light(2048, 1, -(i / 16))).collect();
        let found = sides(&many, mib(128), 256);
        assert!(found.is_sorted_by(|a, b| a >= b) && found[0] > found[63], "{found:?}");
        assert!(sides(&many, mib(128), 3).iter().all(|s| *s >= SMALLEST));
    }

    #[test]
    fn importance_is_what_is_seen_and_steady() {
        let eye = Eye { world_from_view: Mat4::IDENTITY, window: [-1.0, 1.0, -1.0, 1.0], near: 0.1, far: 100.0 };
        let lamp = |z: f32, range: f32| Light {
            kind: LightKind::Point,
            position: Vec3::Z * z,
            intensity: 1e4,
            range,
            ..Light::default()
        };
        let level = |light: &Light, before| level(light, std::slice::from_ref(&eye), before);
        assert_eq!(level(&Light::default(), None), 0);
        assert_eq!(level(&lamp(-1.0, 5.0), None), 0);
        assert_eq!(level(&lamp(-40.0, 5.0), None), -3);
        assert_eq!(level(&lamp(40.0, 5.0), None), UNSEEN as i32);
        let mut held = None;
        let mut changes = 0;
        for step in 0..200 {
            let wobble = if step % 2 == 0 { 0.2 } else { -0.2 };
            let now = level(&lamp(-56.0 + wobble, 5.0), held);
            changes += i32::from(held.is_some_and(|h| h != now));
            held = Some(now);
        }
        assert_eq!(changes, 0, "a head that trembles changes no map");
    }
}
