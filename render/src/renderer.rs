//! The frame: what is prepared, sent and recorded, from top to bottom.

use crate::cache::{GpuMaterial, GpuMesh, MaterialCache, Slab, make_mesh};
use crate::clock::Clock;
use crate::contours::Contours;
use crate::cutouts::Cutouts;
use crate::deform::Deformer;
use crate::draws::{Alpha, Caches, Draw, Draws, Kind};
use crate::handover::Handover;
use crate::jobs::Jobs;
use crate::layouts::Layouts;
use crate::lighting::Lighting;
use crate::lights::{self, Lights, draws_map};
use crate::maps::Maps;
use crate::plan::{self, ViewPlan};
use crate::projection::{self, ProjectionLists};
use crate::read_back::{self, GreyPixels, RgbaPixels};
use crate::record::{Drawer, Recorder};
use crate::screen::Screen;
use crate::sheets::Sheets;
use crate::slots::Slots;
use crate::soft::{self, SoftJob, SoftPass};
use crate::start::joined;
use crate::stats::{FrameStats, Problems};
use crate::surface::{FrameNeeds, Pass, Surface};
use crate::targets::{Canvas, SheetNeeds, Target, ViewTargets};
use crate::volumes::{Depth, VolumePass};
use crate::{Error, Gpu, buffer::GrowBuffer, gpu, jobs, surroundings, uniforms};
use glam::Vec3;
use std::time::Instant;
use umbriel_scene::{Aabb, Drawables, Material, Mesh, Picture, Samples, Scene, origin_near_eyes};

/// Frames from one look for what is not used any more to the next.
const FRAMES_BETWEEN_SWEEPS: u64 = 16;

/// Draws frames.
pub struct Renderer {
    gpu: Gpu,
    layouts: Layouts,
    surface: Surface,
    screen: Screen,
    maps: Maps,
    volumes: VolumePass,
    cutouts: Cutouts,
    soft: SoftPass,
    contours: Contours,
    deformer: Deformer,
    meshes: Slab<Mesh, Option<GpuMesh>>,
    materials: Slab<Material, GpuMaterial>,
    material_cache: MaterialCache,
    draws: Draws,
    surroundings: surroundings::Kept,
    lighting: Lighting,
    views: Slots<uniforms::View>,
    films: Slots<uniforms::Film>,
    visible: GrowBuffer,
    view_targets: ViewTargets,
    targets: Vec<Option<Target>>,
    problems: Problems,
    clock: Clock,
    handover: Handover,
    frame: u64,
    /// The frame before the last, and the last.
    submitted: [Option<wgpu::SubmissionIndex>; 2],
    samples: Samples,
    /// Frames are drawn around this place of the world.
    origin: Vec3,
}

impl Renderer {
    /// Makes what every frame needs.
    pub fn new(gpu: &Gpu) -> Result<Renderer, Error> {
        let device = &gpu.device;
        let layouts = Layouts::new(device);
        let samples = Samples::default();
        let (surface, screen, maps, volumes) = std::thread::scope(|scope| {
            let surface = scope.spawn(|| Surface::new(device, &layouts, samples));
            let screen = scope.spawn(|| Screen::new(device, &layouts, samples));
            let (maps, volumes) = (Maps::new(device, &layouts), volume_pass(device, &layouts, samples));
            (joined(surface), joined(screen), maps, volumes)
        });
        Ok(Renderer {
            surface,
            screen,
            maps,
            volumes,
            cutouts: Cutouts::new(device, &layouts.material, samples),
            soft: SoftPass::new(device, &layouts, samples),
            contours: Contours::new(device, &layouts, samples),
            deformer: Deformer::new(device),
            meshes: Slab::default(),
            materials: Slab::default(),
            material_cache: MaterialCache::new(device, &gpu.queue).map_err(Error::Device)?,
            draws: Draws::default(),
            surroundings: surroundings::Kept::default(),
            lighting: Lighting::new(device),
            views: Slots::new(device, "views"),
            films: Slots::new(device, "films"),
            visible: GrowBuffer::new(device, "visible", wgpu::BufferUsages::VERTEX, 1 << 12),
            view_targets: ViewTargets::default(),
            targets: Vec::new(),
            problems: Problems::default(),
            clock: Clock::new(gpu),
            handover: Handover::new(gpu),
            frame: 0,
            submitted: [None, None],
            samples,
            origin: Vec3::ZERO,
            layouts,
            gpu: gpu.clone(),
        })
    }

