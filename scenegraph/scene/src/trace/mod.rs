//! Exact hard shadows by ray tracing: the truth that maps, volumes and soft shadows are scored against.
//!
//! It answers one question, "what does this light do at what this pixel sees?", in double precision and without any
//! bias but the offset of shadow rays. It does not shade.

mod alpha;
mod area;
mod beam;
mod camera;
mod fine;
mod mask;
mod ray;
mod triangles;

pub use area::{PenumbraScore, Shares};
pub use mask::{Mask, MaskError};

use crate::{Light, Scene, View};
use beam::Beam;
use camera::Camera;
use glam::DVec3;
use ray::{Hit, Ray};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use triangles::Soup;

/// How a mask is traced. The default is what the masks of reference were made with.
#[derive(Clone, Debug, PartialEq)]
pub struct TraceOptions {
    /// Rays per pixel along each axis; where they disagree the pixel is [`Mask::MIXED`]. At least 1.
    pub sub_samples: u32,
    /// The same where a pixel may show what is thinner than its rays are apart: beside edges, and along what is found there.
    /// At most `sub_samples` for none.
    pub fine_sub_samples: u32,
    /// Surfaces whose cosine towards the light is at most this are [`Mask::AWAY`].
    pub graze: f64,
    /// Distance of a shadow ray's start from its surface, as a share of the diagonal of the scene's bounds.
    pub eps_scale: f64,
    /// At most this share of how far the surface is from the origin and from the eye: in a wide world, what is nearby keeps
    /// shadows that are finer than the world is wide.
    pub eps_at_place: f64,
    /// Single-sided faces are not there when seen from behind. They cast shadows from both sides all the same.
    pub cull: bool,
    /// Surfaces with alpha mode blend, which the eye does not see here, cast shadows.
    pub blend_casts: bool,
}

impl Default for TraceOptions {
    fn default() -> TraceOptions {
        TraceOptions {
            sub_samples: 4,
            fine_sub_samples: 0,
            graze: 0.03,
            eps_scale: 1e-5,
            eps_at_place: f64::INFINITY,
            cull: true,
            blend_casts: true,
        }
    }
}

/// Why a mask cannot be traced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TraceError {
    /// The scene has no such light.
    #[error("the scene has {count} lights, there is no light {light}")]
    NoLight {
        /// The place asked for.
        light: usize,
        /// Number of lights.
        count: usize,
    },
    /// The light's direction or position is NaN, infinite, or a direction of length zero.
    #[error("light '{light}': direction {direction}, position {position} give no rays")]
    BadLight {
        /// Name of the light.
        light: String,
        /// Its direction.
        direction: glam::Vec3,
        /// Its position.
        position: glam::Vec3,
    },
    /// The view's matrix cannot be inverted, or its window has no size.
    #[error("view '{view}': its matrix or its window gives no rays")]
    BadView {
        /// Name of the view.
        view: String,
    },
}

/// Traces what light number `light` of `scene` does in each pixel of `view`.
pub fn trace_visibility(scene: &Scene, light: usize, view: &View, options: &TraceOptions) -> Result<Mask, TraceError> {
    let chosen = scene.lights.get(light).ok_or(TraceError::NoLight { light, count: scene.lights.len() })?;
    Tracer::new(scene).visibility(chosen, view, options, &|_| ())
}

/// The triangles of a scene, deformed and in the world, in a bounding volume hierarchy.
pub struct Tracer {
    soup: Soup,
}

impl Tracer {
    /// Takes all visible triangles of the scene. Those that are not finite, that have no area, or whose indices are out of
    /// range are left out.
    pub fn new(scene: &Scene) -> Tracer {
        Tracer { soup: Soup::new(scene) }
    }

    /// Number of triangles that rays can meet.
    pub fn triangle_count(&self) -> usize {
        self.soup.triangles.len()
    }

    /// Traces what `light` does in each pixel of `view`, on all cores. What is nearer than the near plane is not seen.
    /// Attenuation of the light does not count, its range does: what lies beyond is outside. A shape that receives
    /// no shadows is lit where it faces the light. `progress` hears the number of rows that are done, from any thread.
    pub fn visibility(
        &self,
        light: &Light,
        view: &View,
        options: &TraceOptions,
        progress: &(dyn Fn(u32) + Sync),
    ) -> Result<Mask, TraceError> {
        let beam = Beam::new(light)?;
        let camera = Camera::new(view, options.sub_samples.max(1))?;
        let [width, height] = view.size;
        let mut mask = Mask::background(width, height);
        by_rows(&mut mask.classes, width, progress, |pixel| self.pixel(&camera, pixel, &beam, options));
        if options.fine_sub_samples > options.sub_samples {
            let camera = Camera::new(view, options.fine_sub_samples)?;
            fine::refine(&mut mask, |pixel| self.pixel(&camera, pixel, &beam, options));
        }
        Ok(mask)
    }

