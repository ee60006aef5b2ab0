//! Where in a view a shadow can be seen: the depth bounds of 001 section 5.3, where it asks a whole volume by one pair of depths and
//! a card that tests them. Here, faces that shadows may fall on are cut to the planes around the volume, and what is left of them
//! is looked for in the picture, behind what hides it.
//!
//! Outside of that a volume changes nothing that is seen: over all of these pixels it counts to 0, whichever way it is counted.

use super::choose::{Scissor, Sight, overlap};
use super::faces::{Face, clip};
use super::tiles::{Sought, Tiles};
use super::{TurnedBox, hull};
use glam::{DVec3, DVec4};
use std::cell::OnceCell;
use umbriel_scene::Aabb;

/// What is seen of a scene in a view, as far as shadows are concerned.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// What shadows may fall on.
    pub receivers: Vec<Receiver>,
    /// Faces in the depth buffer that hide what is behind them.
    pub hiding: Vec<Face>,
}

/// Something that shadows may fall on.
#[derive(Clone, Debug)]
pub struct Receiver {
    /// Box around it.
    pub bounds: TurnedBox,
    /// Its faces, as far as they may be seen; `None` where they are not known and shadows may fall on anything in the box.
    pub faces: Option<Vec<Face>>,
}

/// The same, ready to be asked.
pub(super) struct Shown {
    seen: Seen,
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
    for (i, j) in hull::edges() {
        let along = toward.truncate() - corners[i] * toward.w;
        let Some(normal) = (corners[j] - corners[i]).cross(along).try_normalize() else { continue };
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
    planes.iter().any(|plane| points.iter().all(|p| hull::height(plane, *p) < 0.0))
}

impl Shown {
    pub(super) fn new(seen: Seen) -> Shown {
        Shown { seen, tiles: OnceCell::new() }
    }

    /// The smallest rectangle of pixels found, inside of `within`, outside of which nothing is seen in the volume of a box. `swept` is a
    /// box along the axes of the world around the volume.
    pub(super) fn touched(
        &self,
        sight: &Sight,
        bounds: &TurnedBox,
        swept: &Aabb,
        planes: &[DVec4],
        within: Scissor,
    ) -> Option<Scissor> {
        let (mut polygon, mut spare) = (Vec::with_capacity(16), Vec::with_capacity(16));
        let mut found: Option<Scissor> = None;
        let is_near = |b: &Aabb| b.min.cmple(swept.max).all() && b.max.cmpge(swept.min).all();
        for receiver in self.seen.receivers.iter().filter(|r| is_near(&r.bounds.in_world)) {
            if found == Some(within) {
                break;
            }
            let b = &receiver.bounds;
            let corners = b.corners.map(DVec4::truncate);
            if are_outside(&corners, planes) {
                continue;
            }
            if let Some(faces) = &receiver.faces {
                for face in faces.iter().filter(|face| !are_outside(face.corners(), planes)) {
                    polygon.clear();
                    polygon.extend_from_slice(face.corners());
                    planes.iter().chain([&sight.ahead]).for_each(|plane| clip(&mut polygon, &mut spare, *plane));
                    self.take(&mut found, (sight, &polygon, Some(face)), planes, within);
                }
                continue;
            }
            // The corners of what is in both and in the view: a corner of one that the others hold, or where sides meet.
            let around: Vec<DVec4> = b.planes().collect();
            let held = bounds.corners.iter().map(|c| c.truncate());
            let is_held = |p: &DVec3| around.iter().chain([&sight.ahead]).all(|plane| hull::height(plane, *p) >= 0.0);
            let mut points: Vec<DVec3> = held.filter(is_held).collect();
            let mut add = |side: [DVec3; 4], others: &[DVec4]| {
                polygon.clear();
                polygon.extend(side);
                planes.iter().chain(others).for_each(|plane| clip(&mut polygon, &mut spare, *plane));
                points.extend_from_slice(&polygon);
            };
            for side in SIDES {
                add(side.map(|i| corners[i]), &[sight.ahead]);
            }
            if corners.iter().any(|c| hull::height(&sight.ahead, *c) < 0.0) {
                add(near_square(&sight.ahead, &corners), &around);
            }
            self.take(&mut found, (sight, &points, None), planes, within);
        }
        found
    }

