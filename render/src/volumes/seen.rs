//! Where in a view a shadow can be seen: the depth bounds of 001 section 5.3, where it asks a whole volume by one pair of depths and
//! a card that tests them. Here, faces that shadows may fall on are cut to the planes around the volume, and what is left of them
//! is looked for in the picture, behind what hides it.
//!
//! Outside of that a volume changes nothing that is seen: over all of these pixels it counts to 0, whichever way it is counted.

use super::choose::Scissor;
use super::faces::{Face, clip};
use super::tiles::{Sought, Tiles};
use super::{TurnedBox, hull};
use glam::{DMat4, DVec3, DVec4};
use std::cell::OnceCell;
use umbriel_scene::View;

/// What is seen of a scene in a view, as far as shadows are concerned.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Faces that shadows may fall on, and boxes in which they may fall on something.
    pub faces: Vec<Face>,
    /// As `faces`.
    pub boxes: Vec<TurnedBox>,
    /// Faces in the depth buffer that hide what is behind them.
    pub hiding: Vec<Face>,
}

/// The same, ready to be asked.
pub(super) struct Shown {
    seen: Seen,
    view: View,
    clip_from_world: DMat4,
    /// Everything behind the near plane.
    ahead: DVec4,
    /// Made when they are first asked.
    tiles: OnceCell<Tiles>,
}

/// Planes around the volume of a box, unit normals inward: through its sides that face the light, and through its outline there.
pub(super) fn planes(bounds: &TurnedBox, toward: DVec4, eye: DVec3, margin: f64) -> Vec<DVec4> {
    let corners = bounds.corners.map(DVec4::truncate);
    let top = |normal: DVec3| corners.iter().map(|c| normal.dot(*c)).fold(f64::NEG_INFINITY, f64::max);
    let rounding = 0.1 * hull::margin(&bounds.corners);
    let mut planes = Vec::with_capacity(16);
    for normal in bounds.normals().into_iter().filter_map(DVec3::try_normalize).flat_map(|n| [n, -n]) {
        let top = top(normal);
        if normal.dot(toward.truncate()) - top * toward.w > 10.0 * rounding {
            // What lies in the plane of a side is lit if it is seen from where the light is, as far as single precision tells.
            planes.push((-normal).extend(if normal.dot(eye) > top { top - rounding } else { top + margin }));
        }
    }
    for (i, bit) in (0..8).flat_map(|i| [1, 2, 4].map(|bit| (i, bit))).filter(|(i, bit)| i & bit == 0) {
        let along = toward.truncate() - corners[i] * toward.w;
        let Some(normal) = (corners[i | bit] - corners[i]).cross(along).try_normalize() else { continue };
        for normal in [normal, -normal] {
            let top = top(normal);
            if top <= normal.dot(corners[i]) + 1e-2 * rounding {
                planes.push((-normal).extend(top + margin));
            }
        }
    }
    planes
}

/// Are all points outside of one of the planes?
fn are_outside(points: &[DVec3], planes: &[DVec4]) -> bool {
    planes.iter().any(|plane| points.iter().all(|p| plane.dot(p.extend(1.0)) < 0.0))
}

impl Shown {
    pub(super) fn new(seen: Seen, view: &View, clip_from_world: DMat4, ahead: DVec4) -> Shown {
        Shown { seen, view: view.clone(), clip_from_world, ahead, tiles: OnceCell::new() }
    }

