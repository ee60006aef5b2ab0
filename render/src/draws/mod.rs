//! The drawables of a frame as instances, sorted so that equal ones are drawn in one call.

mod casting;
mod order;
#[cfg(test)]
mod tests;
mod visible;

use crate::cache::{GpuMaterial, GpuMesh, Slab};
use crate::cull::{CentredBox, Planes};
use crate::uniforms::Instance;
use casting::Pages;
pub(crate) use casting::{Caster, Snapshot};
use glam::{Mat3, Mat4};
pub(crate) use order::Lies;
use order::{Group, Holds, Order};
use std::ops::Range;
use std::sync::Arc;
use umbriel_scene::{Aabb, AlphaMode, Drawable, Drawables, Material, Mesh, Stamp, StandIn, Topology};
pub(crate) use visible::Found;
use visible::{Question, Visible};

/// What a pipeline is chosen by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Kind {
    pub(crate) alpha: Alpha,
    pub(crate) topology: u8,
    pub(crate) mirrored: bool,
    pub(crate) double_sided: bool,
    /// Of the author; see [`crate::author`].
    pub(crate) shader: u32,
    pub(crate) needs: Needs,
}

/// What of the surface shader a material needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Needs {
    /// A bit for each of its textures.
    pub(crate) textures: u8,
    pub(crate) layers: u8,
    /// Number of its shading, as in the uniform.
    pub(crate) shading: u8,
}

/// What alpha means, without its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Alpha {
    Opaque,
    Mask,
    Blend,
}

/// Instances that differ in nothing but their place.
#[derive(Clone, Debug)]
pub(crate) struct Batch {
    pub(crate) kind: Kind,
    pub(crate) mesh: u32,
    pub(crate) material: u32,
    /// Place in the list of deformed meshes.
    pub(crate) deformed: Option<u32>,
    groups: Range<u32>,
}

/// One draw call of a view: a run of the frame's list of visible instances.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Draw {
    pub(crate) batch: u32,
    pub(crate) first: u32,
    pub(crate) count: u32,
}

/// What blocks light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Casting {
    Nothing,
    /// Its triangles.
    Whole,
    /// Its triangles without the holes that alpha cuts into them.
    Holed,
}

impl Casting {
    fn of(d: &Drawable, has_holes: bool) -> Casting {
        match (d.casts_shadow, has_holes) {
            (false, _) => Casting::Nothing,
            (true, false) => Casting::Whole,
            (true, true) => Casting::Holed,
        }
    }
}

/// What is known of one drawable.
#[derive(Clone, Copy, Debug)]
struct Slot {
    mesh: u32,
    material: u32,
    kind: Kind,
    deformed: Option<u32>,
    drawn: bool,
    casting: Casting,
    /// Alpha cuts holes into it, if it casts or not.
    has_holes: bool,
    /// It casts in place of another one, and no view shows it.
    stands_in: bool,
    /// Addresses of its mesh and its material, which are held as long as it is drawn.
    shown: [usize; 2],
}

impl Slot {
    fn key(&self) -> Key {
        (self.kind, self.mesh, self.deformed, self.material)
    }
}

type Key = (Kind, u32, Option<u32>, u32);

/// All drawables of the frame. Kept, so that only pages that changed cost.
#[derive(Default)]
pub(crate) struct Draws {
    /// Of the pages as they were taken.
    stamps: Vec<Stamp>,
    slots: Vec<Slot>,
    pub(crate) instances: Vec<Instance>,
    boxes: Vec<CentredBox>,
    bounds: Vec<Aabb>,
    order: Order,
    pub(crate) visible: Visible,
    pages: Pages,
    /// Places of the stand-ins, ascending.
    stand_ins: Vec<usize>,
    /// Instances that were not sent yet, page by page.
    unsent: Vec<Range<usize>>,
    is_sorted: bool,
    is_changed: bool,
    /// Grows with every frame in which something changed.
    pub(crate) revision: u64,
}

/// GPU copies that drawables are looked up in.
pub(crate) struct Caches<'a> {
    pub(crate) meshes: &'a Slab<Mesh, Option<GpuMesh>>,
    pub(crate) materials: &'a Slab<Material, GpuMaterial>,
}

