//! Scores the shadows of one light against ray-traced ones (S13).

mod eye_path;
mod models;
mod worst;

use crate::cli::{Method, ShadowError};
use crate::headless::{describe, progress};
use crate::png;
use crate::scene_file::{self, SceneFile};
use crate::session::Session;
use glam::Vec3;
use std::path::Path;
use std::sync::Arc;
use umbriel_displays::WindowSizes;
use umbriel_render::{Gpu, Renderer, RgbaPixels};
use umbriel_scene::{
    Mask, Picture, PictureKind, Scene, ShadowMethod, Shares, TraceOptions, Tracer, View, difference, origin_near_eyes, score,
    specks,
};
use umbriel_scenegraph::Extractor;
use worst::Worst;

type Failure = Box<dyn std::error::Error>;

const SIZE: [u32; 2] = [800, 600];
/// Where shadow rays start, from their surface, as a share of the scene's size.
const CLOSE: f64 = 1e-7;
/// The same of how far a place is from origin and eye: what touches there is apart by less, as vertices are rounded.
const CLOSE_AT_PLACE: f64 = 2.0 * f32::EPSILON as f64;

/// What is scored.
struct Subject {
    scene: Scene,
    light: usize,
    view: View,
    options: TraceOptions,
    problems: Vec<String>,
}

impl Subject {
    /// Moves a world far from the origin to where the tracer's numbers are as fine as the renderer's.
    fn come_home(&mut self) {
        let picture = Picture::mono(self.view.clone());
        let origin = origin_near_eyes(Vec3::ZERO, std::slice::from_ref(&picture));
        if origin != Vec3::ZERO {
            self.scene = self.scene.around(origin);
            self.view = picture.around(origin).views.remove(0);
        }
    }
}

/// Renders, traces, and prints the score; gives the number of problems that were reported.
pub(crate) fn run(args: &ShadowError) -> Result<usize, Failure> {
    if let Some(folder) = &args.models {
        return models::run(folder, args);
    }
    let mut subject = match (&args.scene, &args.path) {
        (Some(file), _) => from_scene_file(&scene_file::read(file)?, file, args)?,
        (None, Some(path)) => from_world(path, args)?,
        (None, None) => unreachable!("the command line asks for one of them"),
    };
    subject.come_home();
    let light = &mut subject.scene.lights[subject.light];
    if let Some(method) = args.method {
        light.shadows = method.into();
    }
    light.map.size = args.map_size.unwrap_or(light.map.size);
    let shown = format!("light '{}' by {:?}", light.name, light.shadows);
    if light.shadows == ShadowMethod::None && !args.trace_only {
        return Err(format!("{shown}: it casts no shadows; choose a --method").into());
    }

    if let Some(places) = args.eyes {
        // The eye comes as close as the near plane, where what rays start off their surfaces would be pixels.
        subject.options = start_close(subject.options.clone());
        if args.size.is_none() {
            subject.view.size = eye_path::SIZE;
        }
        say!("{shown}, {places} places, {}x{}", subject.view.size[0], subject.view.size[1]);
        let gpu = Gpu::new(None)?;
        let bar = progress(places, "places");
        let views = eye_path::path(&subject.scene, &subject.view, places);
        let found = Worst::of(&mut Renderer::new(&gpu)?, &mut subject, &views, &|| bar.inc(1))?;
        bar.finish_and_clear();
        for problem in &subject.problems {
            tracing::error!("{problem}");
        }
        say!("{found}");
        if args.diff.is_none() {
            return Ok(subject.problems.len());
        }
        subject.view = views[found.disagreement.1 as usize].clone();
    }
    let truth = match &args.truth {
        Some(path) => read_mask(path, subject.view.size)?,
        None => trace(&subject)?,
    };
    let (visibility, by) =
        if args.trace_only { (trace(&subject)?.visibility(), "CPU tracer".to_string()) } else { render(&mut subject)? };
    for problem in &subject.problems {
        tracing::error!("{problem}");
    }
    let score = score(&truth, &visibility)?;
    if let Some(reduced) = reduced_casters(&subject.scene) {
        say!("{reduced}");
    }
    if let Some(path) = &args.diff {
        let [width, height] = subject.view.size;
        png::write(path, &RgbaPixels { width, height, rgba: difference(&truth, &visibility)? }, &by)?;
    }
    say!("{shown}, view '{}' {}x{}, {by}", subject.view.name, subject.view.size[0], subject.view.size[1]);
    let away = specks(&truth, &visibility)?;
    say!("away from edges: {:.4}% of what is lit is dark, {:.4}% of what is dark is lit", 100.0 * away.dark, 100.0 * away.lit);
    say!("disagreement={:.4}% iou={:.4} pixels={}", 100.0 * score.disagreement, score.iou, score.pixels);
    let light = &subject.scene.lights[subject.light];
    if args.penumbra || (light.soft && light.shadows == ShadowMethod::Volume) {
        let score = trace_shares(&subject)?.score(&visibility)?;
        say!(
            "light of size {}: mean error in the penumbra={:.4} overall={:.5} penumbra pixels={} pixels={}",
            light.size,
            score.penumbra,
            score.overall,
            score.penumbra_pixels,
            score.pixels
        );
    }
    Ok(subject.problems.len())
}

