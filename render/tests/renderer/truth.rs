//! Shadow maps with settings that nobody tuned, against ray tracing: what is lit must not be speckled, what is dark must not
//! leak, from a ball of centimetres to a square kilometre.

use crate::support::*;
use glam::{Mat4, Vec3};
use std::f32::consts::TAU;
use std::sync::Arc;
use umbriel_scene::*;

fn sun(direction: Vec3) -> Light {
    Light { direction: direction.normalize(), shadows: ShadowMethod::Map, ..noon() }
}

fn grey() -> Material {
    Material { double_sided: true, ..matt(0.6, 0.6, 0.6) }
}

fn boxes(list: &[([f32; 3], [f32; 3])]) -> Vec<Drawable> {
    list.iter().map(|(size, p)| shape(cuboid(Vec3::from(*size)), grey(), at(p[0], p[1], p[2]))).collect()
}

fn torus(radius: f32, thickness: f32) -> Mesh {
    let (around, across) = (96u32, 48u32);
    let (mut positions, mut normals, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..=around {
        for j in 0..=across {
            let (a, b) = (TAU * i as f32 / around as f32, TAU * j as f32 / across as f32);
            let out = Vec3::new(a.cos(), 0.0, a.sin());
            normals.push(out * b.cos() + Vec3::Y * b.sin());
            positions.push(out * (radius + thickness * b.cos()) + Vec3::Y * (thickness * b.sin()));
        }
    }
    for i in 0..around {
        for j in 0..across {
            let (a, b) = (i * (across + 1) + j, (i + 1) * (across + 1) + j);
            indices.extend([a, a + 1, b + 1, a, b + 1, b]);
        }
    }
    let (positions, normals, indices) = (positions.into(), normals.into(), indices.into());
    Mesh { name: "torus".into(), positions, normals, indices, ..Default::default() }.checked().unwrap()
}

/// A card with a leaf that is cut out by alpha.
fn leaf() -> Material {
    let texel = |i: u32| {
        let (x, y) = ((i % 32) as f32 / 15.5 - 1.0, (i / 32) as f32 / 15.5 - 1.0);
        [90, 160, 60, if x.abs() < 0.8 * (1.0 - y * y) { 255 } else { 0 }]
    };
    let image = Image { width: 32, height: 32, rgba: (0..32 * 32).flat_map(texel).collect() };
    let texture = TextureRef { image: Arc::new(image), sampler: Sampler::default(), uv_set: 0, uv_from_mesh: Default::default() };
    Material { base_color_texture: Some(texture), alpha: AlphaMode::Mask { cutoff: 0.5 }, ..grey() }
}

fn forest() -> Vec<Drawable> {
    let (card, leaf) = (Arc::new(plane(0.5)), Arc::new(leaf()));
    let mut all = vec![shape(plane(40.0), grey(), Mat4::IDENTITY)];
    for i in 0..300 {
        // Spread and turned by the golden angle.
        let turn = 2.399_963 * i as f32;
        let place = Vec3::new(turn.cos(), 0.0, turn.sin()) * (0.25 * (i as f32).sqrt());
        let height = 1.2 + 1.5 * ((i * 37 % 100) as f32 / 100.0);
        let pose = Mat4::from_translation(place + Vec3::Y * height) * Mat4::from_rotation_y(turn) * Mat4::from_rotation_x(0.7);
        all.push(shape_of(&card, &leaf, pose));
    }
    all.extend(boxes(&[([0.2, 2.0, 0.2], [0.0, 1.0, 0.0])]));
    all
}

fn curved() -> Vec<Drawable> {
    let at_scale = |x: f32, scale: f32| at(x, scale, 0.0) * Mat4::from_scale(Vec3::splat(scale));
    vec![
        shape(plane(12.0), grey(), Mat4::IDENTITY),
        shape(ball(48), grey(), at_scale(-1.6, 0.8)),
        shape(ball(48), grey(), at_scale(1.9, 0.4)),
        shape(torus(0.8, 0.25), grey(), at(0.3, 0.6, 0.8) * Mat4::from_rotation_x(0.9)),
    ]
}

fn railings() -> Vec<Drawable> {
    let mut list = vec![([6.0, 0.03, 0.03], [0.0, 1.0, 0.0]), ([6.0, 0.03, 0.03], [0.0, 0.5, 0.0])];
    list.extend((0..30).map(|i| ([0.02, 1.0, 0.02], [-2.9 + 0.2 * i as f32, 0.5, 0.0])));
    let mut all = boxes(&list);
    all.push(shape(plane(10.0), grey(), Mat4::IDENTITY));
    all
}

fn room() -> Vec<Drawable> {
    boxes(&[
        ([6.0, 0.1, 6.0], [0.0, -0.05, 0.0]),
        ([6.0, 0.1, 6.0], [0.0, 3.05, 0.0]),
        ([0.1, 3.0, 6.0], [-3.05, 1.5, 0.0]),
        ([0.1, 3.0, 6.0], [3.05, 1.5, 0.0]),
        ([6.0, 3.0, 0.1], [0.0, 1.5, -3.05]),
        ([1.2, 0.05, 0.8], [0.3, 0.75, -0.8]),
        ([0.05, 0.72, 0.05], [-0.2, 0.36, -1.1]),
        ([0.05, 0.72, 0.05], [0.8, 0.36, -0.5]),
        ([0.4, 0.4, 0.4], [-1.4, 0.2, -1.2]),
    ])
}

fn field() -> Vec<Drawable> {
    let mut all = boxes(&[
        ([1.0, 1.0, 1.0], [0.0, 0.5, 0.0]),
        ([1.0, 2.0, 1.0], [3.0, 1.0, -4.0]),
        ([9.0, 20.0, 9.0], [20.0, 10.0, -90.0]),
    ]);
    all.push(shape(plane(1000.0), grey(), Mat4::IDENTITY));
    all
}

fn thumb() -> Vec<Drawable> {
    let mut all = boxes(&[([0.02, 0.03, 0.02], [0.03, 0.015, 0.01])]);
    all.push(shape(plane(0.3), grey(), Mat4::IDENTITY));
    all.push(shape(ball(32), grey(), at(-0.02, 0.02, 0.0) * Mat4::from_scale(Vec3::splat(0.02))));
    all
}

/// Posts of 3 cm; see the lens that they are looked at through.
fn posts() -> Vec<Drawable> {
    let post = |i: i32| ([0.03, 1.0, 0.03], [-3.0 + 0.5 * i as f32, 0.5, 0.0]);
    let mut all = boxes(&(0..12).map(post).collect::<Vec<_>>());
    all.push(shape(plane(400.0), grey(), Mat4::IDENTITY));
    all
}

/// Ten centimetres small, on a ground of 4 km, 1 km from the origin.
fn pebbles() -> Vec<Drawable> {
    let mut all = boxes(&[([0.1, 0.1, 0.1], [800.0, 0.05, 600.0]), ([0.1, 0.1, 0.1], [800.25, 0.05, 600.1])]);
    all.push(shape(ball(32), grey(), at(800.0, 0.05, 600.3) * Mat4::from_scale(Vec3::splat(0.05))));
    all.push(shape(plane(4000.0), grey(), Mat4::IDENTITY));
    all
}

/// Draws and traces the shadow of the first light, in a world that stands `out` from the origin. Gives what is wrong away from edges,
/// and the score. Then the world slips by a hundredth of a texel in front of the same maps, as if another device had drawn them: the
/// worse of both counts.
fn scored(name: &str, scene: &Scene, ([eye, to], lens_degrees): ([[f32; 3]; 2], f32), out: Vec3) -> (Specks, Score) {
    let mut view = look(name, Vec3::from(eye), Vec3::from(to), [320, 240]);
    view.frustum = Frustum::symmetric(lens_degrees.to_radians(), 4.0 / 3.0, 0.01);
    let picture = Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(view) }.around(-out);
    let scene = scene.around(-out);
    // Rays need fine numbers as maps do.
    let home = origin_near_eyes(Vec3::ZERO, std::slice::from_ref(&picture));
    let (near, seen) = (scene.around(home), &picture.around(home).views[0]);
    let options = TraceOptions { sub_samples: 2, eps_scale: 1e-7, ..Default::default() };
    let truth = Tracer::new(&near).visibility(&near.lights[0], seen, &options, &|_| ()).unwrap();
    let mut shooter = Shooter::new();
    let mut scored = |name: &str, scene: &Scene| {
        let shot = shooter.shoot(scene, &Picture { name: name.into(), ..picture.clone() });
        assert_eq!(shot.problems, Vec::<String>::new());
        let visibility: Vec<u8> = shot.layers[0].rgba.chunks_exact(4).map(|p| p[0]).collect();
        let rgba = difference(&truth, &visibility).unwrap();
        keep(&format!("{name}_difference"), &[umbriel_render::RgbaPixels { rgba, ..shot.layers[0].clone() }]);
        (specks(&truth, &visibility).unwrap(), score(&truth, &visibility).unwrap())
    };
    let (mut away, mut score) = scored(name, &scene);
    // A map shows about as much as the view.
    let slip = Vec3::ONE * (Vec3::from(eye).distance(Vec3::from(to)) / 2048.0 / 100.0);
    let mut slipped = scene.clone();
    slipped.lights[0].map.update = MapUpdate::Never;
    for d in &mut slipped.drawables {
        d.world_from_object = Mat4::from_translation(slip) * d.world_from_object;
    }
    let (away_then, score_then) = scored(&format!("{name}_slipped"), &slipped);
    (away.dark, away.lit) = (away.dark.max(away_then.dark), away.lit.max(away_then.lit));
    score = if score_then.iou < score.iou { score_then } else { score };
    println!(
        "{name}: {:.4} % specks, {:.4} % leaks, IoU {:.4}, {:.3} % disagree",
        away.dark * 100.0,
        away.lit * 100.0,
        score.iou,
        score.disagreement * 100.0
    );
    (away, score)
}

