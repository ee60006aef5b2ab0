//! Flat faces of meshes: what shadows fall on, and what hides what is behind it.

use super::hull;
use glam::{DVec3, DVec4, Mat4};
use umbriel_scene::Mesh;

/// A convex polygon in the world.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// A triangle repeats its last corner.
    corners: [DVec3; 4],
    count: usize,
    /// Of any length, towards the side that sees its corners counter-clockwise.
    normal: DVec3,
}

/// How far from a plane a corner may be that lies in it, to the way that it is away from another corner.
const FLAT: f64 = 1e-6;

impl Face {
    fn triangle([a, b, c]: [DVec3; 3]) -> Face {
        Face { corners: [a, b, c, c], count: 3, normal: (b - a).cross(c - a) }
    }

    /// Two triangles that follow each other, if they share an edge and make one flat convex face.
    fn quad(one: [DVec3; 3], other: [DVec3; 3]) -> Option<Face> {
        let along = |i: usize| (one[i], one[(i + 1) % 3]);
        let against = |i: usize| (other[(i + 1) % 3], other[i]);
        let (i, j) = (0..9).map(|k| (k / 3, k % 3)).find(|(i, j)| along(*i) == against(*j))?;
        let corners = [one[i], other[(j + 2) % 3], one[(i + 1) % 3], one[(i + 2) % 3]];
        let face = Face { corners, count: 4, ..Face::triangle(one) };
        let is_flat = face.normal.dot(corners[1] - corners[0]).abs()
            <= FLAT * face.normal.length() * corners[0].distance(corners[1]).min(corners[2].distance(corners[1]));
        let turns = |k: usize| {
            let [a, b, c] = [k, k + 1, k + 2].map(|k| corners[k % 4]);
            (b - a).cross(c - b).dot(face.normal)
        };
        (is_flat && (0..4).all(|k| turns(k) > 0.0)).then_some(face)
    }

    /// The corners, in order.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// Distance of a point from its plane, in front of it, metres; of a mirrored object's face, behind it.
    pub fn distance_to(&self, p: DVec3) -> f64 {
        self.normal.normalize_or_zero().dot(p - self.corners[0])
    }

    /// 1 / how often a ray must be as long to reach its plane. Infinite or not a number where the plane holds its origin.
    pub(super) fn nearness(&self, origin: DVec3, ray: DVec3) -> f64 {
        self.normal.dot(ray) / self.normal.dot(self.corners[0] - origin)
    }

    /// How far it may be from where it is drawn, metres.
    pub fn margin(&self) -> f64 {
        hull::margin(&self.corners.map(|c| c.extend(1.0)))
    }
}

/// The faces of a mesh of triangles, at a place.
pub fn faces(mesh: &Mesh, world_from_object: &Mat4) -> Vec<Face> {
    let at = |i: u32| world_from_object.transform_point3(mesh.positions[i as usize]).as_dvec3();
    let mut faces: Vec<Face> = Vec::with_capacity(mesh.triangle_count());
    let mut before: Option<[DVec3; 3]> = None;
    for t in mesh.indices.chunks_exact(3) {
        let corners = [at(t[0]), at(t[1]), at(t[2])];
        if let Some(quad) = before.and_then(|before| Face::quad(before, corners)) {
            faces.pop();
            faces.push(quad);
            before = None;
        } else {
            faces.push(Face::triangle(corners));
            before = Some(corners);
        }
    }
    faces
}

/// What of a convex polygon is on the inner side of a plane (unit normal inward), in place. `spare` is overwritten.
pub(super) fn clip(polygon: &mut Vec<DVec3>, spare: &mut Vec<DVec3>, plane: DVec4) {
    spare.clear();
    for (i, &p) in polygon.iter().enumerate() {
        let next = polygon[(i + 1) % polygon.len()];
        let (here, there) = (hull::height(&plane, p), hull::height(&plane, next));
        if here >= 0.0 {
            spare.push(p);
        }
        if (here < 0.0) != (there < 0.0) {
            spare.push(p.lerp(next, here / (here - there)));
        }
    }
    std::mem::swap(polygon, spare);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn neighbours_in_a_plane_are_one_face() {
        let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let flat = [at(0., 0., 0.), at(1., 0., 0.), at(1., 0., 1.), at(0., 0., 1.)];
        let dented = [at(0., 0., 0.), at(1., 0., 0.), at(0.2, 0., 0.2), at(0., 0., 1.)];
        let bent = [at(0., 0., 0.), at(1., 0., 0.), at(1., 0.1, 1.), at(0., 0., 1.)];
        for (name, positions, indices, expected) in [
            ("flat", flat, vec![0, 2, 1, 0, 3, 2], vec![4]),
            ("flat, from another corner", flat, vec![1, 0, 2, 3, 2, 0], vec![4]),
            ("wound against each other", flat, vec![0, 2, 1, 0, 2, 3], vec![3, 3]),
            ("bent", bent, vec![0, 2, 1, 0, 3, 2], vec![3, 3]),
            ("dented", dented, vec![0, 2, 1, 0, 3, 2], vec![3, 3]),
            ("three", flat, vec![0, 2, 1, 0, 3, 2, 0, 3, 2], vec![4, 3]),
            ("without size", flat, vec![0, 2, 1, 0, 2, 2], vec![3, 3]),
        ] {
            let mesh = Mesh { positions: positions.to_vec().into(), indices: indices.into(), ..Mesh::default() };
            let place = Mat4::from_translation(Vec3::new(3.0, -1.0, 2.0));
            let counts: Vec<usize> = faces(&mesh, &place).iter().map(|f| f.corners().len()).collect();
            assert_eq!(counts, expected, "{name}");
        }
    }
}
