//! How far two surfaces are apart.

use glam::DVec3;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::{BvhBuildParams, aabb::Aabb as Box3};

/// Deepest subdivision of a triangle.
const DEEPEST: u32 = 5;

/// Triangles that are asked for the point nearest to another.
pub(crate) struct Surface {
    triangles: Vec<[DVec3; 3]>,
    bvh: Bvh2,
}

impl Surface {
    /// Of at least one triangle.
    pub(crate) fn new(triangles: Vec<[DVec3; 3]>) -> Surface {
        let boxes: Vec<Box3> =
            triangles.iter().map(|[a, b, c]| Box3::new(a.min(*b).min(*c).as_vec3a(), a.max(*b).max(*c).as_vec3a())).collect();
        let bvh = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut std::time::Duration::default());
        let triangles = bvh.primitive_indices.iter().map(|i| triangles[*i as usize]).collect();
        Surface { triangles, bvh }
    }

    /// Distance of a point from the surface, and the triangle that is nearest.
    fn nearest(&self, p: DVec3) -> Near {
        let (mut best, mut triangle) = (f64::INFINITY, 0);
        let mut open: Vec<(f64, u32)> = vec![(0.0, 0)];
        while let Some((near, node)) = open.pop() {
            if near >= best {
                continue;
            }
            let Some(node) = self.bvh.nodes.get(node as usize) else { continue };
            if node.prim_count > 0 {
                let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
                for t in range {
                    let distance = p.distance(nearest_in_triangle(p, self.triangles[t]));
                    if distance < best {
                        (best, triangle) = (distance, t);
                    }
                }
                continue;
            }
            let mut children = [node.first_index, node.first_index + 1].map(|c| {
                let b = &self.bvh.nodes[c as usize].aabb;
                let (low, high) = (b.min.as_dvec3(), b.max.as_dvec3());
                (p.distance(p.clamp(low, high)), c)
            });
            children.sort_by(|x, y| y.0.total_cmp(&x.0));
            open.extend(children);
        }
        Near { distance: best, triangle }
    }

    /// An upper bound of how far any point of `other` is from this surface, at most about `slack` above the true one.
    pub(crate) fn farthest(&self, other: &Surface, slack: f64) -> f64 {
        let mut reached = 0.0_f64;
        for t in &other.triangles {
            let near = t.map(|p| self.nearest(p));
            reached = reached.max(self.bound(*t, near, reached, slack, 0));
        }
        reached
    }

    /// The bound of one triangle; parts that cannot exceed `known` are not looked at closely.
    fn bound(&self, [a, b, c]: [DVec3; 3], [p, q, r]: [Near; 3], known: f64, slack: f64, depth: u32) -> f64 {
        let highest = p.distance.max(q.distance).max(r.distance);
        // The distance from one triangle is a convex function: largest at a corner. The nearest surface is no farther.
        let from =
            |t: usize| [a, b, c].map(|p| p.distance(nearest_in_triangle(p, self.triangles[t]))).into_iter().fold(0.0, f64::max);
        let bound = [p, q, r].map(|n| from(n.triangle)).into_iter().fold(f64::INFINITY, f64::min);
        if bound <= known.max(highest + slack) || depth == DEEPEST {
            return bound;
        }
        let [ab, bc, ca] = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
        let [x, y, z] = [ab, bc, ca].map(|m| self.nearest(m));
        let parts = [([a, ab, ca], [p, x, z]), ([ab, b, bc], [x, q, y]), ([ca, bc, c], [z, y, r]), ([ab, bc, ca], [x, y, z])];
        parts.into_iter().fold(0.0, |most: f64, (t, d)| most.max(self.bound(t, d, known.max(most), slack, depth + 1)))
    }
}

/// What is nearest to a point.
#[derive(Clone, Copy)]
struct Near {
    distance: f64,
    triangle: usize,
}

/// The point of a triangle that is nearest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
fn nearest_in_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_at_a_known_distance() {
        let sheet = |y: f64, bend: f64| {
            let p = |x: f64, z: f64| DVec3::new(x, y + bend * x * z, z);
            Surface::new(vec![[p(0., 0.), p(1., 0.), p(1., 1.)], [p(0., 0.), p(1., 1.), p(0., 1.)]])
        };
        for (name, other, expected) in
            [("the same", sheet(0.0, 0.0), 0.0), ("above", sheet(0.25, 0.0), 0.25), ("bent", sheet(0.1, 0.2), 0.3)]
        {
            let found = sheet(0.0, 0.0).farthest(&other, 1e-3);
            assert!((expected..=expected + 0.02).contains(&found), "{name}: {found}");
        }
        let outside = nearest_in_triangle(DVec3::new(5.0, 1.0, -3.0), [DVec3::ZERO, DVec3::X, DVec3::Z]);
        assert_eq!(outside, DVec3::X);
    }
}
