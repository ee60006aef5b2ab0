//! Boxes that stand askew.

use super::hull;
use glam::{DVec3, DVec4, Mat4};
use umbriel_scene::Aabb;

/// A box along the axes of an object, in the world. Where the object is turned, it is smaller than the box around it along the
/// axes of the world.
#[derive(Clone, Copy, Debug)]
pub struct TurnedBox {
    /// Box around it along the axes of the world; [`Aabb::EMPTY`] where nothing is known (slower, and as exact).
    pub in_world: Aabb,
    /// w = 1.
    pub(super) corners: [DVec4; 8],
    /// Unit vectors along its edges; those without a direction are zero.
    pub(super) edges: [DVec3; 3],
}

impl TurnedBox {
    /// One along the axes of the world.
    pub fn straight(in_world: Aabb) -> TurnedBox {
        TurnedBox { in_world, corners: hull::corners(&in_world), edges: DVec3::AXES }
    }

    /// One along the axes of an object, given there.
    pub fn of(in_object: &Aabb, world_from_object: &Mat4) -> TurnedBox {
        let in_world = in_object.transformed(world_from_object);
        let to_world = world_from_object.as_dmat4();
        let corners = in_object.corners().map(|c| to_world.transform_point3(c.as_dvec3()).extend(1.0));
        if in_world.is_empty() || !corners.iter().all(|c| c.is_finite()) {
            return TurnedBox::straight(in_world);
        }
        let edges = [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(|axis| axis.truncate().normalize_or_zero());
        TurnedBox { in_world, corners, edges }
    }

    /// Planes that hold it, unit normals inward.
    pub(super) fn planes(&self) -> impl Iterator<Item = DVec4> {
        let margin = hull::margin(&self.corners);
        self.normals().into_iter().filter_map(DVec3::try_normalize).flat_map(move |normal| {
            let (low, high) = hull::extent(&self.corners, normal);
            [normal.extend(margin - low), (-normal).extend(margin + high)]
        })
    }

    /// Normals of its faces, of any length.
    pub(super) fn normals(&self) -> [DVec3; 3] {
        let [x, y, z] = self.edges;
        [y.cross(z), z.cross(x), x.cross(y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn what_is_turned_is_apart_from_what_lies_in_the_corner_of_its_box() {
        let beam = Aabb { min: Vec3::new(-10.0, -0.1, -0.1), max: Vec3::new(10.0, 0.1, 0.1) };
        let turned = TurnedBox::of(&beam, &Mat4::from_rotation_y(std::f32::consts::FRAC_PI_4));
        let corner = [DVec4::new(6.0, 0.0, 6.0, 1.0)];
        let straight = TurnedBox::straight(turned.in_world);
        let is_apart = |b: &TurnedBox| hull::are_apart(&b.corners, &corner, b.normals(), 1e-3);
        assert_eq!([is_apart(&turned), is_apart(&straight)], [true, false]);
        // It holds all of the beam.
        let along = [DVec4::new(7.0, 0.0, -7.0, 1.0)];
        assert!(!hull::are_apart(&turned.corners, &along, turned.normals(), 1e-3));
    }

    #[test]
    fn what_is_not_known_stays_so() {
        let place = Mat4::from_rotation_y(1.0);
        assert!(TurnedBox::of(&Aabb::EMPTY, &place).in_world.is_empty());
        let flat = TurnedBox::of(&Aabb { min: -Vec3::ONE, max: Vec3::ONE }, &Mat4::from_scale(Vec3::new(1.0, 0.0, 1.0)));
        assert!(flat.edges[1] == DVec3::ZERO && flat.corners.iter().all(|c| c.y == 0.0));
    }
}