    /// Draws all pictures of a frame. What cannot be drawn is left out, with a report in [`Renderer::problems`].
    pub fn render(&mut self, scene: &Scene, pictures: &[Picture]) -> Result<FrameStats, Error> {
        self.render_part(scene, pictures, pictures)
    }

    /// Draws some pictures of a frame, the others of which are drawn elsewhere. Maps are fitted to the views of `all` of them, so that
    /// shadows go on without a seam from one process to the next.
    pub fn render_part(&mut self, scene: &Scene, pictures: &[Picture], all: &[Picture]) -> Result<FrameStats, Error> {
        self.origin = origin_near_eyes(self.origin, all);
        if self.origin == Vec3::ZERO {
            return self.render_here(scene, pictures, all);
        }
        let around = |pictures: &[Picture]| pictures.iter().map(|p| p.around(self.origin)).collect::<Vec<_>>();
        let (pictures, all) = (around(pictures), around(all));
        self.render_here(&scene.around(self.origin), &pictures, &all)
    }

    /// The same where numbers are fine enough as they are.
    fn render_here(&mut self, scene: &Scene, pictures: &[Picture], all: &[Picture]) -> Result<FrameStats, Error> {
        let start = Instant::now();
        let mut stats = FrameStats::default();
        self.frame += 1;
        self.views.clear();
        self.films.clear();
        self.take_samples(scene.samples);
        self.take_drawables(scene);
        let lights = Lights::new(scene);
        let casters = self.choose_maps(scene, all);
        let things =
            jobs::Things { draws: &self.draws, meshes: &self.meshes, materials: &self.materials, deformer: &self.deformer };
        let mut jobs = jobs::jobs(scene, &lights, &things, &mut self.films, &mut self.problems);
        let soft = soft::soft_jobs(scene, &lights, &jobs.purposes, &mut jobs.volumes);
        self.cutouts.prepare(&self.gpu.device, &self.gpu.queue, &jobs.cutouts);
        let seen = (&self.draws, &self.meshes, &self.deformer);
        self.contours.prepare((&self.gpu.device, &self.gpu.queue), scene, seen, &mut self.volumes);
        let contours = self.contours.places();
        let light_uniforms: Vec<uniforms::Light> =
            lights.all().map(|i| lights::uniform_of(&scene.lights[i], self.maps.faces_of(i))).collect();
        let adds_light = |kind: Kind| kind.alpha == Alpha::Blend || self.surface.shades_shadow(kind.shader);
        let limit = self.gpu.device.limits().max_texture_dimension_2d;
        let is_mixed = !contours.is_empty() || self.draws.batches().iter().any(|batch| adds_light(batch.kind));
        let canvas = if is_mixed { Canvas::Linear } else { plan::canvas(scene.samples, all, &jobs, &soft, limit) };
        self.volumes.set_colour_format(Some(canvas.format()));
        self.screen.make_background(&self.gpu.device, canvas);
        let shone = &light_uniforms[..lights.order.len()];
        self.surface.set_frame(FrameNeeds::new(scene, shone, &lights, !self.maps.faces.is_empty(), canvas));
        let frame = plan::Frame {
            scene,
            lights: &lights,
            light_uniforms: &light_uniforms,
            purposes: &jobs.purposes,
            soft: &soft,
            contours: &contours,
            bounds_depth: self.gpu.is_software(),
        };
        let (plans, sheets) = self.plan_views(pictures, &frame, canvas, &mut stats);
        self.maps.prepare(&self.gpu.device, &mut self.views, &mut self.draws);
        let lists = projection::lists(scene, pictures, &lights, &self.maps, casters);
        self.upload(scene, (lights.order.len(), &light_uniforms), &lists);
        let prepared = Instant::now();

        self.record((&plans, &sheets, canvas), (&jobs, &soft), &mut stats);
        self.drop_unused();
        stats.maps = self.maps.faces.len() as u32;
        stats.map_shares.clone_from(&self.maps.shares);
        stats.volume_jobs = jobs.purposes.len() as u32;
        stats.prepare_s = (prepared - start).as_secs_f64();
        stats.encode_s = prepared.elapsed().as_secs_f64();
        Ok(stats)
    }

