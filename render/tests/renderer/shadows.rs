//! Shadows against closed forms: a ball over a floor.

use crate::support::*;
use glam::{Mat4, Vec3};
use umbriel_scene::*;

const CENTRE: Vec3 = Vec3::new(0.0, 2.0, 0.0);
const RADIUS: f32 = 0.7;

fn ball_over_floor(light: Light) -> Scene {
    let floor = shape(plane(12.0), matt(0.5, 0.5, 0.5), Mat4::IDENTITY);
    let ball = shape(ball(96), matt(0.8, 0.3, 0.2), Mat4::from_translation(CENTRE) * Mat4::from_scale(Vec3::splat(RADIUS)));
    Scene { drawables: vec![floor, ball].into(), lights: vec![light], ..Default::default() }
}

/// How far a point of the floor is inside of the ball's shadow, metres; negative outside.
fn depth_in_shadow(light: &Light, p: Vec3) -> f32 {
    let towards = if light.kind == LightKind::Directional { -light.direction } else { (light.position - p).normalize() };
    let along = (CENTRE - p).dot(towards);
    if along < 0.0 {
        return -1.0;
    }
    RADIUS - (p + towards * along - CENTRE).length()
}

/// Light, and the share of pixels on the floor that are right, leaving out those within a texel of the outline.
fn agreement(name: &str, light: Light, margin: f32) -> (f32, u32) {
    let scene = ball_over_floor(light.clone());
    let size = [200, 200];
    // From below the ball, so that it hides nothing.
    let eye = Vec3::new(0.0, 1.2, 0.0);
    let mut view = look(name, eye, Vec3::ZERO, size);
    view.frustum = Frustum::symmetric(2.2, 1.0, 0.1);
    let picture = Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(view.clone()) };
    let shot = shoot(&scene, &picture);
    assert_eq!(shot.problems, Vec::<String>::new());
    let world_from_clip = (view.frustum.clip_from_view() * view.view_from_world).inverse();
    let (mut right, mut counted, mut dark) = (0, 0, 0);
    for i in 0..size[0] * size[1] {
        let (x, y) = (i % size[0], i / size[0]);
        let ndc = [(x as f32 + 0.5) / 100.0 - 1.0, 1.0 - (y as f32 + 0.5) / 100.0];
        let ray = (world_from_clip * glam::Vec4::new(ndc[0], ndc[1], 0.0, 1.0)).truncate();
        let p = eye - ray * (eye.y / ray.y);
        let depth = depth_in_shadow(&light, p);
        if ray.y >= 0.0 || p.x.abs().max(p.z.abs()) > 5.9 || depth.abs() < margin {
            continue;
        }
        counted += 1;
        dark += u32::from(depth > 0.0);
        right += u32::from((shot.pixel(x, y)[0] < 128) == (depth > 0.0));
    }
    (right as f32 / counted as f32, dark)
}

const FILTERS: [MapFilter; 6] =
    [MapFilter::None, MapFilter::Hardware, MapFilter::Pcf4, MapFilter::Pcf16, MapFilter::Poisson, MapFilter::Pcss];

#[test]
fn a_ball_throws_the_shadow_that_geometry_says() {
    let slanted = Vec3::new(0.3, -1.0, -0.2).normalize();
    let position = Vec3::new(0.8, 5.0, -0.6);
    let lamp = |kind| Light { kind, position, direction: (CENTRE - position).normalize(), ..noon() };
    let cone = |outer_rad| LightKind::Spot { inner_rad: 0.1, outer_rad };
    let lights = [
        ("directional", Light { direction: slanted, ..noon() }),
        ("straight down", noon()),
        ("spot", lamp(cone(0.6))),
        ("wide spot", lamp(cone(1.4))),
        ("point", lamp(LightKind::Point)),
    ];
    for (name, light) in lights {
        for filter in FILTERS {
            let map = MapSettings { size: 1024, filter, ..Default::default() };
            let light = Light { shadows: ShadowMethod::Map, map, ..light.clone() };
            let (share, dark) = agreement("ball_map", light, 0.02);
            assert!(share > 0.9995 && dark > 1000, "{name} {filter:?}: {share} of the floor is right, {dark} in shadow");
        }
        let (share, dark) = agreement("ball_volume", Light { shadows: ShadowMethod::Volume, ..light }, 0.02);
        assert!(share == 1.0 && dark > 1000, "{name} volume: {share} of the floor is right, {dark} in shadow");
    }
}

