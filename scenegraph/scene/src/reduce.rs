//! Reduced casters: closed surfaces of fewer triangles that throw a shadow in place of another (000 future work 2 and 3).

use crate::distance::Surface;
use crate::doctor::{Steps, mend, natural_weld_m};
use crate::{Aabb, Mesh, MorphTarget};
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// A mesh that casts in place of another.
#[derive(Clone, Debug, PartialEq)]
pub struct ReducedMesh {
    /// A closed surface. Its vertices move as those of the full mesh do.
    pub mesh: Mesh,
    /// No point of either surface is farther from the other than this, at rest, metres.
    pub error_m: f32,
}

/// Why a mesh was not reduced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReduceError {
    /// Not even mending closes it.
    #[error("it cannot be closed: {0}")]
    Open(String),
    /// All its triangles are needed.
    #[error("within {max_error_m} m it needs at least {needed} of its {triangles} triangles")]
    Needed {
        /// The bound, metres.
        max_error_m: f32,
        /// Triangles of the coarsest surface within it.
        needed: usize,
        /// Triangles of the mesh.
        triangles: usize,
    },
}

/// Attempts, each with half of the tolerance of the one before.
const ATTEMPTS: i32 = 7;
/// Reduced meshes have at most this share of the triangles.
const WORTHWHILE: f64 = 0.75;

/// A closed mesh of fewer triangles within `max_error_m` of another one, a little smaller than it, so that the shown surface
/// does not lie in its own shadow. The same mesh always gives the same.
pub fn reduce(mesh: &Mesh, max_error_m: f32) -> Result<ReducedMesh, ReduceError> {
    let mended = mend(mesh, &Steps::all(natural_weld_m(mesh)));
    if !mended.findings.is_closed() || !mended.findings.is_oriented() {
        return Err(ReduceError::Open(mended.findings.faults().join(", ")));
    }
    let whole = merged(&mended.apply(mesh));
    let full = surface(&mesh.positions, &mesh.indices);
    let size = (whole.bounds.max - whole.bounds.min).max_element().max(f32::MIN_POSITIVE);
    let positions: Vec<[f32; 3]> = whole.positions.iter().map(|p| p.to_array()).collect();
    let mut coarsest = whole.indices.len() / 3;
    for attempt in 0..ATTEMPTS {
        let tolerance = 0.5_f32.powi(attempt) * max_error_m / size;
        let mut indices = vec![0; whole.indices.len()];
        let count = meshopt_rs::simplify::simplify(&mut indices, &whole.indices, &positions, 0, tolerance);
        indices.truncate(count);
        if indices.is_empty() {
            continue;
        }
        let slack = 0.1 * f64::from(max_error_m);
        let error = apart(&full, &surface(&whole.positions, &indices), slack);
        if error > f64::from(max_error_m) {
            continue;
        }
        let shrunk = shrunk(&whole, &indices, error as f32);
        let error = apart(&full, &surface(&shrunk.positions, &shrunk.indices), slack);
        if error > f64::from(max_error_m) {
            continue;
        }
        coarsest = indices.len() / 3;
        if coarsest as f64 > WORTHWHILE * mesh.triangle_count() as f64 {
            break;
        }
        return Ok(ReducedMesh { mesh: shrunk, error_m: error as f32 });
    }
    Err(ReduceError::Needed { max_error_m, needed: coarsest, triangles: mesh.triangle_count() })
}

/// How far apart two surfaces are at most (Hausdorff distance, from above), metres.
fn apart(a: &Surface, b: &Surface, slack: f64) -> f64 {
    a.farthest(b, slack).max(b.farthest(a, slack))
}

fn surface(positions: &[Vec3], indices: &[u32]) -> Surface {
    let triangles = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|i| positions[i as usize].as_dvec3()));
    Surface::new(triangles.collect())
}

/// One vertex per corner, without looks: seams of texture coordinates must not hold back the reduction.
fn merged(mesh: &Mesh) -> Mesh {
    let lowest = crate::adjacency::welded(mesh);
    picked(mesh, &mesh.indices.iter().map(|v| lowest[*v as usize]).collect::<Vec<_>>())
}