    /// Makes anew what depends on the number of samples.
    fn take_samples(&mut self, samples: Samples) {
        if self.samples == samples {
            return;
        }
        let device = &self.gpu.device;
        self.samples = samples;
        self.surface.set_samples(samples);
        self.screen = Screen::new(device, &self.layouts, samples);
        self.volumes = volume_pass(device, &self.layouts, samples);
        self.cutouts = Cutouts::new(device, &self.layouts.material, samples);
        self.soft = SoftPass::new(device, &self.layouts, samples);
        self.contours = Contours::new(device, &self.layouts, samples);
        self.view_targets = ViewTargets::default();
    }

    /// Meshes, materials and places of everything that is drawn.
    fn take_drawables(&mut self, scene: &Scene) {
        let (device, queue, frame) = (&self.gpu.device, &self.gpu.queue, self.frame);
        let pages = self.draws.begin(&scene.drawables, &scene.stand_ins);
        for index in pages.into_iter().flat_map(|page| Drawables::places(page, scene.drawables.len())) {
            let d = &scene.drawables[index];
            if self.draws.set_again(index, d) {
                continue;
            }
            if !d.visible {
                self.draws.hide(index);
                continue;
            }
            if !d.world_from_object.is_finite() {
                self.problems.report(format!("shape '{}' has a matrix that is not finite: left out", d.name));
                self.draws.hide(index);
                continue;
            }
            let hint = self.draws.ids(index);
            let problems = &mut self.problems;
            let mesh = self.meshes.get_or_make(&d.mesh, hint.0, frame, || match make_mesh(device, &d.mesh) {
                Ok(mesh) => Some(mesh),
                Err(message) => {
                    problems.report(message);
                    None
                }
            });
            let material = self.materials.get_or_make(&d.material, hint.1, frame, || {
                let shader = self.surface.shaders_of(device, &d.material, frame, |message| problems.report_again(message));
                let report = |message| problems.report(message);
                self.material_cache.make(device, queue, &self.layouts.material, &d.material, shader, report)
            });
            if let Some(made) = self.materials.get(material) {
                self.surface.touch(made.named_shader, frame);
            }
            let deformed = match (&d.pose, self.meshes.get(mesh)) {
                (Some(pose), Some(Some(gpu_mesh))) => {
                    self.deformer.pose(device, index as u32, &d.mesh, gpu_mesh, pose, frame).then_some(index as u32)
                }
                _ => None,
            };
            let caches = Caches { meshes: &self.meshes, materials: &self.materials };
            self.draws.set(index, d, (mesh, material), deformed, &caches);
        }
        self.draws.finish();
    }

