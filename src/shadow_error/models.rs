//! Scores the shadows of every model of a folder: each on a floor of its own, under a light of each kind.

use super::worst::Worst;
use super::{Failure, Subject, eye_path, world_options};
use crate::cli::ShadowError;
use crate::headless::{describe, progress};
use crate::model;
use glam::Vec3;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use umbriel_displays::WindowSizes;
use umbriel_displays::rig::{Rig, Wanted};
use umbriel_render::{Gpu, Renderer};
use umbriel_scene::{Aabb, Frustum, Light, LightKind, Scene, ShadowMethod, View};
use umbriel_scenegraph::Extractor;
use umbriel_scripts::World;

const SIZE: [u32; 2] = [320, 240];

/// Prints a row for each model and light, and the worst of all; gives the number of problems that were reported.
pub(super) fn run(folder: &Path, args: &ShadowError) -> Result<usize, Failure> {
    let files = models_below(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    if files.is_empty() {
        return Err(format!("{}: there are no models (.gltf, .glb) in it", folder.display()).into());
    }
    let gpu = Gpu::new(None)?;
    let mut renderer = Renderer::new(&gpu)?;
    let method = args.method.map_or(ShadowMethod::Volume, Into::into);
    let size = args.size.unwrap_or(if args.eyes.is_some() { eye_path::SIZE } else { SIZE });
    say!("shadows by {method:?}, {}x{}, {} of each, {}", size[0], size[1], places(args.eyes), describe(&gpu));
    say!("| model | light | triangles | disagreement | iou | inverted |\n|---|---|---|---|---|---|");
    let (mut all, mut rows, mut problems) = (Worst::new(), 0, BTreeSet::new());
    let bar = progress(files.len() as u32, "models");
    for file in &files {
        let name = file.strip_prefix(folder).unwrap_or(file).display();
        match placed(file, size, args) {
            Err(error) => {
                problems.insert(format!("{name}: {error}"));
            }
            Ok((mut subject, bounds)) => {
                for light in lights(&bounds, method, args.map_size) {
                    let label = light.name.clone();
                    subject.scene.lights = vec![light];
                    let found = row(&mut renderer, &mut subject, args.eyes)?;
                    bar.suspend(|| say!("| {name} | {label} | {} | {}", triangles(&subject.scene), cells(&found)));
                    all.add(&found);
                    rows += 1;
                }
                problems.extend(subject.problems.iter().map(|p| format!("{name}: {p}")));
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    for problem in &problems {
        tracing::error!("{problem}");
    }
    say!("models={} rows={rows}\n{all}", files.len());
    Ok(problems.len())
}

fn places(eyes: Option<u32>) -> String {
    eyes.map_or_else(|| "1 view".to_owned(), |places| format!("{places} places"))
}

fn row(renderer: &mut Renderer, subject: &mut Subject, eyes: Option<u32>) -> Result<Worst, Failure> {
    let views = match eyes {
        Some(places) => eye_path::path(&subject.scene, &subject.view, places),
        None => vec![subject.view.clone()],
    };
    Worst::of(renderer, subject, &views, &|| ())
}

fn cells(found: &Worst) -> String {
    let iou = if found.with_shadow > 0 { format!("{:.4}", found.iou.0) } else { "none".into() };
    format!("{:.4}% | {iou} | {} |", 100.0 * found.disagreement.0, found.inverted)
}

fn triangles(scene: &Scene) -> usize {
    scene.drawables.iter().filter(|d| d.visible && d.casts_shadow).map(|d| d.mesh.triangle_count()).sum()
}

/// Models in a folder and in the folders in it, by name.
fn models_below(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(models_below(&path)?);
        } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf") || e.eq_ignore_ascii_case("glb")) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// A model on its floor at a time, without lights, and the box around it.
fn placed(file: &Path, size: [u32; 2], args: &ShadowError) -> Result<(Subject, Aabb), Failure> {
    let time_s = args.time;
    let mut world = World::new();
    let bounds = model::show(world.graph_mut(), file)?;
    if time_s > 0.0 {
        world.step(0.0);
    }
    world.step(time_s);
    let (mut extractor, mut scene) = (Extractor::new(), Scene::default());
    extractor.update(world.graph(), &mut scene);
    let mut problems: Vec<String> = world.problems().iter().map(ToString::to_string).collect();
    problems.extend(extractor.problems().iter().map(ToString::to_string));
    let wanted = Wanted { view: None, size, windows: &WindowSizes::new() };
    let found = Rig::new().pictures(world.graph(), extractor.viewpoints(), &bounds, &wanted)?;
    let view = found.pictures.into_iter().flat_map(|p| p.views).next().ok_or("there is nothing to see it from")?;
    let view = View { size, frustum: widened(view.frustum), ..view };
    Ok((Subject { scene, light: 0, view, options: world_options(args), problems }, bounds))
}

/// The camera takes in the model; the floor beside it, where the shadow lies, is seen too.
fn widened(frustum: Frustum) -> Frustum {
    let Frustum { left, right, bottom, top, near } = frustum;
    let [left, right, bottom, top] = [left, right, bottom, top].map(|edge| 1.6 * edge);
    Frustum { left, right, bottom, top, near }
}

/// A sun, a spot that takes in the whole model, and a lamp so near that its shadow is long. They stand behind the model on the
/// left, and the camera before it on the right.
fn lights(bounds: &Aabb, method: ShadowMethod, map_size: Option<u32>) -> [Light; 3] {
    let (centre, radius) = (bounds.centre(), bounds.radius().max(1e-3));
    let at = |x: f32, y: f32, z: f32| centre + radius * Vec3::new(x, y, z);
    let light = |name: &str, kind, position: Vec3| {
        let mut light = Light { name: name.into(), kind, position, shadows: method, ..Light::default() };
        light.direction = (centre - position).normalize_or(Vec3::NEG_Y);
        light.map.size = map_size.unwrap_or(light.map.size);
        light
    };
    [
        light("directional", LightKind::Directional, at(-1.2, 1.5, -0.5)),
        light("spot", LightKind::Spot { inner_rad: 0.5, outer_rad: 0.6 }, at(-0.9, 2.6, -1.0)),
        light("point", LightKind::Point, at(-1.1, 1.6, 0.1)),
    ]
}
