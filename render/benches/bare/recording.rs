//! What a frame costs the CPU alone: from the call until everything is submitted, the GPU idle before and waited for after.

use crate::program::Program;
use crate::{draw, median, turns, world};
use glam::{Mat4, Vec3};
use std::time::Instant;
use umbriel_render::{FrameStats, Gpu, Renderer};
use umbriel_scene::{Picture, Scene, View};

/// What changes from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Moving {
    /// Neither the world nor the eyes.
    Nothing,
    /// The eyes.
    Eyes,
    /// One object of a hundred.
    Some,
    /// Every object.
    All,
}

/// Sides of a view, pixels: few, so that the GPU is soon idle again.
const SIDE: u32 = 64;
/// Rings of a ball, for the same reason.
const RINGS: u32 = 2;

/// All rows: objects, kinds and views.
pub(crate) fn rows(gpu: &Gpu) {
    println!("\nrecording\nobjects  kinds  views   moving  draws  bare, ms  ours, ms   ratio  prepared, ms");
    for (objects, kinds) in [(100, 20), (1_000, 100), (10_000, 20), (10_000, 1_000)] {
        for views in [1, 7, 14] {
            for moving in [Moving::Nothing, Moving::Eyes, Moving::Some, Moving::All] {
                row(gpu, (objects, kinds), views, moving);
            }
        }
    }
}

fn views_at(count: u32, frame: usize) -> Vec<View> {
    let beside = |i: u32| i as f32 - 0.5 * (count - 1) as f32 + 0.01 * frame as f32;
    (0..count).map(|i| world::view([SIDE, SIDE], beside(i))).collect()
}

/// Moves every n-th object and tells which.
fn step(scene: &mut Scene, frame: usize, nth: usize) -> Vec<usize> {
    let by = Mat4::from_translation(Vec3::new((frame as f32 * 0.1).sin() * 1e-3, 0.0, 0.0));
    let moved: Vec<usize> = (frame % nth..scene.drawables.len()).step_by(nth).collect();
    for &index in &moved {
        let d = &mut scene.drawables[index];
        d.world_from_object = by * d.world_from_object;
        d.bounds_in_world = d.mesh.bounds.transformed(&d.world_from_object);
    }
    moved
}

fn row(gpu: &Gpu, (objects, kinds): (usize, usize), count: u32, moving: Moving) {
    let mut scene = world::grid_of(objects, kinds, |_| RINGS);
    let mut program = Program::new(gpu, &scene, &views_at(count, 0));
    let mut renderer = Renderer::new(gpu).expect("the renderer works");
    let pictures = |frame| views_at(count, frame).into_iter().map(Picture::mono).collect::<Vec<_>>();
    let mut seen = pictures(0);
    draw(&mut renderer, &scene, &seen);
    let (mut bare, mut ours, mut prepared) = (Vec::new(), Vec::new(), Vec::new());
    let mut stats = FrameStats::default();
    for frame in turns() {
        let moved = match moving {
            Moving::Nothing | Moving::Eyes => Vec::new(),
            Moving::Some => step(&mut scene, frame, 100),
            Moving::All => step(&mut scene, frame, 1),
        };
        let eyes = if moving == Moving::Eyes { views_at(count, frame) } else { Vec::new() };
        if moving == Moving::Eyes {
            seen = pictures(frame);
        }
        bare.push(recorded(gpu, || {
            program.look(gpu, &eyes);
            program.place(gpu, &scene, &moved);
            program.frame(gpu, false);
        }));
        ours.push(recorded(gpu, || stats = draw(&mut renderer, &scene, &seen)));
        prepared.push(stats.prepare_s);
    }
    let ratios = bare.iter().zip(&ours).map(|(b, o)| o / b).collect();
    println!(
        "{objects:7} {kinds:6} {count:6} {:>8} {:6} {:9.3} {:9.3} {:7.3} {:13.3}",
        format!("{moving:?}").to_lowercase(),
        stats.draws,
        median(bare) * 1e3,
        median(ours) * 1e3,
        median(ratios),
        median(prepared) * 1e3,
    );
}

/// Seconds until `frame` has submitted; the GPU is idle before and after.
fn recorded(gpu: &Gpu, frame: impl FnOnce()) -> f64 {
    let start = Instant::now();
    frame();
    let seconds = start.elapsed().as_secs_f64();
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    seconds
}