    /// Shadow maps, fitted to all views at once. Gives a box around all casters.
    fn choose_maps(&mut self, scene: &Scene, pictures: &[Picture]) -> Aabb {
        let casters = self.draws.casters_box();
        let any_has_holes = self.draws.any_has_holes();
        let lights: Vec<usize> = (0..scene.lights.len()).filter(|light| draws_map(scene, *light, any_has_holes)).collect();
        if lights.is_empty() {
            self.maps.forget();
            return casters;
        }
        let around = self.surroundings.of(pictures, &self.draws);
        let problems = &mut self.problems;
        let revision = |d| self.deformer.get(d).map_or(0, |d| d.revision);
        let snapshots = self.draws.snapshots(&scene.drawables, revision);
        let is_new = self.maps.choose(&self.gpu.device, (scene, &lights), around, &snapshots, |message| problems.report(message));
        if is_new {
            self.lighting.forget_maps();
        }
        casters
    }

    fn plan_views(
        &mut self,
        pictures: &[Picture],
        frame: &plan::Frame<'_>,
        canvas: Canvas,
        stats: &mut FrameStats,
    ) -> (Vec<ViewPlan>, Sheets) {
        let device = &self.gpu.device;
        let limit = device.limits().max_texture_dimension_2d;
        let (mut plans, mut sheets) = (Vec::new(), Sheets::default());
        self.targets.resize_with(pictures.len(), || None);
        for (number, picture) in pictures.iter().enumerate() {
            if !plan::is_drawable(picture, limit, &mut self.problems) {
                self.targets[number] = None;
                continue;
            }
            if !self.targets[number].as_ref().is_some_and(|t| t.fits(picture)) {
                self.targets[number] = Some(Target::new(device, &self.layouts.picture, picture));
            }
            let (draws, views, problems) = (&mut self.draws, (&mut self.views, &mut sheets), &mut self.problems);
            plans.extend(plan::plan_picture(number, picture, frame, draws, views, problems, stats, limit));
        }
        for view in &mut plans {
            if !view.is_visibility && !view.steps.is_empty() {
                let shader = |d: &&Draw| self.draws.batches()[d.batch as usize].kind.shader;
                view.shading_shadow = view.opaque.iter().filter(|d| self.surface.shades_shadow(shader(d))).copied().collect();
            }
            let mut passes: Vec<(Pass, &[Draw])> = vec![(Pass::Blend, &view.blended), (view.first_pass, &view.opaque)];
            if view.lit_slot.is_some() {
                passes.push((Pass::BaseLit, &view.opaque));
            }
            if view.first_pass == Pass::Depth {
                passes.push((Pass::BaseInShadow, &view.opaque));
            }
            if !view.steps.is_empty() {
                passes.push((Pass::AddInShadow, &view.shading_shadow));
                passes.extend(view.steps.iter().map(|step| (Pass::Exempt, &*step.exempt)));
                passes.extend(view.steps.iter().map(|s| (view.add_pass(s.soft.is_some()), &*view.opaque)));
            }
            for (_, draw) in &view.contoured {
                self.surface.want(Pass::Mark, self.draws.batches()[draw.batch as usize].kind);
            }
            for (pass, list) in passes {
                let mut last = None;
                for kind in list.iter().map(|draw| self.draws.batches()[draw.batch as usize].kind) {
                    if last.replace(kind) != Some(kind) {
                        self.surface.want(pass, kind);
                    }
                }
            }
        }
        self.surface.make_wanted(device);
        let mut rest = &plans[..];
        for sheet in &sheets.0 {
            let (views, others) = rest.split_at(sheet.views);
            rest = others;
            let steps = || views.iter().flat_map(|view: &ViewPlan| &view.steps);
            let (is_soft, has_cutouts) = (steps().any(|s| s.soft.is_some()), steps().any(|s| self.cutouts.any(s.job)));
            let needs = SheetNeeds { canvas, is_soft, has_cutouts };
            self.view_targets.make(device, &self.layouts.picture, sheet.size, self.samples, needs, self.frame);
        }
        (plans, sheets)
    }

