//! Groups find what a look at each drawable finds.

use super::*;
use glam::Vec3;
use umbriel_scene::Frustum;

/// Numbers between 0 and 1 (Marsaglia 2003, Xorshift RNGs).
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    fn place(&mut self) -> Vec3 {
        Vec3::new(self.roll(), self.roll(), self.roll()) * 200.0 - 100.0
    }
}

fn kind(alpha: Alpha) -> Kind {
    Kind { alpha, topology: 0, mirrored: false, double_sided: false, shader: 0, needs: Needs::default() }
}

/// Drawables of few and of many to a batch; some cast, some are stand-ins, one has a box without end, one none at all.
fn draws(count: usize, dice: &mut Dice) -> Draws {
    let mut draws = Draws::default();
    for index in 0..count {
        let alpha = [Alpha::Opaque, Alpha::Opaque, Alpha::Mask, Alpha::Blend][(dice.roll() * 4.0) as usize];
        let mesh = (dice.roll() * dice.roll() * 8.0) as u32;
        let (drawn, stands_in) = (dice.roll() > 0.1, dice.roll() > 0.9);
        let casting = [Casting::Nothing, Casting::Whole, Casting::Holed][(dice.roll() * 3.0) as usize];
        draws.slots.push(Slot {
            mesh,
            material: 0,
            kind: kind(alpha),
            deformed: None,
            drawn,
            casting,
            has_holes: false,
            stands_in,
            shown: [0; 2],
        });
        draws.bounds.push(match index {
            5 => Aabb { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY },
            9 => Aabb::EMPTY,
            _ => Aabb::from_points([dice.place()]),
        });
    }
    draws.boxes = draws.bounds.iter().map(|b| CentredBox::from(*b)).collect();
    draws
}

/// Places of what was found, ascending, and how many were culled.
fn places(draws: &Draws, found: &Found) -> (Vec<usize>, usize) {
    let mut places: Vec<usize> =
        found.draws.iter().flat_map(|draw| draws.visible.of(draw)).map(|place| *place as usize).collect();
    places.sort_unstable();
    (places, found.culled)
}

#[test]
fn groups_are_culled_as_each_would_be() {
    let mut dice = Dice(20_261_126);
    let mut draws = draws(2_000, &mut dice);
    for round in 0..40 {
        // Some move, without being sorted anew.
        for _ in 0..100 * usize::from(round > 0) {
            let index = 10 + (dice.roll() * 1_990.0) as usize;
            draws.bounds[index] = Aabb::from_points([dice.place()]);
            draws.boxes[index] = draws.bounds[index].into();
            if draws.slots[index].drawn {
                draws.order.touch(index);
            }
        }
        draws.is_changed = true;
        draws.finish();
        let frustum = Frustum::symmetric(0.2 + 2.0 * dice.roll(), 1.5, 0.1);
        let view = Mat4::from_rotation_y(6.0 * dice.roll()) * Mat4::from_translation(dice.place());
        let clip_from_world = frustum.clip_from_view() * view;
        let planes = Planes::new(&clip_from_world);
        let each = |draws: &Draws, wanted: &dyn Fn(&Slot, usize) -> bool| {
            let drawn = (0..draws.slots.len()).filter(|i| draws.slots[*i].drawn && wanted(&draws.slots[*i], *i));
            let (seen, outside): (Vec<_>, Vec<_>) = drawn.partition(|i| planes.may_see(&draws.boxes[*i]));
            (seen, outside.len())
        };
        let found = draws.surfaces(&clip_from_world);
        assert_eq!(places(&draws, &found), each(&draws, &|s, _| s.kind.alpha != Alpha::Blend && !s.stands_in), "{round}");
        let found = draws.casters(&clip_from_world, false);
        assert_eq!(places(&draws, &found), each(&draws, &|s, _| s.casting != Casting::Nothing), "{round}");
        let found = draws.casters(&clip_from_world, true);
        assert_eq!(places(&draws, &found), each(&draws, &|s, _| s.casting == Casting::Holed), "{round}");
        let found = draws.back_to_front(&clip_from_world, &view);
        assert_eq!(places(&draws, &found), each(&draws, &|s, _| s.kind.alpha == Alpha::Blend && !s.stands_in), "{round}");
        let found = draws.surfaces_where(&clip_from_world, |i| i % 3 == 0);
        let third = |s: &Slot, i| s.kind.alpha != Alpha::Blend && !s.stands_in && i % 3 == 0;
        assert_eq!(places(&draws, &found), each(&draws, &third), "{round}");
        let single = draws.single(&clip_from_world, |i| i % 5 == 0);
        let mut found: Vec<usize> = single.iter().map(|(index, _)| *index).collect();
        found.sort_unstable();
        assert_eq!(found, each(&draws, &|s, i| !s.stands_in && i % 5 == 0).0, "{round}");
        let casters = draws.slots.iter().zip(&draws.bounds).filter(|(s, _)| s.drawn && s.casting != Casting::Nothing);
        assert_eq!(draws.casters_box(), casters.fold(Aabb::EMPTY, |all, (_, b)| all.union(*b)), "{round}");
    }
}
