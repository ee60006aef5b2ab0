//! What is drawn where, and what is not.

use crate::support::*;
use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use std::sync::Arc;
use umbriel_render::Renderer;
use umbriel_scene::*;

fn unlit(r: f32, g: f32, b: f32, a: f32) -> Material {
    Material { shading: Shading::Unlit, base_color: Vec4::new(r, g, b, a), ..Default::default() }
}

fn ahead(name: &str) -> Picture {
    Picture::mono(look(name, Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, [64, 64]))
}

/// A square that faces the camera of [`ahead`].
fn card(material: Material, z: f32, side: f32) -> Drawable {
    shape(plane(side), material, Mat4::from_translation(Vec3::new(0.0, 0.0, z)) * Mat4::from_rotation_x(90f32.to_radians()))
}

#[test]
fn the_nearest_of_all_is_seen() {
    let near = || card(unlit(1.0, 0.0, 0.0, 1.0), 1.0, 2.0);
    let far = || card(unlit(0.0, 1.0, 0.0, 1.0), -1.0, 2.0);
    for drawables in [vec![near(), far()], vec![far(), near()]] {
        let shot = shoot(&Scene { drawables: drawables.into(), ..Default::default() }, &ahead("nearest"));
        assert_eq!(shot.centre(), [255, 0, 0, 255]);
    }
}

#[test]
fn back_faces_are_seen_where_they_should() {
    let turned = |mut d: Drawable| {
        d.world_from_object = Mat4::from_rotation_y(std::f32::consts::PI) * d.world_from_object;
        d
    };
    let mirrored = |mut d: Drawable| {
        d.world_from_object *= Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        d
    };
    let both = Material { double_sided: true, ..unlit(1.0, 1.0, 1.0, 1.0) };
    let one = unlit(1.0, 1.0, 1.0, 1.0);
    let rows = [
        ("front", card(one.clone(), 0.0, 2.0), 255),
        ("back", turned(card(one.clone(), 0.0, 2.0)), 0),
        ("mirrored", mirrored(card(one.clone(), 0.0, 2.0)), 255),
        ("mirrored back", turned(mirrored(card(one, 0.0, 2.0))), 0),
        ("double-sided", card(both.clone(), 0.0, 2.0), 255),
        ("double-sided back", turned(card(both.clone(), 0.0, 2.0)), 255),
        ("double-sided mirrored back", turned(mirrored(card(both, 0.0, 2.0))), 255),
    ];
    for (name, drawable, expected) in rows {
        let shot = shoot(&Scene { drawables: vec![drawable].into(), ..Default::default() }, &ahead("back_faces"));
        assert_eq!(shot.centre()[0], expected, "{name}");
    }
}

#[test]
fn normals_follow_mirrors_and_backs() {
    let light = Light { direction: Vec3::NEG_Z, ..noon() };
    let mirror = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let half_turn = Mat4::from_rotation_y(std::f32::consts::PI);
    let both = Material { double_sided: true, ..matt(0.5, 0.5, 0.5) };
    let facing = Mat4::from_rotation_x(90f32.to_radians());
    let uneven = Mat4::from_scale(Vec3::new(1.0, 3.0, 1.0)) * Mat4::from_rotation_z(0.6);
    let n = (uneven.inverse().transpose().transform_vector3(Vec3::Z)).normalize();
    let rows = [
        ("box", shape(cuboid(Vec3::splat(2.0)), matt(0.5, 0.5, 0.5), Mat4::IDENTITY), 0.5),
        ("mirrored box", shape(cuboid(Vec3::splat(2.0)), matt(0.5, 0.5, 0.5), mirror), 0.5),
        ("back", shape(plane(2.0), both.clone(), half_turn * facing), 0.5),
        ("mirrored back", shape(plane(2.0), both, half_turn * mirror * facing), 0.5),
        ("uneven", shape(cuboid(Vec3::splat(2.0)), matt(0.5, 0.5, 0.5), uneven), 0.5 * n.z),
    ];
    for (name, drawable, value) in rows {
        let shot = shoot(
            &Scene { drawables: vec![drawable].into(), lights: vec![light.clone()], ..Default::default() },
            &ahead("normals"),
        );
        assert_colour(shot.centre(), [value; 3], name);
    }
}