/// The vertices that are used, in the order of their first use, without looks.
fn picked(mesh: &Mesh, indices: &[u32]) -> Mesh {
    let mut place: HashMap<u32, u32> = HashMap::new();
    let mut used: Vec<u32> = Vec::new();
    let indices: Vec<u32> = indices
        .iter()
        .map(|v| {
            *place.entry(*v).or_insert_with(|| {
                used.push(*v);
                used.len() as u32 - 1
            })
        })
        .collect();
    fn pick<T: Copy>(values: &Arc<[T]>, used: &[u32]) -> Arc<[T]> {
        if values.is_empty() { Arc::default() } else { used.iter().map(|v| values[*v as usize]).collect() }
    }
    let positions = pick(&mesh.positions, &used);
    let target = |t: &MorphTarget| MorphTarget { positions: pick(&t.positions, &used), ..MorphTarget::default() };
    Mesh {
        name: mesh.name.clone(),
        bounds: Aabb::from_points(positions.iter().copied()),
        positions,
        joints: pick(&mesh.joints, &used),
        weights: pick(&mesh.weights, &used),
        morph_targets: mesh.morph_targets.iter().map(target).collect(),
        indices: indices.into(),
        ..Mesh::default()
    }
}

/// The triangles, moved inward by `by_m`.
fn shrunk(whole: &Mesh, indices: &[u32], by_m: f32) -> Mesh {
    let mut mesh = picked(whole, indices);
    let mut inward = vec![DVec3::ZERO; mesh.positions.len()];
    for t in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| mesh.positions[i as usize].as_dvec3());
        let n = (b - a).cross(c - a);
        t.iter().for_each(|i| inward[*i as usize] -= n);
    }
    let moved = |(p, n): (&Vec3, &DVec3)| *p + (by_m * n.normalize_or_zero().as_vec3());
    mesh.positions = mesh.positions.iter().zip(&inward).map(moved).collect();
    mesh.name = format!("{}, reduced", whole.name);
    mesh.normals = crate::mesh::area_weighted_normals(&mesh.positions, &mesh.indices).into();
    mesh.bounds = Aabb::from_points(mesh.positions.iter().copied());
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(rings: u32) -> Mesh {
        let at = |i: u32, j: u32| {
            let (theta, phi) =
                (std::f32::consts::PI * i as f32 / rings as f32, std::f32::consts::TAU * (j % rings) as f32 / rings as f32);
            let r = if i == 0 || i == rings { 0.0 } else { theta.sin() };
            Vec3::new(r * phi.sin(), theta.cos(), r * phi.cos())
        };
        let quads = (0..rings).flat_map(|i| (0..rings).map(move |j| (i, j)));
        let positions: Vec<Vec3> = quads
            .flat_map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)])
            .collect();
        let indices = (0..positions.len() as u32).collect();
        Mesh { name: "ball".into(), positions: positions.into(), indices, ..Mesh::default() }.checked().unwrap()
    }

    #[test]
    fn a_ball_is_reduced_within_its_bound() {
        let ball = ball(48);
        let mut last = ball.triangle_count();
        for bound in [0.02, 0.05, 0.12] {
            let reduced = reduce(&ball, bound).unwrap_or_else(|e| panic!("{bound}: {e}"));
            assert!(reduced.error_m <= bound && reduced.error_m > 0.0, "{}", reduced.error_m);
            assert!(reduced.mesh.triangle_count() < last, "{bound}: {} triangles", reduced.mesh.triangle_count());
            last = reduced.mesh.triangle_count();
            let findings = crate::doctor::examine(&reduced.mesh, 0.0);
            assert!(findings.is_closed() && findings.is_oriented(), "{findings}");
            let farthest = reduced.mesh.positions.iter().map(|p| p.length()).fold(0.0, f32::max);
            assert!(farthest <= 1.0, "{bound}: it stands out of the ball: {farthest}");
            assert_eq!(reduce(&ball, bound), Ok(reduced), "the same mesh gives the same");
        }
        assert!(last < 1000, "{last} triangles");
    }

    #[test]
    fn what_cannot_be_reduced_is_told() {
        let cube = ball(4);
        let error = reduce(&cube, 1e-4).unwrap_err().to_string();
        assert!(error.contains("0.0001 m"), "{error}");
        assert!(matches!(reduce(&Mesh::default(), 1.0), Err(ReduceError::Open(_))));
    }
}
