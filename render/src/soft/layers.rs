//! Which casters share a shadow texture.
//!
//! A shadow texture knows only what the light's centre does not see, and one width of penumbra per pixel. Where the shadows
//! of two casters cross, each needs its own: what a place sees past one is then multiplied with what it sees past the other.

use crate::volumes::{VolumeCaster, VolumeLight};
use glam::{Vec2, Vec3};
use umbriel_scene::Aabb;

/// Shadow textures of one light; casters beyond that share one with others that they cross.
const MOST_LAYERS: usize = 4;

/// Distributes casters so that no two of a layer cross, as far as the layers suffice. At least one layer.
pub(super) fn distribute(light: &VolumeLight, size: f32, casters: Vec<VolumeCaster>) -> Vec<Vec<VolumeCaster>> {
    let mut outlines = vec![Vec::new()];
    let mut layers = vec![Vec::new()];
    for caster in casters {
        let layer = place(&mut outlines, Outline::new(light, &caster.bounds.in_world), size);
        layers.resize_with(outlines.len(), Vec::new);
        layers[layer].push(caster);
    }
    layers
}

/// Puts an outline into the first layer where it crosses none, a new one, or the emptiest. Gives the layer.
fn place(layers: &mut Vec<Vec<Outline>>, outline: Outline, size: f32) -> usize {
    let free = layers.iter().position(|layer| !layer.iter().any(|o| o.crosses(&outline, size)));
    let layer = free.unwrap_or_else(|| {
        if layers.len() < MOST_LAYERS {
            layers.push(Vec::new());
        }
        (0..layers.len()).min_by_key(|l| layers[*l].len()).unwrap_or(0)
    });
    layers[layer].push(outline);
    layer
}

/// What the light sees of a caster's bounds.
#[derive(Clone, Copy, Debug)]
enum Outline {
    /// Nothing is known of it.
    Unknown,
    /// A rectangle across parallel light, metres, and how far along the light its middle is.
    Flat { min: Vec2, max: Vec2, along: f32 },
    /// A cone from a place: its axis and half angle, radians, and the distance of its middle.
    Cone { axis: Vec3, angle: f32, distance: f32 },
}

impl Outline {
    fn new(light: &VolumeLight, bounds: &Aabb) -> Outline {
        if bounds.is_empty() {
            return Outline::Unknown;
        }
        let light_at = light.toward_light.truncate();
        if light.toward_light.w == 0.0 {
            let (across, up) = light_at.any_orthonormal_pair();
            let corners = bounds.corners().map(|c| Vec2::new(c.dot(across), c.dot(up)));
            let (min, max) = corners.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(a, b), c| (a.min(*c), b.max(*c)));
            return Outline::Flat { min, max, along: -bounds.centre().dot(light_at) };
        }
        let offset = bounds.centre() - light_at;
        let distance = offset.length();
        let angle = if distance > bounds.radius() { (bounds.radius() / distance).asin() } else { std::f32::consts::PI };
        Outline::Cone { axis: offset.normalize_or(Vec3::NEG_Y), angle, distance }
    }

    /// Do their shadows overlap without one holding the other? What a larger one holds is either in its umbra, or it throws
    /// its shadow onto the larger one itself, behind which nothing but umbra is.
    fn crosses(&self, other: &Outline, size: f32) -> bool {
        match (*self, *other) {
            (Outline::Flat { min: a, max: b, along: s }, Outline::Flat { min: c, max: d, along: t }) => {
                let reach = size * (s - t).abs();
                let overlap = (a - reach).cmple(d).all() && (c - reach).cmple(b).all();
                let holds = |a: Vec2, b: Vec2, c: Vec2, d: Vec2| (a + reach).cmple(c).all() && d.cmple(b - reach).all();
                overlap && !holds(a, b, c, d) && !holds(c, d, a, b)
            }
            (Outline::Cone { axis: a, angle: r, distance: s }, Outline::Cone { axis: b, angle: q, distance: t }) => {
                let between = a.angle_between(b);
                let reach = size * (1.0 / s.min(t) - 1.0 / s.max(t));
                between <= r + q + reach && between + r.min(q) + reach > r.max(q)
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec4, vec3};

    #[test]
    fn what_crosses_parts() {
        let cube = |x: f32, y: f32, half: f32| Aabb { min: vec3(x - half, y - half, -half), max: vec3(x + half, y + half, half) };
        let floor = Aabb { min: vec3(-50.0, 0.0, -50.0), max: vec3(50.0, 0.0, 50.0) };
        let (sun, lamp) = (Vec4::new(0.6, 0.8, 0.0, 0.0), Vec4::new(0.0, 30.0, 0.0, 1.0));
        // Name, light, size, casters, layers.
        let rows = [
            ("nothing", sun, 0.1, vec![], vec![0]),
            ("far apart", sun, 0.01, vec![cube(0.0, 3.0, 1.0), cube(9.0, 3.0, 1.0)], vec![2]),
            ("one above the other, along the light", sun, 0.01, vec![cube(3.0, 4.5, 1.0), cube(0.0, 1.0, 1.0)], vec![1, 1]),
            ("side by side but for their penumbrae", sun, 0.3, vec![cube(0.0, 11.0, 1.0), cube(-4.0, 1.0, 1.0)], vec![1, 1]),
            ("on a floor that holds both", sun, 0.01, vec![floor, cube(0.0, 3.0, 1.0), cube(9.0, 3.0, 1.0)], vec![3]),
            ("lamp, far apart", lamp, 0.1, vec![cube(-9.0, 3.0, 1.0), cube(9.0, 3.0, 1.0)], vec![2]),
            ("lamp, crossing", lamp, 0.1, vec![cube(0.0, 12.0, 1.0), cube(2.0, 3.0, 1.0)], vec![1, 1]),
            ("more than there are layers", sun, 0.01, (0..6).map(|i| cube(0.3 * i as f32, 2.0, 1.0)).collect(), vec![2, 2, 1, 1]),
        ];
        for (name, toward_light, size, boxes, expected) in rows {
            let light = VolumeLight { toward_light, range: f32::INFINITY, cone: None, settings: Default::default() };
            let mut layers: Vec<Vec<Outline>> = vec![Vec::new()];
            for bounds in boxes {
                place(&mut layers, Outline::new(&light, &bounds), size);
            }
            assert_eq!(layers.iter().map(Vec::len).collect::<Vec<_>>(), expected, "{name}");
        }
    }
}