    /// Adds the pixels around points, of one face or somewhere, where they may be seen.
    fn take(
        &self,
        found: &mut Option<Scissor>,
        (sight, points, of): (&Sight, &[DVec3], Option<&Face>),
        planes: &[DVec4],
        within: Scissor,
    ) {
        let places = || points.iter().map(|p| sight.clip_from_world * p.extend(1.0));
        let Some(here) = sight.pixels_around(places()).and_then(|pixels| overlap(pixels, within)) else { return };
        if found.is_some_and(|before| around(before, here) == before) {
            return;
        }
        let nearest = || Sought::Beyond(places().map(|clip| clip.w).fold(f64::INFINITY, f64::min));
        let tiles = self.tiles.get_or_init(|| Tiles::new(&sight.view, &self.seen.hiding));
        if let Some(here) = tiles.seen(here, of.map_or_else(nearest, Sought::On), planes) {
            *found = Some(found.map_or(here, |before| around(before, here)));
        }
    }
}

/// A square in the near plane, large enough for all that is there of a box. `ahead` is everything behind that plane.
fn near_square(ahead: &DVec4, corners: &[DVec3; 8]) -> [DVec3; 4] {
    let normal = ahead.truncate();
    let middle = corners[0] - normal * hull::height(ahead, corners[0]);
    let size = 2.0 * corners.iter().map(|c| c.distance(corners[0])).fold(0.0, f64::max);
    let (right, up) = normal.any_orthonormal_pair();
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| middle + (right * x + up * y) * size)
}

/// Corners of the sides of a box, in order around each.
const SIDES: [[usize; 4]; 6] = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];

/// The smallest rectangle that holds two.
fn around(a: Scissor, b: Scissor) -> Scissor {
    let from = [0, 1].map(|i| a[i].min(b[i]));
    let to = [0, 1].map(|i| (a[i] + a[i + 2]).max(b[i] + b[i + 2]));
    [from[0], from[1], to[0] - from[0], to[1] - from[1]]
}

#[cfg(test)]
mod tests {
    use super::super::faces::faces;
    use super::*;
    use glam::{Mat4, Quat, Vec3};
    use umbriel_scene::{Frustum, Mesh, View};

    /// The same numbers on every machine.
    struct Random(u64);

    impl Random {
        fn between(&mut self, low: f32, high: f32) -> f32 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            low + (high - low) * (self.0 >> 40) as f32 / (1u64 << 24) as f32
        }

        fn place(&mut self, low: f32, high: f32) -> Vec3 {
            Vec3::from_array(std::array::from_fn(|_| self.between(low, high)))
        }