#[test]
fn settings_by_hand_are_obeyed() {
    let light = |map: MapSettings| {
        let position = Vec3::new(0.0, 6.0, 0.0);
        let spot = LightKind::Spot { inner_rad: 0.1, outer_rad: 0.8 };
        let base = Light { kind: spot, position, direction: Vec3::NEG_Y, shadows: ShadowMethod::Map, map, ..noon() };
        shoot(
            &ball_over_floor(base),
            &Picture {
                kind: PictureKind::LightVisibility(0),
                ..Picture::mono(View {
                    frustum: Frustum::symmetric(1.2, 1.0, 0.1),
                    ..look("by_hand", Vec3::new(0.0, 1.2, 0.0), Vec3::ZERO, [64, 64])
                })
            },
        )
        .centre()[0]
    };
    let map = MapSettings { size: 512, ..Default::default() };
    for (name, map, expected) in [
        ("fitted", map, 0),
        ("bias of a millimetre", MapSettings { constant_bias: Some(0.001), ..map }, 0),
        ("bias of three metres", MapSettings { constant_bias: Some(3.0), ..map }, 255),
        ("near behind the ball", MapSettings { near_far: Some([5.0, 20.0]), ..map }, 255),
        ("far before the floor", MapSettings { near_far: Some([1.0, 5.0]), ..map }, 255),
        ("near and far around", MapSettings { near_far: Some([1.0, 20.0]), ..map }, 0),
        ("window beside", MapSettings { frustum: Some([0.2, 1.0, -0.5, 0.5]), ..map }, 255),
        ("window around", MapSettings { frustum: Some([-0.5, 0.5, -0.5, 0.5]), ..map }, 0),
    ] {
        assert_eq!(light(map), expected, "{name}");
    }
}

/// From below the ball to the floor, the middle of its shadow ahead.
fn look_down() -> Picture {
    let frustum = Frustum::symmetric(1.2, 1.0, 0.1);
    Picture::mono(View { frustum, ..look("share", Vec3::new(0.0, 1.2, 0.0), Vec3::ZERO, [64, 64]) })
}

#[test]
fn shadows_take_what_they_should() {
    let light = Light { shadows: ShadowMethod::Map, ..noon() };
    for (name, change, value) in [
        ("all", (|_| ()) as fn(&mut Scene), 0.0),
        ("half", |s| s.lights[0].shadow_intensity = 0.5, 0.25),
        ("switched off", |s| s.lights[0].shadows = ShadowMethod::None, 0.5),
        ("no caster", |s| s.drawables[1].casts_shadow = false, 0.5),
        ("no receiver", |s| s.drawables[0].receives_shadow = false, 0.5),
        (
            "no receiver of a volume",
            |s| {
                s.drawables[0].receives_shadow = false;
                s.lights[0].shadows = ShadowMethod::Volume;
            },
            0.5,
        ),
        (
            "no caster of a volume",
            |s| {
                s.drawables[1].casts_shadow = false;
                s.lights[0].shadows = ShadowMethod::Volume;
            },
            0.5,
        ),
        (
            "no receiver of a film",
            |s| {
                s.drawables[0].receives_shadow = false;
                s.lights[0].shadows = ShadowMethod::None;
                let mode = StencilMode::Modulative(Film::default());
                s.stencil_groups.push(StencilGroup { name: "film".into(), light: 0, casters: vec![1], mode });
            },
            0.5,
        ),
        ("light's own ambient", |s| s.lights[0].ambient_intensity = 0.2, 0.1),
    ] {
        let mut scene = ball_over_floor(light.clone());
        change(&mut scene);
        let shot = shoot(&scene, &look_down());
        assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
        assert_colour(shot.centre(), [value; 3], name);
    }
}

