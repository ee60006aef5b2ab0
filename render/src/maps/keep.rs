//! When a map need not be drawn anew: light and casters stand still, or moved together as one stiff body ("the world
//! moves": the whole world turns around a visitor who stands still in his room).

use super::fit::Fit;
use crate::draws::Caster;
use glam::{Mat4, Vec3};
use std::sync::Arc;
use umbriel_scene::{Light, MapSettings};

/// Deviation from a stiff motion that is not seen, as share of the size of all casters: a tenth of a texel of a map of
/// 2048 that shows all of them.
const TOLERANCE: f32 = 3e-5;

/// What cast at the time a map was drawn.
pub(crate) struct Snapshot {
    pub(crate) casters: Vec<Caster>,
    /// Half the diagonal of the box around them, metres.
    pub(crate) radius: f32,
}

/// What a light's maps in the texture show.
pub(crate) struct Record {
    pub(crate) light: Light,
    pub(crate) snapshot: Arc<Snapshot>,
    pub(crate) fits: Vec<Fit>,
    /// Size and place of each.
    pub(crate) tiles: Vec<(u32, super::atlas::Place)>,
}

/// The motion of all casters since `old`, where it is that of one stiff body.
pub(crate) fn motion(old: &Snapshot, new: &Snapshot) -> Option<Mat4> {
    if old.casters.len() != new.casters.len() {
        return None;
    }
    let Some((first_old, first_new)) = old.casters.first().zip(new.casters.first()) else { return Some(Mat4::IDENTITY) };
    let new_from_old = if first_old.world_from_object == first_new.world_from_object {
        Mat4::IDENTITY
    } else {
        first_new.world_from_object * first_old.world_from_object.inverse()
    };
    if !is_stiff(&new_from_old) {
        return None;
    }
    let tolerance = TOLERANCE * new.radius;
    let agrees = |(a, b): (&Caster, &Caster)| {
        if a.content != b.content {
            return false;
        }
        let expected = new_from_old * a.world_from_object;
        let linear = (0..3).map(|i| (expected.col(i) - b.world_from_object.col(i)).length()).fold(0.0, f32::max);
        let moved = (expected.transform_point3(a.centre) - b.world_from_object.transform_point3(a.centre)).length();
        moved + linear * a.reach <= tolerance
    };
    old.casters.iter().zip(&new.casters).all(agrees).then_some(new_from_old)
}

fn is_stiff(m: &Mat4) -> bool {
    let axes = [m.x_axis, m.y_axis, m.z_axis].map(|a| a.truncate());
    let [x, y, z] = axes;
    let lengths = axes.iter().all(|a| (a.length() - 1.0).abs() < 1e-4);
    lengths && x.dot(y).abs() < 1e-4 && y.dot(z).abs() < 1e-4 && z.dot(x).abs() < 1e-4 && m.determinant() > 0.0
}

impl Record {
    /// The old maps as they serve now, or `None` where they have to be drawn anew. `wanted` are the maps that a new fit
    /// would draw, `new_from_old` is the motion of the casters.
    pub(crate) fn kept(&self, light: &Light, wanted: &[Fit], new_from_old: Mat4) -> Option<Vec<Fit>> {
        let same_map = |a: &MapSettings, b: &MapSettings| (a.size, a.frustum, a.near_far) == (b.size, b.frustum, b.near_far);
        let stayed = |a: Vec3, b: Vec3| (a - b).length() <= TOLERANCE * self.snapshot.radius.max(1e-3);
        let has_moved_along = stayed(new_from_old.transform_vector3(self.light.direction), light.direction)
            && stayed(new_from_old.transform_point3(self.light.position), light.position);
        if self.light.kind != light.kind || !same_map(&self.light.map, &light.map) || !has_moved_along {
            return None;
        }
        if wanted.len() != self.fits.len() {
            return None;
        }
        let old_from_new = new_from_old.inverse();
        let mut fits = self.fits.clone();
        for (fit, wanted) in fits.iter_mut().zip(wanted) {
            fit.projection.map_from_world *= old_from_new;
            fit.projection.eye = wanted.projection.eye;
            if !fit.still_serves(wanted) {
                return None;
            }
        }
        Some(fits)
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
        let caster = |m: &Mat4| Caster { content: [1, 2, 0], world_from_object: *m, centre: Vec3::ZERO, reach: 1.0 };
        Snapshot { casters: places.iter().map(caster).collect(), radius: 10.0 }
    }

    #[test]
    fn only_stiff_motions_count() {
        let places = [Mat4::from_translation(Vec3::X * 3.0), Mat4::from_rotation_z(0.3), Mat4::from_scale(Vec3::splat(2.0))];
        let turn = Mat4::from_rotation_y(0.7) * Mat4::from_translation(Vec3::new(1.0, 2.0, 3.0));
        let slip = Mat4::from_translation(Vec3::Y * 0.01);
        let each = |f: &dyn Fn(usize, Mat4) -> Mat4| snapshot(&std::array::from_fn::<Mat4, 3, _>(|i| f(i, places[i])));
        let old = each(&|_, m| m);
        for (name, new, expected) in [
            ("nothing moved", each(&|_, m| m), true),
            ("all turned", each(&|_, m| turn * m), true),
            ("one slipped", each(&|i, m| if i == 2 { slip * m } else { m }), false),
            ("the first slipped", each(&|i, m| if i == 0 { slip * m } else { m }), false),
            ("all grew", each(&|_, m| Mat4::from_scale(Vec3::splat(1.1)) * m), false),
            ("all mirrored", each(&|_, m| Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0)) * m), false),
            ("one fewer", snapshot(&places[..2]), false),
        ] {
            assert_eq!(motion(&old, &new).is_some(), expected, "{name}");
        }
        let m = motion(&old, &each(&|_, m| turn * m)).unwrap();
        assert!((m.transform_point3(Vec3::ONE) - turn.transform_point3(Vec3::ONE)).length() < 1e-4);
    }
}
