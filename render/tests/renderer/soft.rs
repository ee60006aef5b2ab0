//! Soft shadows of volumes, against the share of the light's disc that rays find.

use crate::support::*;
use glam::{Mat4, Vec3};
use umbriel_scene::*;

/// A pillar and a ball on a floor, as in 004's figures 16 and 17.
fn pillar_and_ball() -> Vec<Drawable> {
    vec![
        shape(plane(30.0), matt(0.8, 0.8, 0.8), Mat4::IDENTITY),
        shape(cuboid(Vec3::new(0.5, 4.0, 0.5)), matt(0.7, 0.4, 0.3), at(-1.2, 2.0, -1.0)),
        shape(ball(48), matt(0.3, 0.5, 0.7), at(1.4, 1.6, 0.4) * Mat4::from_scale(Vec3::splat(0.7))),
    ]
}

fn view(name: &str, size: [u32; 2]) -> View {
    look(name, Vec3::new(2.0, 5.0, 9.0), Vec3::new(0.6, 0.6, 0.0), size)
}

fn slanted(size: f32) -> Light {
    let direction = Vec3::new(0.55, -0.7, 0.25).normalize();
    Light { direction, shadows: ShadowMethod::Volume, soft: true, size, ..noon() }
}

fn lamp(kind: LightKind, size: f32) -> Light {
    let position = Vec3::new(-4.5, 7.0, -2.0);
    Light { kind, position, direction: -position.normalize(), ..slanted(size) }
}

/// A box without its bottom: two layers of shadow, and an outline that both throw.
fn open_box() -> Vec<Drawable> {
    let mut mesh = cuboid(Vec3::new(1.4, 1.4, 1.4));
    // Faces come in pairs of x, y, z; the third one is below.
    mesh.indices = mesh.indices.iter().copied().filter(|i| !(8..12).contains(i)).collect();
    vec![shape(plane(30.0), matt(0.8, 0.8, 0.8), Mat4::IDENTITY), shape(mesh, matt(0.7, 0.4, 0.3), at(0.0, 2.5, 0.0))]
}

/// Two sheets through each other.
fn crossed_sheets() -> Vec<Drawable> {
    let sheet = |turn: f32| {
        let double_sided = Material { double_sided: true, ..matt(0.3, 0.6, 0.3) };
        shape(plane(1.6), double_sided, at(0.0, 2.0, 0.0) * Mat4::from_rotation_z(turn))
    };
    vec![shape(plane(30.0), matt(0.8, 0.8, 0.8), Mat4::IDENTITY), sheet(0.5), sheet(-0.9)]
}

/// One byte per pixel of the light's visibility.
fn visibility(name: &str, scene: &Scene, view: &View) -> Vec<u8> {
    let picture = Picture { kind: PictureKind::LightVisibility(0), name: name.into(), ..Picture::mono(view.clone()) };
    let shot = shoot(scene, &picture);
    assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
    shot.layers[0].rgba.chunks_exact(4).map(|p| p[0]).collect()
}

/// Score of the first light's shadow against rays.
fn score(name: &str, drawables: &[Drawable], light: Light, view: &View) -> PenumbraScore {
    let scene = Scene { drawables: drawables.to_vec().into(), lights: vec![light], ..Default::default() };
    let seen = visibility(name, &scene, view);
    let options = TraceOptions { sub_samples: 2, ..Default::default() };
    let shares = Tracer::new(&scene).shares(&scene.lights[0], view, &options, 128, &|_| ()).unwrap();
    let grey = |bytes: &[u8]| bytes.iter().flat_map(|b| [*b, *b, *b, 255]).collect();
    let [width, height] = view.size;
    keep(&format!("{name}_truth"), &[umbriel_render::RgbaPixels { width, height, rgba: grey(&shares.visibility()) }]);
    shares.score(&seen).unwrap()
}

