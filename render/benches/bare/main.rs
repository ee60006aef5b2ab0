//! What the framework costs: the same draws by a bare wgpu program and by the renderer, in one run.
//!
//! `cargo bench -p umbriel-render --bench bare`

mod program;
mod world;

use glam::{Mat4, Vec3};
use program::Program;
use std::time::Instant;
use umbriel_render::{Gpu, Renderer};
use umbriel_scene::{Picture, Scene, View};

/// Timed frames of each program.
const FRAMES: usize = 21;

/// Seconds until the GPU is done with what `frame` submits.
fn timed(gpu: &Gpu, frame: impl FnOnce()) -> f64 {
    let start = Instant::now();
    frame();
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    start.elapsed().as_secs_f64()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn compare(gpu: &Gpu, objects: usize, kinds: usize, size: [u32; 2]) {
    let scene = world::scene(objects, kinds);
    let picture = Picture::mono(world::view(size));
    let mut renderer = Renderer::new(gpu).expect("the renderer works");
    let program = Program::new(gpu, &scene, &picture.views[0]);
    let (mut bare, mut ours, mut cpu) = (Vec::new(), Vec::new(), Vec::new());
    let mut draws = 0;
    // Frame by frame in turns, so that both meet the same load of the machine; the first ones warm up.
    for frame in 0..FRAMES + 3 {
        let b = timed(gpu, || program.frame(gpu));
        let o = timed(gpu, || {
            let stats = renderer.render(&scene, std::slice::from_ref(&picture)).expect("the frame is drawn");
            cpu.push(stats.prepare_s + stats.encode_s);
            draws = stats.draws;
        });
        if frame >= 3 {
            bare.push(b);
            ours.push(o);
        }
    }
    let ratios = bare.iter().zip(&ours).map(|(b, o)| o / b).collect();
    let theirs = program.pixels(gpu);
    let pixels = &renderer.read_back(0).expect("a picture")[0].rgba;
    let differ = theirs.iter().zip(pixels).filter(|(a, b)| a.abs_diff(**b) > 2).count();
    println!(
        "{objects:6} objects of {kinds:3} kinds, {}x{}, {draws:3} draws: bare {:7.2} ms, umbriel {:7.2} ms, ratio {:.3}, \
         CPU of umbriel {:.2} ms, {differ} bytes differ",
        size[0],
        size[1],
        median(bare) * 1e3,
        median(ours) * 1e3,
        median(ratios),
        median(cpu) * 1e3,
    );
    assert!(renderer.problems().is_empty());
}

/// CPU time of the framework where everything moves and seven views look.
fn seven_views(gpu: &Gpu, objects: usize) {
    let mut scene: Scene = world::scene(objects, 20);
    let mut views: Vec<View> = Vec::new();
    for i in 0..7 {
        let mut view = world::view([64, 64]);
        view.view_from_world = Mat4::from_rotation_y((i as f32 - 3.0) * 0.67) * view.view_from_world;
        views.push(view);
    }
    let pictures: Vec<Picture> = views.into_iter().map(Picture::mono).collect();
    let mut renderer = Renderer::new(gpu).expect("the renderer works");
    let (mut prepare, mut encode) = (Vec::new(), Vec::new());
    for frame in 0..40 {
        let step = Mat4::from_translation(Vec3::new((frame as f32 * 0.1).sin() * 0.01, 0.0, 0.0));
        for d in &mut scene.drawables {
            d.world_from_object = step * d.world_from_object;
            d.bounds_in_world = d.mesh.bounds.transformed(&d.world_from_object);
        }
        let stats = renderer.render(&scene, &pictures).expect("the frame is drawn");
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
        prepare.push(stats.prepare_s);
        encode.push(stats.encode_s);
    }
    println!(
        "{objects} moving objects in seven views: CPU {:.2} ms to prepare, {:.2} ms to record",
        median(prepare) * 1e3,
        median(encode) * 1e3
    );
}

fn main() {
    let gpu = Gpu::new(None).expect("a graphics device");
    println!("{} ({:?})", gpu.info.name, gpu.info.device_type);
    compare(&gpu, 300, 20, [512, 384]);
    compare(&gpu, 300, 300, [512, 384]);
    compare(&gpu, 2_000, 100, [512, 384]);
    compare(&gpu, 10_000, 20, [512, 384]);
    seven_views(&gpu, 10_000);
}
