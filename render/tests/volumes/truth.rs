//! What is in shadow, by testing every triangle in double precision.

use crate::shapes::Thing;
use glam::{DMat4, DVec3, Vec4};
use umbriel_scene::View;

struct Triangle {
    a: DVec3,
    to_b: DVec3,
    to_c: DVec3,
}

struct Body {
    casts: bool,
    centre: DVec3,
    radius: f64,
    triangles: Vec<Triangle>,
}

/// Bodies, the light and the eye.
pub(crate) struct Truth {
    bodies: Vec<Body>,
    toward_light: Vec4,
    view: View,
}

impl Truth {
    pub(crate) fn new(casters: &[Thing], receivers: &[Thing], toward_light: Vec4, view: &View) -> Truth {
        let bodies = casters.iter().map(|t| (t, true)).chain(receivers.iter().map(|t| (t, false)));
        Truth { bodies: bodies.map(|(t, casts)| Body::new(t, casts)).collect(), toward_light, view: view.clone() }
    }

    /// Is what is seen at this place of the picture (pixels from the top left) in shadow? `None` where nothing is seen,
    /// where the four nearest sub-samples do not all agree with it, and where light grazes the surface.
    pub(crate) fn shadowed(&self, x: f64, y: f64) -> Option<bool> {
        let here = self.one(x, y)?;
        let around = [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)];
        around.into_iter().all(|(dx, dy)| self.one(x + dx, y + dy) == Some(here)).then_some(here)
    }

    fn one(&self, x: f64, y: f64) -> Option<bool> {
        let f = &self.view.frustum;
        let lerp = |a: f32, b: f32, t: f64| f64::from(a) + (f64::from(b) - f64::from(a)) * t;
        let right = lerp(f.left, f.right, x / f64::from(self.view.size[0]));
        let up = lerp(f.top, f.bottom, y / f64::from(self.view.size[1]));
        let ahead = DVec3::new(right, up, -f64::from(f.near)) / f64::from(f.near);
        let world_from_view: DMat4 = self.view.view_from_world.as_dmat4().inverse();
        let eye = world_from_view.transform_point3(DVec3::ZERO);
        // Parameter 1 is the near plane, as it clips.
        let along = world_from_view.transform_vector3(ahead);
        let near = f64::from(f.near);
        let (t, body, triangle) = self.first_hit(eye, along, near)?;
        let p = eye + along * t;
        let to_light = self.toward_light.truncate().as_dvec3() - p * f64::from(self.toward_light.w);
        let normal = triangle.to_b.cross(triangle.to_c).normalize();
        let slope = normal.dot(to_light.normalize());
        if slope.abs() < 0.01 {
            return None;
        }
        let own_back = body.casts && (slope > 0.0) != (normal.dot(along) < 0.0);
        Some(own_back || self.blocked(p, to_light))
    }

    fn first_hit(&self, from: DVec3, along: DVec3, near: f64) -> Option<(f64, &Body, &Triangle)> {
        let mut best: Option<(f64, &Body, &Triangle)> = None;
        for body in self.bodies.iter().filter(|b| b.is_near(from, along)) {
            for triangle in &body.triangles {
                if let Some(t) = triangle.hit(from, along)
                    && t > near
                    && best.is_none_or(|(b, ..)| t < b)
                {
                    best = Some((t, body, triangle));
                }
            }
        }
        best
    }

    fn blocked(&self, p: DVec3, to_light: DVec3) -> bool {
        let end = if self.toward_light.w == 0.0 { f64::INFINITY } else { 1.0 };
        let start = 1e-5 / to_light.length();
        let casting = self.bodies.iter().filter(|b| b.casts && b.is_near(p, to_light));
        casting.flat_map(|b| &b.triangles).any(|tri| tri.hit(p, to_light).is_some_and(|t| t > start && t < end))
    }
}

impl Body {
    fn new(thing: &Thing, casts: bool) -> Body {
        let positions: Vec<DVec3> =
            thing.mesh.positions.iter().map(|p| thing.world_from_object.transform_point3(*p).as_dvec3()).collect();
        let triangle = |t: &[u32]| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i as usize]);
            Triangle { a, to_b: b - a, to_c: c - a }
        };
        let centre = positions.iter().sum::<DVec3>() / positions.len() as f64;
        Body {
            casts,
            centre,
            radius: positions.iter().map(|p| p.distance(centre)).fold(0.0, f64::max),
            triangles: thing.mesh.indices.chunks_exact(3).map(triangle).collect(),
        }
    }

    /// May the ray meet the sphere around the body?
    fn is_near(&self, from: DVec3, along: DVec3) -> bool {
        let to = self.centre - from;
        let t = (to.dot(along) / along.length_squared()).max(0.0);
        (along * t).distance_squared(to) <= self.radius * self.radius * 1.0001
    }
}

impl Triangle {
    /// Möller and Trumbore 1997: parameter of the hit, both sides.
    fn hit(&self, from: DVec3, along: DVec3) -> Option<f64> {
        let p = along.cross(self.to_c);
        let det = self.to_b.dot(p);
        if det == 0.0 {
            return None;
        }
        let s = from - self.a;
        let u = s.dot(p) / det;
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
        let q = s.cross(self.to_b);
        let v = along.dot(q) / det;
        (v >= 0.0 && u + v <= 1.0).then(|| self.to_c.dot(q) / det)
    }
}
