//! Axis-aligned bounding boxes.

use glam::{Mat4, Vec3};

/// An axis-aligned box. The empty box has `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest corner, metres.
    pub min: Vec3,
    /// Largest corner, metres.
    pub max: Vec3,
}

impl Default for Aabb {
    fn default() -> Aabb {
        Aabb::EMPTY
    }
}

impl Aabb {
    /// The box that contains nothing; the neutral element of [`Aabb::union`].
    pub const EMPTY: Aabb = Aabb { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around `points`. Points that are not finite are left out.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Aabb {
        points.into_iter().filter(|p| p.is_finite()).fold(Aabb::EMPTY, |b, p| Aabb { min: b.min.min(p), max: b.max.max(p) })
    }

    /// Does the box contain no point?
    pub fn is_empty(&self) -> bool {
        !(self.min.cmple(self.max).all())
    }

    /// The smallest box around both.
    pub fn union(self, other: Aabb) -> Aabb {
        Aabb { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Centre; the origin for an empty box.
    pub fn centre(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { (self.min + self.max) * 0.5 }
    }

    /// Half of the diagonal, metres; 0 for an empty box.
    pub fn radius(&self) -> f32 {
        if self.is_empty() { 0.0 } else { (self.max - self.min).length() * 0.5 }
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let pick = |bit: usize, lo: f32, hi: f32| if i & bit == 0 { lo } else { hi };
            Vec3::new(pick(1, self.min.x, self.max.x), pick(2, self.min.y, self.max.y), pick(4, self.min.z, self.max.z))
        })
    }

    /// The axis-aligned box around the transformed box. Empty stays empty.
    pub fn transformed(&self, b_from_a: &Mat4) -> Aabb {
        if self.is_empty() {
            return Aabb::EMPTY;
        }
        Aabb::from_points(self.corners().map(|c| b_from_a.transform_point3(c)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_is_neutral_and_nan_is_left_out() {
        let b = Aabb::from_points([Vec3::ZERO, Vec3::NAN, Vec3::ONE]);
        assert_eq!(b, Aabb { min: Vec3::ZERO, max: Vec3::ONE });
        assert_eq!(b.union(Aabb::EMPTY), b);
        assert!(Aabb::EMPTY.transformed(&Mat4::from_scale(Vec3::splat(2.0))).is_empty());
    }

    #[test]
    fn transformed_box_holds_every_corner() {
        let b = Aabb { min: Vec3::new(-1.0, 0.0, 2.0), max: Vec3::new(1.0, 3.0, 4.0) };
        let m = Mat4::from_rotation_y(0.7) * Mat4::from_scale(Vec3::new(-1.0, 2.0, 1.0));
        let t = b.transformed(&m);
        for c in b.corners() {
            let p = m.transform_point3(c);
            assert!(p.cmpge(t.min - 1e-5).all() && p.cmple(t.max + 1e-5).all());
        }
    }
}
