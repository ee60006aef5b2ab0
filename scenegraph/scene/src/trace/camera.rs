//! The rays of a view.

use super::TraceError;
use super::ray::Ray;
use crate::View;
use glam::{DMat4, DVec3};

/// An eye and its window, in double precision.
pub(super) struct Camera {
    pub(super) eye: DVec3,
    /// Distance of the near plane, metres.
    near: f64,
    world_from_view: DMat4,
    /// Left and top of the window at distance 1, and its width and (negative) height.
    corner: [f64; 2],
    span: [f64; 2],
    size: [u32; 2],
    sub_samples: u32,
}

impl Camera {
    pub(super) fn new(view: &View, sub_samples: u32) -> Result<Camera, TraceError> {
        let [left, right, bottom, top, near] =
            [view.frustum.left, view.frustum.right, view.frustum.bottom, view.frustum.top, view.frustum.near].map(f64::from);
        let world_from_view = view.view_from_world.as_dmat4().inverse();
        let span = [(right - left) / near, (bottom - top) / near];
        let corner = [left / near, top / near];
        let finite = world_from_view.is_finite() && span.iter().chain(&corner).all(|x| x.is_finite());
        if !finite || span.contains(&0.0) {
            return Err(TraceError::BadView { view: view.name.clone() });
        }
        let eye = world_from_view.transform_point3(DVec3::ZERO);
        Ok(Camera { eye, near, world_from_view, corner, span, size: view.size, sub_samples })
    }

    /// Rays through the centres of a pixel's sub-pixels. They start at the near plane: what is nearer is not seen.
    pub(super) fn rays(&self, [x, y]: [u32; 2]) -> impl Iterator<Item = Ray> + '_ {
        let n = self.sub_samples;
        let along = move |pixel: u32, sub: u32, axis: usize| {
            let share = (f64::from(pixel) + (f64::from(sub) + 0.5) / f64::from(n)) / f64::from(self.size[axis]);
            self.corner[axis] + self.span[axis] * share
        };
        (0..n).flat_map(move |sub_y| {
            (0..n).map(move |sub_x| {
                let in_view = DVec3::new(along(x, sub_x, 0), along(y, sub_y, 1), -1.0);
                let ahead = self.world_from_view.transform_vector3(in_view);
                Ray::new(self.eye + ahead * self.near, ahead.normalize())
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Frustum;
    use glam::{Mat4, Vec3};

    #[test]
    fn rays_go_through_the_centres_of_sub_pixels() {
        let frustum = Frustum { left: -2.0, right: 6.0, bottom: 0.0, top: 4.0, near: 2.0 };
        let view_from_world = Mat4::from_translation(Vec3::new(-1.0, -2.0, -3.0));
        let view = View { name: "window".into(), view_from_world, frustum, size: [4, 2] };
        // At distance 1 the window spans -1..3 and 0..2: a pixel is a unit wide and high.
        let rows = [
            (1, [0, 0], vec![(-0.5, 1.5)]),
            (1, [3, 1], vec![(2.5, 0.5)]),
            (2, [1, 0], vec![(0.25, 1.75), (0.75, 1.75), (0.25, 1.25), (0.75, 1.25)]),
        ];
        for (sub_samples, pixel, expected) in rows {
            let camera = Camera::new(&view, sub_samples).unwrap();
            assert_eq!(camera.eye, DVec3::new(1.0, 2.0, 3.0));
            let found: Vec<Ray> = camera.rays(pixel).collect();
            assert_eq!(found.len(), expected.len());
            for (found, (x, y)) in found.iter().zip(expected) {
                let ahead = DVec3::new(x, y, -1.0);
                assert!(found.direction.abs_diff_eq(ahead.normalize(), 1e-12), "{pixel:?}: {found:?} {x} {y}");
                assert!(found.origin.abs_diff_eq(camera.eye + 2.0 * ahead, 1e-12), "{pixel:?}: {found:?} {x} {y}");
            }
        }
    }
}