#[test]
fn stencil_groups_and_methods_work_together() {
    let light = Light { direction: Vec3::NEG_Y, ..noon() };
    let film = StencilMode::Modulative(Film { color: glam::Vec4::new(0.0, 0.0, 1.0, 0.25) });
    let group = |light, casters: Vec<usize>, mode| StencilGroup { name: "group".into(), light, casters, mode };
    let with = |method| Light { shadows: method, ..light.clone() };
    let side = Light { direction: Vec3::new(1.0, -1.0, 0.0).normalize(), ..light.clone() };
    let slanted = 0.5 * 0.5f32.sqrt();
    use ShadowMethod::{Map, None, Volume};
    type Row = (&'static str, Vec<Light>, Vec<StencilGroup>, [f32; 3]);
    let rows: Vec<Row> = vec![
        ("no shadow", vec![with(None)], vec![], [0.5; 3]),
        ("volume", vec![with(Volume)], vec![], [0.0; 3]),
        ("additive group", vec![with(None)], vec![group(0, vec![1], StencilMode::Additive)], [0.0; 3]),
        ("additive group without casters", vec![with(None)], vec![group(0, vec![], StencilMode::Additive)], [0.5; 3]),
        ("additive group of a mapped light", vec![with(Map)], vec![group(0, vec![1], StencilMode::Additive)], [0.0; 3]),
        ("film", vec![with(None)], vec![group(0, vec![1], film)], [0.375, 0.375, 0.625]),
        ("two films of a caster", vec![with(None)], vec![group(0, vec![1, 1], film)], [0.375, 0.375, 0.625]),
        ("film of a light with a map", vec![with(Map)], vec![group(0, vec![1], film)], [0.0; 3]),
        ("film of a light with volumes", vec![with(Volume)], vec![group(0, vec![1], film)], [0.0; 3]),
        ("volume and another light", vec![with(Volume), side.clone()], vec![], [slanted; 3]),
        ("map and volume", vec![with(Map), with(Volume)], vec![], [0.0; 3]),
        ("two volumes", vec![with(Volume), Light { shadows: Volume, ..side.clone() }], vec![], [slanted; 3]),
        ("film of one, volume of the other", vec![with(Volume), side], vec![group(1, vec![1], film)], [slanted; 3]),
    ];
    for (name, lights, stencil_groups, colour) in rows {
        let scene = Scene { lights, stencil_groups, ..ball_over_floor(light.clone()) };
        let shot = shoot(&scene, &look_down());
        // A film on top of another shadow of the same light would darken twice: it is left out, and told.
        let told = shot.problems.iter().filter(|p| p.contains("nothing is darkened twice")).count();
        assert_eq!((told, shot.problems.len()), if name.starts_with("film of a light with") { (1, 1) } else { (0, 0) }, "{name}");
        assert_colour(shot.centre(), colour, name);
    }
}

#[test]
fn maps_are_kept_while_light_and_casters_move_as_one() {
    let lamp = Vec3::new(0.8, 5.0, -0.6);
    let towards = (CENTRE - lamp).normalize();
    let spot = LightKind::Spot { inner_rad: 0.1, outer_rad: 0.6 };
    for kind in [LightKind::Directional, spot, LightKind::Point] {
        let map = MapSettings { size: 512, ..Default::default() };
        let light =
            Light { kind, position: lamp, direction: towards, shadows: ShadowMethod::Map, map, intensity: 20.0, ..noon() };
        let still = ball_over_floor(light);
        let picture = Picture::mono(look("kept", Vec3::new(3.0, 4.0, 6.0), Vec3::ZERO, [120, 90]));
        let moved = |m: Mat4| {
            let mut scene = still.clone();
            for d in &mut scene.drawables {
                *d = shape_of(&d.mesh, &d.material, m * d.world_from_object);
            }
            scene.lights[0].position = m.transform_point3(lamp);
            scene.lights[0].direction = m.transform_vector3(towards);
            scene
        };
        let turn = Mat4::from_translation(Vec3::new(0.3, 0.1, -0.2)) * Mat4::from_rotation_y(1.1);
        let mut one_slipped = moved(turn);
        let slipped = at(0.3, 0.0, 0.0) * one_slipped.drawables[1].world_from_object;
        one_slipped.drawables[1] = shape_of(&still.drawables[1].mesh, &still.drawables[1].material, slipped);
        let mut light_moved = moved(turn);
        light_moved.lights[0].position.x += 0.3;
        light_moved.lights[0].direction = (light_moved.lights[0].direction + Vec3::X * 0.1).normalize();
        let mut gone = light_moved.clone();
        gone.drawables[1].visible = false;
        let steps = [
            ("first", still.clone(), true),
            ("same", still.clone(), false),
            ("all turned", moved(turn), kind == LightKind::Directional),
            ("one slipped", one_slipped, true),
            ("light moved", light_moved, true),
            ("caster gone", gone.clone(), true),
            ("same again", gone, false),
        ];
        let (turn_of_test, gpu) = gpu();
        let mut renderer = umbriel_render::Renderer::new(gpu).unwrap();
        let mut pictures = Vec::new();
        for (name, scene, is_redrawn) in steps {
            let stats = renderer.render(&scene, std::slice::from_ref(&picture)).unwrap();
            // A directional light's maps follow the views, so a turned world may need others.
            let may_be_either = name == "all turned" && kind == LightKind::Directional;
            assert!(may_be_either || (stats.map_redraws > 0) == is_redrawn, "{kind:?}, {name}: {stats:?}");
            pictures.push((name, scene, renderer.read_back(0).unwrap()));
        }
        drop(turn_of_test);
        for (name, scene, layers) in pictures {
            let fresh = shoot(&scene, &picture);
            let differ = fresh.layers[0].rgba.iter().zip(&layers[0].rgba).filter(|(a, b)| a.abs_diff(**b) > 40).count();
            assert!(differ < 100, "{kind:?}, {name}: {differ} bytes differ from a picture with fresh maps");
        }
    }
}

/// Bottoms in the plane of the floor, which the eye sees through walls that have no back: what the light reaches past a missing
/// side is lit, in one piece.
#[test]
fn what_lies_in_the_plane_of_a_face_is_on_its_lit_side() {
    let without = |face: usize| {
        let mut mesh = cuboid(Vec3::new(2.2, 1.0, 1.3));
        mesh.indices = (0..36).filter(|i| i / 6 != face).map(|i| mesh.indices[i]).collect();
        mesh
    };
    let lights = [
        Light { direction: Vec3::new(-0.5, -1.0, -0.35).normalize(), ..noon() },
        Light { kind: LightKind::Point, position: Vec3::new(1.9, 1.3, 0.8), ..noon() },
    ];
    let eyes = [[2.5, 1.4, 0.3], [0.3, 3.0, -0.2], [-2.2, 1.1, 1.7], [0.4, 0.5, 3.5], [1.3, 0.3, -2.6]].map(Vec3::from);
    for (name, open) in [("open at a side", 1), ("open at the top", 3)] {
        let floor = shape(plane(12.0), matt(0.5, 0.5, 0.5), Mat4::from_rotation_y(0.3));
        let stall = shape(without(open), matt(0.5, 0.5, 0.5), at(0.0, 0.5, 0.0) * Mat4::from_rotation_y(0.2));
        let drawables = vec![floor, stall];
        for (light, eye) in lights.iter().flat_map(|light| eyes.map(|eye| (light, eye))) {
            let light = Light { shadows: ShadowMethod::Volume, ..light.clone() };
            let scene = Scene { drawables: drawables.clone().into(), lights: vec![light], ..Default::default() };
            let view = look("plane_of_a_face", eye, Vec3::new(0.1, 0.0, 0.0), [160, 120]);
            let options = TraceOptions { sub_samples: 2, ..Default::default() };
            let truth = Tracer::new(&scene).visibility(&scene.lights[0], &view, &options, &|_| ()).unwrap();
            let shot = shoot(&scene, &Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(view) });
            let visibility: Vec<u8> = shot.layers[0].rgba.chunks_exact(4).map(|p| p[0]).collect();
            let score = score(&truth, &visibility).unwrap();
            assert!(score.disagreement <= 0.0002, "{name}, from {eye}: {:.3} %", score.disagreement * 100.0);
        }
    }
}
