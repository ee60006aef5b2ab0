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

/// Median of the seconds that a frame takes, GPU included.
fn median_s(gpu: &Gpu, frames: usize, mut frame: impl FnMut(usize)) -> f64 {
    let mut times: Vec<f64> = (0..frames + 3)
        .map(|i| {
            let start = Instant::now();
            frame(i);
            gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
            start.elapsed().as_secs_f64()
        })
        .skip(3)
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn compare(gpu: &Gpu, objects: usize, kinds: usize, size: [u32; 2]) {
    let scene = world::scene(objects, kinds);
    let picture = Picture::mono(world::view(size));
    let mut renderer = Renderer::new(gpu).expect("the renderer works");
    let program = Program::new(gpu, &scene, &picture.views[0]);
    let frames = 15;
    // In turns, so that both meet the same load of the machine.
    let mut ratios = Vec::new();
    let mut best = [f64::INFINITY; 2];
    for _ in 0..3 {
        let bare = median_s(gpu, frames, |_| program.frame(gpu));
        let ours = median_s(gpu, frames, |_| {
            renderer.render(&scene, std::slice::from_ref(&picture)).expect("the frame is drawn");
        });
        ratios.push(ours / bare);
        best = [best[0].min(bare), best[1].min(ours)];
    }
    ratios.sort_by(f64::total_cmp);
    let stats = renderer.render(&scene, std::slice::from_ref(&picture)).expect("the frame is drawn");
    let same = program.pixels(gpu) == renderer.read_back(0).expect("a picture")[0].rgba;
    println!(
        "{objects:6} objects of {kinds:3} kinds, {}x{}: bare {:7.2} ms, umbriel {:7.2} ms, ratio {:.3} (median of 3); \
         {} draws, {} instances, CPU {:.2} ms, same pixels: {same}",
        size[0],
        size[1],
        best[0] * 1e3,
        best[1] * 1e3,
        ratios[1],
        stats.draws,
        stats.instances,
        (stats.prepare_s + stats.encode_s) * 1e3,
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
    let median = |mut v: Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v[v.len() / 2] * 1e3
    };
    println!(
        "{objects} moving objects in seven views: CPU {:.2} ms to prepare, {:.2} ms to record",
        median(prepare),
        median(encode)
    );
}

fn main() {
    let gpu = Gpu::new(None).expect("a graphics device");
    println!("{} ({:?})", gpu.info.name, gpu.info.device_type);
    compare(&gpu, 300, 20, [640, 480]);
    compare(&gpu, 300, 300, [640, 480]);
    compare(&gpu, 2_000, 100, [640, 480]);
    compare(&gpu, 10_000, 20, [640, 480]);
    seven_views(&gpu, 10_000);
}
