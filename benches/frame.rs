//! What a frame of the whole framework costs the CPU: 10 000 objects that move every frame, in seven channels.
//!
//! `cargo bench --bench frame`. Fields are routed from interpolators, the flat scene is brought up to date, the rig is turned into
//! views, and the renderer prepares and records; what the GPU (or the software driver) then takes is not counted.

use glam::{Vec2, Vec3};
use std::sync::Arc;
use std::time::Instant;
use umbriel_displays::WindowSizes;
use umbriel_displays::rig::{Rig, Wanted, cylinder_screens};
use umbriel_fields::{Graph, NoHost, NodeId, Strength};
use umbriel_render::{Gpu, Renderer};
use umbriel_scene::{Aabb, Scene};
use umbriel_scenegraph::{Extractor, WORLD, new_graph};

const OBJECTS: usize = 10_000;
const FRAMES: usize = 20;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let mut graph = new_graph();
    objects(&mut graph)?;
    bridge(&mut graph)?;
    let gpu = Gpu::new(None)?;
    let mut renderer = Renderer::new(&gpu)?;
    let (mut extractor, mut scene, mut rig) = (Extractor::new(), Scene::default(), Rig::new());
    let mut rows: Vec<[f64; 5]> = Vec::new();
    for frame in 0..FRAMES + 3 {
        let start = Instant::now();
        let report = graph.evaluate(frame as f64 / 60.0, &mut NoHost);
        let evaluated = start.elapsed();
        let stats = extractor.update(&graph, &mut scene);
        let extracted = start.elapsed();
        let wanted = Wanted { view: None, size: [320, 256], windows: &WindowSizes::new() };
        let pictures = rig.pictures(&graph, extractor.viewpoints(), &Aabb::EMPTY, &wanted)?.pictures;
        let viewed = start.elapsed();
        let drawn = renderer.render(&scene, &pictures)?;
        renderer.read_back(0)?;
        if frame == 1 {
            println!(
                "{} objects moved, {} values routed, {} views, {} draws, {} instances, {}",
                stats.drawables_changed, report.copied, drawn.views, drawn.draws, drawn.instances, gpu.info.name
            );
        }
        if frame >= 3 {
            let ms = |d: std::time::Duration| 1e3 * d.as_secs_f64();
            rows.push([
                ms(evaluated),
                ms(extracted - evaluated),
                ms(viewed - extracted),
                1e3 * drawn.prepare_s,
                1e3 * drawn.encode_s,
            ]);
        }
    }
    println!("\n| CPU, ms per frame (median of {FRAMES}) | |\n|---|---|");
    let names =
        ["evaluate fields", "bring the scene up to date", "turn the rig into views", "renderer: prepare", "renderer: record"];
    let mut sum = 0.0;
    for (column, name) in names.iter().enumerate() {
        let mut values: Vec<f64> = rows.iter().map(|r| r[column]).collect();
        values.sort_by(f64::total_cmp);
        sum += values[FRAMES / 2];
        println!("| {name} | {:.2} |", values[FRAMES / 2]);
    }
    println!("| **sum** | **{sum:.2}** |");
    Ok(())
}

/// Boxes of ten materials, each moved by an interpolator of its own from one clock.
fn objects(graph: &mut Graph) -> Outcome<()> {
    let clock = make(graph, "TimeSensor")?;
    graph.set_named(clock, "loop", true)?;
    graph.set_named(clock, "cycle_interval", 10.0)?;
    let geometry = make(graph, "Box")?;
    graph.set_named(geometry, "size", Vec3::splat(0.5))?;
    let looks: Vec<NodeId> = (0..10)
        .map(|i| {
            let (appearance, material) = (make(graph, "Appearance")?, make(graph, "PhysicalMaterial")?);
            graph.set_named(material, "roughness", 0.1 * i as f32)?;
            graph.set_named(appearance, "material", Some(material))?;
            Ok(appearance)
        })
        .collect::<Outcome<_>>()?;
    let mut children: Vec<Option<NodeId>> = Vec::new();
    for i in 0..OBJECTS {
        let (shape, place, path) = (make(graph, "Shape")?, make(graph, "Transform")?, make(graph, "PositionInterpolator")?);
        graph.set_named(shape, "geometry", Some(geometry))?;
        graph.set_named(shape, "appearance", Some(looks[i % looks.len()]))?;
        graph.set_named(place, "children", Arc::from([Some(shape)]) as Arc<[Option<NodeId>]>)?;
        let angle = i as f32 * 2.399_963;
        let from = Vec3::new(angle.sin(), 0.0, angle.cos()) * (5.0 + 0.01 * i as f32);
        graph.set_named(path, "key", Arc::from([0.0f32, 0.5, 1.0]) as Arc<[f32]>)?;
        graph.set_named(path, "key_value", Arc::from([from, from + Vec3::Y * 3.0, from]) as Arc<[Vec3]>)?;
        route(graph, clock, "fraction_changed", path, "set_fraction")?;
        route(graph, path, "value_changed", place, "translation")?;
        children.push(Some(place));
    }
    children.push(Some(make(graph, "DirectionalLight")?));
    let world = graph.find(WORLD).ok_or("no world")?;
    Ok(graph.set_named(world, "children", Arc::from(children) as Arc<[Option<NodeId>]>)?)
}

/// Seven channels over 270 degrees (001).
fn bridge(graph: &mut Graph) -> Outcome<()> {
    let user = make(graph, "User")?;
    graph.set_named(user, "position", Vec3::Y)?;
    let mut screens: Vec<Option<NodeId>> = Vec::new();
    for corners in cylinder_screens(7, 270f32.to_radians(), 4.0, 3.2, Vec3::Y) {
        let screen = make(graph, "Screen")?;
        graph.set_named(screen, "lower_left", corners.lower_left)?;
        graph.set_named(screen, "lower_right", corners.lower_right)?;
        graph.set_named(screen, "upper_left", corners.upper_left)?;
        screens.push(Some(screen));
    }
    let display = make(graph, "Display")?;
    graph.set_named(display, "user", Some(user))?;
    graph.set_named(display, "screens", Arc::from(screens) as Arc<[Option<NodeId>]>)?;
    graph.set_named(display, "layout", "row")?;
    Ok(graph.set_named(display, "size", Vec2::new(320.0, 256.0))?)
}

fn make(graph: &mut Graph, type_name: &str) -> Outcome<NodeId> {
    Ok(graph.create(type_name)?)
}

fn route(graph: &mut Graph, from: NodeId, output: &str, to: NodeId, input: &str) -> Outcome<()> {
    let (from, to) = (graph.field(from, output)?, graph.field(to, input)?);
    graph.connect(from, to, Strength::Strong)?;
    Ok(())
}
