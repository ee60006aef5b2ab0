//! Recording of passes.

use crate::cache::{GpuMaterial, GpuMesh, Slab};
use crate::clock::Clock;
use crate::deform::Deformer;
use crate::draws::{Batch, Draw, Kind};
use crate::maps::Maps;
use crate::plan::{Step, Then, ViewPlan};
use crate::screen::Screen;
use crate::slots::Slots;
use crate::soft::{SoftPass, SoftTarget};
use crate::stats::FrameStats;
use crate::surface::{Pass, Surface};
use crate::targets::{Layer, ViewTarget};
use crate::uniforms;
use crate::volumes::VolumePass;
use umbriel_scene::{Material, Mesh};
use wgpu::{LoadOp, Operations, StoreOp};

/// Binds what draws need and draws.
pub(crate) struct Drawer<'a> {
    pub(crate) meshes: &'a Slab<Mesh, Option<GpuMesh>>,
    pub(crate) materials: &'a Slab<Material, GpuMaterial>,
    pub(crate) deformer: &'a Deformer,
    pub(crate) batches: &'a [Batch],
    pub(crate) visible: &'a wgpu::Buffer,
    pub(crate) instances: Option<&'a wgpu::BindGroup>,
}

impl Drawer<'_> {
    /// Draws a list; `choose` sets the pipeline of a kind.
    pub(crate) fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        draws: &[Draw],
        stats: &mut FrameStats,
        mut choose: impl FnMut(&mut wgpu::RenderPass<'_>, Kind),
    ) {
        if draws.is_empty() {
            return;
        }
        let (mut kind, mut material, mut mesh) = (None, None, None);
        pass.set_bind_group(1, self.instances, &[]);
        pass.set_vertex_buffer(3, self.visible.slice(..));
        for draw in draws {
            let batch = &self.batches[draw.batch as usize];
            let (Some(Some(gpu_mesh)), Some(gpu_material)) = (self.meshes.get(batch.mesh), self.materials.get(batch.material))
            else {
                continue;
            };
            if kind.replace(batch.kind) != Some(batch.kind) {
                choose(pass, batch.kind);
            }
            if material.replace(batch.material) != Some(batch.material) {
                pass.set_bind_group(2, &gpu_material.group, &[]);
            }
            if mesh.replace((batch.mesh, batch.deformed)) != Some((batch.mesh, batch.deformed)) {
                let deformed = batch.deformed.and_then(|d| self.deformer.get(d));
                pass.set_vertex_buffer(0, deformed.map_or(&gpu_mesh.positions, |d| &d.positions).slice(..));
                pass.set_vertex_buffer(1, deformed.map_or(&gpu_mesh.frames, |d| &d.frames).slice(..));
                pass.set_vertex_buffer(2, gpu_mesh.attributes.slice(..));
                pass.set_index_buffer(gpu_mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            }
            pass.draw_indexed(0..gpu_mesh.index_count, 0, draw.first..draw.first + draw.count);
            stats.draws += 1;
            stats.instances += draw.count;
            if batch.kind.topology == 0 {
                stats.triangles += u64::from(gpu_mesh.index_count / 3) * u64::from(draw.count);
            }
        }
    }
}

/// Records the passes of a frame.
pub(crate) struct Recorder<'a> {
    pub(crate) drawer: &'a Drawer<'a>,
    pub(crate) surface: &'a Surface,
    pub(crate) screen: &'a Screen,
    pub(crate) device: &'a wgpu::Device,
    pub(crate) volumes: &'a VolumePass,
    pub(crate) soft: &'a SoftPass,
    pub(crate) views: &'a Slots<uniforms::View>,
    pub(crate) films: &'a Slots<uniforms::Film>,
    pub(crate) lighting: Option<&'a wgpu::BindGroup>,
    pub(crate) clock: &'a Clock,
    pub(crate) stats: &'a mut FrameStats,
}

