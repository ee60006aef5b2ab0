//! Stencil shadow volumes of any triangle soup, made on the GPU.
//!
//! The one idea: every triangle is turned to face the light and casts its own volume; what neighbours share cancels
//! before anything is drawn, because each edge carries the signed sum of its triangles (Kim, Kim, Turk 2008). Closed
//! meshes leave their silhouette, open borders count once, edges of n faces count what they must. Volumes reach to
//! infinity by w = 0 in world space (002), or until nothing is left that receives (`reach`). They are made once per
//! frame and light; each view then counts them in front of the visible surface where that is safe and behind it
//! elsewhere, and leaves out what it cannot see (`choose`).
//!
//! After [`VolumePass::draw`] the stencil is not 0 exactly where the job's light is hidden by one of the job's casters.
//! The stencil counts layers of shadow in eight bits. Jobs that may hold more are drawn in groups of at most 127 layers,
//! after each of which the eighth bit remembers what is in shadow: any number of casters, and of pieces of a mesh, is
//! exact, and so is a surface that lies over itself more often, which is cut apart. What remains is a mesh of more than 8128
//! layers, see [`VolumeStats::may_wrap`].
//!
//! Casters throw the shadow of their whole triangles. Those that alpha cuts holes into are drawn by `cutouts`.
//!
//! This module knows nothing of lighting, materials or how the stencil is used afterwards.

mod cache;
mod choose;
mod draw;
mod extent;
mod extract;
mod faces;
mod hull;
mod layers;
mod parts;
mod reach;
mod seen;
mod tiles;
mod turned;

pub(crate) use cache::GpuPart;
pub use choose::Sight;
pub(crate) use extent::Extent;
pub(crate) use extract::CasterUniform;
pub use faces::{Face, faces};
pub use seen::{Receiver, Seen};
pub use turned::TurnedBox;

use choose::Watch;
use extract::{Lists, Stale, Wanted};
use glam::{Mat4, Vec3, Vec4};
use reach::Reach;
use std::sync::Arc;
use umbriel_scene::{Aabb, Mesh, VolumeSettings};

/// One light and what stands in it.
#[derive(Clone, Debug)]
pub struct VolumeJob {
    /// The light.
    pub light: VolumeLight,
    /// What casts.
    pub casters: Vec<VolumeCaster>,
    /// Box around everything that shadows may fall on, in any view; [`Aabb::EMPTY`] leaves it open.
    pub receivers: Aabb,
}

/// The light of a job, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeLight {
    /// w = 1: position of a point or spot light, metres. w = 0: unit vector towards a directional light.
    pub toward_light: Vec4,
    /// Reach of the light, metres; infinite where unlimited. Shadows end a little beyond.
    pub range: f32,
    /// The cone outside of which shadows do not count.
    pub cone: Option<Cone>,
    /// How its volumes are made and counted.
    pub settings: VolumeSettings,
}

/// The cone of a spot light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector along its axis, away from the light.
    pub direction: Vec3,
    /// Half angle, radians.
    pub outer_rad: f32,
}

/// A mesh at a place.
#[derive(Clone, Debug)]
pub struct VolumeCaster {
    /// Topology; its triangles and edges are kept on the GPU as long as the mesh lives.
    pub mesh: Arc<Mesh>,
    /// One position per vertex of the mesh, at rest or deformed, object space: three f32, stride 12. STORAGE.
    pub positions: wgpu::Buffer,
    /// Changes whenever the content of `positions` does; static casters under static lights then cost nothing.
    pub positions_revision: u64,
    /// Where it is. A mirroring matrix is fine.
    pub world_from_object: Mat4,
    /// Box around it, deformation included.
    pub bounds: TurnedBox,
    /// What of it is seen.
    pub surface: Surface,
}

/// What of a caster's surface is in the depth buffer, wherever a view shows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Surface {
    /// All of it, from both sides.
    BothSides,
    /// All of it, from the side that its triangles are wound for, and no vertex is deformed.
    Front,
    /// Not all: it is half-transparent, has holes, or is deformed and not drawn from behind.
    #[default]
    InParts,
}

/// How depth runs in the pass that volumes are drawn in. The far plane is at infinity; clip coordinates x, y and w are those
/// of [`umbriel_scene::Frustum::clip_from_view`] in all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Depth {
    /// 1 at the near plane, 0 at infinity, where nothing is clipped.
    #[default]
    Reversed,
    /// 0 at the near plane, 1 - epsilon at infinity (002): [`umbriel_scene::Frustum::clip_from_view_conventional`].
    Conventional,
    /// The same without epsilon: the device clamps what rounding takes beyond 1. Needs `DEPTH_CLIP_CONTROL`. What is in
    /// front of the near plane is then not clipped but clamped to it, so all casters must be counted by z-fail
    /// ([`umbriel_scene::VolumeCounting::ZFail`]).
    Clamped,
}

