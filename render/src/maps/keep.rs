//! When a map need not be drawn anew: light and casters stand still, or moved together as one stiff body ("the world
//! moves": the whole world turns around a visitor who stands still in his room). What moved otherwise costs only the
//! maps that it is in reach of.

use super::atlas::Place;
use super::fit::{Fit, Projection, map_frame};
use crate::cull::{CentredBox, Planes};
use crate::draws::{Caster, Snapshot};
use glam::{Mat4, Vec3};
use std::sync::Arc;
use umbriel_scene::{Aabb, Light, MapSettings};

/// Deviation from a stiff motion that is not seen, as share of the size of all casters: a tenth of a texel of a map of
/// 2048 that shows all of them.
const TOLERANCE: f32 = 3e-5;
/// Casters whose motion is tried for all of them.
const GUESSES: usize = 4;

/// How casters moved since a snapshot.
pub(crate) struct Motion {
    /// Motion of all but the strays.
    pub(crate) new_from_old: Mat4,
    /// Boxes, in the world as it is now, of where casters that moved otherwise were and are.
    pub(crate) strays: Vec<Aabb>,
    /// All but the strays are exactly where they were.
    pub(crate) is_exact: bool,
}

/// A map in the texture.
#[derive(Clone)]
pub(crate) struct Held {
    pub(crate) fit: Fit,
    /// Its side, and where it lies.
    pub(crate) tile: (u32, Place),
    /// The light when the map was drawn.
    pub(crate) light: Arc<Light>,
    pub(crate) snapshot: Arc<Snapshot>,
    /// Nobody asked for it yet: nothing casts into it.
    pub(crate) is_empty: bool,
}

/// How the casters moved from one snapshot to another. Pages that both share are at rest and need not be looked at.
pub(crate) fn motion(old: &Snapshot, new: &Snapshot) -> Motion {
    let page = |of: &Snapshot, number: usize| of.pages.get(number).cloned().unwrap_or_else(|| [].into());
    let pages: Vec<_> = (0..old.pages.len().max(new.pages.len())).map(|i| (page(old, i), page(new, i))).collect();
    let is_shared = |(a, b): &&(Arc<[Caster]>, Arc<[Caster]>)| Arc::ptr_eq(a, b);
    let at_rest: usize = pages.iter().filter(is_shared).map(|(page, _)| page.len()).sum();
    let changed = || pages.iter().filter(|pair| !is_shared(pair)).flat_map(|(a, b)| pairs(a, b));
    let together: Vec<(&Caster, &Caster)> = changed().filter_map(|(a, b)| a.zip(b)).collect();
    let tolerance = TOLERANCE * new.radius;
    // One that looks otherwise now says as much of how all moved.
    let strays_of = |m: &Mat4| together.iter().filter(|(a, b)| !is_carried(m, a, b, tolerance)).count();
    let mut best = (strays_of(&Mat4::IDENTITY), Mat4::IDENTITY);
    for guess in 0..GUESSES.min(together.len()) {
        if best.0 <= at_rest {
            break;
        }
        let (a, b) = together[guess * together.len() / GUESSES.min(together.len())];
        let m = b.world_from_object * a.world_from_object.inverse();
        if a.world_from_object != b.world_from_object && is_stiff(&m) {
            let strays = strays_of(&m) + at_rest;
            best = if strays < best.0 { (strays, m) } else { best };
        }
    }
    let new_from_old = best.1;
    let is_at_rest = new_from_old == Mat4::IDENTITY;
    let mut strays = Vec::new();
    let mut is_exact = is_at_rest;
    for (a, b) in pages.iter().filter(|pair| !is_at_rest || !is_shared(pair)).flat_map(|(a, b)| pairs(a, b)) {
        if let (Some(a), Some(b)) = (a, b)
            && a.content == b.content
            && is_carried(&new_from_old, a, b, tolerance)
        {
            is_exact &= a.world_from_object == b.world_from_object;
            continue;
        }
        strays.extend(a.map(|a| a.bounds_in_world.transformed(&new_from_old)));
        strays.extend(b.map(|b| b.bounds_in_world));
    }
    Motion { new_from_old, strays, is_exact }
}

