//! How often a surface goes around a place.

use crate::Mesh;
use glam::{DVec3, Vec3};

impl Mesh {
    /// How often the closed surface of triangles, at rest, goes around a place in object space: 1 inside of what is wound outward, -1
    /// inside of what is wound inward, 0 outside. Means nothing where [`crate::Edges::closed`] is false.
    ///
    /// What a ray along x leaves counts up, what it enters down. Triangles that share an edge agree on which of them the ray meets, so
    /// none is met twice or missed.
    pub fn winding_around(&self, place: Vec3) -> i32 {
        let place = place.as_dvec3();
        let corners = |t: &[u32]| {
            let at = |i: usize| self.positions.get(t[i] as usize).map(|p| p.as_dvec3() - place);
            Some([at(0)?, at(1)?, at(2)?])
        };
        self.indices.chunks_exact(3).filter_map(corners).map(crossing).sum()
    }
}

/// 1 where a ray along x from the origin passes the triangle from behind, -1 where from its front, else 0.
fn crossing([a, b, c]: [DVec3; 3]) -> i32 {
    let turns = passed(a, b) + passed(b, c) + passed(c, a);
    let normal = (b - a).cross(c - a);
    // Which way the ray comes is the sign of the normal's x, and so of the turns.
    if turns != 0 && normal.dot(a) * f64::from(turns) > 0.0 { turns } else { 0 }
}

/// Of an edge as it is seen along x: 1 where it passes over the origin towards negative y, with z up, -1 on the way back.
fn passed(from: DVec3, to: DVec3) -> i32 {
    let (low, high, turn) = match (from.y <= 0.0, to.y <= 0.0) {
        (true, false) => (from, to, -1),
        (false, true) => (to, from, 1),
        _ => return 0,
    };
    if low.z * high.y > high.z * low.y { turn } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube from -1 to 1, moved and scaled, wound outward.
    fn cube(scale: f32, middle: Vec3) -> Vec<[Vec3; 3]> {
        let corner =
            |i: u32| middle + scale * Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 }));
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).map(|t| t.map(corner)).collect()
    }

    fn turned(triangles: Vec<[Vec3; 3]>) -> Vec<[Vec3; 3]> {
        triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect()
    }

    fn around(triangles: &[[Vec3; 3]], place: Vec3) -> i32 {
        let positions = triangles.concat().into();
        let indices = (0..3 * triangles.len() as u32).collect();
        Mesh { positions, indices, ..Default::default() }.winding_around(place)
    }

    #[test]
    fn surfaces_go_around_what_is_inside() {
        let one = cube(1.0, Vec3::ZERO);
        let hollow = [one.clone(), turned(cube(0.5, Vec3::ZERO))].concat();
        let two = [one.clone(), cube(1.0, Vec3::new(1.0, 0.5, 0.25))].concat();
        let rows = [
            ("inside", &one, Vec3::new(0.3, -0.2, 0.9), 1),
            // Rays meet edges and corners there.
            ("in the middle", &one, Vec3::ZERO, 1),
            ("beside an edge", &one, Vec3::new(-3.0, 1.0, 0.0), 0),
            ("beside a corner", &one, Vec3::new(-3.0, -1.0, -1.0), 0),
            ("behind", &one, Vec3::new(3.0, 0.0, 0.0), 0),
            ("before", &one, Vec3::new(-3.0, 0.0, 0.0), 0),
            ("wound inward", &turned(one.clone()), Vec3::ZERO, -1),
            ("within a hollow wall", &hollow, Vec3::ZERO, 0),
            ("inside of a wall", &hollow, Vec3::new(0.0, 0.75, 0.0), 1),
            ("inside of two", &two, Vec3::new(0.5, 0.25, 0.0), 2),
            ("nothing", &vec![], Vec3::ZERO, 0),
        ];
        for (name, triangles, place, expected) in rows {
            assert_eq!(around(triangles, place), expected, "{name}");
        }
    }

    #[test]
    fn indices_out_of_range_do_not_count() {
        let mesh = Mesh { positions: [Vec3::ONE].into(), indices: [0, 1, 2].into(), ..Default::default() };
        assert_eq!(mesh.winding_around(Vec3::ZERO), 0);
    }
}
