//! Exact shadows of what alpha cuts holes into: leaves, fences, nets.
//!
//! The one idea: the volume that a triangle throws says where its shadow may fall, and each sample of the picture in it asks
//! the texture, where its own ray to the light passes the triangle, whether something is there (Hasselgren and Akenine-Moller
//! 2007, Textured Shadow Volumes). What is hidden is marked in the stencil that the volumes of whole triangles were counted
//! into. Nothing is cut, cached or counted, so that pictures, cutoffs and poses may change in every frame, thousands of holes
//! cost as much as none, and the shadow's outline is the one that the surface itself shows from nearby.
//!
//! Rays need the place of what is seen, so that depth is copied before the volumes are drawn.
//!
//! This module knows nothing of how the stencil is used afterwards, nor of lights but where they are and how far they reach.

mod pipeline;

use crate::slots::Slots;
use crate::volumes::{Extent, Sight, TurnedBox, VolumeLight};
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec4};
use pipeline::{CORNERS, Pipeline};
use std::collections::HashMap;
use umbriel_scene::{Aabb, Samples};

/// `Cutout` of cutouts.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Uniform {
    pub(crate) world_from_object: Mat4,
    pub(crate) toward_light: Vec4,
    pub(crate) reach_w: f32,
    pub(crate) spare: [u32; 3],
}

/// A shape with holes at its place.
pub(crate) struct Cutout {
    /// As they are drawn, at rest or deformed.
    pub(crate) positions: wgpu::Buffer,
    pub(crate) indices: wgpu::Buffer,
    pub(crate) attributes: wgpu::Buffer,
    pub(crate) triangle_count: u32,
    /// Its material's group 2.
    pub(crate) material: wgpu::BindGroup,
    pub(crate) world_from_object: Mat4,
    pub(crate) bounds: TurnedBox,
}

/// What cuts holes into the shadow of one light or group.
pub(crate) struct CutoutJob {
    pub(crate) light: VolumeLight,
    pub(crate) receivers: Aabb,
    pub(crate) cutouts: Vec<Cutout>,
}

/// A cut-out whose shadow falls on something.
struct Prepared {
    extent: Extent,
    /// Number of its uniform.
    slot: usize,
    mesh: wgpu::BindGroup,
    material: wgpu::BindGroup,
    triangle_count: u32,
}

/// Draws the cut-outs of all jobs of a frame.
pub(crate) struct Cutouts {
    pipeline: Pipeline,
    uniforms: Slots<Uniform>,
    /// Groups of meshes by their positions, and whether the last frame used them.
    meshes: HashMap<wgpu::Buffer, (wgpu::BindGroup, bool)>,
    jobs: Vec<(VolumeLight, Vec<Prepared>)>,
}

impl Cutouts {
    pub(crate) fn new(device: &wgpu::Device, material: &wgpu::BindGroupLayout, samples: Samples) -> Cutouts {
        Cutouts {
            pipeline: Pipeline::new(device, material, samples),
            uniforms: Slots::new(device, "cut-outs"),
            meshes: HashMap::new(),
            jobs: Vec::new(),
        }
    }

    /// Takes the jobs of a frame; they are then drawn by their place in `jobs`.
    pub(crate) fn prepare(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, jobs: &[CutoutJob]) {
        self.uniforms.clear();
        self.meshes.retain(|_, (_, is_used)| std::mem::take(is_used));
        self.jobs.clear();
        for CutoutJob { light, receivers, cutouts } in jobs {
            let mut prepared = Vec::new();
            for cutout in cutouts {
                let Some(extent) = Extent::new(light, &cutout.bounds, receivers) else { continue };
                let slot = self.uniforms.push(&Uniform {
                    world_from_object: cutout.world_from_object,
                    toward_light: light.toward_light,
                    reach_w: extent.w(),
                    spare: [0; 3],
                });
                let make = || (self.pipeline.mesh(device, [&cutout.positions, &cutout.indices, &cutout.attributes]), true);
                let (mesh, is_used) = self.meshes.entry(cutout.positions.clone()).or_insert_with(make);
                *is_used = true;
                prepared.push(Prepared {
                    extent,
                    slot,
                    mesh: mesh.clone(),
                    material: cutout.material.clone(),
                    triangle_count: cutout.triangle_count,
                });
            }
            self.jobs.push((*light, prepared));
        }
        self.uniforms.upload(device, queue, self.pipeline.caster_layout());
    }

    /// Is there anything to draw for a job?
    pub(crate) fn any(&self, job: usize) -> bool {
        self.jobs.get(job).is_some_and(|(_, cutouts)| !cutouts.is_empty())
    }

    /// Group 0 of [`Cutouts::draw`]: a view, and the copy of what its pass has in depth.
    pub(crate) fn view_group(
        &self,
        device: &wgpu::Device,
        view: wgpu::BufferBinding<'_>,
        depth: &wgpu::TextureView,
    ) -> wgpu::BindGroup {
        self.pipeline.view(device, view, depth)
    }

    /// Marks in the stencil what a job's cut-outs hide of what is not marked yet; gives how many were drawn. The stencil reference
    /// is 0, `view` is of [`Cutouts::view_group`], viewport and scissor rectangle are the view's, and the latter is so again afterwards.
    pub(crate) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, job: usize, view: &wgpu::BindGroup, sight: &Sight) -> u32 {
        let Some((light, cutouts)) = self.jobs.get(job).filter(|(_, cutouts)| !cutouts.is_empty()) else { return 0 };
        let pixels = sight.pixels_of(light, cutouts.iter().map(|c| &c.extent));
        let mut drawn = 0;
        for (cutout, pixels) in cutouts.iter().zip(pixels) {
            let Some([left, top, width, height]) = pixels else { continue };
            if drawn == 0 {
                self.pipeline.set(pass);
                pass.set_bind_group(0, view, &[]);
            }
            drawn += 1;
            pass.set_scissor_rect(left, top, width, height);
            pass.set_bind_group(1, self.uniforms.group(cutout.slot), &[]);
            pass.set_bind_group(2, &cutout.material, &[]);
            pass.set_bind_group(3, &cutout.mesh, &[]);
            for (indices, first) in pipeline::runs(cutout.triangle_count) {
                pass.draw_indexed(indices, (first * CORNERS) as i32, 0..1);
            }
        }
        if drawn > 0 {
            let [left, top, width, height] = sight.in_target();
            pass.set_scissor_rect(left, top, width, height);
        }
        drawn
    }
}