impl From<Method> for ShadowMethod {
    fn from(method: Method) -> ShadowMethod {
        match method {
            Method::Map => ShadowMethod::Map,
            Method::Volume => ShadowMethod::Volume,
        }
    }
}

fn from_world(path: &Path, args: &ShadowError) -> Result<Subject, Failure> {
    let mut session = Session::open(path)?.wait_for_casters();
    if args.time > 0.0 {
        session.step(0.0);
    }
    session.step(args.time);
    let size = args.size.unwrap_or(SIZE);
    let mut pictures = session.pictures(args.view.as_deref(), size, &WindowSizes::new())?;
    if let (Some(size), Some(name)) = (args.size, pictures.first().map(|p| p.name.clone())) {
        pictures = session.pictures(args.view.as_deref(), size, &WindowSizes::from([(name, size)]))?;
    }
    let view = pictures.into_iter().flat_map(|p| p.views).next().ok_or("there is nothing to see the world from")?;
    let lights = &session.scene().lights;
    let light = match &args.light {
        Some(name) => session.light_named(name).ok_or_else(|| session.no_light(name))?,
        None => {
            let casting = lights.iter().position(|l| l.shines && l.shadows != ShadowMethod::None);
            casting.or(lights.iter().position(|l| l.shines)).ok_or("the world has no light that is on")?
        }
    };
    let options = world_options(args);
    let problems = session.problems();
    let mut scene = std::mem::take(session.scene_mut());
    // The tracer knows no lists of lights.
    for drawable in &mut scene.drawables {
        let lists_it = |list: usize| scene.receive_lists.get(list).is_some_and(|lights| lights.contains(&light));
        drawable.receives_shadow &= drawable.receives.is_none_or(lists_it);
    }
    Ok(Subject { scene, light, view, options, problems })
}

fn world_options(args: &ShadowError) -> TraceOptions {
    let (sub_samples, fine_sub_samples) = (args.sub_samples, args.fine_sub_samples);
    start_close(TraceOptions { sub_samples, fine_sub_samples, ..TraceOptions::default() })
}

/// A world may be a kilometre wide, and its lamps stand centimetres from what casts: rays start close to surfaces.
fn start_close(options: TraceOptions) -> TraceOptions {
    TraceOptions { eps_scale: options.eps_scale.min(CLOSE), eps_at_place: CLOSE_AT_PLACE, ..options }
}