/// What a frame's [`VolumePass::prepare`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VolumeStats {
    /// Lists made anew.
    pub extracted: usize,
    /// Lists kept from the frame before.
    pub kept: usize,
    /// Casters left out: no triangles, a position buffer that is too small, or lists too large for the device.
    pub left_out: usize,
    /// Casters whose shadow falls on nothing that receives.
    pub without_receiver: usize,
    /// Lists of meshes with so many loose pieces, or such a deep surface, that they may put more than 127 layers over a point
    /// however they are cut. Where it is an exact multiple of 128, the point is lit.
    pub may_wrap: usize,
}

/// What was drawn of a job in one view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VolumeDraws {
    /// Casters counted in front of what is seen.
    pub z_pass: u32,
    /// Casters counted behind it.
    pub z_fail: u32,
    /// Casters left out because nothing of their shadow can be seen.
    pub culled: u32,
    /// Casters drawn with their near caps.
    pub near_caps: u32,
    /// Casters drawn with their far caps.
    pub far_caps: u32,
}

/// Makes and draws the volumes of all jobs of a frame.
pub struct VolumePass {
    extract: extract::Extract,
    drawing: draw::Drawing,
    meshes: cache::MeshCache,
    jobs: Vec<Prepared>,
}

/// A job of the frame.
#[derive(Default)]
struct Prepared {
    light: Option<VolumeLight>,
    /// Bounds, surface and reach of each caster that is drawn.
    casters: Vec<(TurnedBox, Surface, Reach)>,
    lists: Vec<Lists>,
}

impl VolumePass {
    /// `view_layout` is the layout of bind group 0, the View uniform of `shaders/view.wgsl`, visible to vertex shaders.
    /// The pass that is drawn in has a depth and stencil attachment of `depth_stencil_format` with `sample_count`
    /// samples, and one colour attachment of `colour_format` (none for `None`).
    pub fn new(
        device: &wgpu::Device,
        depth: Depth,
        depth_stencil_format: wgpu::TextureFormat,
        sample_count: u32,
        colour_format: Option<wgpu::TextureFormat>,
        view_layout: &wgpu::BindGroupLayout,
    ) -> VolumePass {
        let layouts = draw::Layouts::new(device);
        let target = draw::Target { depth, depth_stencil_format, sample_count, colour_format };
        VolumePass {
            extract: extract::Extract::new(device, &layouts),
            drawing: draw::Drawing::new(device, target, view_layout, &layouts),
            meshes: cache::MeshCache::default(),
            jobs: Vec::new(),
        }
    }

    /// The passes that are drawn in from now on have a colour attachment of this format, or none.
    pub fn set_colour_format(&mut self, colour_format: Option<wgpu::TextureFormat>) {
        self.drawing.set_colour(colour_format);
    }

    /// Makes the lists of every job, in the encoder of the passes that draw them and before these; jobs are then drawn by
    /// their place in `jobs`.
    pub fn prepare(&mut self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, jobs: &[VolumeJob]) -> VolumeStats {
        let mut stats = VolumeStats::default();
        let (mut stale, mut too_large) = (Vec::new(), Vec::new());
        let mut old_jobs = std::mem::take(&mut self.jobs).into_iter();
        for (j, job) in jobs.iter().enumerate() {
            let mut old = OldLists::new(old_jobs.next().unwrap_or_default().lists);
            let mut prepared = Prepared { light: Some(job.light), ..Prepared::default() };
            for caster in &job.casters {
                let Some(reach) = reach::reach(&job.light, &caster.bounds, &job.receivers) else {
                    stats.without_receiver += 1;
                    continue;
                };
                let pieces = self.meshes.parts(device, &caster.mesh);
                if pieces.is_empty() || caster.positions.size() < 12 * caster.mesh.positions.len() as u64 {
                    stats.left_out += 1;
                    continue;
                }
                for part in pieces {
                    let wanted = Wanted {
                        light: &job.light,
                        part,
                        caster: prepared.casters.len(),
                        positions: &caster.positions,
                        positions_revision: caster.positions_revision,
                        world_from_object: caster.world_from_object,
                        bounds_in_world: &caster.bounds.in_world,
                        reach_w: reach.w(),
                    };
                    stats.may_wrap += usize::from(part.layers > parts::GROUP_LAYERS);
                    let Some((made, is_stale)) = self.extract.lists(device, &wanted, old.take(part)) else {
                        stats.left_out += 1;
                        let name = &caster.mesh.name;
                        too_large.push(format!("mesh '{name}' casts no shadow volume: the device cannot hold its sides"));
                        continue;
                    };
                    match is_stale {
                        Stale::Lists => stats.extracted += 1,
                        Stale::No | Stale::Uniform => stats.kept += 1,
                    }
                    self.drawing.make(device, &made);
                    if is_stale != Stale::No {
                        stale.push((j, prepared.lists.len(), is_stale));
                    }
                    prepared.lists.push(made);
                }
                prepared.casters.push((caster.bounds, caster.surface, reach));
            }
            self.jobs.push(prepared);
        }
        let stale: Vec<_> = stale.into_iter().map(|(job, place, stale)| (&self.jobs[job].lists[place], stale)).collect();
        self.extract.run(device, encoder, &stale);
        self.meshes.forget_dead();
        self.meshes.problems.append(&mut too_large);
        stats
    }