const NOTHING: u32 = u32::MAX;

/// Instances between two that changed that are sent along: to begin another write costs more than these 128 kB.
const MOST_BETWEEN: usize = 1024;

impl Draws {
    /// Starts a frame. Gives the pages of drawables that may have changed since the last one.
    pub(crate) fn begin(&mut self, drawables: &Drawables, stand_ins: &[StandIn]) -> Vec<usize> {
        let kind =
            Kind { alpha: Alpha::Opaque, topology: 0, mirrored: false, double_sided: false, shader: 0, needs: Needs::default() };
        let slot = Slot {
            mesh: NOTHING,
            material: NOTHING,
            kind,
            deformed: None,
            drawn: false,
            casting: Casting::Nothing,
            has_holes: false,
            stands_in: false,
            shown: [0; 2],
        };
        let count = drawables.len();
        if self.slots.len() != count {
            self.is_sorted = false;
        }
        self.slots.resize(count, slot);
        self.instances.resize(count, bytemuck::Zeroable::zeroed());
        self.boxes.resize(count, CentredBox::default());
        self.bounds.resize(count, Aabb::EMPTY);
        let now = drawables.stamps();
        let mut pages = Vec::new();
        self.stamps.truncate(now.len());
        for (page, stamp) in now.iter().enumerate() {
            match self.stamps.get_mut(page) {
                Some(taken) if taken == stamp => continue,
                Some(taken) => *taken = stamp.clone(),
                None => self.stamps.push(stamp.clone()),
            }
            self.pages.forget(page);
            pages.push(page);
        }
        self.pages.truncate(now.len());
        self.is_changed = !self.is_sorted;
        self.take_stand_ins(stand_ins);
        pages
    }

    fn take_stand_ins(&mut self, stand_ins: &[StandIn]) {
        let mut now: Vec<usize> = stand_ins.iter().map(|s| s.place).filter(|place| *place < self.slots.len()).collect();
        now.sort_unstable();
        if now == self.stand_ins {
            return;
        }
        for (places, stands_in) in [(&self.stand_ins, false), (&now, true)] {
            for place in places {
                if let Some(slot) = self.slots.get_mut(*place) {
                    slot.stands_in = stands_in;
                }
            }
        }
        self.stand_ins = now;
        (self.is_sorted, self.is_changed) = (false, true);
    }

    /// Mesh and material that a drawable had in the frame before; a hint.
    pub(crate) fn ids(&self, index: usize) -> (u32, u32) {
        (self.slots[index].mesh, self.slots[index].material)
    }

    /// Leaves a drawable out of the frame.
    pub(crate) fn hide(&mut self, index: usize) {
        if self.slots[index].drawn {
            self.slots[index].drawn = false;
            self.is_sorted = false;
        }
    }

    /// Takes a drawable that at most moved, or casts and receives otherwise, since it was last taken. False where it did more than that.
    pub(crate) fn set_again(&mut self, index: usize, d: &Drawable) -> bool {
        let slot = &self.slots[index];
        let is_stiff = d.pose.is_none() && slot.deformed.is_none();
        if !(slot.drawn && d.visible && is_stiff && slot.shown == shown(d)) {
            return false;
        }
        let instance = self.instance_at(index, d);
        let mirrored = instance.flags & Instance::MIRRORED != 0;
        if mirrored != slot.kind.mirrored || !d.world_from_object.is_finite() {
            return false;
        }
        self.place(index, d, instance);
        true
    }

    /// What the shaders read of a drawable.
    fn instance_at(&self, index: usize, d: &Drawable) -> Instance {
        let before = &self.instances[index];
        let list = d.receives.map_or(0, |list| (list as u32 + 1) << Instance::RECEIVE_LIST_SHIFT);
        let receives = if d.receives_shadow { Instance::RECEIVES_SHADOW | list } else { 0 };
        let is_same = before.flags != 0 && before.world_from_object == d.world_from_object.to_cols_array_2d();
        let mut instance = if is_same { *before } else { instance_of(&d.world_from_object) };
        let flat = if d.mesh.flat { Instance::FLAT } else { 0 };
        instance.flags = (instance.flags & Instance::MIRRORED) | flat | receives | PRESENT;
        instance
    }