#[test]
fn half_transparent_shapes_lie_over_each_other() {
    let red = || card(Material { alpha: AlphaMode::Blend, ..unlit(1.0, 0.0, 0.0, 0.5) }, 1.0, 2.0);
    let green = || card(Material { alpha: AlphaMode::Blend, ..unlit(0.0, 1.0, 0.0, 0.25) }, 0.0, 2.0);
    let blue = || card(unlit(0.0, 0.0, 1.0, 1.0), -1.0, 3.0);
    for drawables in [vec![red(), green(), blue()], vec![green(), blue(), red()], vec![blue(), red(), green()]] {
        let shot = shoot(&Scene { drawables: drawables.into(), ..Default::default() }, &ahead("blend"));
        assert_colour(shot.centre(), [0.5, 0.5 * 0.25, 0.5 * 0.75], "red over green over blue");
    }
}

#[test]
fn alpha_cuts_holes() {
    let rgba: Vec<u8> = (0..64 * 64).flat_map(|i| [255, 255, 255, if i % 64 < 32 { 255 } else { 100 }]).collect();
    let image = Arc::new(Image { width: 64, height: 64, rgba: rgba.into() });
    let sampler = Sampler { filter: Filter::Nearest, mip_maps: false, ..Default::default() };
    let texture = TextureRef { image, sampler, uv_set: 0, uv_from_mesh: Default::default() };
    let mut material = Material { base_color_texture: Some(texture), ..unlit(1.0, 1.0, 1.0, 1.0) };
    for (alpha, right) in [(AlphaMode::Opaque, 255), (AlphaMode::Mask { cutoff: 0.5 }, 0), (AlphaMode::Mask { cutoff: 0.2 }, 255)]
    {
        material.alpha = alpha;
        let shot =
            shoot(&Scene { drawables: vec![card(material.clone(), 0.0, 3.0)].into(), ..Default::default() }, &ahead("mask"));
        assert_eq!([shot.pixel(20, 32)[0], shot.pixel(44, 32)[0]], [255, right], "{alpha:?}");
    }
}

