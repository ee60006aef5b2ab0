//! Tangents for normal textures on meshes that have none.

use crate::{Mesh, Topology};
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Vec3, Vec4};

/// Unit tangents of `mesh` by MikkTSpace (Mikkelsen 2008, the default of glTF 2.0), one per vertex; w is the sign of the
/// bitangent `cross(normal, tangent) * w`, which points up in the picture. `uv_set` is that of the normal texture.
///
/// MikkTSpace gives one tangent per corner of each triangle. As the mesh keeps its vertices, the tangents of the corners
/// at a vertex are averaged, by the sign of the majority. Vertices around which the texture has no area get any tangent
/// across the normal. Empty where the mesh has no triangles, normals or such texture coordinates.
pub fn tangents(mesh: &Mesh, uv_set: u8) -> Vec<Vec4> {
    let uv = if uv_set == 0 { &mesh.uv0 } else { &mesh.uv1 };
    let vertices = mesh.positions.len();
    let usable = mesh.topology == Topology::Triangles && mesh.normals.len() == vertices && uv.len() == vertices;
    if !usable || mesh.indices.iter().any(|i| *i as usize >= vertices) {
        return Vec::new();
    }
    let mut corners =
        Corners { mesh, uv, right: vec![Vec3::ZERO; vertices], mirrored: vec![Vec3::ZERO; vertices], sign: vec![0; vertices] };
    // Its error has no variants; unusable triangles are passed to `set_tangent` as `None`.
    let _ = generate_tangents(&mut corners);
    (0..vertices).map(|v| corners.average(v)).collect()
}

struct Corners<'a> {
    mesh: &'a Mesh,
    uv: &'a [glam::Vec2],
    /// Sum of the tangents with w = 1.
    right: Vec<Vec3>,
    /// Sum of the tangents with w = -1.
    mirrored: Vec<Vec3>,
    /// Number of the former less that of the latter.
    sign: Vec<i32>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.indices[face * 3 + corner] as usize
    }

    fn average(&self, vertex: usize) -> Vec4 {
        let normal = finite(self.mesh.normals[vertex]).try_normalize().unwrap_or(Vec3::Y);
        let (sum, w) = if self.sign[vertex] < 0 { (self.mirrored[vertex], -1.0) } else { (self.right[vertex], 1.0) };
        let across = sum - normal * normal.dot(sum);
        // Opposite tangents cancel to a rest that is only rounding.
        let tangent = if across.length_squared() > 1e-8 { across.normalize() } else { normal.any_orthonormal_vector() };
        tangent.extend(w)
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangle_count()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        finite(self.mesh.positions[self.vertex(face, corner)]).to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        finite(self.mesh.normals[self.vertex(face, corner)]).to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let uv = self.uv[self.vertex(face, corner)];
        // MikkTSpace has v up, our pictures have it down.
        if uv.is_finite() { [uv.x, 1.0 - uv.y] } else { [0.0, 0.0] }
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let Some(space) = space else { return };
        let vertex = self.vertex(face, corner);
        let tangent = finite(Vec3::from_array(space.tangent()));
        if space.is_orientation_preserving() {
            self.right[vertex] += tangent;
            self.sign[vertex] += 1;
        } else {
            self.mirrored[vertex] += tangent;
            self.sign[vertex] -= 1;
        }
    }
}

fn finite(v: Vec3) -> Vec3 {
    if v.is_finite() { v } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec2, vec2};

    /// A square that faces +z, with `uv` at bottom left, bottom right, top right, top left.
    fn square(uv: [Vec2; 4]) -> Mesh {
        Mesh {
            positions: [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y].into(),
            normals: [Vec3::Z; 4].into(),
            uv0: uv.into(),
            indices: [0, 1, 2, 0, 2, 3].into(),
            ..Mesh::default()
        }
    }

    #[test]
    fn tangents_of_a_square() {
        let (bl, br, tr, tl) = (vec2(0.0, 1.0), vec2(1.0, 1.0), vec2(1.0, 0.0), vec2(0.0, 0.0));
        let rows = [
            ("as in a picture", [bl, br, tr, tl], Some(Vec4::new(1.0, 0.0, 0.0, 1.0))),
            ("mirrored", [br, bl, tl, tr], Some(Vec4::new(-1.0, 0.0, 0.0, -1.0))),
            ("a quarter turn", [br, tr, tl, bl], Some(Vec4::new(0.0, -1.0, 0.0, 1.0))),
            ("without area", [bl; 4], None),
            ("not a number", [Vec2::NAN; 4], None),
        ];
        for (name, uv, expected) in rows {
            let found = tangents(&square(uv), 0);
            assert_eq!(found.len(), 4, "{name}");
            for t in found {
                assert!(t.truncate().is_normalized() && t.z.abs() < 1e-6 && t.w.abs() == 1.0, "{name}: {t}");
                assert!(expected.is_none_or(|e| t.abs_diff_eq(e, 1e-5)), "{name}: {t}");
            }
        }
    }

    #[test]
    fn corners_of_one_vertex_are_averaged() {
        // Around the y axis: two squares that meet at a right angle and share the vertices of their edge.
        let mesh = Mesh {
            positions: [Vec3::NEG_X, Vec3::ZERO, Vec3::Y, Vec3::new(-1.0, 1.0, 0.0), Vec3::NEG_Z, Vec3::new(0.0, 1.0, -1.0)]
                .into(),
            normals: [Vec3::Z, Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::Z, Vec3::X, Vec3::X]
                .map(|n| n.normalize())
                .into(),
            uv0: [vec2(0., 1.), vec2(1., 1.), vec2(1., 0.), vec2(0., 0.), vec2(2., 1.), vec2(2., 0.)].into(),
            indices: [0, 1, 2, 0, 2, 3, 1, 4, 5, 1, 5, 2].into(),
            ..Mesh::default()
        };
        let found = tangents(&mesh, 0);
        let expected = [Vec3::X, Vec3::new(1., 0., -1.), Vec3::new(1., 0., -1.), Vec3::X, Vec3::NEG_Z, Vec3::NEG_Z];
        for (t, e) in found.iter().zip(expected) {
            assert!(t.abs_diff_eq(e.normalize().extend(1.0), 1e-4), "{t} {e}");
        }
    }

    #[test]
    fn nothing_to_go_by() {
        let whole = square([Vec2::ZERO; 4]);
        for mesh in [
            Mesh::default(),
            Mesh { uv0: [].into(), ..whole.clone() },
            Mesh { normals: [].into(), ..whole.clone() },
            Mesh { indices: [0, 1, 9].into(), ..whole.clone() },
            Mesh { topology: Topology::Lines, ..whole.clone() },
        ] {
            assert!(tangents(&mesh, 0).is_empty());
        }
        assert!(tangents(&whole, 1).is_empty());
    }
}
