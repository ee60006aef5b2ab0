//! Stencil shadow volumes of any triangle soup, made on the GPU.
//!
//! The one idea: every triangle is turned to face the light and casts its own volume; what neighbours share cancels
//! before anything is drawn, because each edge carries the signed sum of its triangles (Kim, Kim, Turk 2008). Closed
//! meshes leave their silhouette, open borders count once, edges of n faces count what they must. Volumes are counted
//! where they lie behind the visible surface (z-fail, 000 section 3.2) and reach to infinity by w = 0 in world space.
//!
//! After [`VolumePass::draw`] the stencil is not 0 exactly where the job's light is hidden by one of the job's casters.
//! The stencil counts layers of shadow in eight bits. Jobs that may hold more are drawn in groups of at most 127 layers,
//! after each of which the eighth bit remembers what is in shadow: any number of casters, and of pieces of a mesh, is
//! exact. What remains is a single connected surface (or a mesh of very many loose pieces, see
//! [`VolumeStats::may_wrap`]) that by itself puts exactly 128 or 256 layers between a point and the light.
//!
//! Alpha-tested casters throw the shadow of their whole triangles.
//!
//! This module knows nothing of lighting, materials or how the stencil is used afterwards.

mod cache;
mod draw;
mod extract;
mod parts;

use extract::{Lists, Wanted};
use glam::{Mat4, Vec4};
use std::sync::Arc;
use umbriel_scene::{Aabb, Mesh};

/// One light and what stands in it.
#[derive(Clone, Debug)]
pub struct VolumeJob {
    /// The light.
    pub light: VolumeLight,
    /// What casts.
    pub casters: Vec<VolumeCaster>,
}

/// The light of a job, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeLight {
    /// w = 1: position of a point or spot light, metres. w = 0: unit vector towards a directional light.
    pub toward_light: Vec4,
    /// Reach of the light, metres; infinite where unlimited.
    pub range: f32,
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
    /// Box around it in the world, deformation included; [`Aabb::EMPTY`] where unknown (slower, and as exact).
    pub bounds_in_world: Aabb,
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
    /// Lists of meshes with so many loose pieces that these may put more than 255 layers over a point. Where it is an
    /// exact multiple of 128, the point is lit.
    pub may_wrap: usize,
}

/// Makes and draws the volumes of all jobs of a frame.
pub struct VolumePass {
    extract: extract::Extract,
    drawing: draw::Drawing,
    meshes: cache::MeshCache,
    jobs: Vec<Vec<Lists>>,
}

impl VolumePass {
    /// `view_layout` is the layout of bind group 0, the View uniform of `shaders/view.wgsl`, visible to vertex shaders.
    /// The pass that is drawn in has a depth and stencil attachment of `depth_stencil_format` with `sample_count`
    /// samples, and one colour attachment of `colour_format` (none for `None`).
    pub fn new(
        device: &wgpu::Device,
        depth_stencil_format: wgpu::TextureFormat,
        sample_count: u32,
        colour_format: Option<wgpu::TextureFormat>,
        view_layout: &wgpu::BindGroupLayout,
    ) -> VolumePass {
        let placed_layout = draw::placed_layout(device);
        let target = draw::Target { depth_stencil_format, sample_count, colour_format };
        VolumePass {
            extract: extract::Extract::new(device, &placed_layout),
            drawing: draw::Drawing::new(device, target, view_layout, &placed_layout),
            meshes: cache::MeshCache::default(),
            jobs: Vec::new(),
        }
    }

    /// Makes the lists of every job, in the encoder of the passes that draw them and before these; jobs are then drawn by
    /// their place in `jobs`.
    pub fn prepare(&mut self, device: &wgpu::Device, encoder: &mut wgpu::CommandEncoder, jobs: &[VolumeJob]) -> VolumeStats {
        let mut stats = VolumeStats::default();
        let mut stale = Vec::new();
        let mut old_jobs = std::mem::take(&mut self.jobs).into_iter();
        for (j, job) in jobs.iter().enumerate() {
            let mut old = OldLists::new(old_jobs.next().unwrap_or_default());
            let mut lists = Vec::new();
            for caster in &job.casters {
                let pieces = self.meshes.parts(device, &caster.mesh);
                if pieces.is_empty() || caster.positions.size() < 12 * caster.mesh.positions.len() as u64 {
                    stats.left_out += 1;
                    continue;
                }
                for part in pieces {
                    let wanted = Wanted {
                        light: &job.light,
                        part,
                        positions: &caster.positions,
                        positions_revision: caster.positions_revision,
                        world_from_object: caster.world_from_object,
                        bounds_in_world: &caster.bounds_in_world,
                    };
                    stats.may_wrap += usize::from(part.layers > parts::STENCIL_LAYERS);
                    match self.extract.lists(device, &wanted, old.take(part)) {
                        Some((made, anew)) => {
                            if anew {
                                stale.push((j, lists.len()));
                                stats.extracted += 1;
                            } else {
                                stats.kept += 1;
                            }
                            lists.push(made);
                        }
                        None => stats.left_out += 1,
                    }
                }
            }
            self.jobs.push(lists);
        }
        let stale: Vec<&Lists> = stale.into_iter().map(|(job, place)| &self.jobs[job][place]).collect();
        self.extract.run(device, encoder, &stale);
        self.meshes.forget_dead();
        stats
    }

    /// Counts the volumes of a job into the stencil, which must be 0 in the viewport; afterwards it is 0 where the light
    /// shines. Depth is read, stencil written, colour untouched; the stencil reference is changed. Depth is reversed,
    /// with its far plane at infinity, and cleared to 0.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, job: usize, view: &wgpu::BindGroup) {
        if let Some(lists) = self.jobs.get(job) {
            self.drawing.run(pass, lists, view);
        }
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
