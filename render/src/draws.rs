//! The drawables of a frame as instances, sorted so that equal ones are drawn in one call.

use crate::cache::{GpuMaterial, GpuMesh, Slab};
use crate::cull::{CentredBox, Planes};
use crate::uniforms::Instance;
use glam::{Mat3, Mat4, Vec3};
use umbriel_scene::{Aabb, AlphaMode, Drawable, Material, Mesh, Topology};

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

/// Instances that differ in nothing but their place: `order[first..first + count]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Batch {
    pub(crate) kind: Kind,
    pub(crate) mesh: u32,
    pub(crate) material: u32,
    /// Place in the list of deformed meshes.
    pub(crate) deformed: Option<u32>,
    first: u32,
    count: u32,
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

/// What is known of one drawable.
#[derive(Clone, Copy, Debug)]
struct Slot {
    mesh: u32,
    material: u32,
    kind: Kind,
    deformed: Option<u32>,
    drawn: bool,
    casting: Casting,
}

type Key = (Kind, u32, Option<u32>, u32);

/// All drawables of the frame. Kept, so that only what changed costs.
#[derive(Default)]
pub(crate) struct Draws {
    slots: Vec<Slot>,
    pub(crate) instances: Vec<Instance>,
    pub(crate) boxes: Vec<CentredBox>,
    /// Drawn drawables by key.
    order: Vec<(Key, u32)>,
    pub(crate) batches: Vec<Batch>,
    /// Instances that some view sees, view after view.
    pub(crate) visible: Vec<u32>,
    is_sorted: bool,
}

/// A drawable that casts, as shadow maps remember it.
#[derive(Clone, Debug)]
pub(crate) struct Caster {
    /// Its place in [`umbriel_scene::Scene::drawables`].
    pub(crate) index: usize,
    /// Mesh, material where that cuts holes, and revision of the deformation.
    pub(crate) content: [u64; 3],
    pub(crate) has_holes: bool,
    pub(crate) world_from_object: Mat4,
    /// Middle of the mesh at rest, and how far it reaches from there, in the space of the object.
    pub(crate) centre: Vec3,
    pub(crate) reach: f32,
    /// Deformation included.
    pub(crate) bounds_in_world: Aabb,
}

/// GPU copies that drawables are looked up in.
pub(crate) struct Caches<'a> {
    pub(crate) meshes: &'a Slab<Mesh, Option<GpuMesh>>,
    pub(crate) materials: &'a Slab<Material, GpuMaterial>,
}

const NOTHING: u32 = u32::MAX;