impl Recorder<'_> {
    /// All shadow maps of the frame.
    pub(crate) fn maps(&mut self, encoder: &mut wgpu::CommandEncoder, maps: &Maps) {
        let (drawer, views) = (self.drawer, self.views);
        self.stats.map_redraws = maps.draw(encoder, self.clock, views, |pass, draws| {
            drawer.draw(pass, draws, self.stats, |pass, kind| maps.set_pipeline(pass, &kind));
            self.stats.map_draws += draws.len() as u32;
        });
    }

    /// One view: surfaces, then light and films by shadow volumes, then what is half-transparent.
    pub(crate) fn view(&mut self, encoder: &mut wgpu::CommandEncoder, view: &ViewPlan, to: &ViewTarget) {
        // The stencil starts empty, so the first volumes may be counted in the pass that filled depth.
        let joins = |number: usize| number == 0 && view.steps[0].soft.is_none();
        let is_last = view.steps.is_empty() || joins(0) && view.steps.len() == 1;
        let mut pass = begin_view(encoder, self.clock, "surfaces", to, Part { is_first: true, is_last, keeps_stencil: false });
        pass.set_bind_group(0, self.views.group(view.base_slot), &[]);
        self.surfaces(&mut pass, &view.opaque, view.base_pass());
        if !view.is_visibility {
            pass.set_pipeline(&self.screen.background);
            pass.set_bind_group(3, self.lighting, &[]);
            pass.draw(0..3, 0..1);
        }
        for (number, step) in view.steps.iter().enumerate() {
            let is_last = number + 1 == view.steps.len();
            if joins(number) {
                self.count(&mut pass, view, (step.job, &step.exempt));
                self.use_counts(&mut pass, view, &step.then);
                continue;
            }
            drop(pass);
            if let (Some(layers), Some(soft)) = (&step.soft, &to.soft) {
                pass = self.soft_step(encoder, view, (step, layers), (to, soft), is_last);
                continue;
            }
            pass = self.counted(
                encoder,
                view,
                (step.job, &step.exempt),
                to,
                Part { is_first: false, is_last, keeps_stencil: false },
            );
            self.use_counts(&mut pass, view, &step.then);
        }
        pass.set_bind_group(0, self.views.group(view.blend_slot), &[]);
        self.surfaces(&mut pass, &view.blended, Pass::Blend);
    }

    /// A pass whose stencil holds the counts of a job's volumes.
    fn counted<'e>(
        &mut self,
        encoder: &'e mut wgpu::CommandEncoder,
        view: &ViewPlan,
        (job, exempt): (usize, &[Draw]),
        to: &ViewTarget,
        part: Part,
    ) -> wgpu::RenderPass<'e> {
        let mut pass = begin_view(encoder, self.clock, "shadow volumes", to, part);
        self.count(&mut pass, view, (job, exempt));
        pass
    }

    /// Counts the volumes of a job, and forgets them where shapes receive no shadow.
    fn count(&mut self, pass: &mut wgpu::RenderPass<'_>, view: &ViewPlan, (job, exempt): (usize, &[Draw])) {
        let drawn = self.volumes.draw(pass, job, self.views.group(view.base_slot), &view.sight);
        self.stats.volumes.add(&drawn);
        pass.set_stencil_reference(0);
        pass.set_bind_group(0, self.views.group(view.base_slot), &[]);
        self.surfaces(pass, exempt, Pass::Exempt);
    }

    /// Adds light outside of what was counted, or lays a film inside.
    fn use_counts(&mut self, pass: &mut wgpu::RenderPass<'_>, view: &ViewPlan, then: &Then) {
        match *then {
            Then::Light { slot } => {
                pass.set_bind_group(0, self.views.group(slot), &[]);
                self.surfaces(pass, &view.opaque, view.add_pass(false));
                self.surfaces(pass, &view.shading_shadow, Pass::AddInShadow);
            }
            Then::Film { slot } => {
                pass.set_pipeline(&self.screen.film);
                pass.set_bind_group(1, self.films.group(slot), &[]);
                pass.draw(0..3, 0..1);
            }
        }
    }

    /// Light or film by the shadow texture that is made of the stencil, layer by layer. The pass that is left open is the
    /// view's.
    fn soft_step<'e>(
        &mut self,
        encoder: &'e mut wgpu::CommandEncoder,
        view: &ViewPlan,
        (step, layers): (&Step, &[usize]),
        (to, soft): (&ViewTarget, &SoftTarget),
        is_last: bool,
    ) -> wgpu::RenderPass<'e> {
        for (number, &job) in layers.iter().enumerate() {
            drop(self.counted(
                encoder,
                view,
                (job, &step.exempt),
                to,
                Part { is_first: false, is_last: false, keeps_stencil: true },
            ));
            self.soft.draw(self.device, encoder, self.clock, (job, self.views.group(view.base_slot)), (soft, number == 0));
        }
        let slot = if let Then::Light { slot } = step.then { slot } else { view.base_slot };
        let soft_view = self.soft.passes.view_group(self.device, self.views.binding(slot), soft);
        if let Then::Film { slot } = step.then {
            let groups = (&soft_view, self.films.group(slot));
            self.soft.passes.film(self.device, encoder, self.clock, groups, (soft, &to.samples));
        }
        let mut pass = begin_view(encoder, self.clock, "soft light", to, Part { is_first: false, is_last, keeps_stencil: false });
        if let Then::Light { .. } = step.then {
            pass.set_bind_group(0, &soft_view, &[]);
            self.surfaces(&mut pass, &view.opaque, view.add_pass(true));
        }
        pass
    }

    fn surfaces(&mut self, pass: &mut wgpu::RenderPass<'_>, draws: &[Draw], kind_of_pass: Pass) {
        pass.set_bind_group(3, self.lighting, &[]);
        self.drawer.draw(pass, draws, self.stats, |pass, kind| {
            if let Some(pipeline) = self.surface.get(kind_of_pass, kind) {
                pass.set_pipeline(pipeline);
            }
        });
    }

    /// Brings a view to its place in its picture.
    pub(crate) fn compose(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        view: &ViewPlan,
        from: &ViewTarget,
        to: &Layer,
        is_first: bool,
    ) {
        let (target, pipelines) =
            if view.is_visibility { (&to.plain, &self.screen.plain) } else { (&to.encoding, &self.screen.exposed) };
        let mut pass = begin_colour(encoder, self.clock.render("compose"), target, is_first);
        let r = view.rect;
        pass.set_viewport(r.x as f32, r.y as f32, r.width as f32, r.height as f32, 0.0, 1.0);
        pass.set_pipeline(&pipelines[view.channels]);
        pass.set_bind_group(0, self.views.group(view.base_slot), &[]);
        pass.set_bind_group(1, &from.group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// A pass into one texture, black at first.
pub(crate) fn begin_colour<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
    view: &wgpu::TextureView,
    is_first: bool,
) -> wgpu::RenderPass<'e> {
    let load = if is_first { LoadOp::Clear(wgpu::Color::BLACK) } else { LoadOp::Load };
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("compose"),
        timestamp_writes,
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: Operations { load, store: StoreOp::Store },
        })],
        ..Default::default()
    })
}

/// Place of a pass among those of a view.
struct Part {
    is_first: bool,
    is_last: bool,
    /// A later pass reads what is counted here.
    keeps_stencil: bool,
}

/// A pass into a view. The first fills depth, later ones read it and start with an empty stencil; the last resolves.
fn begin_view<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    clock: &Clock,
    label: &'static str,
    to: &ViewTarget,
    part: Part,
) -> wgpu::RenderPass<'e> {
    let kept = |is_kept| if is_kept { StoreOp::Store } else { StoreOp::Discard };
    let store = kept(!part.is_last);
    let load = if part.is_first { LoadOp::Clear(wgpu::Color::BLACK) } else { LoadOp::Load };
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some(label),
        timestamp_writes: clock.render(label),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &to.samples,
            depth_slice: None,
            resolve_target: part.is_last.then_some(&to.resolved),
            ops: Operations { load, store },
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &to.depth,
            depth_ops: part.is_first.then_some(Operations { load: LoadOp::Clear(0.0), store }),
            stencil_ops: Some(Operations { load: LoadOp::Clear(0), store: kept(part.keeps_stencil) }),
        }),
        ..Default::default()
    })
}