    /// The smallest rectangle of pixels found, inside of `within`, outside of which nothing is seen in the volume of a box.
    pub(super) fn touched(&self, bounds: &TurnedBox, planes: &[DVec4], within: Scissor) -> Option<Scissor> {
        let (mut polygon, mut spare) = (Vec::with_capacity(16), Vec::with_capacity(16));
        let mut found: Option<Scissor> = None;
        for face in self.seen.faces.iter().filter(|face| !are_outside(face.corners(), planes)) {
            polygon.clear();
            polygon.extend_from_slice(face.corners());
            planes.iter().chain([&self.ahead]).for_each(|plane| clip(&mut polygon, &mut spare, *plane));
            self.take(&mut found, &polygon, within, (Some(face), planes));
        }
        for b in &self.seen.boxes {
            let corners = b.corners.map(DVec4::truncate);
            if are_outside(&corners, planes) {
                continue;
            }
            // The corners of what is in both and in the view: a corner of one that the others hold, or where sides meet.
            let around: Vec<DVec4> = b.planes().collect();
            let held = bounds.corners.iter().map(|c| c.truncate());
            let is_held = |p: &DVec3| around.iter().chain([&self.ahead]).all(|plane| plane.dot(p.extend(1.0)) >= 0.0);
            let mut points: Vec<DVec3> = held.filter(is_held).collect();
            let mut add = |side: [DVec3; 4], others: &[DVec4]| {
                polygon.clear();
                polygon.extend(side);
                planes.iter().chain(others).for_each(|plane| clip(&mut polygon, &mut spare, *plane));
                points.extend_from_slice(&polygon);
            };
            for side in SIDES {
                add(side.map(|i| corners[i]), &[self.ahead]);
            }
            if corners.iter().any(|c| self.ahead.dot(c.extend(1.0)) < 0.0) {
                add(self.near_square(&corners), &around);
            }
            self.take(&mut found, &points, within, (None, planes));
        }
        found
    }

    /// A square in the near plane, large enough for all that is there of a box.
    fn near_square(&self, corners: &[DVec3; 8]) -> [DVec3; 4] {
        let ahead = self.ahead.truncate();
        let middle = corners[0] - ahead * self.ahead.dot(corners[0].extend(1.0));
        let size = 2.0 * corners.iter().map(|c| c.distance(corners[0])).fold(0.0, f64::max);
        let (right, up) = ahead.any_orthonormal_pair();
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| middle + (right * x + up * y) * size)
    }

    /// Adds the pixels around points, of one face or somewhere, where they may be seen.
    fn take(&self, found: &mut Option<Scissor>, points: &[DVec3], within: Scissor, (of, planes): (Option<&Face>, &[DVec4])) {
        let (mut low, mut high, mut depth) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], f64::INFINITY);
        for p in points {
            let clip = self.clip_from_world * p.extend(1.0);
            depth = depth.min(clip.w);
            for (i, ndc) in [clip.x / clip.w, -clip.y / clip.w].into_iter().enumerate() {
                let pixel = (ndc * 0.5 + 0.5) * f64::from(self.view.size[i]);
                (low[i], high[i]) = (low[i].min(pixel), high[i].max(pixel));
            }
        }
        // Conversion from float to integer ends at the borders of the integer.
        let from = [0, 1].map(|i| ((low[i] - 1.0).floor() as u32).max(within[i]));
        let to = [0, 1].map(|i| ((high[i] + 1.0).ceil() as u32).min(within[i] + within[i + 2]));
        if to[0] <= from[0] || to[1] <= from[1] {
            return;
        }
        let is_inside = |[l, t, w, h]: Scissor| l <= from[0] && t <= from[1] && to[0] <= l + w && to[1] <= t + h;
        if found.is_some_and(is_inside) {
            return;
        }
        let tiles = self.tiles.get_or_init(|| Tiles::new(&self.view, &self.seen.hiding));
        let here = [from[0], from[1], to[0] - from[0], to[1] - from[1]];
        if let Some(here) = tiles.seen(here, of.map_or(Sought::Beyond(depth), Sought::On), planes) {
            *found = Some(found.map_or(here, |before| around(before, here)));
        }
    }
}

/// Corners of the sides of a box, in order around each.
const SIDES: [[usize; 4]; 6] = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];

/// The smallest rectangle that holds two.
fn around(a: Scissor, b: Scissor) -> Scissor {
    let from = [0, 1].map(|i| a[i].min(b[i]));
    let to = [0, 1].map(|i| (a[i] + a[i + 2]).max(b[i] + b[i + 2]));
    [from[0], from[1], to[0] - from[0], to[1] - from[1]]
}