    /// What of a mesh casts, part by part.
    pub(crate) fn parts(&mut self, device: &wgpu::Device, mesh: &Arc<Mesh>) -> &[Arc<GpuPart>] {
        self.meshes.parts(device, mesh)
    }

    /// What was wrong with casters since the last call.
    pub fn problems(&mut self) -> Vec<String> {
        std::mem::take(&mut self.meshes.problems)
    }

    /// Counts the volumes of a job into the stencil, which must be 0 in the viewport; afterwards it is 0 where the light
    /// shines. Depth is read, stencil written, colour untouched; the stencil reference is changed. Depth was cleared to
    /// infinity. `view` is the View uniform of the view that `sight` tells of; viewport and scissor rectangle are the view's,
    /// and the latter is so again afterwards.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, job: usize, view: &wgpu::BindGroup, sight: &Sight) -> VolumeDraws {
        let mut draws = VolumeDraws::default();
        let Some((job, light)) = self.jobs.get(job).and_then(|j| Some((j, j.light.as_ref()?))) else { return draws };
        let watch = Watch::new(sight, light);
        let choices = job.casters.iter().map(|(bounds, surface, reach)| watch.choose(bounds, *surface, reach));
        let choices: Vec<_> = choices.collect();
        for choice in &choices {
            match choice {
                None => draws.culled += 1,
                Some(choice) => {
                    *(if choice.z_fail { &mut draws.z_fail } else { &mut draws.z_pass }) += 1;
                    draws.near_caps += u32::from(choice.near_caps);
                    draws.far_caps += u32::from(choice.far_caps);
                }
            }
        }
        let shown: Vec<_> = job.lists.iter().filter_map(|lists| Some((lists, choices[lists.caster]?))).collect();
        if !shown.is_empty() {
            self.drawing.run(pass, &shown, sight, view);
        }
        draws
    }
}

impl VolumeDraws {
    /// Adds what was drawn in another view.
    pub fn add(&mut self, other: &VolumeDraws) {
        self.z_pass += other.z_pass;
        self.z_fail += other.z_fail;
        self.culled += other.culled;
        self.near_caps += other.near_caps;
        self.far_caps += other.far_caps;
    }
}

impl VolumeLight {
    /// Box of where it shines; without end where that is unknown.
    fn bounds(&self) -> Aabb {
        let everything = Aabb { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
        if self.toward_light.w == 0.0 {
            return everything;
        }
        let extent = |axis: Vec3| match self.cone {
            None => self.range,
            Some(cone) => {
                // The farthest point of the cone along an axis: at its rim, or on the axis itself where that is inside.
                let off_rad = cone.direction.angle_between(axis) - cone.outer_rad;
                if off_rad <= 0.0 {
                    self.range
                } else if off_rad < std::f32::consts::FRAC_PI_2 {
                    self.range * off_rad.cos()
                } else {
                    0.0
                }
            }
        };
        let position = self.toward_light.truncate();
        let margin = 1e-3 + 1e-5 * position.abs().max_element();
        let reach = |sign: f32| Vec3::from_array(Vec3::AXES.map(|axis| extent(sign * axis) + margin));
        Aabb { min: position - reach(-1.0), max: position + reach(1.0) }
    }

    /// Is a box outside of the cone for certain?
    fn misses(&self, bounds: &Aabb) -> bool {
        let Some(cone) = self.cone else { return false };
        let to_centre = bounds.centre() - self.toward_light.truncate();
        let (distance, radius) = (to_centre.length(), 1.001 * bounds.radius());
        distance > radius && to_centre.angle_between(cone.direction) > cone.outer_rad + (radius / distance).asin() + 1e-3
    }
}

/// The lists of a job in the frame before, to be taken up again.
struct OldLists {
    lists: Vec<Option<Lists>>,
    next: usize,
}

impl OldLists {
    fn new(lists: Vec<Lists>) -> OldLists {
        OldLists { lists: lists.into_iter().map(Some).collect(), next: 0 }
    }

    /// The next list of this part; casters mostly keep their order, so it is near.
    fn take(&mut self, part: &Arc<cache::GpuPart>) -> Option<Lists> {
        let (before, after) = (0..self.next, self.next..self.lists.len());
        let place = after.chain(before).find(|i| self.lists[*i].as_ref().is_some_and(|l| Arc::ptr_eq(&l.part, part)))?;
        self.next = place + 1;
        self.lists[place].take()
    }
}