#[test]
fn penumbrae_are_those_of_the_lights_disc() {
    let cone = LightKind::Spot { inner_rad: 0.5, outer_rad: 0.9 };
    // Name, shapes, light, how far off the penumbra may be, and the whole.
    let rows = [
        ("soft_wide", pillar_and_ball(), slanted(0.05), 0.05, 0.003),
        ("soft_paper", pillar_and_ball(), slanted(0.1), 0.04, 0.003),
        ("soft_spot", pillar_and_ball(), lamp(cone, 0.3), 0.04, 0.003),
        ("soft_point", pillar_and_ball(), lamp(LightKind::Point, 0.3), 0.04, 0.003),
        ("soft_open", open_box(), slanted(0.08), 0.04, 0.003),
        ("soft_sheets", crossed_sheets(), lamp(LightKind::Point, 0.3), 0.04, 0.003),
    ];
    for (name, shapes, light, penumbra, overall) in rows {
        let view = view(name, [160, 120]);
        let hard = score(&format!("{name}_hard"), &shapes, Light { soft: false, ..light.clone() }, &view);
        let soft = score(name, &shapes, light, &view);
        println!(
            "{name:12} penumbra {:.4} of {} pixels (hard {:.4}), overall {:.5} of {} (hard {:.5})",
            soft.penumbra, soft.penumbra_pixels, hard.penumbra, soft.overall, soft.pixels, hard.overall
        );
        assert!(soft.penumbra_pixels > 200, "{name}");
        assert!(soft.penumbra <= penumbra && soft.overall <= overall, "{name}: {soft:?}");
    }
}

#[test]
fn a_point_of_light_throws_the_hard_shadow_to_the_byte() {
    let view = view("soft_zero", [160, 120]);
    let shot = |light| {
        let scene = Scene { drawables: pillar_and_ball().into(), lights: vec![light], ..Default::default() };
        shoot(&scene, &Picture::mono(view.clone())).layers
    };
    let hard = shot(Light { soft: false, ..slanted(0.0) });
    assert!(hard == shot(slanted(0.0)));
    assert!(hard != shot(slanted(0.05)));
    // A shadow that takes half of the light.
    let dark = Scene { drawables: pillar_and_ball().into(), lights: vec![slanted(0.0)], ..Default::default() };
    let lit = shot(Light { shadows: ShadowMethod::None, ..slanted(0.0) });
    let pale = shot(Light { shadow_intensity: 0.5, soft: false, ..slanted(0.0) });
    let (mut compared, mut wrong) = (0, 0);
    for (i, seen) in visibility("soft_zero", &dark, &view).iter().enumerate().filter(|(_, v)| [0, 255].contains(*v)) {
        let linear = |layers: &[umbriel_render::RgbaPixels]| decoded(layers[0].rgba[4 * i]);
        let expected = linear(&lit) * if *seen == 0 { 0.5 } else { 1.0 };
        // The sky has no visibility.
        if linear(&lit) > 0.0 {
            compared += 1;
            wrong += u32::from((linear(&pale) - expected).abs() > 0.01);
        }
    }
    // Pixels that show a crease have one shadow for both sides of it.
    assert!(compared > 5000 && wrong < 10, "{wrong} of {compared}");
}

