//! Rays and triangles in double precision.

use glam::DVec3;

/// A ray; distances along it are in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) origin: DVec3,
    /// Unit vector.
    pub(super) direction: DVec3,
}

/// A triangle in the world, and where it came from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub(super) corners: [DVec3; 3],
    /// Place among the soup's shapes.
    pub(super) shape: u32,
    /// Place among the triangles of its mesh.
    pub(super) place: u32,
    /// The matrix mirrors: corners 1 and 2 were swapped, so that the winding in the world tells the front.
    pub(super) mirrored: bool,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    /// Place among the soup's triangles.
    pub(super) triangle: usize,
    /// Metres from the ray's origin.
    pub(super) distance: f64,
    /// Weights of the corners, which sum to 1.
    pub(super) weights: [f64; 3],
    /// Met from the side from which the triangle winds counter-clockwise.
    pub(super) front: bool,
}

impl Triangle {
    /// Unit normal of the front.
    pub(super) fn normal(&self) -> DVec3 {
        self.scaled_normal().normalize_or_zero()
    }

    /// Normal as long as twice the area.
    pub(super) fn scaled_normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }
}

impl Ray {
    pub(super) fn new(origin: DVec3, direction: DVec3) -> Ray {
        Ray { origin, direction }
    }

    /// The same ray from a later start.
    pub(super) fn starting_at(&self, distance: f64) -> Ray {
        Ray { origin: self.origin + self.direction * distance, direction: self.direction }
    }

    /// Meets `triangle`, number `place` of the soup, at a positive distance.
    ///
    /// The three signed volumes change nothing but their sign when an edge is taken from the other side, so no ray slips
    /// between two triangles with a common edge.
    #[inline]
    pub(super) fn meets(&self, place: usize, triangle: &Triangle) -> Option<Hit> {
        let [a, b, c] = triangle.corners.map(|corner| corner - self.origin);
        let volumes = [c.cross(b), a.cross(c), b.cross(a)].map(|normal| normal.dot(self.direction));
        let inside = volumes.iter().all(|v| *v >= 0.0) || volumes.iter().all(|v| *v <= 0.0);
        let sum = volumes[0] + volumes[1] + volumes[2];
        if !inside || sum == 0.0 {
            return None;
        }
        let normal = triangle.scaled_normal();
        let distance = normal.dot(a) / normal.dot(self.direction);
        // Also false for NaN.
        let ahead = distance > 0.0 && distance < f64::INFINITY;
        ahead.then(|| Hit { triangle: place, distance, weights: volumes.map(|v| v / sum), front: sum > 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_tight_and_sides_are_told() {
        let p = DVec3::new;
        let triangle = |corners| Triangle { corners, shape: 0, place: 0, mirrored: false };
        let (a, b, c, d) = (p(0.1, 0.0, 0.3), p(1.0, 0.7, 0.1), p(0.0, 1.0, 0.2), p(1.3, 1.9, 0.4));
        let (lower, upper) = (triangle([a, b, c]), triangle([b, d, c]));
        let eye = p(0.31, 0.27, 5.0);
        for i in 1..1000 {
            let on_the_edge = b.lerp(c, f64::from(i) / 1000.0);
            let ray = Ray::new(eye, (on_the_edge - eye).normalize());
            let hits = [&lower, &upper].map(|t| ray.meets(0, t));
            assert!(hits.iter().any(|h| h.is_some()), "{i}");
            assert!(hits.iter().flatten().all(|h| h.front && (h.distance - on_the_edge.distance(eye)).abs() < 1e-12));
        }
        let back = Ray::new(p(0.3, 0.3, -4.0), DVec3::Z).meets(7, &lower).unwrap();
        assert!(!back.front && back.triangle == 7);
        let point = a * back.weights[0] + b * back.weights[1] + c * back.weights[2];
        assert!(point.abs_diff_eq(p(0.3, 0.3, -4.0 + back.distance), 1e-12));
        for (origin, direction) in
            [(p(0.3, 0.3, 4.0), DVec3::Z), (p(3.0, 0.3, 4.0), DVec3::NEG_Z), (p(0.3, 0.3, 0.0), DVec3::NAN)]
        {
            assert_eq!(Ray::new(origin, direction).meets(0, &lower), None);
        }
    }
}
