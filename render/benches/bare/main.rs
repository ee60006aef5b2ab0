//! What the framework costs: the same draws by a bare wgpu program and by the renderer, in one run.
//!
//! `cargo bench -p umbriel-render --bench bare`. It takes the fastest graphics device that it finds and needs no files.
//! Pictures of both programs are compared before anything is timed. An argument, `recording` or `frames`, asks for one part alone.

mod bindings;
mod pipelines;
mod program;
mod recording;
mod world;

use program::Program;
use std::time::Instant;
use umbriel_render::{FrameStats, Gpu, Renderer};
use umbriel_scene::{MapUpdate, Picture, Scene, View};

/// Seconds that a row is timed for, within a number of turns.
const ROW_S: f64 = 1.0;
const LEAST_TURNS: usize = 7;
const MOST_TURNS: usize = 200;
/// Bytes of a picture may be so far from those of the other program.
const TOLERANCE: u8 = 2;

/// Seconds until the GPU is done with what `frame` submits.
fn timed(gpu: &Gpu, frame: impl FnOnce()) -> f64 {
    let start = Instant::now();
    frame();
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    start.elapsed().as_secs_f64()
}

/// The turns of a row; its first frames were drawn before, so that caches are full.
fn turns() -> impl Iterator<Item = usize> {
    let start = Instant::now();
    (0..MOST_TURNS).take_while(move |turn| *turn < LEAST_TURNS || start.elapsed().as_secs_f64() < ROW_S)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn draw(renderer: &mut Renderer, scene: &Scene, pictures: &[Picture]) -> FrameStats {
    renderer.render(scene, pictures).expect("the frame is drawn")
}

/// How the light of a row throws shadows.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shadows {
    Without,
    /// A map that is drawn in every frame.
    Drawn,
    /// A map of a world that stands still.
    Kept,
}

/// One row: the grid by both programs.
fn compare(gpu: &Gpu, (objects, kinds): (usize, usize), (count, size): (u32, [u32; 2]), shadows: Shadows) {
    let mut scene = if shadows == Shadows::Without { world::grid(objects, kinds) } else { world::shadowed(objects, kinds) };
    if shadows == Shadows::Drawn {
        scene.lights[0].map.update = MapUpdate::Always;
    }
    let views: Vec<View> = (0..count).map(|i| world::view(size, i as f32 - 0.5 * (count - 1) as f32)).collect();
    let program = Program::new(gpu, &scene, &views);
    let pictures: Vec<Picture> = views.into_iter().map(Picture::mono).collect();
    let mut renderer = Renderer::new(gpu).expect("the renderer works");
    timed(gpu, || program.frame(gpu, true));
    draw(&mut renderer, &scene, &pictures);
    assert_alike(gpu, &program, &mut renderer);

    let (mut bare, mut ours, mut cpu) = (Vec::new(), Vec::new(), Vec::new());
    let mut stats = FrameStats::default();
    // Frame by frame in turns, so that both meet the same load of the machine.
    for _ in turns() {
        bare.push(timed(gpu, || program.frame(gpu, shadows == Shadows::Drawn)));
        ours.push(timed(gpu, || stats = draw(&mut renderer, &scene, &pictures)));
        cpu.push(stats.prepare_s + stats.encode_s);
    }
    assert_eq!(stats.map_redraws, u32::from(shadows == Shadows::Drawn), "a world that stands still redraws no map");
    let ratios = bare.iter().zip(&ours).map(|(b, o)| o / b).collect();
    println!(
        "{objects:7} {kinds:6} {count:6} {:>9} {:>8} {:6} {:10} {:9.2} {:9.2} {:7.3} {:8.2}",
        format!("{}x{}", size[0], size[1]),
        format!("{shadows:?}").to_lowercase(),
        stats.draws,
        stats.map_redraws,
        median(bare) * 1e3,
        median(ours) * 1e3,
        median(ratios),
        median(cpu) * 1e3,
    );
}