/// The linear value of a byte of an sRGB picture.
fn decoded(byte: u8) -> f32 {
    let v = f32::from(byte) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// 004 table 1: a pillar 0.3 m wide in the sun. Soft diameter over hard one, measured on the picture.
#[test]
fn the_soft_outline_expands_with_distance_as_the_paper_measured() {
    const WIDTH_M: f32 = 0.307;
    for (distance, paper) in [(0.3, 1.01), (1.5, 1.10), (3.0, 1.20)] {
        let board = shape(cuboid(Vec3::new(WIDTH_M, 0.001, 8.0)), matt(0.5, 0.5, 0.5), at(0.0, distance, 0.0));
        let sun = Light { shadows: ShadowMethod::Volume, soft: true, size: Light::SUN_SIZE, ..noon() };
        let floor = shape(plane(8.0), matt(0.5, 0.5, 0.5), Mat4::IDENTITY);
        let scene = Scene { drawables: vec![floor, board].into(), lights: vec![sun], ..Default::default() };
        let eye = Vec3::new(0.0, 0.25, 0.0);
        let mut view = look("soft_table_1", eye, Vec3::ZERO, [1000, 8]);
        view.frustum = Frustum { left: -0.08, right: 0.08, bottom: -0.00064, top: 0.00064, near: 0.1 };
        let row: Vec<u8> = visibility("soft_table_1", &scene, &view)[4 * 1000..5 * 1000].to_vec();
        let width = |dark: fn(&u8) -> bool| row.iter().filter(|v| dark(v)).count() as f32;
        let (soft, hard) = (width(|v| *v < 254), width(|v| *v < 2));
        let expected = (WIDTH_M + 2.0 * distance * Light::SUN_SIZE) / (WIDTH_M - 2.0 * distance * Light::SUN_SIZE);
        println!(
            "{distance} m: {:.1} %, the disc says {:.1} %, 004 says {:.0} %",
            100.0 * soft / hard,
            100.0 * expected,
            100.0 * paper
        );
        assert!((soft / hard - expected).abs() < 0.012, "{distance} m: {} instead of {expected}", soft / hard);
        assert!((soft / hard - paper).abs() < 0.02, "{distance} m: {} where 004 has {paper}", soft / hard);
    }
}

#[test]
fn two_lights_are_masked_each_by_its_own() {
    let view = view("soft_two", [160, 120]);
    let other = Light { direction: Vec3::new(-0.5, -0.8, 0.1).normalize(), color: Vec3::new(0.1, 0.2, 0.5), ..slanted(0.08) };
    let one = Light { color: Vec3::new(0.5, 0.3, 0.1), ..slanted(0.04) };
    let shot = |lights: Vec<Light>| {
        let scene = Scene { drawables: pillar_and_ball().into(), lights, ..Default::default() };
        shoot(&scene, &Picture::mono(view.clone())).layers.remove(0).rgba
    };
    let (both, a, b) = (shot(vec![one.clone(), other.clone()]), shot(vec![one]), shot(vec![other]));
    for (i, ((both, a), b)) in both.iter().zip(a).zip(b).enumerate().filter(|(i, _)| i % 4 != 3) {
        let sum = decoded(a) + decoded(b);
        assert!((decoded(*both) - sum).abs() < 0.015, "byte {i}: {} instead of {sum}", decoded(*both));
    }
}

#[test]
fn a_film_is_as_strong_as_the_shadow() {
    let view = view("soft_film", [160, 120]);
    let film = Film { color: glam::Vec4::new(0.0, 0.0, 0.0, 0.5) };
    let group = StencilGroup { name: "group".into(), light: 0, casters: vec![1, 2], mode: StencilMode::Modulative(film) };
    let light = Light { shadows: ShadowMethod::None, ..slanted(0.08) };
    let scene =
        Scene { drawables: pillar_and_ball().into(), lights: vec![light], stencil_groups: vec![group], ..Default::default() };
    let bare = Scene { stencil_groups: Vec::new(), ..scene.clone() };
    let shot = |scene: &Scene| shoot(scene, &Picture::mono(view.clone())).layers.remove(0).rgba;
    let (with, without, shown) = (shot(&scene), shot(&bare), visibility("soft_film_shown", &scene, &view));
    // On the floor; at the rims of other shapes the mean of products is not the product of means.
    let floor = without[4 * (160 * 119)];
    let (mut soft, mut dark) = (0, 0);
    for (i, shown) in shown.iter().enumerate().filter(|(i, _)| without[4 * i] == floor) {
        let expected = decoded(floor) * (0.5 + 0.5 * f32::from(*shown) / 255.0);
        soft += u32::from((20..235).contains(shown));
        dark += u32::from(*shown == 0);
        let found = decoded(with[4 * i]);
        assert!((found - expected).abs() < 0.02, "pixel {i}: {found} instead of {expected}");
    }
    assert!(soft > 300 && dark > 100, "{soft} {dark}");
}

#[test]
fn nothing_bleeds_over_the_rim_of_what_stands_before() {
    // A lit post between the eye and a wide penumbra, that casts nothing itself.
    let mut shapes = pillar_and_ball();
    let post = shape(cuboid(Vec3::new(0.12, 3.0, 0.12)), matt(0.5, 0.5, 0.5), at(1.5, 1.5, 3.2));
    let post = Drawable { casts_shadow: false, ..post };
    let view = view("soft_bleeding", [240, 180]);
    let scene =
        |drawables: Vec<Drawable>| Scene { drawables: drawables.into(), lights: vec![slanted(0.1)], ..Default::default() };
    let without = visibility("soft_bleeding_without", &scene(shapes.clone()), &view);
    shapes.push(post.clone());
    let with = visibility("soft_bleeding", &scene(shapes), &view);
    let alone = visibility("soft_bleeding_post", &scene(vec![post]), &view);
    let (mut on_post, mut beside, mut worst, mut sum) = (0, 0, 0, 0);
    for ((with, without), alone) in with.iter().zip(without).zip(alone) {
        match alone {
            255 => {
                on_post += u32::from(without < 250);
                assert!(*with > 250, "the post is lit: {with}, behind it {without}");
            }
            0 => {
                beside += u32::from((5..250).contains(&without));
                worst = worst.max(with.abs_diff(without));
                sum += u32::from(with.abs_diff(without));
            }
            _ => (),
        }
    }
    println!("beside the post: at most {worst} of 255, {sum} in {beside} pixels of penumbra; {on_post} on the post");
    assert!(on_post > 50 && beside > 500 && worst < 60 && sum < beside, "{on_post} {beside} {worst} {sum}");
}
