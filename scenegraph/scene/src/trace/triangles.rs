//! All triangles of a scene in one hierarchy.

use super::alpha::Cutout;
use super::ray::{Hit, Ray, Triangle};
use crate::{AlphaMode, Drawable, Scene, Topology, deformed};
use glam::{DVec3, Vec3};
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::ray::{Ray as BoxRay, RayHit};
use obvhs::{BvhBuildParams, aabb::Aabb as Box3};
use std::borrow::Cow;

/// Triangles in the order of the hierarchy's leaves, and the shapes they belong to.
pub(super) struct Soup {
    pub(super) triangles: Vec<Triangle>,
    pub(super) shapes: Vec<Shape>,
    bvh: Bvh2,
    /// Bounds of all vertices of visible shapes, metres.
    min: DVec3,
    max: DVec3,
    /// How much the boxes of the hierarchy are larger than their triangles, metres: more than the rounding of its single
    /// precision, so that no box is missed whose triangle is met.
    slack: f64,
}

/// What a ray has to know of a drawable.
pub(super) struct Shape {
    /// By eyes; what stands in for others is not.
    pub(super) seen: bool,
    pub(super) casts: bool,
    pub(super) receives: bool,
    pub(super) double_sided: bool,
    pub(super) blend: bool,
    pub(super) cutout: Option<Cutout>,
}

impl Soup {
    pub(super) fn new(scene: &Scene) -> Soup {
        let mut soup = Soup {
            triangles: Vec::new(),
            shapes: Vec::new(),
            bvh: Bvh2::default(),
            min: DVec3::INFINITY,
            max: DVec3::NEG_INFINITY,
            slack: 0.0,
        };
        let unseen: std::collections::HashSet<usize> = scene.stand_ins.iter().map(|s| s.place).collect();
        for (place, drawable) in scene.drawables.iter().enumerate() {
            if drawable.visible && drawable.mesh.topology == Topology::Triangles {
                soup.add(drawable, !unseen.contains(&place));
            }
        }
        soup.build();
        soup
    }

    fn add(&mut self, drawable: &Drawable, seen: bool) {
        let (mesh, material) = (&drawable.mesh, &drawable.material);
        let world_from_object = drawable.world_from_object.as_dmat4();
        let positions: Cow<'_, [Vec3]> = match &drawable.pose {
            Some(pose) => Cow::Owned(deformed(mesh, pose).positions),
            None => Cow::Borrowed(&mesh.positions),
        };
        let in_world: Vec<DVec3> = positions.iter().map(|p| world_from_object.transform_point3(p.as_dvec3())).collect();
        for p in in_world.iter().filter(|p| p.is_finite()) {
            self.min = self.min.min(*p);
            self.max = self.max.max(*p);
        }
        let mirrored = world_from_object.determinant() < 0.0;
        let shape = self.shapes.len() as u32;
        for (place, corners) in (0..).zip(mesh.indices.chunks_exact(3)) {
            let [Some(&a), Some(&b), Some(&c)] = [0, 1, 2].map(|i| in_world.get(corners[i] as usize)) else { continue };
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            let triangle = Triangle { corners, shape, place, mirrored };
            // Also false for NaN and for numbers that overflow.
            if triangle.scaled_normal().length_squared() > 0.0 && corners.iter().all(|p| p.as_vec3().is_finite()) {
                self.triangles.push(triangle);
            }
        }
        self.shapes.push(Shape {
            seen,
            casts: drawable.casts_shadow,
            receives: drawable.receives_shadow,
            double_sided: material.double_sided,
            blend: material.alpha == AlphaMode::Blend,
            cutout: Cutout::of(mesh, material),
        });
    }

    fn build(&mut self) {
        if self.triangles.is_empty() {
            return;
        }
        let largest = self.min.abs().max(self.max.abs()).max_element();
        self.slack = 1e-6 * (largest + self.diagonal());
        let slack = DVec3::splat(self.slack);
        let boxes: Vec<Box3> = self
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.corners;
                Box3::new((a.min(b).min(c) - slack).as_vec3a(), (a.max(b).max(c) + slack).as_vec3a())
            })
            .collect();
        self.bvh = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut std::time::Duration::default());
        self.triangles = self.bvh.primitive_indices.iter().map(|&i| self.triangles[i as usize]).collect();
    }

    /// Length of the diagonal of the bounds, metres; 0 for an empty scene.
    pub(super) fn diagonal(&self) -> f64 {
        (self.max - self.min).max(DVec3::ZERO).length()
    }

    /// The nearest hit that `counts`.
    pub(super) fn first(&self, ray: &Ray, counts: impl Fn(&Hit) -> bool) -> Option<Hit> {
        let start = self.start(ray)?;
        let ray = ray.starting_at(start);
        let mut best: Option<Hit> = None;
        self.bvh.ray_traverse(box_ray(&ray, f64::INFINITY), &mut RayHit::none(), |_, place| {
            let hit = ray.meets(place, &self.triangles[place]);
            match hit.filter(|h| best.is_none_or(|b| h.distance < b.distance) && counts(h)) {
                Some(hit) => {
                    best = Some(hit);
                    ((hit.distance + self.slack) as f32).next_up()
                }
                None => f32::INFINITY,
            }
        });
        best.map(|hit| Hit { distance: hit.distance + start, ..hit })
    }

    /// Is there a hit that `counts` before the distance `far`?
    pub(super) fn any(&self, ray: &Ray, far: f64, counts: impl Fn(&Hit) -> bool) -> bool {
        let Some(start) = self.start(ray).filter(|start| *start < far) else { return false };
        let (ray, far) = (ray.starting_at(start), far - start);
        !self.bvh.ray_traverse_miss(box_ray(&ray, far + self.slack), |_, place| {
            let hit = ray.meets(place, &self.triangles[place]);
            if hit.is_some_and(|h| h.distance < far && counts(&h)) { f32::NEG_INFINITY } else { f32::INFINITY }
        })
    }

    /// Is the surface there, or cut out by its alpha?
    pub(super) fn is_there(&self, hit: &Hit) -> bool {
        let triangle = &self.triangles[hit.triangle];
        let Some(cutout) = &self.shapes[triangle.shape as usize].cutout else { return true };
        let [a, b, c] = hit.weights;
        cutout.is_there(triangle.place, if triangle.mirrored { [a, c, b] } else { [a, b, c] })
    }

    /// Distance at which the ray enters the bounds, from where it is followed: an eye far away costs no precision. `None`
    /// where it misses them or is no ray.
    pub(super) fn start(&self, ray: &Ray) -> Option<f64> {
        if self.triangles.is_empty() || !ray.origin.is_finite() || !ray.direction.is_finite() {
            return None;
        }
        let slack = DVec3::splat(self.slack);
        let (min, max) = (self.min - slack, self.max + slack);
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
            if direction == 0.0 {
                if origin < min[axis] || origin > max[axis] {
                    return None;
                }
                continue;
            }
            let (t0, t1) = ((min[axis] - origin) / direction, (max[axis] - origin) / direction);
            enter = enter.max(t0.min(t1));
            leave = leave.min(t0.max(t1));
        }
        (enter <= leave).then_some(enter)
    }
}

fn box_ray(ray: &Ray, far: f64) -> BoxRay {
    BoxRay::new(ray.origin.as_vec3a(), ray.direction.as_vec3a(), 0.0, (far as f32).next_up())
}
