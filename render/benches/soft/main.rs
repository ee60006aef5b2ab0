//! What softness costs: 004's table 3 with our pillar, ball and knot, hard and soft frames in turns.
//!
//! `cargo bench -p umbriel-render --bench soft`

mod shapes;

use glam::{Mat4, Vec3};
use std::sync::Arc;
use std::time::Instant;
use umbriel_render::{Gpu, Renderer};
use umbriel_scene::*;

/// Timed frames of each kind.
const FRAMES: usize = 25;
const SIZE: [u32; 2] = [640, 480];

/// 004 table 3: polygons, hard and soft shadow, milliseconds.
const PAPER: [(&str, usize, f64, f64); 3] =
    [("pillar", 176, 121.0, 196.0), ("ball", 1472, 267.0, 349.0), ("dragon", 26584, 516.0, 622.0)];

fn drawable(mesh: Mesh, grey: f32) -> Drawable {
    let bounds = mesh.bounds;
    Drawable {
        name: mesh.name.clone(),
        mesh: Arc::new(mesh),
        material: Arc::new(Material { base_color: Vec3::splat(grey).extend(1.0), ..Default::default() }),
        world_from_object: Mat4::IDENTITY,
        pose: None,
        bounds_in_world: bounds,
        visible: true,
        casts_shadow: true,
        receives_shadow: true,
        receives: None,
        revision: 0,
    }
}

fn floor() -> Drawable {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let positions = corners.map(|(x, z)| Vec3::new(x, 0.0, z) * 12.0).into();
    drawable(Mesh { positions, indices: [0, 2, 1, 0, 3, 2].into(), ..Default::default() }.checked().expect("a square"), 0.8)
}

/// Range 10 and brightness 128, as the paper's.
fn light(soft: bool) -> Light {
    let direction = Vec3::new(0.6, -0.8, 0.2).normalize();
    let shadow_intensity = if soft { 0.784 } else { 1.0 };
    Light { direction, shadows: ShadowMethod::Volume, soft, size: 0.1, shadow_intensity, ..Default::default() }
}

/// Median milliseconds of a frame, hard and soft. The caster turns, so that its volume is made anew each time.
fn time(gpu: &Gpu, caster: Mesh, picture: &Picture) -> (f64, f64) {
    let bounds = caster.bounds;
    let mut scene = Scene { drawables: vec![floor(), drawable(caster, 0.6)].into(), ..Default::default() };
    let mut renderers = [false, true].map(|soft| (soft, Renderer::new(gpu).expect("the renderer works"), Vec::new()));
    for frame in 0..FRAMES + 3 {
        let turn = Mat4::from_rotation_y(0.05 * frame as f32);
        scene.drawables[1].world_from_object = turn;
        scene.drawables[1].bounds_in_world = bounds.transformed(&turn);
        scene.drawables[1].revision += 1;
        for (soft, renderer, times) in &mut renderers {
            scene.lights = vec![light(*soft)];
            let start = Instant::now();
            renderer.render(&scene, std::slice::from_ref(picture)).expect("the frame is drawn");
            gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
            if frame >= 3 {
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    let [hard, soft] = renderers.map(|(_, _, mut times)| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    (hard, soft)
}

fn main() {
    let gpu = Gpu::new(None).expect("there is a device");
    println!("{}, {}x{}, median of {FRAMES} frames in turns", gpu.info.name, SIZE[0], SIZE[1]);
    let eye = Vec3::new(1.0, 4.0, 7.5);
    let picture = Picture::mono(View {
        name: "soft".into(),
        view_from_world: glam::camera::rh::view::look_at_mat4(eye, Vec3::new(0.6, 1.0, 0.0), Vec3::Y),
        frustum: Frustum::symmetric(0.75, SIZE[0] as f32 / SIZE[1] as f32, 0.1),
        size: SIZE,
    });
    println!(
        "            polygons   hard, ms   soft, ms   added, ms   soft over hard      004: hard, ms  soft, ms  soft over hard"
    );
    for ((name, polygons, hard, soft), caster) in PAPER.into_iter().zip([shapes::pillar(), shapes::ball(), shapes::knot()]) {
        assert_eq!(caster.triangle_count(), polygons, "{name}");
        let ours = time(&gpu, caster, &picture);
        let over = |(hard, soft): (f64, f64)| 100.0 * (soft / hard - 1.0);
        println!(
            "{name:10} {polygons:10} {:10.1} {:10.1} {:11.1} {:14.0} % {hard:18.0} {soft:9.0} {:13.0} %",
            ours.0,
            ours.1,
            ours.1 - ours.0,
            over(ours),
            over((hard, soft))
        );
    }
}
