//! What a view can see: boxes against the planes of its frustum.

use glam::{Mat4, Vec3, Vec4};
use umbriel_scene::Aabb;

/// The planes of a frustum; a far plane at infinity lets everything pass.
pub(crate) struct Planes([Vec4; 6]);

/// A box as its centre and half its size.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CentredBox {
    pub(crate) centre: Vec3,
    pub(crate) half: Vec3,
}

impl From<Aabb> for CentredBox {
    fn from(b: Aabb) -> CentredBox {
        CentredBox { centre: b.centre(), half: (b.max - b.min) * 0.5 }
    }
}

impl Planes {
    /// From `clip_from_world` with depth 0..=1.
    pub(crate) fn new(clip_from_world: &Mat4) -> Planes {
        let [x, y, z, w] = [0, 1, 2, 3].map(|i| clip_from_world.row(i));
        Planes([w + x, w - x, w + y, w - y, w - z, z])
    }

    /// False only where the box is outside for certain.
    pub(crate) fn may_see(&self, b: &CentredBox) -> bool {
        self.0.iter().all(|plane| {
            let n = plane.truncate();
            n.dot(b.centre) + plane.w + n.abs().dot(b.half) >= 0.0
        })
    }

    /// True only where all of the box is inside for certain.
    pub(crate) fn see_all_of(&self, b: &CentredBox) -> bool {
        self.0.iter().all(|plane| {
            let n = plane.truncate();
            n.dot(b.centre) + plane.w - n.abs().dot(b.half) >= 0.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use umbriel_scene::Frustum;

    #[test]
    fn boxes_in_front_are_seen_and_others_not() {
        let planes = Planes::new(&Frustum::symmetric(1.0, 1.0, 0.1).clip_from_view());
        for (centre, seen) in [
            ([0.0, 0.0, -5.0], true),
            ([0.0, 0.0, -1e7], true),
            ([0.0, 0.0, 5.0], false),
            ([0.0, 0.0, 0.3], true),
            ([-9.0, 0.0, -5.0], false),
            ([9.0, 0.0, -5.0], false),
            ([0.0, 9.0, -5.0], false),
            ([0.0, -9.0, -5.0], false),
            ([3.0, 0.0, -5.0], true),
        ] {
            let b = CentredBox { centre: Vec3::from(centre), half: Vec3::splat(0.5) };
            assert_eq!(planes.may_see(&b), seen, "{centre:?}");
        }
        for (centre, whole) in [([0.0, 0.0, -5.0], true), ([2.5, 0.0, -5.0], false), ([0.0, 0.0, -0.3], false)] {
            let b = CentredBox { centre: Vec3::from(centre), half: Vec3::splat(0.5) };
            assert_eq!(planes.see_all_of(&b), whole, "{centre:?}");
        }
    }
}