/// Each sample of a pixel asks alpha at its own place, whatever passes light it and whoever wrote its shader. What layers or a shaders'
/// author make of alpha is asked once.
#[test]
fn edges_that_alpha_cuts_are_smooth() {
    // A ramp of alpha: half of the card is there, beyond a slanted line.
    let rgba: Vec<u8> = (0..64).flat_map(|i| [255, 255, 255, (4 * i + 1) as u8]).collect();
    let image = Arc::new(Image { width: 64, height: 1, rgba: rgba.into() });
    let sampler = Sampler { wrap_u: Wrap::Clamp, ..Default::default() };
    let uv_from_mesh = glam::Affine2::from_translation(glam::Vec2::splat(0.5))
        * glam::Affine2::from_angle(0.4)
        * glam::Affine2::from_translation(glam::Vec2::splat(-0.5));
    let texture = TextureRef { image, sampler, uv_set: 0, uv_from_mesh };
    let lit = |texture: Option<TextureRef>, text: Option<&str>| {
        let source = |text: &str| Arc::new(ShaderSource { name: "own.wgsl".into(), text: text.into() });
        let shader = text.map(|text| FragmentShader { source: source(text), params: vec![] });
        Material { base_color_texture: texture, alpha: AlphaMode::Mask { cutoff: 0.5 }, shader, ..matt(1.0, 1.0, 1.0) }
    };
    let same = "fn surface(s: Surface) -> Surface { return s; }";
    let own =
        "fn surface(s: Surface) -> Surface { var t = s; t.base_color.a = f32(s.pixel.x + 0.3 * s.pixel.y > 40.0); return t; }";
    let rows = [
        ("plain", lit(Some(texture.clone()), None), true),
        ("same", lit(Some(texture.clone()), Some(same)), true),
        ("own", lit(None, Some(own)), false),
        ("own, with a texture", lit(Some(texture.clone()), Some(own)), false),
    ];
    for (name, material, is_smooth) in rows {
        for (shadows, ambient) in [(ShadowMethod::None, 1.0), (ShadowMethod::Volume, 0.0), (ShadowMethod::Volume, 1.0)] {
            let light = Light { direction: Vec3::NEG_Z, shadows, ..noon() };
            let drawables = vec![card(material.clone(), 0.0, 8.0)].into();
            let lights = if ambient == 1.0 && shadows == ShadowMethod::None { vec![] } else { vec![light.clone(), light] };
            let mut scene = Scene { drawables, lights, ambient: Vec3::splat(0.2 * ambient), ..Default::default() };
            let mut drawn = |samples| {
                scene.samples = samples;
                let shot = shoot(&scene, &ahead("smooth"));
                assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
                let full = shot.layers[0].rgba.chunks(4).map(|p| p[0]).max().unwrap();
                let part = shot.layers[0].rgba.chunks(4).filter(|p| p[0] > 0 && p[0] < full).count();
                (part, shot.layers[0].rgba.chunks(4).filter(|p| p[0] == full).count())
            };
            let [(rough, one), (smooth, four)] = [Samples::One, Samples::Four].map(&mut drawn);
            let what = format!("{name}, {shadows:?}, {ambient}: {rough} {one} {smooth} {four}");
            assert!(one > 200 && four > 200 && rough == 0 && (smooth > 20) == is_smooth, "{what}");
        }
    }
}

/// Two cards in one place, each with a hole where the other one is.
#[test]
fn what_is_in_the_hole_of_another_keeps_its_look() {
    let half = |rgb: [u8; 3], side: u32| {
        let rgba: Vec<u8> = (0..64).flat_map(|i| [rgb[0], rgb[1], rgb[2], if i / 32 == side { 255 } else { 0 }]).collect();
        let image = Arc::new(Image { width: 64, height: 1, rgba: rgba.into() });
        let sampler = Sampler { filter: Filter::Nearest, mip_maps: false, ..Default::default() };
        let texture = TextureRef { image, sampler, uv_set: 0, uv_from_mesh: Default::default() };
        let alpha = AlphaMode::Mask { cutoff: 0.5 };
        card(Material { base_color_texture: Some(texture), alpha, ..matt(1.0, 1.0, 1.0) }, 0.0, 8.0)
    };
    let light = Light { direction: Vec3::NEG_Z, shadows: ShadowMethod::Volume, ..noon() };
    for (samples, lights) in [(Samples::One, 1), (Samples::Four, 1), (Samples::One, 2), (Samples::Four, 2)] {
        let light = Light { intensity: light.intensity / lights as f32, ..light.clone() };
        let drawables = vec![half([255, 0, 0], 0), half([0, 255, 0], 1)].into();
        let scene = Scene { drawables, lights: vec![light; lights], samples, ..Default::default() };
        let shot = shoot(&scene, &ahead("in_the_hole"));
        assert_colour(shot.pixel(16, 32), [1.0, 0.0, 0.0], "the left one");
        assert_colour(shot.pixel(48, 32), [0.0, 1.0, 0.0], "the right one");
    }
}