/// Casters before and after; both lists are in the order of places.
fn pairs<'a>(old: &'a [Caster], new: &'a [Caster]) -> Vec<(Option<&'a Caster>, Option<&'a Caster>)> {
    let mut pairs = Vec::with_capacity(old.len().max(new.len()));
    let (mut old, mut new) = (old.iter().peekable(), new.iter().peekable());
    loop {
        pairs.push(match (old.peek(), new.peek()) {
            (None, None) => return pairs,
            (Some(a), Some(b)) if a.index == b.index => (old.next(), new.next()),
            (Some(a), Some(b)) if a.index < b.index => (old.next(), None),
            (Some(_), None) => (old.next(), None),
            _ => (None, new.next()),
        });
    }
}

fn is_carried(new_from_old: &Mat4, a: &Caster, b: &Caster, tolerance: f32) -> bool {
    let expected = *new_from_old * a.world_from_object;
    let linear = (0..3).map(|i| (expected.col(i) - b.world_from_object.col(i)).length()).fold(0.0, f32::max);
    let moved = (expected.transform_point3(a.centre) - b.world_from_object.transform_point3(a.centre)).length();
    moved + linear * a.reach <= tolerance
}

fn is_stiff(m: &Mat4) -> bool {
    let axes = [m.x_axis, m.y_axis, m.z_axis].map(|a| a.truncate());
    let [x, y, z] = axes;
    let lengths = axes.iter().all(|a| (a.length() - 1.0).abs() < 1e-4);
    lengths && x.dot(y).abs() < 1e-4 && y.dot(z).abs() < 1e-4 && z.dot(x).abs() < 1e-4 && m.determinant() > 0.0
}

impl Held {
    /// The map as it lies now if it moved along with its light, or `None` where light and casters moved relative to each
    /// other, or another map is `wanted`.
    pub(crate) fn carried(&self, light: &Light, wanted: &Fit, new_from_old: &Mat4) -> Option<Fit> {
        let same_map = |a: &MapSettings, b: &MapSettings| (a.size, a.frustum, a.near_far) == (b.size, b.frustum, b.near_far);
        let tolerance = TOLERANCE * self.snapshot.radius.max(1e-3);
        let stayed = |a: Vec3, b: Vec3| (a - b).length() <= tolerance;
        let has_moved_along = stayed(new_from_old.transform_vector3(self.light.direction), light.direction)
            && stayed(new_from_old.transform_point3(self.light.position), light.position)
            && self.light.up.is_some() == light.up.is_some()
            && self.light.up.zip(light.up).is_none_or(|(old, new)| stayed(new_from_old.transform_vector3(old), new));
        if self.light.kind != light.kind || !same_map(&self.light.map, &light.map) || !has_moved_along {
            return None;
        }
        let mut fit = self.fit.clone();
        fit.projection = fit.projection.carried(new_from_old);
        let drift = fit.projection.map_from_world * light.position.extend(1.0);
        if wanted.projection.eye.w > 0.5 && drift.truncate().truncate().abs().max_element().max(drift.w.abs()) > 10.0 * tolerance
        {
            return None;
        }
        fit.projection.eye = wanted.projection.eye;
        fit.still_serves(wanted).then_some(fit)
    }

    /// Is the light where it was when the map was drawn?
    pub(crate) fn light_stands(&self, light: &Light) -> bool {
        let pose = |l: &Light| (l.position, l.direction, l.up);
        pose(&self.light) == pose(light)
    }

    /// The map of a light with a position as it lies if it stuck to its light, whatever the casters did.
    pub(crate) fn with_light(&self, light: &Light) -> Fit {
        let new_from_old = map_frame(light).inverse() * map_frame(&self.light);
        Fit { projection: self.fit.projection.carried(&new_from_old), needed: None }
    }

    /// Was something in the map's reach before or after it strayed?
    pub(crate) fn is_reached(fit: &Fit, strays: &[Aabb]) -> bool {
        let planes = Planes::new(&fit.projection.map_from_world);
        strays.iter().any(|b| planes.may_see(&CentredBox::from(*b)))
    }
}