    /// Notes what changed of a drawable's place and what it does to light.
    fn place(&mut self, index: usize, d: &Drawable, instance: Instance) {
        if self.instances[index] != instance {
            self.instances[index] = instance;
            self.is_changed = true;
            let page = Drawables::places(index / Drawables::PAGE, self.slots.len());
            match self.unsent.last_mut() {
                Some(last) if last.contains(&index) => {}
                Some(last) if (last.start..=last.end + MOST_BETWEEN).contains(&page.start) => last.end = last.end.max(page.end),
                _ => self.unsent.push(page),
            }
        }
        let casting = Casting::of(d, self.slots[index].has_holes);
        if self.bounds[index] != d.bounds_in_world || self.slots[index].casting != casting {
            self.bounds[index] = d.bounds_in_world;
            self.boxes[index] = d.bounds_in_world.into();
            self.slots[index].casting = casting;
            self.is_changed = true;
            self.order.touch(index);
        }
    }

    /// Takes a drawable into the frame.
    pub(crate) fn set(
        &mut self,
        index: usize,
        d: &Drawable,
        (mesh, material): (u32, u32),
        deformed: Option<u32>,
        caches: &Caches<'_>,
    ) {
        let (Some(Some(gpu_mesh)), Some(gpu_material)) = (caches.meshes.get(mesh), caches.materials.get(material)) else {
            return self.hide(index);
        };
        let instance = self.instance_at(index, d);
        let slot = &self.slots[index];
        let kind = Kind {
            alpha: match gpu_material.alpha {
                AlphaMode::Opaque => Alpha::Opaque,
                AlphaMode::Mask { .. } => Alpha::Mask,
                AlphaMode::Blend => Alpha::Blend,
            },
            topology: match gpu_mesh.topology {
                Topology::Triangles => 0,
                Topology::Lines => 1,
                Topology::Points => 2,
            },
            mirrored: instance.flags & Instance::MIRRORED != 0,
            double_sided: gpu_material.double_sided,
            shader: gpu_material.shader,
            needs: gpu_material.needs,
        };
        let has_holes = match gpu_material.alpha {
            AlphaMode::Mask { cutoff } => gpu_material.least_alpha * gpu_mesh.least_alpha < cutoff,
            _ => false,
        };
        let same = slot.drawn && (slot.mesh, slot.material, slot.deformed, slot.kind) == (mesh, material, deformed, kind);
        self.is_sorted &= same;
        self.slots[index] = Slot { mesh, material, kind, deformed, drawn: true, has_holes, shown: shown(d), ..*slot };
        self.place(index, d, instance);
    }

    /// Sorts the frame's drawables into batches, where that is needed, once all that changed are taken.
    pub(crate) fn finish(&mut self) {
        if !self.is_sorted {
            self.order.sort(&self.slots, &self.boxes);
            (self.is_sorted, self.is_changed) = (true, true);
        }
        self.order.refit(&self.slots, &self.bounds);
        self.visible.begin(self.is_changed);
        self.revision += u64::from(self.is_changed);
    }

    pub(crate) fn batches(&self) -> &[Batch] {
        &self.order.batches
    }

    /// Those of the batches that are half-transparent follow the others.
    fn first_blended(&self) -> usize {
        self.order.batches.partition_point(|b| b.kind.alpha < Alpha::Blend)
    }

    /// Draws of all drawables that a view shows, but what is half-transparent.
    pub(crate) fn surfaces(&mut self, clip_from_world: &Mat4) -> Found {
        let question = Question::Surfaces { clip_from_world: *clip_from_world };
        let batches = 0..self.first_blended();
        self.ask(Some(question), clip_from_world, batches, Group::is_shown, |slot, _| !slot.stands_in)
    }

    /// Draws of all drawables that cast into a map, or of those alone that have holes.
    pub(crate) fn casters(&mut self, clip_from_world: &Mat4, holes_only: bool) -> Found {
        let question = Question::Casters { clip_from_world: *clip_from_world, holes_only };
        let batches = 0..self.order.batches.len();
        let holds = |group: &Group| if holes_only { group.has_holes() } else { group.casts() };
        let wanted = |slot: &Slot, _| slot.casting == Casting::Holed || slot.casting == Casting::Whole && !holes_only;
        self.ask(Some(question), clip_from_world, batches, holds, wanted)
    }