        /// A box that stands askew, its place, and its half sizes.
        fn askew(&mut self, sizes: [f32; 2]) -> (TurnedBox, Mat4, Vec3) {
            let [yaw, pitch] = [3.0, 1.5].map(|most| self.between(-most, most));
            let turned = Quat::from_rotation_y(yaw) * Quat::from_rotation_x(pitch);
            let place = Mat4::from_rotation_translation(turned, self.place(-3.0, 3.0));
            let half = self.place(sizes[0], sizes[1]);
            (TurnedBox::of(&Aabb { min: -half, max: half }, &place), place, half)
        }
    }

    /// Points of a box, or of a rectangle, that the light reaches through the caster's box are in the rectangle of pixels, wherever
    /// the eye is: inside of either box, and in the shadow.
    #[test]
    fn all_that_is_seen_in_a_volume_is_in_the_rectangle() {
        let mut random = Random(3);
        let (mut checked, mut around_the_eye) = ([0, 0], 0);
        for round in 0..4000 {
            let (caster, caster_place, caster_half) = random.askew([0.05, 1.5]);
            let (receiver, place, mut half) = random.askew([0.5, 4.0]);
            let is_face = round % 2 == 0;
            let mut known = None;
            if is_face {
                half.y = 0.0;
                let corner = |x: f32, z: f32| Vec3::new(x * half.x, 0.0, z * half.z);
                let mesh = Mesh {
                    positions: vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)].into(),
                    indices: vec![0, 1, 2, 0, 2, 3].into(),
                    ..Mesh::default()
                };
                known = Some(faces(&mesh, &place));
            }
            let seen = Seen { receivers: vec![Receiver { bounds: receiver, faces: known }], ..Seen::default() };
            let toward = if round % 3 == 0 { random.place(-1.0, 1.0).extend(0.0) } else { random.place(-6.0, 6.0).extend(1.0) };
            let eye = match round % 4 {
                1 => place.transform_point3(random.place(-1.0, 1.0) * half),
                _ => random.place(-5.0, 5.0),
            };
            let view = View {
                name: String::new(),
                view_from_world: glam::camera::rh::view::look_at_mat4(eye, random.place(-2.0, 2.0), Vec3::Y),
                frustum: Frustum::symmetric(1.0, 1.25, [0.01, 1.0][round / 2 % 2]),
                size: [200, 160],
            };
            let sight = Sight::new(&view, Aabb::EMPTY);
            let shown = Shown::new(seen);
            let planes = planes(&caster, toward.as_dvec4(), eye.as_dvec3(), hull::margin(&caster.corners));
            let everything = Aabb { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
            let found = shown.touched(&sight, &caster, &everything, &planes, [0, 0, 200, 160]);
            let to_caster = caster_place.inverse();
            for sample in 0..400 {
                let mut p = place.transform_point3(random.place(-1.0, 1.0) * half);
                if !is_face && sample % 2 == 0 {
                    // Just behind the near plane, where that is in the box.
                    let ahead = sight.ahead.truncate().as_vec3();
                    p -= ahead * (sight.ahead.dot(p.as_dvec3().extend(1.0)) as f32 - 1e-4);
                    if receiver.planes().any(|plane| plane.dot(p.as_dvec3().extend(1.0)) < 0.0) {
                        continue;
                    }
                }
                // From the receiver towards the light, in the caster's space.
                let from = to_caster.transform_point3(p);
                let along = to_caster.transform_vector3(toward.truncate() - p * toward.w);
                let end = if toward.w == 0.0 { f32::INFINITY } else { 1.0 };
                let ends = [(-caster_half - from) / along, (caster_half - from) / along];
                let (enter, leave) = (ends[0].min(ends[1]).max_element().max(0.0), ends[0].max(ends[1]).min_element().min(end));
                let clip = sight.clip_from_world * p.as_dvec3().extend(1.0);
                let [x, y] = [clip.x / clip.w, -clip.y / clip.w].map(|ndc| ndc * 0.5 + 0.5);
                let is_seen = clip.w > f64::from(view.frustum.near) && (0.0..1.0).contains(&x) && (0.0..1.0).contains(&y);
                if enter + 1e-3 < leave && is_seen {
                    let [x, y] = [(x * 200.0) as u32, (y * 160.0) as u32];
                    let is_in = |[l, t, w, h]: Scissor| (l..l + w).contains(&x) && (t..t + h).contains(&y);
                    assert!(found.is_some_and(is_in), "{x} {y} is not in {found:?}, round {round}");
                    checked[usize::from(is_face)] += 1;
                    around_the_eye += usize::from(receiver.planes().all(|plane| plane.dot(eye.as_dvec3().extend(1.0)) > 0.0));
                }
            }
        }
        assert!(checked.iter().all(|c| *c > 5000) && around_the_eye > 1000, "{checked:?}, {around_the_eye}");
    }
}
