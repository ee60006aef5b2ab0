//! The rays of a view.

use super::TraceError;
use crate::View;
use glam::{DMat4, DVec3};

/// An eye and its window, in double precision.
pub(super) struct Camera {
    pub(super) eye: DVec3,
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
        Ok(Camera { eye, world_from_view, corner, span, size: view.size, sub_samples })
    }

    /// Unit vectors through the centres of a pixel's sub-pixels.
    pub(super) fn directions(&self, [x, y]: [u32; 2]) -> impl Iterator<Item = DVec3> + '_ {
        let n = self.sub_samples;
        let along = move |pixel: u32, sub: u32, axis: usize| {
            let share = (f64::from(pixel) + (f64::from(sub) + 0.5) / f64::from(n)) / f64::from(self.size[axis]);
            self.corner[axis] + self.span[axis] * share
        };
        (0..n).flat_map(move |sub_y| {
            (0..n).map(move |sub_x| {
                let in_view = DVec3::new(along(x, sub_x, 0), along(y, sub_y, 1), -1.0);
                self.world_from_view.transform_vector3(in_view).normalize()
            })
        })
    }
}