#[test]
fn bias_tunes_itself() {
    let lamp = |kind, position| Light { kind, position, shadows: ShadowMethod::Map, ..noon() };
    let bulb = lamp(LightKind::Point, Vec3::new(0.4, 2.3, 0.5));
    // 170 degrees wide.
    let wide = lamp(LightKind::Spot { inner_rad: 1.4, outer_rad: 1.4835 }, Vec3::new(0.4, 2.3, 0.5));
    let far = Vec3::new(1e6, 2e4, -3e5);
    let here = Vec3::ZERO;
    // Scene, light, eye, where it looks and through which lens, how far out, the worst IoU.
    let rows = [
        ("field", field(), sun(Vec3::new(0.5, -0.6, 0.3)), ([[4.0, 2.0, 7.0], [0.0, 0.5, 0.0]], 45.0), here, 0.98),
        ("field_far_out", field(), sun(Vec3::new(0.5, -0.6, 0.3)), ([[4.0, 2.0, 7.0], [0.0, 0.5, 0.0]], 45.0), far, 0.98),
        ("forest", forest(), sun(Vec3::new(0.4, -1.0, -0.3)), ([[2.5, 5.0, 6.0], [0.3, 0.0, 0.0]], 45.0), here, 0.98),
        ("curved", curved(), sun(Vec3::new(1.0, -0.25, -0.2)), ([[0.0, 2.5, 5.5], [0.3, 0.5, 0.0]], 45.0), here, 0.98),
        // 3 degrees high.
        ("evening", curved(), sun(Vec3::new(0.98, -0.0524, -0.19)), ([[0.0, 2.5, 5.5], [0.3, 0.5, 0.0]], 45.0), here, 0.98),
        ("railings", railings(), sun(Vec3::new(0.3, -1.0, 0.9)), ([[1.0, 1.8, 5.0], [0.0, 0.3, 1.0]], 45.0), here, 0.97),
        ("room", room(), bulb.clone(), ([[-1.5, 1.7, 2.8], [0.2, 0.8, -1.0]], 45.0), here, 0.98),
        ("room_far_out", room(), bulb, ([[-1.5, 1.7, 2.8], [0.2, 0.8, -1.0]], 45.0), far, 0.98),
        ("wide_spot", room(), wide, ([[-1.5, 1.7, 2.8], [0.2, 0.8, -1.0]], 45.0), here, 0.98),
        ("thumb", thumb(), sun(Vec3::new(0.5, -0.8, -0.3)), ([[0.03, 0.12, 0.25], [0.0, 0.01, 0.0]], 45.0), here, 0.98),
        ("pebbles", pebbles(), sun(Vec3::new(0.5, -0.6, 0.3)), ([[800.3, 0.7, 601.2], [800.0, 0.0, 600.1]], 45.0), here, 0.98),
        // Seen at 4 degrees over the ground.
        ("posts", posts(), sun(Vec3::new(0.5, -0.6, 0.3)), ([[2.0, 2.0, 28.0], [0.0, 0.2, 0.0]], 10.0), here, 0.95),
    ];
    let mut failed = Vec::new();
    for (name, drawables, light, eyes, out, least) in rows {
        let scene = Scene { drawables: drawables.into(), lights: vec![light], ..Default::default() };
        let (away, score) = scored(&format!("bias_{name}"), &scene, eyes, out);
        if away.dark >= 0.0002 || away.lit >= 0.0002 || score.iou < least {
            failed.push(name);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

/// Lights that cast by volume draw maps of what alpha cuts holes into where they are told to, and of nothing else.
#[test]
fn holes_are_left_to_maps() {
    let volume = VolumeSettings { holes_by_map: true, ..Default::default() };
    let by_volume = |light: Light| Light { shadows: ShadowMethod::Volume, volume, ..light };
    let lights = [
        ("sun", by_volume(sun(Vec3::new(0.4, -1.0, -0.3)))),
        ("bulb", by_volume(Light { kind: LightKind::Point, position: Vec3::new(1.0, 5.0, 1.5), ..noon() })),
    ];
    for (name, light) in lights {
        let mut scene = Scene { drawables: forest().into(), lights: vec![light], ..Default::default() };
        let (away, score) = scored(&format!("holes_{name}"), &scene, ([[2.5, 5.0, 6.0], [0.3, 0.0, 0.0]], 45.0), Vec3::ZERO);
        assert!(away.dark < 0.0002 && away.lit < 0.0002 && score.iou > 0.98, "{name}");

        let (_turn, gpu) = gpu();
        let mut renderer = umbriel_render::Renderer::new(gpu).unwrap();
        let view = look("holes", Vec3::new(2.5, 5.0, 6.0), Vec3::ZERO, [64, 48]);
        let mut redraws = |scene: &Scene| {
            let stats = renderer.render(scene, &[Picture::mono(view.clone())]).unwrap();
            (stats.maps > 0, stats.map_redraws > 0)
        };
        assert_eq!([redraws(&scene), redraws(&scene)], [(true, true), (true, false)], "{name}");
        let post = scene.drawables.len() - 1;
        for (moved, is_drawn_anew) in [(post, false), (1, true)] {
            let d = &mut scene.drawables[moved];
            let by = Mat4::from_translation(Vec3::X * 0.1);
            (d.world_from_object, d.bounds_in_world) = (by * d.world_from_object, d.bounds_in_world.transformed(&by));
            assert_eq!(redraws(&scene), (true, is_drawn_anew), "{name}: {moved} moved");
        }
        // A mask that cuts nothing off leaves triangles whole.
        for d in &mut scene.drawables {
            std::sync::Arc::make_mut(&mut d.material).base_color_texture = None;
        }
        assert_eq!(redraws(&scene), (false, false), "{name}: without holes");
        let mut scene = Scene { drawables: forest().into(), lights: scene.lights, ..Default::default() };
        scene.lights[0].volume.holes_by_map = false;
        assert_eq!(redraws(&scene), (false, false), "{name}: by rays");
    }
}

/// Where volumes have penumbrae, leaves have them too.
#[test]
fn leaves_are_as_soft_as_volumes() {
    let leaves: Vec<Drawable> = forest().into_iter().take(40).collect();
    let half_lit = |soft: bool| {
        let light = Light { soft, size: 0.05, shadows: ShadowMethod::Volume, ..sun(Vec3::new(0.4, -1.0, -0.3)) };
        let scene = Scene { drawables: leaves.clone().into(), lights: vec![light], ..Default::default() };
        let view = look(&format!("leaves_{soft}"), Vec3::new(2.0, 2.5, 2.0), Vec3::new(0.8, 0.0, -0.5), [160, 120]);
        let shot = shoot(&scene, &Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(view) });
        shot.layers[0].rgba.chunks_exact(4).filter(|p| (30..225).contains(&p[0])).count()
    };
    let [hard, soft] = [half_lit(false), half_lit(true)];
    assert!(hard > 100 && soft > 2 * hard, "{hard} pixels in half shadow, {soft} where it is soft");
}

/// How much of the light is wrong, in penumbrae and everywhere, by filter.
#[test]
fn penumbrae_follow_from_the_size_of_the_light() {
    let mut drawables =
        boxes(&[([0.1, 1.5, 0.1], [-0.6, 0.75, 0.0]), ([0.5, 0.5, 0.5], [0.5, 0.25, 0.0]), ([0.6, 0.05, 0.6], [0.2, 1.2, -0.4])]);
    drawables.push(shape(plane(10.0), grey(), Mat4::IDENTITY));
    let wide_sun = Light { size: 0.05, ..sun(Vec3::new(0.5, -1.0, 0.4)) };
    let spot = LightKind::Spot { inner_rad: 0.4, outer_rad: 0.5 };
    let position = Vec3::new(-1.5, 4.0, -1.2);
    let lamp = Light { kind: spot, position, direction: -position.normalize(), size: 0.15, shadows: ShadowMethod::Map, ..noon() };
    for (name, light) in [("sun", wide_sun), ("spot", lamp)] {
        let scene = Scene { drawables: drawables.clone().into(), lights: vec![light], ..Default::default() };
        let view = look(&format!("penumbra_{name}"), Vec3::new(0.5, 3.0, 3.5), Vec3::new(0.2, 0.2, 0.2), [240, 180]);
        let options = TraceOptions { sub_samples: 1, eps_scale: 1e-6, ..Default::default() };
        let truth = Tracer::new(&scene).shares(&scene.lights[0], &view, &options, 96, &|_| ()).unwrap();
        let error = |filter: MapFilter| {
            let mut scene = scene.clone();
            scene.lights[0].map.filter = filter;
            let view = View { name: format!("{}_{filter:?}", view.name), ..view.clone() };
            let shot = shoot(&scene, &Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(view) });
            let visibility: Vec<u8> = shot.layers[0].rgba.chunks_exact(4).map(|p| p[0]).collect();
            truth.score(&visibility).unwrap()
        };
        let (hard, soft) = (error(MapFilter::Pcf16), error(MapFilter::Pcss));
        println!(
            "{name}: share of light wrong in penumbrae: {:.4} by pcss, {:.4} by pcf16; everywhere: {:.4}, {:.4}; {} pixels",
            soft.penumbra, hard.penumbra, soft.overall, hard.overall, soft.penumbra_pixels
        );
        assert!(soft.penumbra_pixels > 500 && soft.penumbra < 0.06 && soft.penumbra < 0.3 * hard.penumbra, "{name}");
    }
}

/// The samples that look for casters lie far apart where the source is wide; a thin post is found all the same.
#[test]
fn thin_casters_are_found_by_pcss() {
    let mut drawables = boxes(&[([0.15, 1.0, 0.15], [0.0, 0.5, -0.5]), ([0.03, 1.0, 0.03], [0.4, 0.5, -0.3])]);
    drawables.push(shape(plane(4.0), grey(), Mat4::IDENTITY));
    let kind = LightKind::Spot { inner_rad: 0.28, outer_rad: 0.3 };
    let position = Vec3::new(-1.5, 3.5, -2.5);
    let map = MapSettings { filter: MapFilter::Pcss, size: 256, ..Default::default() };
    let light =
        Light { kind, position, direction: (-position).normalize(), size: 0.12, shadows: ShadowMethod::Map, map, ..noon() };
    let scene = Scene { drawables: drawables.into(), lights: vec![light], ..Default::default() };
    let view = look("thin_by_pcss", Vec3::new(1.2, 2.2, 1.6), Vec3::new(0.25, 0.1, -0.3), [320, 240]);
    let shot = shoot(&scene, &Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(view) });
    let value = |x: u32, y: u32| shot.pixel(x, y)[0];
    let is_speck = |x: u32, y: u32| {
        let around = [value(x - 1, y), value(x + 1, y), value(x, y - 1), value(x, y + 1)];
        value(x, y) > 200 && around.iter().all(|v| *v < 60)
    };
    let specks = (1..319).flat_map(|x| (1..239).map(move |y| (x, y))).filter(|(x, y)| is_speck(*x, *y)).count();
    assert_eq!(specks, 0, "lit pixels in the dark");
}