/// The share of a net that its wires fill stays what it is, from where a texel is large to where a mesh is.
#[test]
fn nets_keep_their_wires_from_afar() {
    let wire = |i: u32| (14..17).contains(&(i % 32));
    let rgba: Vec<u8> =
        (0..128 * 128).flat_map(|i| [255, 255, 255, if wire(i % 128) || wire(i / 128) { 255 } else { 0 }]).collect();
    let image = Arc::new(Image { width: 128, height: 128, rgba: rgba.into() });
    let texture = |uv_from_mesh| TextureRef { image: image.clone(), sampler: Sampler::default(), uv_set: 0, uv_from_mesh };
    let turned = glam::Affine2::from_angle(0.3);
    for samples in [Samples::One, Samples::Four] {
        let shares = [1.0f32, 2.0, 4.0, 8.0, 16.0].map(|times| {
            let uv_from_mesh = glam::Affine2::from_scale(Vec2::splat(times)) * turned;
            let material = Material {
                base_color_texture: Some(texture(uv_from_mesh)),
                alpha: AlphaMode::Mask { cutoff: 0.5 },
                ..unlit(1.0, 1.0, 1.0, 1.0)
            };
            let scene = Scene { drawables: vec![card(material, 0.0, 8.0)].into(), samples, ..Default::default() };
            let name = format!("net_{}_{times}", samples.count());
            let shot = shoot(&scene, &Picture::mono(look(&name, Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, [256, 256])));
            let linear = |p: &[u8]| (f32::from(p[0]) / 255.0).powf(2.2);
            shot.layers[0].rgba.chunks(4).map(linear).sum::<f32>() / (256.0 * 256.0)
        });
        println!("{samples:?}: {shares:?}");
        assert!(shares.iter().all(|share| (share / shares[0] - 1.0).abs() < 0.25), "{samples:?}: {shares:?}");
    }
}

#[test]
fn textures_are_looked_up_where_they_should() {
    let texel = |x: u32, y: u32| [x * 255, y * 255, 0].map(|v| v as u8);
    let rgba: Vec<u8> = [(0, 0), (1, 0), (0, 1), (1, 1)]
        .into_iter()
        .flat_map(|(x, y)| {
            let [r, g, b] = texel(x, y);
            [r, g, b, 255]
        })
        .collect();
    let image = Arc::new(Image { width: 2, height: 2, rgba: rgba.into() });
    let sampler = Sampler { filter: Filter::Nearest, mip_maps: false, ..Default::default() };
    let texture = |uv_from_mesh, uv_set| {
        let texture = TextureRef { image: image.clone(), sampler, uv_set, uv_from_mesh };
        Material { base_color_texture: Some(texture), ..unlit(1.0, 1.0, 1.0, 1.0) }
    };
    let mut mesh = plane(3.0);
    mesh.uv1 = mesh.uv0.iter().map(|uv| Vec2::new(1.0 - uv.x, uv.y)).collect();
    let facing = Mat4::from_rotation_x(90f32.to_radians());
    let half = glam::Affine2::from_translation(Vec2::new(0.5, 0.0));
    // Colours at the left and the right of the upper half.
    for (name, material, left, right) in [
        ("first set", texture(Default::default(), 0), texel(0, 0), texel(1, 0)),
        ("second set", texture(Default::default(), 1), texel(1, 0), texel(0, 0)),
        ("moved by half", texture(half, 0), texel(1, 0), texel(0, 0)),
    ] {
        let scene = Scene { drawables: vec![shape(mesh.clone(), material, facing)].into(), ..Default::default() };
        let shot = shoot(&scene, &ahead("textures"));
        assert_eq!(
            (shot.pixel(20, 20)[..3].to_vec(), shot.pixel(44, 20)[..3].to_vec()),
            (left.to_vec(), right.to_vec()),
            "{name}"
        );
    }
}