    /// Those of [`Draws::surfaces`] that pass `wanted`.
    pub(crate) fn surfaces_where(&mut self, clip_from_world: &Mat4, wanted: impl Fn(usize) -> bool) -> Found {
        let batches = 0..self.first_blended();
        self.shown_where(clip_from_world, batches, wanted)
    }

    fn ask(
        &mut self,
        question: Option<Question>,
        clip_from_world: &Mat4,
        batches: Range<usize>,
        holds: impl Fn(&Group) -> Holds,
        wanted: impl Fn(&Slot, u32) -> bool,
    ) -> Found {
        let Draws { order, slots, boxes, visible, .. } = self;
        let find = |list: &mut Vec<u32>| {
            let planes = Planes::new(clip_from_world);
            let (mut draws, mut culled) = (Vec::new(), 0);
            for number in batches {
                let first = list.len() as u32;
                for group in order.groups_of(&order.batches[number]) {
                    let members = order.members(group);
                    let lies = group.lies(&planes);
                    match (holds(group), lies) {
                        (Holds::None, _) => {}
                        (Holds::All, Lies::Inside) => list.extend_from_slice(members),
                        (Holds::All, Lies::Outside) => culled += members.len(),
                        _ => {
                            for index in members.iter().filter(|i| wanted(&slots[**i as usize], **i)) {
                                if lies != Lies::Outside && planes.may_see(&boxes[*index as usize]) {
                                    list.push(*index);
                                } else {
                                    culled += 1;
                                }
                            }
                        }
                    }
                }
                let count = list.len() as u32 - first;
                if count > 0 {
                    draws.push(Draw { batch: number as u32, first, count });
                }
            }
            (draws, culled)
        };
        visible.ask(question, find)
    }

    /// Drawables that a view may show and that pass `wanted`, each with a draw of its own.
    pub(crate) fn single(&mut self, clip_from_world: &Mat4, wanted: impl Fn(usize) -> bool) -> Vec<(usize, Draw)> {
        let batches = 0..self.order.batches.len();
        let found = self.shown_where(clip_from_world, batches, wanted);
        let each = |draw: Draw| (draw.first..draw.first + draw.count).map(move |first| Draw { first, count: 1, ..draw });
        let draws = found.draws.iter().copied().flat_map(each);
        draws.map(|draw| (self.visible.of(&draw)[0] as usize, draw)).collect()
    }

    fn shown_where(&mut self, clip_from_world: &Mat4, batches: Range<usize>, wanted: impl Fn(usize) -> bool) -> Found {
        let is_wanted = |slot: &Slot, index: u32| !slot.stands_in && wanted(index as usize);
        self.ask(None, clip_from_world, batches, |_| Holds::Some, is_wanted)
    }