/// A probe that stands still looks at edges of shadows while a head beside it moves by centimetres; maps are fitted to what
/// the head sees, which is all that the probe sees and more.
#[test]
fn edges_stand_still_while_a_head_moves() {
    let mut drawables = field();
    drawables.extend(railings());
    let scene = Scene { drawables: drawables.into(), lights: vec![sun(Vec3::new(0.5, -0.8, 0.3))], ..Default::default() };
    let size = [96, 72];
    let eye = Vec3::new(1.0, 1.7, 5.0);
    let target = Vec3::new(0.5, 0.0, 0.8);
    let mut probe = look("probe", eye, target, size);
    probe.frustum = Frustum::symmetric(0.3, 4.0 / 3.0, 0.1);
    let (_turn, gpu) = gpu();
    for (name, head_at) in [
        ("sideways", Box::new(|i: f32| eye + Vec3::X * 0.01 * i) as Box<dyn Fn(f32) -> Vec3>),
        ("ahead", Box::new(|i: f32| eye + (target - eye).normalize() * (0.01 * i - 0.4))),
        ("around", Box::new(|i: f32| target + glam::Quat::from_rotation_y(0.003 * i) * (eye - target))),
    ] {
        let mut renderer = umbriel_render::Renderer::new(gpu).unwrap();
        let mut before: Option<Vec<u8>> = None;
        let (mut worst, mut redraws) = (0.0f64, 0);
        for step in 0..40 {
            let head =
                View { frustum: Frustum::symmetric(1.4, 4.0 / 3.0, 0.1), ..look("head", head_at(step as f32), target, [32, 24]) };
            let pictures = [
                Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(probe.clone()) },
                Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(head) },
            ];
            redraws += renderer.render(&scene, &pictures).unwrap().map_redraws;
            let now: Vec<u8> = renderer.read_back(0).unwrap()[0].rgba.chunks_exact(4).map(|p| p[0]).collect();
            if let Some(before) = before.replace(now.clone()) {
                let edges: Vec<f64> = before
                    .iter()
                    .zip(&now)
                    .filter(|(a, b)| (1..255).contains(*a) || (1..255).contains(*b) || a != b)
                    .map(|(a, b)| f64::from(a.abs_diff(*b)))
                    .collect();
                assert!(edges.len() > 100, "{name}: {} pixels on edges", edges.len());
                worst = worst.max(edges.iter().sum::<f64>() / edges.len() as f64 / 255.0);
            }
        }
        println!(
            "{name}: worst mean change of a pixel on an edge from step to step: {worst:.4}, {redraws} maps drawn in 40 frames"
        );
        // One sample of four is a quarter.
        assert!(worst < 0.1, "{name}: {worst}");
    }
}