    /// The class of a pixel: that of all its rays, or mixed.
    fn pixel(&self, camera: &Camera, pixel: [u32; 2], beam: &Beam, options: &TraceOptions) -> u8 {
        let mut classes = camera.rays(pixel).map(|ray| self.classify(&ray, beam, options));
        let first = classes.next().unwrap_or(Mask::BACKGROUND);
        if classes.all(|class| class == first) { first } else { Mask::MIXED }
    }

    /// The class of what a ray of the eye meets.
    fn classify(&self, ray: &Ray, beam: &Beam, options: &TraceOptions) -> u8 {
        let Some(place) = self.place(ray, beam, options) else { return Mask::BACKGROUND };
        let may_be_dark = place.class == Mask::LIT && place.receives;
        let shadow = Ray::new(place.start, place.to_light);
        if may_be_dark && self.is_blocked(&shadow, place.far - 2.0 * place.eps, options) {
            return Mask::SHADOW;
        }
        place.class
    }

    /// What a ray of the eye meets, as if nothing cast shadows.
    fn place(&self, ray: &Ray, beam: &Beam, options: &TraceOptions) -> Option<Place> {
        let Ray { origin, direction } = *ray;
        let hit = self.first_seen(ray, options.cull)?;
        let triangle = &self.soup.triangles[hit.triangle];
        let normal = triangle.normal();
        // Once more against the plane: the hit's own distance comes from barycentrics.
        let distance = (triangle.corners[0] - origin).dot(normal) / normal.dot(direction);
        let point = origin + direction * distance;
        let facing = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let (to_light, far) = beam.to_light(point, facing);
        let class = if beam.misses(to_light, far) {
            Mask::OUTSIDE
        } else if facing.dot(to_light) <= options.graze {
            Mask::AWAY
        } else {
            Mask::LIT
        };
        let away = point.length() + point.distance(origin);
        let eps = (self.soup.diagonal() * options.eps_scale).min(away * options.eps_at_place);
        let receives = self.soup.shapes[triangle.shape as usize].receives;
        // From the start on, the ray must end at the light, or one that stands in a surface is hidden by what it stands in.
        let start = point + facing * eps;
        let (to_light, far) = beam.to_light(start, facing);
        Some(Place { class, to_light, far, start, eps, receives })
    }

    /// The first triangle along the ray that the eye sees.
    fn first_seen(&self, ray: &Ray, cull: bool) -> Option<Hit> {
        self.soup.first(ray, |hit| {
            let shape = &self.soup.shapes[self.soup.triangles[hit.triangle].shape as usize];
            shape.seen && !shape.blend && (hit.front || shape.double_sided || !cull) && self.soup.is_there(hit)
        })
    }

    /// Is there a caster on the ray before the distance `far`?
    fn is_blocked(&self, ray: &Ray, far: f64, options: &TraceOptions) -> bool {
        self.soup.any(ray, far, |hit| {
            let shape = &self.soup.shapes[self.soup.triangles[hit.triangle].shape as usize];
            shape.casts && (options.blend_casts || !shape.blend) && self.soup.is_there(hit)
        })
    }
}

/// Where a ray ended, and what there is to know about the light there.
struct Place {
    /// Lit, away or outside.
    class: u8,
    /// Where shadow rays start.
    start: DVec3,
    /// Unit vector from there.
    to_light: DVec3,
    /// Distance of the light from there, metres.
    far: f64,
    /// Distance of the start from the surface, metres.
    eps: f64,
    receives: bool,
}

/// Computes every pixel, row by row, on all cores. `progress` hears the number of rows that are done.
fn by_rows<T: Send>(pixels: &mut [T], width: u32, progress: &(dyn Fn(u32) + Sync), pixel: impl Fn([u32; 2]) -> T + Sync) {
    let done = AtomicU32::new(0);
    let rows = Mutex::new((0u32..).zip(pixels.chunks_mut((width as usize).max(1))));
    let work = || {
        loop {
            // The guard must not live while the row is traced.
            let next = rows.lock().unwrap_or_else(|e| e.into_inner()).next();
            let Some((y, row)) = next else { break };
            for (x, place) in (0..).zip(row) {
                *place = pixel([x, y]);
            }
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..std::thread::available_parallelism().map_or(1, |n| n.get()) {
            scope.spawn(work);
        }
        work();
    });
}

#[cfg(test)]
mod tests;