#[test]
fn equal_shapes_are_one_draw() {
    let (mesh, material) = (Arc::new(cuboid(Vec3::splat(0.4))), Arc::new(unlit(1.0, 1.0, 1.0, 1.0)));
    let places = (0..9).map(|i| at((i % 3 - 1) as f32, (i / 3 - 1) as f32, 0.0));
    let scene = Scene { drawables: places.map(|p| shape_of(&mesh, &material, p)).collect(), ..Default::default() };
    let shot = shoot(&scene, &ahead("instances"));
    assert_eq!((shot.stats.draws, shot.stats.instances, shot.stats.triangles), (1, 9, 108));
    let lit = (0..64 * 64).filter(|i| shot.pixel(i % 64, i / 64)[0] > 128).count();
    let separate = Scene {
        drawables: scene.drawables.iter().map(|d| shape((*d.mesh).clone(), (*d.material).clone(), d.world_from_object)).collect(),
        ..Default::default()
    };
    let other = shoot(&separate, &ahead("instances"));
    assert_eq!((other.stats.draws, &other.layers[0].rgba), (9, &shot.layers[0].rgba), "the picture is the same");
    assert!(lit > 9 * 20, "{lit}");
}

#[test]
fn what_is_outside_changes_nothing() {
    let mut scene = Scene { lights: vec![noon()], ambient: Vec3::splat(0.1), ..Default::default() };
    let mesh = Arc::new(ball(8));
    let material = Arc::new(matt(0.8, 0.5, 0.2));
    for i in 0..300 {
        let f = |k: f32| (i as f32 * k).sin() * 12.0;
        let turn = Mat4::from_rotation_translation(Quat::from_rotation_x(i as f32), Vec3::new(f(12.9), f(78.2), f(37.7)));
        scene.drawables.push(shape_of(&mesh, &material, turn));
    }
    let with_culling = shoot(&scene, &ahead("culling"));
    // Boxes that are everywhere are never culled.
    let all = Aabb { min: Vec3::splat(-1e6), max: Vec3::splat(1e6) };
    scene.drawables.iter_mut().for_each(|d| d.bounds_in_world = all);
    let without = shoot(&scene, &ahead("culling"));
    assert_eq!((without.stats.culled, without.stats.instances), (0, 300));
    assert!(with_culling.stats.culled > 100 && with_culling.stats.instances < 200, "{:?}", with_culling.stats);
    assert_eq!(with_culling.layers, without.layers);
}

#[test]
fn lines_and_points_show_their_colour() {
    let mesh = |topology, positions: Vec<Vec3>| {
        let indices: Arc<[u32]> = (0..positions.len() as u32).collect();
        Mesh { topology, positions: positions.into(), indices, ..Default::default() }.checked().unwrap()
    };
    let crossing = vec![Vec3::new(-1.0, 0.01, 0.0), Vec3::new(1.0, 0.01, 0.0)];
    let field: Vec<Vec3> =
        (0..10_000).map(|i| Vec3::new((i % 100) as f32 * 0.01 - 0.5, (i / 100) as f32 * 0.01 - 0.5, 0.0)).collect();
    for (name, mesh) in [("line", mesh(Topology::Lines, crossing)), ("points", mesh(Topology::Points, field))] {
        let scene = Scene { drawables: vec![shape(mesh, matt(0.0, 1.0, 0.0), Mat4::IDENTITY)].into(), ..Default::default() };
        let shot = shoot(&scene, &ahead(name));
        let brightest = (28..36).map(|y| shot.pixel(32, y)[1]).max().unwrap();
        assert!(brightest > 100 && shot.pixel(32, 5)[1] == 0, "{name}: {brightest}");
    }
}