/// The models of a scene file, with its light alone.
fn from_scene_file(file: &SceneFile, path: &Path, args: &ShadowError) -> Result<Subject, Failure> {
    let mut scene = Scene::default();
    let mut problems = Vec::new();
    for model in &file.models {
        let mut graph = umbriel_scenegraph::new_graph();
        let options = umbriel_scenegraph::gltf::LoadOptions::default();
        let loaded = umbriel_scenegraph::gltf::load(&mut graph, &model.file, &options)?;
        let world = graph.find(umbriel_scenegraph::WORLD).ok_or("the graph has no world")?;
        let children: Arc<[_]> = [Some(loaded.root)].into();
        graph.set_named(world, "children", children)?;
        let (mut extractor, mut part) = (Extractor::new(), Scene::default());
        extractor.update(&graph, &mut part);
        problems.extend(extractor.problems().iter().map(ToString::to_string));
        for mut drawable in part.drawables {
            drawable.world_from_object = model.world_from_model * drawable.world_from_object;
            drawable.bounds_in_world = drawable.bounds_in_world.transformed(&model.world_from_model);
            drawable.casts_shadow &= model.caster;
            drawable.receives_shadow &= model.receiver;
            let casts = file.options.blend_casts || drawable.material.alpha != umbriel_scene::AlphaMode::Blend;
            drawable.casts_shadow &= casts;
            if model.double_sided {
                Arc::make_mut(&mut drawable.material).double_sided = true;
            }
            scene.drawables.push(drawable);
        }
    }
    let mut light = file.light.clone();
    light.shadows = ShadowMethod::Volume;
    light.name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    scene.lights = vec![light];
    let mut view = file.view.clone();
    view.size = args.size.unwrap_or(view.size);
    Ok(Subject { scene, light: 0, view, options: file.options.clone(), problems })
}

fn read_mask(path: &Path, size: [u32; 2]) -> Result<Mask, Failure> {
    let grey = image::open(path).map_err(|e| format!("{}: {e}", path.display()))?.into_luma8();
    if grey.dimensions() != (size[0], size[1]) {
        let (width, height) = grey.dimensions();
        return Err(format!("{}: {width}x{height} pixels, but the view has {}x{}", path.display(), size[0], size[1]).into());
    }
    Ok(Mask::from_grey(size[0], size[1], grey.as_raw()).map_err(|e| format!("{}: {e}", path.display()))?)
}

fn trace(subject: &Subject) -> Result<Mask, Failure> {
    let bar = progress(subject.view.size[1], "rows traced");
    // The truth knows no reduced casters.
    let tracer = Tracer::new(&subject.scene.with_full_casters());
    let light = &subject.scene.lights[subject.light];
    let mask = tracer.visibility(light, &subject.view, &subject.options, &|rows| bar.set_position(rows.into()));
    bar.finish_and_clear();
    Ok(mask?)
}

/// Rays to the disc of the light, where it is partly hidden.
const DISC_RAYS: usize = 256;

fn trace_shares(subject: &Subject) -> Result<Shares, Failure> {
    let bar = progress(subject.view.size[1], "rows of penumbra traced");
    let tracer = Tracer::new(&subject.scene.with_full_casters());
    let light = &subject.scene.lights[subject.light];
    let options = TraceOptions { sub_samples: subject.options.sub_samples.min(2), ..subject.options.clone() };
    let shares = tracer.shares(light, &subject.view, &options, DISC_RAYS, &|rows| bar.set_position(rows.into()));
    bar.finish_and_clear();
    Ok(shares?)
}

/// What reduced casters save and how wrong they are, where there are any.
fn reduced_casters(scene: &Scene) -> Option<String> {
    let triangles = |place: usize| scene.drawables.get(place).map_or(0, |d| d.mesh.triangle_count());
    let sum = |place: fn(&umbriel_scene::StandIn) -> usize| scene.stand_ins.iter().map(|s| triangles(place(s))).sum::<usize>();
    let (few, all) = (sum(|s| s.place), sum(|s| s.of));
    let measured = scene.stand_ins.iter().map(|s| s.error_m).filter(|e| e.is_finite()).fold(f32::NEG_INFINITY, f32::max);
    let bound = if measured.is_finite() { format!(", at most {measured:.5} m from the shown") } else { String::new() };
    let count = scene.stand_ins.len();
    (count > 0).then(|| format!("reduced casters: {count}, {few} of {all} triangles{bound}; scored against the full ones"))
}

/// One byte per pixel, and the device that drew it.
fn render(subject: &mut Subject) -> Result<(Vec<u8>, String), Failure> {
    let gpu = Gpu::new(None)?;
    let mut renderer = Renderer::new(&gpu)?;
    let picture = Picture { kind: PictureKind::LightVisibility(subject.light), ..Picture::mono(subject.view.clone()) };
    renderer.render(&subject.scene, &[picture])?;
    subject.problems.extend(renderer.problems());
    let pixels = renderer.read_back(0)?.pop().ok_or("the renderer gave no picture")?;
    Ok((pixels.rgba.chunks_exact(4).map(|p| p[0]).collect(), describe(&gpu)))
}