    /// Sends the frame's lists to the GPU.
    fn upload(&mut self, scene: &Scene, lights: (usize, &[uniforms::Light]), lists: &ProjectionLists) {
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        self.views.upload(device, queue, &self.layouts.view);
        self.films.upload(device, queue, &self.layouts.film);
        let (visible, unsent) = self.draws.visible.send();
        self.visible.write_parts(device, queue, visible, &[unsent]);
        self.lighting.upload(device, queue, &self.layouts, scene, lights, &self.maps, &mut self.draws, lists);
    }

    /// Records and submits: deformation, volumes, maps, views.
    fn record(
        &mut self,
        (plans, sheets, canvas): (&[ViewPlan], &Sheets, Canvas),
        (jobs, soft): (&Jobs, &[Option<SoftJob>]),
        stats: &mut FrameStats,
    ) {
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") });
        stats.deformed = self.deformer.run(&mut encoder, &self.clock);
        stats.volumes_made = self.volumes.prepare(device, &mut encoder, &jobs.volumes);
        self.volumes.problems().into_iter().for_each(|message| self.problems.report(message));
        let report = |message| self.problems.report(message);
        self.soft.prepare((device, queue), &mut encoder, &mut self.volumes, (&jobs.volumes, soft), report);
        let drawer = Drawer {
            meshes: &self.meshes,
            materials: &self.materials,
            deformer: &self.deformer,
            batches: self.draws.batches(),
            visible: &self.visible.buffer,
            instances: self.lighting.instances(),
        };
        let mut recorder = Recorder {
            drawer: &drawer,
            surface: &self.surface,
            screen: &self.screen,
            device,
            volumes: &self.volumes,
            cutouts: &self.cutouts,
            soft: &self.soft,
            contours: &self.contours,
            views: &self.views,
            films: &self.films,
            lighting: self.lighting.group(),
            clock: &self.clock,
            handover: &self.handover,
            picture: None,
            stats,
        };
        recorder.maps(&mut encoder, &self.maps);
        let mut begun = std::collections::HashSet::new();
        let mut rest = plans;
        for sheet in &sheets.0 {
            let (views, others) = rest.split_at(sheet.views);
            rest = others;
            let Some(target) = self.view_targets.get(sheet.size) else { continue };
            if canvas == Canvas::Picture {
                recorder.picture = self.targets[views[0].picture].as_ref().map(|to| &to.layers[0].encoding);
                recorder.sheet(&mut encoder, views, target);
                continue;
            }
            recorder.sheet(&mut encoder, views, target);
            for views in views.chunk_by(|a, b| (a.picture, a.layer) == (b.picture, b.layer)) {
                let place = (views[0].picture, views[0].layer);
                if let Some(Some(to)) = self.targets.get(place.0) {
                    recorder.compose(&mut encoder, views, target, &to.layers[place.1], begun.insert(place));
                }
            }
        }
        self.clock.resolve(&mut encoder);
        let submitted = queue.submit([encoder.finish()]);
        self.submitted = [self.submitted[1].take(), Some(submitted)];
        stats.gpu_s = self.clock.collect(device);
    }

    /// What the frame's batches use stays for a while, even if nothing looks at it because nothing changed.
    fn drop_unused(&mut self) {
        if !self.frame.is_multiple_of(FRAMES_BETWEEN_SWEEPS) {
            return;
        }
        for batch in self.draws.batches() {
            self.meshes.touch(batch.mesh, self.frame);
            self.materials.touch(batch.material, self.frame);
            if let Some(made) = self.materials.get(batch.material) {
                self.surface.touch(made.named_shader, self.frame);
            }
            if let Some(deformed) = batch.deformed {
                self.deformer.touch(deformed, self.frame);
            }
        }
        self.meshes.drop_unused(self.frame);
        self.materials.drop_unused(self.frame);
        self.material_cache.drop_unused();
        self.surface.drop_unused(self.frame);
        self.deformer.drop_unused(self.frame);
        self.view_targets.drop_unused(self.frame);
    }

