//! What shadow volumes cost: harbour in seven channels, and the silhouette of a mesh of a million edges.
//!
//! `cargo bench --bench volumes`, with the pixels of a channel behind `--`, such as `-- 1920x1080`, and names of rows to draw those
//! alone. Rows are drawn in turns, so that all meet the same load of the machine; the ratio is the median of the frames' ratios, each
//! to the first row's frame of its turn. With a software driver, time is what all threads of the process spent on processors, where
//! the system tells: that is the frame, whatever else runs beside it. On a card it is the time until the frame is done.

mod harbour;

use glam::{Mat4, Vec3};
use std::sync::Arc;
use std::time::Instant;
use umbriel_displays::WindowSizes;
use umbriel_displays::rig::{Rig, Wanted};
use umbriel_render::{FrameStats, Gpu, Renderer};
use umbriel_scene::{
    Aabb, Drawable, Frustum, Light, Material, Mesh, Picture, Scene, ShadowMethod, Silhouettes, View, VolumeCounting,
    VolumeSettings,
};
use umbriel_scenegraph::Extractor;

const TURNS: usize = 15;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;
type Row = (&'static str, Scene);

fn main() -> Outcome<()> {
    let gpu = Gpu::new(None)?;
    println!("{}", gpu.info.name);
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let size = args.iter().find_map(|a| harbour::size_in(a)).unwrap_or([320, 256]);
    let (scene, pictures) = channels(size)?;
    let plain = VolumeSettings {
        counting: VolumeCounting::ZFail,
        culling: false,
        fitted: false,
        depth_bounds: false,
        ..VolumeSettings::default()
    };
    let rows: Vec<Row> = vec![
        ("z-fail, nothing left out", with(&scene, ShadowMethod::Volume, plain)),
        ("z-fail, culled", with(&scene, ShadowMethod::Volume, VolumeSettings { culling: true, ..plain })),
        ("z-fail, fitted", with(&scene, ShadowMethod::Volume, VolumeSettings { fitted: true, ..plain })),
        (
            "z-pass where safe, nothing left out",
            with(&scene, ShadowMethod::Volume, VolumeSettings { counting: VolumeCounting::Auto, ..plain }),
        ),
        ("automatic", with(&scene, ShadowMethod::Volume, VolumeSettings::default())),
        (
            "automatic, degenerate quads",
            with(&scene, ShadowMethod::Volume, VolumeSettings { silhouettes: Silhouettes::Quads, ..VolumeSettings::default() }),
        ),
        (
            "automatic, without depth bounds",
            with(&scene, ShadowMethod::Volume, VolumeSettings { depth_bounds: false, ..VolumeSettings::default() }),
        ),
        ("map of 2048", with(&scene, ShadowMethod::Map, plain)),
        ("no shadows", with(&scene, ShadowMethod::None, plain)),
    ];
    let only: Vec<&String> = args.iter().filter(|a| harbour::size_in(a).is_none()).collect();
    let rows: Vec<Row> = rows.into_iter().filter(|(name, _)| only.is_empty() || only.iter().any(|o| *o == name)).collect();
    table(&gpu, &format!("harbour, seven channels of {}x{}", size[0], size[1]), rows, &pictures)?;

    if !only.is_empty() {
        return Ok(());
    }
    let still = ball_over_floor(Mat4::IDENTITY);
    let picture = [Picture::mono(View {
        name: "ball".into(),
        view_from_world: glam::camera::rh::view::look_at_mat4(Vec3::new(0.0, 3.0, 8.0), Vec3::Y, Vec3::Y),
        frustum: Frustum::symmetric(0.8, 1.25, 0.1),
        size: [320, 256],
    })];
    println!("\n{} edges", still.drawables[0].mesh.indices.len() / 2);
    for (name, silhouettes) in [("compute", Silhouettes::Compute), ("degenerate quads", Silhouettes::Quads)] {
        for moves in [false, true] {
            let mut renderer = Renderer::new(&gpu)?;
            let mut fastest = f64::INFINITY;
            for i in 0..6 {
                let turned = Mat4::from_rotation_y(if moves { 0.1 * i as f32 } else { 0.0 });
                let settings = VolumeSettings { silhouettes, ..VolumeSettings::default() };
                let mut scene = with(&still, ShadowMethod::Volume, settings);
                scene.drawables[0].world_from_object = still.drawables[0].world_from_object * turned;
                let (seconds, _) = timed(&gpu, &mut renderer, &scene, &picture)?;
                fastest = if i > 0 { fastest.min(seconds) } else { fastest };
            }
            println!("{name}, {}: {:.1} ms", if moves { "moving" } else { "still" }, 1e3 * fastest);
        }
    }
    Ok(())
}

/// Draws all rows in turns and prints them.
fn table(gpu: &Gpu, title: &str, rows: Vec<Row>, pictures: &[Picture]) -> Outcome<()> {
    let mut renderers = rows.iter().map(|_| Renderer::new(gpu)).collect::<Result<Vec<_>, _>>()?;
    let mut times = vec![Vec::new(); rows.len()];
    let mut stats = vec![FrameStats::default(); rows.len()];
    for turn in 0..TURNS + 2 {
        for (i, (_, scene)) in rows.iter().enumerate() {
            let (seconds, frame) = timed(gpu, &mut renderers[i], scene, pictures)?;
            stats[i] = frame;
            if turn >= 2 {
                times[i].push(seconds);
            }
        }
    }
    println!(
        "\n| {title} | ms, fastest | ratio | z-pass | z-fail | left out | near caps | far caps |\n|---|---|---|---|---|---|---|---|"
    );
    for (i, (name, _)) in rows.iter().enumerate() {
        let mut ratios: Vec<f64> = times[0].iter().zip(&times[i]).map(|(first, own)| first / own).collect();
        ratios.sort_by(f64::total_cmp);
        let fastest = times[i].iter().copied().fold(f64::INFINITY, f64::min);
        let v = &stats[i].volumes;
        println!(
            "| {name} | {:.1} | {:.2} | {} | {} | {} | {} | {} |",
            1e3 * fastest,
            ratios[TURNS / 2],
            v.z_pass,
            v.z_fail,
            v.culled,
            v.near_caps,
            v.far_caps
        );
        for problem in renderers[i].problems() {
            println!("{name}: {problem}");
        }
    }
    Ok(())
}

/// Seconds of a frame until the GPU is done with it.
fn timed(gpu: &Gpu, renderer: &mut Renderer, scene: &Scene, pictures: &[Picture]) -> Outcome<(f64, FrameStats)> {
    let is_software = gpu.info.device_type == wgpu::DeviceType::Cpu;
    let processor_seconds = || if is_software { processor_seconds() } else { None };
    let (start, busy) = (Instant::now(), processor_seconds());
    let stats = renderer.render(scene, pictures)?;
    gpu.device.poll(wgpu::PollType::wait_indefinitely())?;
    let wall = start.elapsed().as_secs_f64();
    Ok((processor_seconds().zip(busy).map_or(wall, |(now, then)| now - then), stats))
}

/// What the threads of this process spent on processors, where the system tells.
fn processor_seconds() -> Option<f64> {
    let mut nanoseconds = 0u64;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let stat = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        nanoseconds += stat.split_whitespace().next()?.parse::<u64>().ok()?;
    }
    Some(nanoseconds as f64 * 1e-9)
}

