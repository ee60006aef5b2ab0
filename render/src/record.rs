//! Recording of passes.

use crate::cache::{GpuMaterial, GpuMesh, Slab};
use crate::clock::Clock;
use crate::contours::Contours;
use crate::cutouts::Cutouts;
use crate::deform::Deformer;
use crate::draws::{Batch, Draw, Kind};
use crate::handover::Handover;
use crate::maps::Maps;
use crate::plan::{BLACK_FILM, Step, Then, ViewPlan};
use crate::screen::Screen;
use crate::slots::Slots;
use crate::soft::{SoftPass, SoftTarget};
use crate::stats::FrameStats;
use crate::surface::{Pass, Surface};
use crate::targets::{Canvas, Layer, Linear, ViewTarget};
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

/// What a pipeline reads of meshes and materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reads {
    /// Places of vertices alone.
    Positions,
    All,
}

impl Drawer<'_> {
    /// Draws a list; `choose` sets the pipeline of a kind.
    pub(crate) fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        draws: &[Draw],
        stats: &mut FrameStats,
        mut choose: impl FnMut(&mut wgpu::RenderPass<'_>, Kind) -> Reads,
    ) {
        if draws.is_empty() {
            return;
        }
        let (mut kind, mut material, mut mesh) = (None, None, None);
        let mut reads = Reads::All;
        pass.set_bind_group(1, self.instances, &[]);
        pass.set_vertex_buffer(3, self.visible.slice(..));
        for draw in draws {
            let batch = &self.batches[draw.batch as usize];
            let (Some(Some(gpu_mesh)), Some(gpu_material)) = (self.meshes.get(batch.mesh), self.materials.get(batch.material))
            else {
                continue;
            };
            if kind.replace(batch.kind) != Some(batch.kind) {
                let before = std::mem::replace(&mut reads, choose(pass, batch.kind));
                if before != reads {
                    (material, mesh) = (None, None);
                }
            }
            if reads == Reads::All && material.replace(batch.material) != Some(batch.material) {
                pass.set_bind_group(2, &gpu_material.group, &[]);
            }
            if mesh.replace((batch.mesh, batch.deformed)) != Some((batch.mesh, batch.deformed)) {
                let deformed = batch.deformed.and_then(|d| self.deformer.get(d));
                pass.set_vertex_buffer(0, deformed.map_or(&gpu_mesh.positions, |d| &d.positions).slice(..));
                if reads == Reads::All {
                    pass.set_vertex_buffer(1, deformed.map_or(&gpu_mesh.frames, |d| &d.frames).slice(..));
                    pass.set_vertex_buffer(2, gpu_mesh.attributes.slice(..));
                }
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
    pub(crate) cutouts: &'a Cutouts,
    pub(crate) soft: &'a SoftPass,
    pub(crate) contours: &'a Contours,
    pub(crate) views: &'a Slots<uniforms::View>,
    pub(crate) films: &'a Slots<uniforms::Film>,
    pub(crate) lighting: Option<&'a wgpu::BindGroup>,
    pub(crate) clock: &'a Clock,
    pub(crate) handover: &'a Handover,
    /// The picture that views are drawn in, where that is not linear light.
    pub(crate) picture: Option<&'a wgpu::TextureView>,
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

    /// All views of a sheet, each of them surfaces, then light and films by shadow volumes, then what is half-transparent.
    pub(crate) fn sheet(&mut self, encoder: &mut wgpu::CommandEncoder, views: &[ViewPlan], to: &ViewTarget) {
        let is_soft = |view: &ViewPlan| view.steps.iter().any(|step| step.soft.is_some());
        if let [view] = views
            && is_soft(view)
        {
            return self.soft_view(encoder, view, to);
        }
        let reads_depth = self.seen_depth(views, to).is_some();
        let part = |is_first, is_last| Part { is_first, is_last, keeps_stencil: false };
        let mut pass = self.begin_part(encoder, "views", to, part(true, !reads_depth));
        if reads_depth {
            for view in views {
                enter(&mut pass, view);
                self.depth_and_base(&mut pass, view);
            }
            drop(pass);
            copy_depth(encoder, to);
            pass = self.begin_part(encoder, "shadow volumes", to, part(false, true));
        }
        for (place, view) in views.iter().enumerate() {
            enter(&mut pass, view);
            if !reads_depth {
                self.depth_and_base(&mut pass, view);
            }
            for (number, step) in view.steps.iter().enumerate() {
                if number > 0 {
                    pass.set_stencil_reference(0);
                    fill_stencil(&mut pass, self.screen, self.films.group(BLACK_FILM));
                }
                self.hard_step(&mut pass, (view, to), step, number == 0);
            }
            self.blend(&mut pass, view);
            self.handover.after_view(&mut pass, place);
        }
    }

    /// Where depth is copied to, if a step of these views reads it.
    fn seen_depth<'t>(&self, views: &[ViewPlan], to: &'t ViewTarget) -> Option<&'t wgpu::TextureView> {
        let has_cutouts = views.iter().flat_map(|view| &view.steps).any(|step| self.cutouts.any(step.job));
        to.seen_depth.as_ref().filter(|_| has_cutouts)
    }

    /// One view with soft shadows, which read in a pass what one before it counted.
    fn soft_view(&mut self, encoder: &mut wgpu::CommandEncoder, view: &ViewPlan, to: &ViewTarget) {
        let part = |is_last| Part { is_first: false, is_last, keeps_stencil: false };
        let mut pass = self.begin_part(encoder, "surfaces", to, Part { is_first: true, ..part(false) });
        self.depth_and_base(&mut pass, view);
        let reads_depth = self.seen_depth(std::slice::from_ref(view), to).is_some();
        if reads_depth {
            drop(pass);
            copy_depth(encoder, to);
            pass = self.begin_part(encoder, "shadow volumes", to, part(false));
        }
        for (number, step) in view.steps.iter().enumerate() {
            let is_last = number + 1 == view.steps.len();
            if let (Some(layers), Some(soft)) = (&step.soft, &to.soft) {
                drop(pass);
                pass = self.soft_step(encoder, view, (step, layers), (to, soft), part(is_last));
                continue;
            }
            // The stencil starts empty, so the first volumes may be counted in the pass that is open.
            if number > 0 {
                drop(pass);
                pass = self.begin_part(encoder, "shadow volumes", to, part(is_last));
            }
            self.hard_step(&mut pass, (view, to), step, number == 0);
        }
        self.blend(&mut pass, view);
    }

    /// Depth, and whatever is seen where no volume is needed for it.
    fn depth_and_base(&mut self, pass: &mut wgpu::RenderPass<'_>, view: &ViewPlan) {
        pass.set_bind_group(0, self.views.group(view.base_slot), &[]);
        self.surfaces(pass, &view.opaque, view.first_pass);
        if !view.is_visibility {
            let canvas = if self.picture.is_some() { Canvas::Picture } else { Canvas::Linear };
            if let Some(background) = self.screen.background(canvas) {
                pass.set_pipeline(background);
                pass.set_bind_group(1, self.lighting, &[]);
                pass.draw(0..3, 0..1);
            }
        }
    }

    /// Counts volumes into the empty stencil and uses the counts.
    fn hard_step(&mut self, pass: &mut wgpu::RenderPass<'_>, (view, to): (&ViewPlan, &ViewTarget), step: &Step, is_first: bool) {
        let is_counted = self.count(pass, (view, to), (step.job, &step.exempt));
        let shades = is_first && view.lit_slot.is_some();
        if shades {
            self.shade_once(pass, view, is_counted);
        }
        self.use_counts(pass, view, &step.then, shades);
    }

    /// Lines over edges, and what is half-transparent.
    fn blend(&mut self, pass: &mut wgpu::RenderPass<'_>, view: &ViewPlan) {
        let base = self.views.group(view.base_slot);
        let contours = self.contours;
        let screen = self.screen;
        let film = self.films.group(BLACK_FILM);
        let empty = |pass: &mut wgpu::RenderPass<'_>| fill_stencil(pass, screen, film);
        contours.draw(pass, base, &view.contoured, empty, |pass, draw| {
            pass.set_bind_group(0, base, &[]);
            self.surfaces(pass, &[*draw], Pass::Mark);
        });
        pass.set_bind_group(0, self.views.group(view.blend_slot), &[]);
        self.surfaces(pass, &view.blended, Pass::Blend);
    }

    /// Counts the volumes of a job, and forgets them where shapes receive no shadow. False where there is none to count.
    fn count(
        &mut self,
        pass: &mut wgpu::RenderPass<'_>,
        (view, to): (&ViewPlan, &ViewTarget),
        (job, exempt): (usize, &[Draw]),
    ) -> bool {
        let drawn = self.volumes.draw(pass, job, self.views.group(view.base_slot), &view.sight);
        let mut is_counted = drawn.z_pass + drawn.z_fail > 0;
        self.stats.volumes.add(&drawn);
        pass.set_stencil_reference(0);
        if let Some(depth) = to.seen_depth.as_ref().filter(|_| self.cutouts.any(job)) {
            let group = self.cutouts.view_group(self.device, self.views.binding(view.base_slot), depth);
            let drawn = self.cutouts.draw(pass, job, &group, &view.sight);
            is_counted |= drawn > 0;
            self.stats.cutouts += drawn;
        }
        pass.set_bind_group(0, self.views.group(view.base_slot), &[]);
        self.surfaces(pass, exempt, Pass::Exempt);
        is_counted
    }

    /// Shades what depth holds: with the counted light outside of its shadow, without it inside, unless that is done.
    fn shade_once(&mut self, pass: &mut wgpu::RenderPass<'_>, view: &ViewPlan, is_counted: bool) {
        let Some(lit_slot) = view.lit_slot else { return };
        pass.set_bind_group(0, self.views.group(lit_slot), &[]);
        self.surfaces(pass, &view.opaque, Pass::BaseLit);
        if is_counted && view.first_pass == Pass::Depth {
            pass.set_bind_group(0, self.views.group(view.base_slot), &[]);
            self.surfaces(pass, &view.opaque, Pass::BaseInShadow);
        }
    }

    /// Adds light outside of what was counted, unless it `is_added` already, or lays a film inside.
    fn use_counts(&mut self, pass: &mut wgpu::RenderPass<'_>, view: &ViewPlan, then: &Then, is_added: bool) {
        match *then {
            Then::Light { slot } => {
                pass.set_bind_group(0, self.views.group(slot), &[]);
                if !is_added {
                    self.surfaces(pass, &view.opaque, view.add_pass(false));
                }
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
        last: Part,
    ) -> wgpu::RenderPass<'e> {
        for (number, &job) in layers.iter().enumerate() {
            let part = Part { is_last: false, keeps_stencil: true, ..last };
            let mut pass = self.begin_part(encoder, "shadow volumes", to, part);
            self.count(&mut pass, (view, to), (job, &step.exempt));
            drop(pass);
            self.soft.draw(self.device, encoder, self.clock, (job, self.views.group(view.base_slot)), (soft, number == 0));
        }
        let slot = if let Then::Light { slot } = step.then { slot } else { view.base_slot };
        let soft_view = self.soft.passes.view_group(self.device, self.views.binding(slot), soft);
        if let Then::Film { slot } = step.then {
            let groups = (&soft_view, self.films.group(slot));
            if let Some(linear) = &to.linear {
                self.soft.passes.film(self.device, encoder, self.clock, groups, (soft, linear.colour()));
            }
        }
        let mut pass = self.begin_part(encoder, "soft light", to, last);
        if let Then::Light { .. } = step.then {
            pass.set_bind_group(0, &soft_view, &[]);
            self.surfaces(&mut pass, &view.opaque, view.add_pass(true));
        }
        pass
    }

    /// A pass into a sheet. The first fills depth, later ones read it and start with an empty stencil; the last resolves.
    fn begin_part<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        label: &'static str,
        to: &ViewTarget,
        part: Part,
    ) -> wgpu::RenderPass<'e> {
        let kept = |is_kept| if is_kept { StoreOp::Store } else { StoreOp::Discard };
        let store = kept(!part.is_last);
        let (colour, mean) = match (self.picture, &to.linear) {
            (Some(picture), _) => (Some(picture), None),
            (None, linear) => (linear.as_ref().map(Linear::colour), linear.as_ref().and_then(Linear::resolve_target)),
        };
        let resolve_target = mean.filter(|_| part.is_last);
        let is_resolved = resolve_target.is_some();
        let load = if part.is_first { LoadOp::Clear(wgpu::Color::BLACK) } else { LoadOp::Load };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(label),
            timestamp_writes: self.clock.render(label),
            color_attachments: &[colour.map(|view| wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: Operations { load, store: kept(!is_resolved) },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &to.depth,
                depth_ops: part.is_first.then_some(Operations { load: LoadOp::Clear(0.0), store }),
                stencil_ops: Some(Operations { load: LoadOp::Clear(0), store: kept(part.keeps_stencil) }),
            }),
            ..Default::default()
        })
    }

    fn surfaces(&mut self, pass: &mut wgpu::RenderPass<'_>, draws: &[Draw], kind_of_pass: Pass) {
        pass.set_bind_group(3, self.lighting, &[]);
        self.drawer.draw(pass, draws, self.stats, |pass, kind| {
            if let Some(pipeline) = self.surface.get(kind_of_pass, kind) {
                pass.set_pipeline(pipeline);
            }
            Reads::All
        });
    }

    /// Brings views to their places in their picture.
    pub(crate) fn compose(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        views: &[ViewPlan],
        from: &ViewTarget,
        to: &Layer,
        is_first: bool,
    ) {
        let Some(linear) = &from.linear else { return };
        let is_visibility = views[0].is_visibility;
        let (target, pipelines) =
            if is_visibility { (&to.plain, &self.screen.plain) } else { (&to.encoding, &self.screen.exposed) };
        let mut pass = begin_colour(encoder, self.clock.render("compose"), target, is_first);
        pass.set_bind_group(1, &linear.group, &[]);
        self.stats.composed += views.len() as u32;
        for view in views {
            let r = view.rect;
            pass.set_viewport(r.x as f32, r.y as f32, r.width as f32, r.height as f32, 0.0, 1.0);
            pass.set_scissor_rect(r.x, r.y, r.width, r.height);
            pass.set_pipeline(&pipelines[view.channels]);
            pass.set_bind_group(0, self.views.group(view.base_slot), &[]);
            pass.draw(0..3, 0..1);
        }
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

/// The view's part of the stencil becomes the reference. `any_film` is bound and not read.
fn fill_stencil(pass: &mut wgpu::RenderPass<'_>, screen: &Screen, any_film: &wgpu::BindGroup) {
    pass.set_pipeline(&screen.fill_stencil);
    pass.set_bind_group(1, any_film, &[]);
    pass.draw(0..3, 0..1);
}

/// What follows is drawn where the view lies in its sheet.
fn enter(pass: &mut wgpu::RenderPass<'_>, view: &ViewPlan) {
    let ([left, top], [width, height]) = (view.origin, view.size);
    pass.set_viewport(left as f32, top as f32, width as f32, height as f32, 0.0, 1.0);
    pass.set_scissor_rect(left, top, width, height);
}

/// Copies depth to where later passes read it while they test against it.
fn copy_depth(encoder: &mut wgpu::CommandEncoder, to: &ViewTarget) {
    if let Some(copy) = &to.seen_depth {
        let (from, copy) = (to.depth.texture(), copy.texture());
        encoder.copy_texture_to_texture(from.as_image_copy(), copy.as_image_copy(), from.size());
    }
}

/// Place of a pass among those of a sheet.
#[derive(Clone, Copy)]
struct Part {
    is_first: bool,
    is_last: bool,
    /// A later pass reads what is counted here.
    keeps_stencil: bool,
}