    /// The finished picture: `Rgba8Unorm` that may be seen as `Rgba8UnormSrgb`; one layer per view for
    /// [`umbriel_scene::Layout::Layers`]. Its bytes are sRGB encoded, but for visibility pictures.
    pub fn target(&self, picture: usize) -> Result<&wgpu::Texture, Error> {
        self.finished(picture).map(|t| &t.texture)
    }

    /// The whole of [`Renderer::target`] seen as sRGB.
    pub fn target_view(&self, picture: usize) -> Result<&wgpu::TextureView, Error> {
        self.finished(picture).map(|t| &t.whole)
    }

    fn finished(&self, index: usize) -> Result<&Target, Error> {
        let count = self.targets.len();
        self.targets.get(index).and_then(|t| t.as_ref()).ok_or(Error::NoPicture { index, count })
    }

    /// Waits until the frame before the last is drawn, so that no more than two are in the making: the device draws one while the
    /// next is recorded.
    pub fn wait_for_room(&self) -> Result<(), Error> {
        let Some(submission_index) = self.submitted[0].clone() else { return Ok(()) };
        let wait = wgpu::PollType::Wait { submission_index: Some(submission_index), timeout: None };
        self.gpu.device.poll(wait).map(drop).map_err(|e| Error::Device(e.to_string()))
    }

    /// Waits until the last frame is drawn.
    pub fn wait(&self) -> Result<(), Error> {
        let done = self.gpu.device.poll(wgpu::PollType::wait_indefinitely());
        done.map(drop).map_err(|e| Error::Device(e.to_string()))
    }

    /// Waits for the last frame and brings a picture back, layer by layer.
    pub fn read_back(&self, picture: usize) -> Result<Vec<RgbaPixels>, Error> {
        let texture = &self.finished(picture)?.texture;
        let size = texture.size();
        (0..size.depth_or_array_layers)
            .map(|layer| {
                let rgba = read_back::layer(&self.gpu.device, &self.gpu.queue, texture, layer)?;
                Ok(RgbaPixels { width: size.width, height: size.height, rgba })
            })
            .collect()
    }

    /// The shadow maps of a light of the last frame's scene as grey pictures: the nearest surface is white, the farthest
    /// dark grey, nothing black. One for a spot light, one per cascade, six for a point light (+x -x +y -y +z -z).
    pub fn shadow_map_picture(&self, light: usize) -> Result<Vec<GreyPixels>, Error> {
        let pictures = self.maps.pictures(&self.gpu.device, &self.gpu.queue, light)?;
        if pictures.is_empty() { Err(Error::NoMap(light)) } else { Ok(pictures) }
    }

    /// Shows the first layer of a picture on the whole of a window's surface of the given format.
    pub fn blit(
        &mut self,
        picture: usize,
        encoder: &mut wgpu::CommandEncoder,
        surface: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) -> Result<(), Error> {
        let pipeline = self.screen.blit(&self.gpu.device, format).clone();
        let layer = &self.finished(picture)?.layers[0];
        // A surface that encodes gets linear values, any other gets the bytes.
        let group = if format.is_srgb() { &layer.group_decoding } else { &layer.group };
        let mut pass = crate::record::begin_colour(encoder, None, surface, true);
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(1, group, &[]);
        pass.draw(0..3, 0..1);
        Ok(())
    }

    /// What was wrong with scene, pictures or device since the last call; each message comes once.
    pub fn problems(&mut self) -> Vec<String> {
        if let Ok(mut reports) = self.gpu.reports.lock() {
            reports.drain(..).for_each(|message| self.problems.report(message));
        }
        self.problems.drain()
    }
}

fn volume_pass(device: &wgpu::Device, layouts: &Layouts, samples: Samples) -> VolumePass {
    let linear = Some(gpu::LINEAR_FORMAT);
    VolumePass::new(device, Depth::Reversed, gpu::DEPTH_FORMAT, samples.count(), linear, &layouts.view)
}
