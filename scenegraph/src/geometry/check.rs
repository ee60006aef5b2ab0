//! What the tests of the solids ask of a mesh.

use glam::Vec3;
use std::collections::HashMap;
use umbriel_scene::Mesh;

type Bits = [u32; 3];

fn triangles(mesh: &Mesh) -> impl Iterator<Item = [Vec3; 3]> + '_ {
    mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|i| mesh.positions[i as usize]))
}

/// Directed edges between positions, compared by their bits, and how often each occurs minus its reverse.
fn edges(mesh: &Mesh) -> HashMap<(Bits, Bits), i32> {
    let bits = |p: Vec3| p.to_array().map(f32::to_bits);
    let mut sum = HashMap::new();
    for [a, b, c] in triangles(mesh) {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *sum.entry((bits(from), bits(to))).or_insert(0) += 1;
            *sum.entry((bits(to), bits(from))).or_insert(0) -= 1;
        }
    }
    sum
}

/// Edges that only one triangle has.
pub(crate) fn border_edges(mesh: &Mesh) -> usize {
    edges(mesh).values().filter(|n| **n > 0).count()
}

/// Every edge is met once in each direction, and no triangle has zero area.
pub(crate) fn closed(mesh: &Mesh) {
    assert!(mesh.triangle_count() > 0, "{} has no triangles", mesh.name);
    assert_eq!(border_edges(mesh), 0, "{} is open", mesh.name);
    assert!(triangle_areas(mesh).all(|a| a > 0.0), "{} has a triangle without area", mesh.name);
    assert!(mesh.clone().checked().is_ok());
}

/// Areas of the triangles, square metres.
pub(crate) fn triangle_areas(mesh: &Mesh) -> impl Iterator<Item = f32> + '_ {
    triangles(mesh).map(|[a, b, c]| (b - a).cross(c - a).length() * 0.5)
}

/// Faces and normals point away from the origin.
pub(crate) fn outward(mesh: &Mesh) {
    outward_along(mesh, |p| p);
}

/// Faces and normals point to the side of `out(place)`; normals have unit length.
pub(crate) fn outward_along(mesh: &Mesh, out: impl Fn(Vec3) -> Vec3) {
    for t in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| mesh.positions[i as usize]);
        let face = (b - a).cross(c - a).normalize();
        assert!(face.dot(out((a + b + c) / 3.0)) > 0.0, "{}: a triangle faces inward", mesh.name);
        for i in t {
            let n = mesh.normals[*i as usize];
            assert!((n.length() - 1.0).abs() < 1e-5, "{}: normal {n} is not of unit length", mesh.name);
            assert!(n.dot(face) > 0.0, "{}: normal {n} against its face {face}", mesh.name);
        }
    }
}

/// Enclosed volume, cubic metres; positive if the faces point outward.
pub(crate) fn volume(mesh: &Mesh) -> f32 {
    triangles(mesh).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}