#[test]
fn fog_and_background_follow_their_laws() {
    let fog = |kind, visibility_range| Some(Fog { color: Vec3::new(0.0, 0.0, 1.0), kind, visibility_range });
    let e = |d: f32, r: f32| (-d / (r - d)).exp();
    for (name, fog, red) in [
        ("none", None, 1.0),
        ("linear", fog(FogKind::Linear, 10.0), 0.5),
        ("exponential", fog(FogKind::Exponential, 20.0), e(5.0, 20.0)),
        ("thick", fog(FogKind::Linear, 4.0), 0.0),
    ] {
        let scene = Scene { drawables: vec![card(unlit(1.0, 0.0, 0.0, 1.0), 0.0, 3.0)].into(), fog, ..Default::default() };
        assert_colour(shoot(&scene, &ahead("fog")).centre(), [red, 0.0, 1.0 - red], name);
    }
    let background = Background { zenith: Vec3::X, horizon: Vec3::Y, nadir: Vec3::Z };
    let scene = Scene { background, ..Default::default() };
    let eye = Vec3::new(3.0, 2.0, 1.0);
    for (name, ray, colour) in [
        ("up", Vec3::Y, Vec3::X),
        ("down", Vec3::NEG_Y, Vec3::Z),
        ("ahead", Vec3::NEG_Z, Vec3::Y),
        ("slanted", Vec3::new(0.8, 0.6, 0.0), Vec3::Y * 0.4 + Vec3::X * 0.6),
    ] {
        let picture = Picture::mono(look("background", eye, eye + ray, [65, 65]));
        assert_colour(shoot(&scene, &picture).centre(), colour.to_array(), name);
    }
}

#[test]
fn bad_input_is_told_once_and_the_rest_is_drawn() {
    let (_turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    let mut scene = Scene { drawables: vec![card(unlit(1.0, 1.0, 1.0, 1.0), 0.0, 3.0)].into(), ..Default::default() };
    let wrong_index = Mesh { name: "wild".into(), indices: [0, 1, 99].into(), ..plane(1.0) };
    let short = Image { width: 4, height: 4, rgba: Arc::new([0; 3]) };
    let texture = TextureRef { image: Arc::new(short), sampler: Sampler::default(), uv_set: 0, uv_from_mesh: Default::default() };
    scene.drawables.push(shape(Mesh { name: "nothing".into(), ..Default::default() }, unlit(1.0, 0.0, 0.0, 1.0), Mat4::IDENTITY));
    scene.drawables.push(shape(wrong_index, unlit(1.0, 0.0, 0.0, 1.0), Mat4::IDENTITY));
    scene.drawables.push(shape(
        plane(0.1),
        Material { name: "torn".into(), base_color_texture: Some(texture), ..Default::default() },
        at(9.0, 0.0, 0.0),
    ));
    scene.drawables.push(shape(plane(1.0), unlit(1.0, 0.0, 0.0, 1.0), Mat4::from_scale(Vec3::NAN)));
    scene.lights.push(Light { position: Vec3::NAN, kind: LightKind::Point, ..noon() });
    let map = MapSettings { size: 0, ..Default::default() };
    scene.lights.push(Light { name: "tiny".into(), shadows: ShadowMethod::Map, map, ..noon() });
    let mut flat = ahead("flat").views.remove(0);
    flat.frustum.right = flat.frustum.left;
    let pictures = [
        ahead("good"),
        Picture { size: [0, 5], ..ahead("empty") },
        Picture::mono(flat),
        Picture { kind: PictureKind::LightVisibility(7), ..ahead("no such light") },
    ];
    renderer.render(&scene, &pictures).unwrap();
    let problems = renderer.problems();
    for expected in [
        "'nothing' has nothing to draw",
        "'wild'",
        "'torn'",
        "not finite",
        "'tiny': shadow map size 0: using 1",
        "'empty' of 0 x 5",
        "frustum without content",
        "shows light 7",
    ] {
        assert!(problems.iter().any(|p| p.contains(expected)), "{expected} is missing in {problems:#?}");
    }
    assert!(!problems.iter().any(|p| p.contains("graphics device")), "{problems:#?}");
    let size = pictures[0].size;
    let centre = renderer.read_back(0).unwrap()[0].pixel(size[0] / 2, size[1] / 2);
    assert_eq!(centre, [255; 4]);
    assert!(renderer.read_back(1).is_err());
    renderer.render(&scene, &pictures).unwrap();
    assert_eq!(renderer.problems(), Vec::<String>::new(), "each is told once");
}
