//! Drawables in the order in which they are drawn: batches of equal ones, and groups of neighbours in these that are culled together.

use super::{Batch, Casting, Key, Slot};
use crate::cull::{CentredBox, Planes};
use glam::Vec3;
use umbriel_scene::Aabb;

/// Drawables of a group.
const GROUP: usize = 64;

/// Neighbours in a batch: `list[first..first + count]`.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    first: u32,
    count: u32,
    /// Those that cast, and a box around them.
    casting: u32,
    pub(crate) casters: Aabb,
    /// Those that cast and have holes.
    holed: u32,
    /// Those that views show.
    shown: u32,
    /// Box around all of them.
    pub(crate) bounds: Aabb,
    /// The same, or none where numbers end.
    around: Option<CentredBox>,
    is_stale: bool,
}

/// How a group lies to a frustum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lies {
    Outside,
    Inside,
    /// Each of its drawables may lie in any way.
    Across,
}

/// Whether it holds for the drawables of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Holds {
    All,
    Some,
    None,
}

impl Group {
    pub(crate) fn lies(&self, planes: &Planes) -> Lies {
        match &self.around {
            Some(around) if !planes.may_see(around) => Lies::Outside,
            Some(around) if planes.see_all_of(around) => Lies::Inside,
            _ => Lies::Across,
        }
    }

    /// A box around all of it, where there is one.
    pub(crate) fn around(&self) -> Option<&CentredBox> {
        self.around.as_ref()
    }

    pub(crate) fn casts(&self) -> Holds {
        self.holds(self.casting)
    }

    pub(crate) fn has_holes(&self) -> Holds {
        self.holds(self.holed)
    }

    pub(crate) fn is_shown(&self) -> Holds {
        self.holds(self.shown)
    }

    fn holds(&self, count: u32) -> Holds {
        match count {
            0 => Holds::None,
            n if n == self.count => Holds::All,
            _ => Holds::Some,
        }
    }
}

/// All drawn drawables.
#[derive(Default)]
pub(crate) struct Order {
    list: Vec<u32>,
    pub(crate) batches: Vec<Batch>,
    groups: Vec<Group>,
    /// Number of the group of each drawable.
    group_of: Vec<u32>,
    /// Groups to be looked at again.
    stale: Vec<u32>,
    keyed: Vec<(Key, u32)>,
}

impl Order {
    /// Sorts all of them anew.
    pub(super) fn sort(&mut self, slots: &[Slot], boxes: &[CentredBox]) {
        self.keyed.clear();
        self.keyed.extend(slots.iter().enumerate().filter(|(_, s)| s.drawn).map(|(i, s)| (s.key(), i as u32)));
        self.keyed.sort_unstable();
        self.list.clear();
        self.batches.clear();
        self.groups.clear();
        self.stale.clear();
        self.group_of.resize(slots.len(), 0);
        for batch in self.keyed.chunk_by(|a, b| a.0 == b.0) {
            let (kind, mesh, deformed, material) = batch[0].0;
            let first = self.list.len();
            self.list.extend(batch.iter().map(|(_, index)| *index));
            let members = &mut self.list[first..];
            if members.len() > GROUP {
                sort_by_place(members, boxes);
            }
            let first_group = self.groups.len() as u32;
            for (number, neighbours) in (0u32..).zip(members.chunks(GROUP)) {
                for index in neighbours {
                    self.group_of[*index as usize] = first_group + number;
                }
                let (first, count) = (first as u32 + number * GROUP as u32, neighbours.len() as u32);
                let (casters, bounds) = (Aabb::EMPTY, Aabb::EMPTY);
                self.groups.push(Group {
                    first,
                    count,
                    casting: 0,
                    casters,
                    holed: 0,
                    shown: 0,
                    bounds,
                    around: None,
                    is_stale: true,
                });
            }
            self.batches.push(Batch { kind, mesh, material, deformed, groups: first_group..self.groups.len() as u32 });
        }
        self.stale.extend(0..self.groups.len() as u32);
    }

    /// A drawn drawable moved, or is another one now.
    pub(super) fn touch(&mut self, index: usize) {
        let Some(number) = self.group_of.get(index).copied() else { return };
        let Some(group) = self.groups.get_mut(number as usize) else { return };
        if !std::mem::replace(&mut group.is_stale, true) {
            self.stale.push(number);
        }
    }

    /// Looks at what was touched.
    pub(super) fn refit(&mut self, slots: &[Slot], bounds: &[Aabb]) {
        for number in self.stale.drain(..) {
            let group = &mut self.groups[number as usize];
            (group.casting, group.holed, group.shown) = (0, 0, 0);
            (group.casters, group.bounds) = (Aabb::EMPTY, Aabb::EMPTY);
            for index in &self.list[group.first as usize..][..group.count as usize] {
                let (slot, b) = (&slots[*index as usize], bounds[*index as usize]);
                group.bounds = group.bounds.union(b);
                group.shown += u32::from(!slot.stands_in);
                group.holed += u32::from(slot.casting == Casting::Holed);
                if slot.casting != Casting::Nothing {
                    group.casting += 1;
                    group.casters = group.casters.union(b);
                }
            }
            (group.around, group.is_stale) = (around(&group.bounds), false);
        }
    }

    /// Drawables of a group.
    pub(crate) fn members(&self, group: &Group) -> &[u32] {
        &self.list[group.first as usize..][..group.count as usize]
    }

    pub(crate) fn groups_of(&self, batch: &Batch) -> &[Group] {
        &self.groups[batch.groups.start as usize..batch.groups.end as usize]
    }

    pub(crate) fn groups(&self) -> &[Group] {
        &self.groups
    }
}

/// A box that rounding does not make too small; none around nothing, or where numbers end.
fn around(bounds: &Aabb) -> Option<CentredBox> {
    let mut around = CentredBox::from(*bounds);
    around.half += 1e-6 * (around.centre.abs() + around.half);
    (!bounds.is_empty() && around.centre.is_finite() && around.half.is_finite()).then_some(around)
}

/// Neighbours come to lie together, along a curve through a grid of 1024 cells each way (Morton 1966).
fn sort_by_place(members: &mut [u32], boxes: &[CentredBox]) {
    let centre = |index: u32| boxes[index as usize].centre;
    let all = Aabb::from_points(members.iter().map(|i| centre(*i)));
    let scale = 1023.0 / (all.max - all.min).max(Vec3::splat(1e-20));
    let spread = |v: f32| {
        let v = (v as u32).min(1023);
        (0..10).fold(0u32, |bits, i| bits | (v >> i & 1) << (3 * i))
    };
    let place = |index: &u32| {
        let cell = (centre(*index) - all.min) * scale;
        (spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2, *index)
    };
    members.sort_by_cached_key(place);
}
