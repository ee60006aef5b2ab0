//! How many layers of one surface lie over each other, as lights from a few directions see it.

use glam::{DMat3, DVec2, DVec3};
use std::collections::HashMap;
use umbriel_scene::Mesh;

/// Points across and down where layers are counted.
const SIDE: usize = 24;
/// Lights: along the axes, and from between them.
const DIRECTIONS: [DVec3; 7] = [
    DVec3::X,
    DVec3::Y,
    DVec3::Z,
    DVec3::new(1.0, 1.0, 1.0),
    DVec3::new(-1.0, 1.0, 1.0),
    DVec3::new(1.0, -1.0, 1.0),
    DVec3::new(1.0, 1.0, -1.0),
];

/// A surface whose layers are to be counted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deep {
    /// Place among the surfaces of the mesh.
    pub(super) surface: u32,
    /// Only one side of it casts.
    pub(super) is_closed: bool,
}

/// The most layers of each surface that were found over one point. A count at sample points: a light from elsewhere may
/// find more.
pub(super) fn counted(mesh: &Mesh, surface_of: &[u32], surfaces: &[Deep]) -> Vec<u32> {
    let mut most = vec![0; surfaces.len()];
    let place: HashMap<u32, usize> = surfaces.iter().enumerate().map(|(i, s)| (s.surface, i)).collect();
    let corner = |t: usize, i: usize| mesh.positions[mesh.indices[3 * t + i] as usize].as_dvec3();
    let triangles: Vec<(usize, [DVec3; 3])> = surface_of
        .iter()
        .enumerate()
        .filter_map(|(t, surface)| Some((*place.get(surface)?, [0, 1, 2].map(|i| corner(t, i)))))
        .collect();
    for direction in DIRECTIONS {
        let z = direction.normalize();
        let x = z.any_orthonormal_vector();
        let flat_from_object = DMat3::from_cols(x, z.cross(x), z).transpose();
        let flat = |p: DVec3| (flat_from_object * p).truncate();
        // The grid of each surface spans its own extent; its points are turned a little, so that edges of a regular mesh
        // do not all pass through them.
        let (mut low, mut high) = (vec![DVec2::INFINITY; surfaces.len()], vec![DVec2::NEG_INFINITY; surfaces.len()]);
        for (surface, corners) in &triangles {
            for p in corners.map(flat) {
                low[*surface] = low[*surface].min(p);
                high[*surface] = high[*surface].max(p);
            }
        }
        // Triangles over each point that look towards the light and away from it.
        let mut counts = vec![[0u32; 2]; surfaces.len() * SIDE * SIDE];
        for (surface, corners) in &triangles {
            let step = (high[*surface] - low[*surface]).max(DVec2::splat(1e-30)) / SIDE as f64;
            let [a, b, c] = corners.map(|p| (flat(p) - low[*surface]) / step - DVec2::new(0.4872, 0.5131));
            let area = (b - a).perp_dot(c - a);
            let from = a.min(b).min(c).ceil().max(DVec2::ZERO);
            let to = a.max(b).max(c).floor().min(DVec2::splat(SIDE as f64 - 1.0));
            for y in from.y as usize..(to.y + 1.0).max(0.0) as usize {
                for x in from.x as usize..(to.x + 1.0).max(0.0) as usize {
                    let p = DVec2::new(x as f64, y as f64);
                    let inside = [(a, b), (b, c), (c, a)].iter().all(|(a, b)| (*b - *a).perp_dot(p - *a) * area > 0.0);
                    counts[(surface * SIDE + y) * SIDE + x][usize::from(area > 0.0)] += u32::from(inside);
                }
            }
        }
        for (surface, cells) in counts.chunks_exact(SIDE * SIDE).enumerate() {
            let layers = |c: &[u32; 2]| if surfaces[surface].is_closed { c[0].max(c[1]) } else { c[0] + c[1] };
            let deepest = cells.iter().map(layers).max().unwrap_or(0);
            most[surface] = most[surface].max(deepest);
        }
    }
    most
}