/// Both programs drew the same.
fn assert_alike(gpu: &Gpu, program: &Program, renderer: &mut Renderer) {
    for (view, theirs) in program.pixels(gpu).iter().enumerate() {
        let ours = &renderer.read_back(view).expect("a picture")[0].rgba;
        let differ = theirs.iter().zip(ours).filter(|(a, b)| a.abs_diff(**b) > TOLERANCE).count();
        assert_eq!(differ, 0, "bytes of view {view} that differ, of {}", ours.len());
    }
    assert_eq!(renderer.problems(), [""; 0]);
}

/// What shadow passes cost by number of views: frames that draw the map less frames that keep it, in turns. The views see
/// next to nothing, so that a frame is its shadow pass.
fn shadow_passes(gpu: &Gpu, objects: usize) {
    struct Row {
        pictures: Vec<Picture>,
        renderer: Renderer,
        costs: Vec<f64>,
        clock: Vec<f64>,
        stats: FrameStats,
    }
    let kept = world::shadowed_behind_the_viewer(objects, 20);
    let mut drawn = kept.clone();
    drawn.lights[0].map.update = MapUpdate::Always;
    let row = |views: u32| Row {
        pictures: (0..views).map(|i| Picture::mono(world::view([64, 64], i as f32))).collect(),
        renderer: Renderer::new(gpu).expect("the renderer works"),
        costs: Vec::new(),
        clock: Vec::new(),
        stats: FrameStats::default(),
    };
    let mut rows = [1, 2, 7, 14].map(row);
    for row in &mut rows {
        timed(gpu, || row.stats = draw(&mut row.renderer, &kept, &row.pictures));
    }
    for _ in turns() {
        for row in &mut rows {
            let drawing = timed(gpu, || row.stats = draw(&mut row.renderer, &drawn, &row.pictures));
            let mut redraws = 0;
            let keeping = timed(gpu, || redraws = draw(&mut row.renderer, &kept, &row.pictures).map_redraws);
            assert_eq!(redraws, 0, "a world that stands still redraws no map");
            row.costs.push(drawing - keeping);
            row.clock.extend(row.stats.gpu_s.iter().filter(|(label, _)| *label == "shadow maps").map(|(_, s)| *s));
        }
    }
    println!("\nshadow pass of {objects} casters\n views  maps  draws  map, ms  to one view  by the GPU's clock, ms");
    let one = median(rows[0].costs.clone());
    for row in rows {
        let clock = if row.clock.is_empty() { "none".to_owned() } else { format!("{:.3}", median(row.clock) * 1e3) };
        let (cost, stats) = (median(row.costs), &row.stats);
        let views = row.pictures.len();
        println!("{views:6} {:5} {:6} {:8.2} {:12.3}  {clock}", stats.map_redraws, stats.map_draws, cost * 1e3, cost / one);
    }
}

fn main() {
    let gpu = Gpu::new(None).expect("a graphics device");
    println!("{} ({:?})", gpu.info.name, gpu.info.device_type);
    let only = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    if only.as_deref() != Some("frames") {
        recording::rows(&gpu);
    }
    if only.as_deref() != Some("recording") {
        frames(&gpu);
    }
}

/// Whole frames, until the GPU is done with them.
fn frames(gpu: &Gpu) {
    println!("\nobjects  kinds  views      size  shadows  draws  maps drawn  bare, ms  ours, ms   ratio  CPU, ms");
    for of in [(300, 20), (300, 300), (2_000, 100), (10_000, 20)] {
        for shadows in [Shadows::Without, Shadows::Drawn] {
            compare(gpu, of, (1, [512, 384]), shadows);
        }
    }
    for count in [1, 7, 14] {
        for shadows in [Shadows::Without, Shadows::Drawn, Shadows::Kept] {
            compare(gpu, (500, 50), (count, [256, 192]), shadows);
        }
    }
    shadow_passes(gpu, 2_000);
}