impl Draws {
    /// Starts a frame with room for `count` drawables.
    pub(crate) fn begin(&mut self, count: usize) {
        let kind =
            Kind { alpha: Alpha::Opaque, topology: 0, mirrored: false, double_sided: false, shader: 0, needs: Needs::default() };
        let slot = Slot { mesh: NOTHING, material: NOTHING, kind, deformed: None, drawn: false, casting: Casting::Nothing };
        if self.slots.len() != count {
            self.is_sorted = false;
        }
        self.slots.resize(count, slot);
        self.instances.resize(count, bytemuck::Zeroable::zeroed());
        self.boxes.resize(count, CentredBox::default());
        self.visible.clear();
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

    /// Takes a drawable into the frame.
    pub(crate) fn set(
        &mut self,
        index: usize,
        d: &Drawable,
        (mesh, material): (u32, u32),
        deformed: Option<u32>,
        caches: &Caches,
    ) {
        let (Some(Some(gpu_mesh)), Some(gpu_material)) = (caches.meshes.get(mesh), caches.materials.get(material)) else {
            return self.hide(index);
        };
        let instance = &mut self.instances[index];
        let world_from_object = d.world_from_object.to_cols_array_2d();
        let list = d.receives.map_or(0, |list| (list as u32 + 1) << Instance::RECEIVE_LIST_SHIFT);
        let receives = if d.receives_shadow { Instance::RECEIVES_SHADOW | list } else { 0 };
        if instance.world_from_object != world_from_object || instance.flags == 0 {
            *instance = instance_of(&d.world_from_object);
        }
        instance.flags = (instance.flags & Instance::MIRRORED) | receives | PRESENT;
        self.boxes[index] = d.bounds_in_world.into();
        let slot = &mut self.slots[index];
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
        let same = slot.drawn && (slot.mesh, slot.material, slot.deformed, slot.kind) == (mesh, material, deformed, kind);
        self.is_sorted &= same;
        let has_holes = match gpu_material.alpha {
            AlphaMode::Mask { cutoff } => gpu_material.least_alpha * gpu_mesh.least_alpha < cutoff,
            _ => false,
        };
        let casting = match (d.casts_shadow, has_holes) {
            (false, _) => Casting::Nothing,
            (true, false) => Casting::Whole,
            (true, true) => Casting::Holed,
        };
        *slot = Slot { mesh, material, kind, deformed, drawn: true, casting };
    }

    /// Sorts the frame's drawables into batches.
    pub(crate) fn sort(&mut self) {
        if self.is_sorted {
            return;
        }
        self.is_sorted = true;
        self.order.clear();
        let drawn = self.slots.iter().enumerate().filter(|(_, s)| s.drawn);
        self.order.extend(drawn.map(|(i, s)| ((s.kind, s.mesh, s.deformed, s.material), i as u32)));
        self.order.sort_unstable();
        self.batches.clear();
        for (place, (key, _)) in (0u32..).zip(&self.order) {
            let (kind, mesh, deformed, material) = *key;
            match self.batches.last_mut() {
                Some(b) if (b.kind, b.mesh, b.deformed, b.material) == *key => b.count += 1,
                _ => self.batches.push(Batch { kind, mesh, material, deformed, first: place, count: 1 }),
            }
        }
    }

    /// Draws of all drawables in the frustum that pass `wanted`, and how many were outside.
    pub(crate) fn cull(&mut self, planes: &Planes, wanted: impl Fn(Alpha, Casting, u32) -> bool) -> (Vec<Draw>, usize) {
        let mut draws = Vec::new();
        let mut culled = 0;
        for (number, batch) in (0u32..).zip(&self.batches) {
            let first = self.visible.len() as u32;
            for (_, index) in &self.order[batch.first as usize..(batch.first + batch.count) as usize] {
                if !wanted(batch.kind.alpha, self.slots[*index as usize].casting, *index) {
                    continue;
                }
                if planes.may_see(&self.boxes[*index as usize]) {
                    self.visible.push(*index);
                } else {
                    culled += 1;
                }
            }
            let count = self.visible.len() as u32 - first;
            if count > 0 {
                draws.push(Draw { batch: number, first, count });
            }
        }
        (draws, culled)
    }

    /// Drawables that a view may see and that pass `wanted`, each with a draw of its own.
    pub(crate) fn single(&mut self, planes: &Planes, wanted: impl Fn(usize) -> bool) -> Vec<(usize, Draw)> {
        let mut found = Vec::new();
        for (number, batch) in (0u32..).zip(&self.batches) {
            for (_, index) in &self.order[batch.first as usize..(batch.first + batch.count) as usize] {
                if wanted(*index as usize) && planes.may_see(&self.boxes[*index as usize]) {
                    found.push((*index as usize, Draw { batch: number, first: self.visible.len() as u32, count: 1 }));
                    self.visible.push(*index);
                }
            }
        }
        found
    }

    /// Numbers of the drawables of one draw.
    pub(crate) fn visible_of(&self, draw: &Draw) -> &[u32] {
        &self.visible[draw.first as usize..][..draw.count as usize]
    }

    /// Draws of what is half-transparent, the farthest first.
    pub(crate) fn back_to_front(&mut self, planes: &Planes, view_from_world: &Mat4) -> (Vec<Draw>, usize) {
        let mut found = Vec::new();
        let mut culled = 0;
        for (number, batch) in (0u32..).zip(&self.batches).filter(|(_, b)| b.kind.alpha == Alpha::Blend) {
            for (_, index) in &self.order[batch.first as usize..(batch.first + batch.count) as usize] {
                let b = &self.boxes[*index as usize];
                if planes.may_see(b) {
                    found.push((view_from_world.transform_point3(b.centre).length_squared(), number, *index));
                } else {
                    culled += 1;
                }
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)));
        let mut draws: Vec<Draw> = Vec::new();
        for (_, batch, index) in found {
            let first = self.visible.len() as u32;
            self.visible.push(index);
            match draws.last_mut() {
                Some(last) if last.batch == batch => last.count += 1,
                _ => draws.push(Draw { batch, first, count: 1 }),
            }
        }
        (draws, culled)
    }

    /// Numbers of the drawables that are drawn, with what of them casts.
    pub(crate) fn drawn(&self) -> impl Iterator<Item = (usize, Casting)> + '_ {
        self.slots.iter().enumerate().filter(|(_, s)| s.drawn).map(|(i, s)| (i, s.casting))
    }

    /// All drawables that cast.
    pub(crate) fn casters(&self, drawables: &[Drawable], revision: impl Fn(u32) -> u64) -> Vec<Caster> {
        let casting = self.slots.iter().zip(drawables).enumerate().filter(|(_, (s, _))| s.drawn && s.casting != Casting::Nothing);
        let holes = |slot: &Slot| if slot.kind.alpha == Alpha::Mask { 1 + u64::from(slot.material) } else { 0 };
        let caster = |(i, (slot, d)): (usize, (&Slot, &Drawable))| Caster {
            index: i,
            content: [u64::from(slot.mesh), holes(slot), slot.deformed.map_or(0, &revision)],
            has_holes: slot.casting == Casting::Holed,
            world_from_object: d.world_from_object,
            centre: d.mesh.bounds.centre(),
            reach: d.mesh.bounds.radius(),
            bounds_in_world: d.bounds_in_world,
        };
        casting.map(caster).collect()
    }

    /// Mesh of a drawn drawable, and its place in the list of deformed ones.
    pub(crate) fn mesh_of(&self, index: usize) -> Option<(u32, Option<u32>)> {
        self.slots.get(index).filter(|s| s.drawn).map(|s| (s.mesh, s.deformed))
    }
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