    /// Draws of what is half-transparent, the farthest first.
    pub(crate) fn back_to_front(&mut self, clip_from_world: &Mat4, view_from_world: &Mat4) -> Found {
        let blended = self.first_blended()..self.order.batches.len();
        if blended.is_empty() {
            return Found::default();
        }
        let Draws { order, slots, boxes, visible, .. } = self;
        let find = |list: &mut Vec<u32>| {
            let planes = Planes::new(clip_from_world);
            let (mut found, mut culled) = (Vec::new(), 0);
            for number in blended {
                for group in order.groups_of(&order.batches[number]) {
                    for index in order.members(group).iter().filter(|i| !slots[**i as usize].stands_in) {
                        let b = &boxes[*index as usize];
                        if planes.may_see(b) {
                            found.push((view_from_world.transform_point3(b.centre).length_squared(), number as u32, *index));
                        } else {
                            culled += 1;
                        }
                    }
                }
            }
            found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)));
            let mut draws: Vec<Draw> = Vec::new();
            for (_, batch, index) in found {
                let first = list.len() as u32;
                list.push(index);
                match draws.last_mut() {
                    Some(last) if last.batch == batch => last.count += 1,
                    _ => draws.push(Draw { batch, first, count: 1 }),
                }
            }
            (draws, culled)
        };
        let question = Question::Blended { clip_from_world: *clip_from_world, view_from_world: *view_from_world };
        visible.ask(Some(question), find)
    }

    /// Numbers of the drawables that are drawn, with what of them casts.
    pub(crate) fn drawn(&self) -> impl Iterator<Item = (usize, Casting)> + '_ {
        self.slots.iter().enumerate().filter(|(_, s)| s.drawn).map(|(i, s)| (i, s.casting))
    }

    /// Does alpha cut holes into anything that casts?
    pub(crate) fn any_has_holes(&self) -> bool {
        self.order.groups().iter().any(|group| group.has_holes() != Holds::None)
    }

    /// A box around all drawables that cast.
    pub(crate) fn casters_box(&self) -> Aabb {
        self.order.groups().iter().fold(Aabb::EMPTY, |all, group| all.union(group.casters))
    }

    /// Neighbours, and the boxes of each of them.
    pub(crate) fn groups(&self) -> impl Iterator<Item = (&Group, impl Iterator<Item = (&CentredBox, &Aabb)>)> {
        let boxes = |index: &u32| (&self.boxes[*index as usize], &self.bounds[*index as usize]);
        self.order.groups().iter().map(move |group| (group, self.order.members(group).iter().map(boxes)))
    }

    /// What casts, as shadow maps remember it: all of it, and what has holes.
    pub(crate) fn snapshots(&mut self, drawables: &Drawables, revision: impl Fn(u32) -> u64) -> [Arc<Snapshot>; 2] {
        let slots = &self.slots;
        let radius = self.casters_box().radius();
        let holes = |slot: &Slot| if slot.kind.alpha == Alpha::Mask { 1 + u64::from(slot.material) } else { 0 };
        self.pages.snapshots(drawables.stamps().len(), radius, |page| {
            let places = Drawables::places(page, slots.len());
            let places = places.filter(|i| slots[*i].drawn && slots[*i].casting != Casting::Nothing);
            let caster = |index: usize| {
                let (slot, d) = (&slots[index], &drawables[index]);
                Caster {
                    index,
                    content: [u64::from(slot.mesh), holes(slot), slot.deformed.map_or(0, &revision)],
                    has_holes: slot.casting == Casting::Holed,
                    world_from_object: d.world_from_object,
                    centre: d.mesh.bounds.centre(),
                    reach: d.mesh.bounds.radius(),
                    bounds_in_world: d.bounds_in_world,
                }
            };
            places.map(caster).collect()
        })
    }

    /// Material of a drawn drawable that alpha cuts holes into.
    pub(crate) fn holed_by(&self, index: usize) -> Option<u32> {
        self.slots.get(index).filter(|s| s.drawn && s.has_holes).map(|s| s.material)
    }

    /// Mesh of a drawn drawable, and its place in the list of deformed ones.
    pub(crate) fn mesh_of(&self, index: usize) -> Option<(u32, Option<u32>)> {
        self.slots.get(index).filter(|s| s.drawn).map(|s| (s.mesh, s.deformed))
    }

    /// Instances, and which of them were not sent yet.
    pub(crate) fn send(&mut self) -> (&[Instance], Vec<Range<usize>>) {
        (&self.instances, std::mem::take(&mut self.unsent))
    }
}

/// Addresses of mesh and material.
fn shown(d: &Drawable) -> [usize; 2] {
    [Arc::as_ptr(&d.mesh).addr(), Arc::as_ptr(&d.material).addr()]
}

/// Set on every instance in use, so that an empty one is told from the identity.
const PRESENT: u32 = 1 << 31;

fn instance_of(world_from_object: &Mat4) -> Instance {
    let linear = Mat3::from_mat4(*world_from_object);
    let determinant = linear.determinant();
    // The matrix of cofactors serves flattened shapes too; its sign is that of the determinant.
    let cofactors = Mat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    ) * if determinant < 0.0 { -1.0 } else { 1.0 };
    Instance {
        world_from_object: world_from_object.to_cols_array_2d(),
        world_from_object_normal: [cofactors.x_axis, cofactors.y_axis, cofactors.z_axis].map(|c| c.extend(0.0).to_array()),
        flags: if determinant < 0.0 { Instance::MIRRORED } else { 0 },
        spare: [0; 3],
    }
}
