//! What a ray meets first: what somebody points at.

use crate::{Aabb, Drawable, Scene, Topology, deformed};
use glam::{DVec3, Vec3};
use std::borrow::Cow;

/// A place on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picked {
    /// Its place in [`Scene::drawables`].
    pub drawable: usize,
    /// Where, in the space of the scene, metres.
    pub point: Vec3,
    /// Unit normal of the triangle there, towards where the ray came from.
    pub normal: Vec3,
    /// From the ray's origin, metres.
    pub distance_m: f32,
}

impl Scene {
    /// The nearest place that a ray meets, of what eyes see: visible triangles from the sides that are drawn. What a texture's alpha
    /// cuts out counts as if it were there. `direction` needs no length of one.
    pub fn pick(&self, origin: Vec3, direction: Vec3) -> Option<Picked> {
        let direction = direction.try_normalize()?;
        let unseen = |place: usize| self.stand_ins.iter().any(|s| s.place == place);
        let is_seen = |drawable: &Drawable| drawable.visible && drawable.mesh.topology == Topology::Triangles;
        let mut best: Option<Picked> = None;
        for (place, drawable) in self.drawables.iter().enumerate().filter(|(_, drawable)| is_seen(drawable)) {
            let nearer = |distance: f64| best.is_none_or(|best| distance < f64::from(best.distance_m));
            if !enters(&drawable.bounds_in_world, origin, direction).is_some_and(|distance| nearer(distance.into()))
                || unseen(place)
            {
                continue;
            }
            let Some((distance, normal)) = first_in(drawable, origin, direction).filter(|(distance, _)| nearer(*distance)) else {
                continue;
            };
            let point = origin + direction * distance as f32;
            best = Some(Picked { drawable: place, point, normal, distance_m: distance as f32 });
        }
        best
    }
}

/// Where a ray comes into a box, or zero if it starts inside: the slabs of Kay and Kajiya 1986.
fn enters(bounds: &Aabb, origin: Vec3, direction: Vec3) -> Option<f32> {
    if bounds.is_empty() {
        return None;
    }
    // Flat boxes of planes are met in spite of rounding.
    let slack = Vec3::splat(1e-4 * (1.0 + bounds.radius()));
    let (low, high) = (bounds.min - slack - origin, bounds.max + slack - origin);
    let (mut near, mut far) = (0.0f32, f32::INFINITY);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if low[axis] > 0.0 || high[axis] < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = (low[axis] / direction[axis], high[axis] / direction[axis]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    (near <= far).then_some(near)
}

/// The nearest triangle of a drawable along a ray of unit length: its distance, and its normal towards the ray.
fn first_in(drawable: &Drawable, origin: Vec3, direction: Vec3) -> Option<(f64, Vec3)> {
    let world_from_object = drawable.world_from_object.as_dmat4();
    if world_from_object.determinant() == 0.0 {
        return None;
    }
    let object_from_world = world_from_object.inverse();
    // Not normalised, so that distances along it stay those of the world.
    let start = object_from_world.transform_point3(origin.as_dvec3());
    let way = object_from_world.transform_vector3(direction.as_dvec3());
    let (mesh, double_sided) = (&drawable.mesh, drawable.material.double_sided);
    let positions: Cow<'_, [Vec3]> = match &drawable.pose {
        Some(pose) => Cow::Owned(deformed(mesh, pose).positions),
        None => Cow::Borrowed(&mesh.positions),
    };
    let mut best: Option<(f64, DVec3)> = None;
    for corners in mesh.indices.chunks_exact(3) {
        let corner = |i: usize| positions.get(corners[i] as usize).map(|p| p.as_dvec3());
        let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) else { continue };
        let Some((distance, normal)) = meets(start, way, [a, b, c]) else { continue };
        let is_front = normal.dot(way) < 0.0;
        if (is_front || double_sided) && best.is_none_or(|(nearest, _)| distance < nearest) {
            best = Some((distance, normal));
        }
    }
    let (distance, normal) = best?;
    let normal_in_world = object_from_world.transpose().transform_vector3(normal).normalize_or_zero().as_vec3();
    Some((distance, if normal_in_world.dot(direction) > 0.0 { -normal_in_world } else { normal_in_world }))
}

/// Moeller and Trumbore 1997, from both sides: the distance in lengths of `way`, and the normal by the winding.
fn meets(start: DVec3, way: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, DVec3)> {
    let (ab, ac) = (b - a, c - a);
    let p = way.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from_a = start - a;
    let u = from_a.dot(p) / determinant;
    let q = from_a.cross(ab);
    let v = way.dot(q) / determinant;
    let distance = ac.dot(q) / determinant;
    let is_met = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 && distance.is_finite();
    is_met.then(|| (distance, ab.cross(ac)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Material, Mesh};
    use glam::Mat4;
    use std::sync::Arc;

    /// A square of two metres around the origin, seen from +z.
    fn square(world_from_object: Mat4, double_sided: bool) -> Drawable {
        let positions = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
        let mesh = Mesh { positions: positions.into(), indices: [0, 1, 2, 0, 2, 3].into(), ..Mesh::default() };
        let bounds = Aabb::from_points(positions).transformed(&world_from_object);
        Drawable {
            name: String::new(),
            mesh: Arc::new(mesh),
            material: Arc::new(Material { double_sided, ..Material::default() }),
            world_from_object,
            pose: None,
            bounds_in_world: bounds,
            visible: true,
            casts_shadow: true,
            receives_shadow: true,
            receives: None,
            revision: 0,
        }
    }

    #[test]
    fn the_nearest_that_is_seen() {
        let at = |z: f32| Mat4::from_translation(Vec3::new(0.0, 0.0, z));
        let hidden = Drawable { visible: false, ..square(at(3.0), true) };
        let turned = square(at(2.0) * Mat4::from_rotation_y(std::f32::consts::PI), false);
        let large = square(at(-5.0) * Mat4::from_scale(Vec3::new(-8.0, 4.0, 1.0)), true);
        let scene = Scene { drawables: vec![hidden, turned, square(at(1.0), false), large].into(), ..Scene::default() };
        let rows = [
            // Through what is hidden and what is seen from behind to the third.
            (Vec3::new(0.5, 0.5, 9.0), Vec3::NEG_Z, Some((2, 8.0))),
            (Vec3::new(0.0, 0.0, 9.0), Vec3::new(0.0, 0.0, -7.0), Some((2, 8.0))),
            // Beside it, onto the one that is stretched and mirrored.
            (Vec3::new(7.9, 3.9, 0.0), Vec3::NEG_Z, Some((3, 5.0))),
            (Vec3::new(8.1, 0.0, 0.0), Vec3::NEG_Z, None),
            (Vec3::new(0.0, 0.0, 1.5), Vec3::Z, Some((1, 0.5))),
            (Vec3::ZERO, Vec3::Z, Some((1, 2.0))),
            (Vec3::ZERO, Vec3::ZERO, None),
            (Vec3::ZERO, Vec3::NAN, None),
        ];
        for (origin, direction, expected) in rows {
            let found = scene.pick(origin, direction);
            assert_eq!(found.map(|p| p.drawable), expected.map(|(d, _)| d), "{origin} {direction}: {found:?}");
            if let (Some(found), Some((_, distance))) = (found, expected) {
                assert!((found.distance_m - distance).abs() < 1e-4, "{found:?}");
                assert!((found.normal.dot(direction.normalize()) + 1.0).abs() < 1e-5, "{found:?}");
            }
        }
    }
}
