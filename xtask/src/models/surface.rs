//! Triangles of one material, put together from simple pieces.

use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// Vertices and triangles. Joints and weights are empty where nothing is skinned.
#[derive(Default)]
pub(crate) struct Surface {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) uvs: Vec<Vec2>,
    pub(crate) joints: Vec<[u8; 4]>,
    pub(crate) weights: Vec<[f32; 4]>,
    pub(crate) indices: Vec<u32>,
}

/// A ring of a loft: an ellipse in a horizontal plane, moved by at most two joints.
pub(crate) struct Ring {
    pub(crate) centre: Vec3,
    pub(crate) radius: Vec2,
    pub(crate) joints: [(u8, f32); 2],
}

impl Surface {
    fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.uvs.push(uv);
        self.positions.len() as u32 - 1
    }

    /// A flat quad, corners counter-clockwise from the lower left; `uv` is the size of its texture in repeats.
    pub(crate) fn quad(&mut self, corners: [Vec3; 4], uv: Vec2) {
        let n = (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalize_or(Vec3::Y);
        let uvs = [Vec2::new(0.0, uv.y), uv, Vec2::new(uv.x, 0.0), Vec2::ZERO];
        let [a, b, c, d] = std::array::from_fn(|i| self.vertex(corners[i], n, uvs[i]));
        self.indices.extend([a, b, c, a, c, d]);
    }

    /// A flat triangle, corners counter-clockwise.
    pub(crate) fn triangle(&mut self, corners: [Vec3; 3], uvs: [Vec2; 3]) {
        let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(Vec3::Y);
        let [a, b, c] = std::array::from_fn(|i| self.vertex(corners[i], n, uvs[i]));
        self.indices.extend([a, b, c]);
    }

    /// A box between two corners; the texture repeats every `texture_m` metres.
    pub(crate) fn cuboid(&mut self, min: Vec3, max: Vec3, texture_m: f32) {
        self.walls(min, max, texture_m);
        let (a, b) = (min, max);
        let uv = Vec2::new(b.x - a.x, b.z - a.z) / texture_m;
        self.quad([Vec3::new(a.x, b.y, b.z), b, Vec3::new(b.x, b.y, a.z), Vec3::new(a.x, b.y, a.z)], uv);
        self.quad([a, Vec3::new(b.x, a.y, a.z), Vec3::new(b.x, a.y, b.z), Vec3::new(a.x, a.y, b.z)], uv);
    }

    /// The four upright sides of a box: open above and below.
    pub(crate) fn walls(&mut self, min: Vec3, max: Vec3, texture_m: f32) {
        let (x, z) = ([min.x, max.x], [min.z, max.z]);
        let at = |i: usize, y: f32, k: usize| Vec3::new(x[i], y, z[k]);
        for [(i, k), (l, m)] in [[(0, 1), (1, 1)], [(1, 1), (1, 0)], [(1, 0), (0, 0)], [(0, 0), (0, 1)]] {
            let corners = [at(i, min.y, k), at(l, min.y, m), at(l, max.y, m), at(i, max.y, k)];
            let uv = Vec2::new(corners[0].distance(corners[1]), max.y - min.y) / texture_m;
            self.quad(corners, uv);
        }
    }

    /// A solid of revolution about the y axis through `centre`: `profile` holds radius and height from bottom to top.
    /// It is closed where the profile starts and ends at radius 0.
    pub(crate) fn lathe(&mut self, centre: Vec3, profile: &[Vec2], segments: usize) {
        for pair in profile.windows(2) {
            let (low, high) = (pair[0], pair[1]);
            let slope = high - low;
            for i in 0..segments {
                let direction = |k: usize| {
                    let angle = TAU * (k % segments) as f32 / segments as f32;
                    Vec3::new(angle.sin(), 0.0, angle.cos())
                };
                let (d0, d1) = (direction(i), direction(i + 1));
                let at = |d: Vec3, p: Vec2| centre + d * p.x + Vec3::Y * p.y;
                let normal = |d: Vec3| (d * slope.y - Vec3::Y * slope.x).normalize_or(Vec3::Y);
                let (u0, u1) = (i as f32 / segments as f32, (i + 1) as f32 / segments as f32);
                let a = self.vertex(at(d0, low), normal(d0), Vec2::new(u0, 1.0));
                let b = self.vertex(at(d1, low), normal(d1), Vec2::new(u1, 1.0));
                let c = self.vertex(at(d1, high), normal(d1), Vec2::new(u1, 0.0));
                let d = self.vertex(at(d0, high), normal(d0), Vec2::new(u0, 0.0));
                if low.x > 0.0 {
                    self.indices.extend([a, b, c]);
                }
                if high.x > 0.0 {
                    self.indices.extend([a, c, d]);
                }
            }
        }
    }

    /// A closed skinned tube through elliptic rings from bottom to top.
    pub(crate) fn loft(&mut self, rings: &[Ring], segments: usize) {
        let first = self.positions.len() as u32;
        for (r, ring) in rings.iter().enumerate() {
            for i in 0..segments {
                let angle = TAU * i as f32 / segments as f32;
                let out = Vec3::new(angle.sin(), 0.0, angle.cos());
                let p = ring.centre + out * Vec3::new(ring.radius.x, 0.0, ring.radius.y);
                let normal = (out / Vec3::new(ring.radius.x, 1.0, ring.radius.y)).normalize();
                self.vertex(p, normal, Vec2::new(i as f32 / segments as f32, r as f32));
                self.bind(ring.joints);
            }
        }
        let n = segments as u32;
        for r in 0..rings.len() as u32 - 1 {
            for i in 0..n {
                let [a, b] = [i, (i + 1) % n].map(|k| first + r * n + k);
                self.indices.extend([a, b, b + n, a, b + n, a + n]);
            }
        }
        for (ring, r, up) in [(&rings[0], 0, -1.0), (&rings[rings.len() - 1], rings.len() as u32 - 1, 1.0)] {
            let middle = self.vertex(ring.centre, Vec3::Y * up, Vec2::splat(0.5));
            self.bind(ring.joints);
            for i in 0..n {
                let [a, b] = [i, (i + 1) % n].map(|k| first + r * n + k);
                self.indices.extend(if up > 0.0 { [a, b, middle] } else { [b, a, middle] });
            }
        }
    }

    fn bind(&mut self, joints: [(u8, f32); 2]) {
        self.joints.push([joints[0].0, joints[1].0, 0, 0]);
        self.weights.push([joints[0].1, joints[1].1, 0.0, 0.0]);
    }

    /// A closed round bar between two points.
    pub(crate) fn bar(&mut self, from: Vec3, to: Vec3, radius: f32, segments: usize) {
        let axis = (to - from).normalize_or(Vec3::Y);
        let (side, other) = axis.any_orthonormal_pair();
        let at = |p: Vec3, i: usize| {
            let angle = TAU * (i % segments) as f32 / segments as f32;
            p + (side * angle.cos() + other * angle.sin()) * radius
        };
        for i in 0..segments {
            let corners = [at(from, i), at(from, i + 1), at(to, i + 1), at(to, i)];
            self.quad(corners, Vec2::ONE);
            self.triangle([at(to, i), at(to, i + 1), to], [Vec2::ZERO; 3]);
            self.triangle([at(from, i + 1), at(from, i), from], [Vec2::ZERO; 3]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// How often each directed edge, by position, lacks its opposite.
    fn open_edges(s: &Surface) -> usize {
        let key = |i: u32| s.positions[i as usize].to_array().map(|v| (v + 0.0).to_bits());
        let mut count: HashMap<_, i32> = HashMap::new();
        for t in s.indices.chunks_exact(3) {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let (a, b) = (key(a), key(b));
                *count.entry(if a < b { (a, b) } else { (b, a) }).or_default() += if a < b { 1 } else { -1 };
            }
        }
        count.values().filter(|c| **c != 0).count()
    }

    #[test]
    fn closed_pieces_are_closed_and_open_ones_open() {
        let build = |f: &dyn Fn(&mut Surface)| {
            let mut s = Surface::default();
            f(&mut s);
            s
        };
        let ring = |y| Ring { centre: Vec3::Y * y, radius: Vec2::new(1.0, 0.5), joints: [(0, 1.0), (0, 0.0)] };
        let rows = [
            ("cuboid", build(&|s| s.cuboid(Vec3::ZERO, Vec3::ONE, 1.0)), 0),
            ("walls", build(&|s| s.walls(Vec3::ZERO, Vec3::ONE, 1.0)), 8),
            (
                "lathe",
                build(&|s| s.lathe(Vec3::ZERO, &[Vec2::ZERO, Vec2::new(1.0, 0.0), Vec2::new(1.0, 2.0), Vec2::new(0.0, 2.0)], 12)),
                0,
            ),
            ("loft", build(&|s| s.loft(&[ring(0.0), ring(1.0), ring(2.0)], 8)), 0),
            ("bar", build(&|s| s.bar(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), 0.1, 6)), 0),
        ];
        for (name, surface, expected) in rows {
            assert_eq!(open_edges(&surface), expected, "{name}");
        }
    }

    #[test]
    fn closed_pieces_face_outwards() {
        let mut s = Surface::default();
        s.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), 1.0);
        let volume: f32 = s
            .indices
            .chunks_exact(3)
            .map(|t| {
                let [a, b, c] = [t[0], t[1], t[2]].map(|i| s.positions[i as usize]);
                a.dot(b.cross(c)) / 6.0
            })
            .sum();
        assert!((volume - 8.0).abs() < 1e-5, "{volume}");
    }
}