fn with(scene: &Scene, method: ShadowMethod, settings: VolumeSettings) -> Scene {
    let mut scene = scene.clone();
    for light in &mut scene.lights {
        (light.shadows, light.volume) = (method, settings);
    }
    scene
}

/// The harbour as the command shows it, with so many pixels in a channel.
fn channels(size: [u32; 2]) -> Outcome<(Scene, Vec<Picture>)> {
    let world = harbour::open(size)?;
    let (mut extractor, mut scene, mut rig) = (Extractor::new(), Scene::default(), Rig::new());
    extractor.update(world.graph(), &mut scene);
    let wanted = Wanted { view: None, size: [320, 256], windows: &WindowSizes::new() };
    let pictures = rig.pictures(world.graph(), extractor.viewpoints(), &Aabb::EMPTY, &wanted)?.pictures;
    Ok((scene, pictures))
}

/// A closed ball of a million edges over a floor.
fn ball_over_floor(world_from_ball: Mat4) -> Scene {
    let (around, rings) = (816u32, 409u32);
    let mut positions = vec![Vec3::Y, Vec3::NEG_Y];
    for ring in 1..rings {
        let polar = std::f32::consts::PI * ring as f32 / rings as f32;
        positions.extend((0..around).map(|i| {
            let a = std::f32::consts::TAU * i as f32 / around as f32;
            Vec3::new(polar.sin() * a.cos(), polar.cos(), -polar.sin() * a.sin())
        }));
    }
    let at = |ring: u32, i: u32| 2 + (ring - 1) * around + i % around;
    let mut indices = vec![];
    for i in 0..around {
        indices.extend([0, at(1, i), at(1, i + 1), 1, at(rings - 1, i + 1), at(rings - 1, i)]);
        for ring in 1..rings - 1 {
            let [a, b, c, d] = [at(ring, i), at(ring + 1, i), at(ring + 1, i + 1), at(ring, i + 1)];
            indices.extend([a, b, c, a, c, d]);
        }
    }
    let ball = Mesh { positions: positions.into(), indices: indices.into(), ..Mesh::default() };
    let corner = |x: f32, z: f32| Vec3::new(5.0 * x, -1.5, 5.0 * z);
    let floor = Mesh {
        positions: vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)].into(),
        indices: vec![0, 1, 2, 0, 2, 3].into(),
        ..Mesh::default()
    };
    let drawable = |mesh: Mesh, world_from_object: Mat4| {
        let mesh = Arc::new(mesh.checked().expect("a whole mesh"));
        Drawable {
            name: String::new(),
            bounds_in_world: mesh.bounds.transformed(&world_from_object),
            mesh,
            material: Arc::new(Material::default()),
            world_from_object,
            pose: None,
            visible: true,
            casts_shadow: true,
            receives_shadow: true,
            receives: None,
            revision: 0,
        }
    };
    let light = Light { direction: Vec3::new(-0.4, -1.0, -0.3).normalize(), ..Light::default() };
    Scene {
        drawables: vec![drawable(ball, world_from_ball), drawable(floor, Mat4::IDENTITY)].into(),
        lights: vec![light],
        ..Scene::default()
    }
}