impl Projection {
    /// As it lies after its world moved.
    pub(crate) fn carried(&self, new_from_old: &Mat4) -> Projection {
        let map_from_world = self.map_from_world * new_from_old.inverse();
        Projection { map_from_world, eye: *new_from_old * self.eye, ..*self }
    }
}

impl Fit {
    /// Does this map show all that `wanted` needs, about as finely?
    fn still_serves(&self, wanted: &Fit) -> bool {
        let Some(needed) = wanted.needed else { return true };
        let inside = |p: Vec3| {
            let p = self.projection.map_from_world.project_point3(p);
            p.x.abs() <= 1.0 && p.y.abs() <= 1.0 && (-1e-4..=1.0 + 1e-4).contains(&p.z)
        };
        self.projection.texel <= 1.1 * wanted.projection.texel && needed.into_iter().all(inside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot(places: &[Mat4]) -> Snapshot {
        let unit = Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE };
        let caster = |(index, m): (usize, &Mat4)| Caster {
            index,
            content: [1, 2, 0],
            has_holes: false,
            world_from_object: *m,
            centre: Vec3::ZERO,
            reach: 1.0,
            bounds_in_world: unit.transformed(m),
        };
        let casters: Vec<Caster> = places.iter().enumerate().map(caster).collect();
        Snapshot { pages: casters.chunks(2).map(Arc::from).collect(), radius: 10.0 }
    }

    #[test]
    fn what_does_not_move_with_the_others_strays() {
        let places = [
            Mat4::from_translation(Vec3::X * 3.0),
            Mat4::from_rotation_z(0.3),
            Mat4::from_scale(Vec3::splat(2.0)),
            Mat4::from_translation(Vec3::Z * 9.0),
        ];
        let turn = Mat4::from_rotation_y(0.7) * Mat4::from_translation(Vec3::new(1.0, 2.0, 3.0));
        let slip = Mat4::from_translation(Vec3::Y * 0.01);
        let each = |f: &dyn Fn(usize, Mat4) -> Mat4| snapshot(&std::array::from_fn::<Mat4, 4, _>(|i| f(i, places[i])));
        let old = each(&|_, m| m);
        // What happened, the places now, boxes of strays, exact.
        for (name, new, strays, is_exact) in [
            ("nothing moved", each(&|_, m| m), 0, true),
            ("all turned", each(&|_, m| turn * m), 0, false),
            ("one slipped", each(&|i, m| if i == 2 { slip * m } else { m }), 2, true),
            ("the first slipped", each(&|i, m| if i == 0 { slip * m } else { m }), 2, true),
            ("the first slipped while all turned", each(&|i, m| if i == 0 { slip * turn * m } else { turn * m }), 2, false),
            ("all grew", each(&|i, m| Mat4::from_scale(Vec3::splat(1.1 + i as f32)) * m), 8, true),
            ("all mirrored", each(&|_, m| Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0)) * m), 8, true),
            ("two fewer", snapshot(&places[..2]), 2, true),
        ] {
            let found = motion(&old, &new);
            assert_eq!((found.strays.len(), found.is_exact), (strays, is_exact), "{name}");
        }
        let m = motion(&old, &each(&|_, m| turn * m)).new_from_old;
        assert!((m.transform_point3(Vec3::ONE) - turn.transform_point3(Vec3::ONE)).length() < 1e-4);
        // Half of them lie in a page that both snapshots share, so it is known to be at rest.
        let mut half_at_rest = each(&|i, m| if i < 2 { m } else { turn * m });
        half_at_rest.pages[0] = old.pages[0].clone();
        let found = motion(&old, &half_at_rest);
        assert_eq!((found.new_from_old, found.strays.len(), found.is_exact), (Mat4::IDENTITY, 4, true));
        let mut more_moved = each(&|i, m| if i < 1 { m } else { turn * m });
        more_moved.pages[0] = vec![old.pages[0][0].clone()].into();
        let (mut shares, gone) = (snapshot(&places), more_moved.pages[0].clone());
        shares.pages[0] = gone;
        let found = motion(&shares, &more_moved);
        assert_eq!((found.strays.len(), found.is_exact), (2, false), "one at rest strays from two that moved");
        let back = motion(&snapshot(&places[..2]), &old);
        assert_eq!(back.strays.len(), 2, "casters that came");
    }
}
