//! Shadows on shapes that list lights, maps as textures, several textures, and what is projected (003).

use crate::support::*;
use glam::{Mat4, Vec3, Vec4};
use std::sync::Arc;
use umbriel_scene::*;

/// A floor of a material, and a ball that hovers over its middle.
fn ball_over(floor: Material, lights: Vec<Light>) -> Scene {
    let ball = shape(ball(48), matt(0.8, 0.3, 0.2), at(0.0, 2.0, 0.0) * Mat4::from_scale(Vec3::splat(0.7)));
    Scene { drawables: vec![shape(plane(12.0), floor, Mat4::IDENTITY), ball].into(), lights, ..Default::default() }
}

/// From below the ball to the floor: its shadow in the middle, light in the corners.
fn look_down() -> Picture {
    let frustum = Frustum::symmetric(1.8, 1.0, 0.1);
    Picture::mono(View { frustum, ..look("projection", Vec3::new(0.0, 1.2, 0.0), Vec3::ZERO, [64, 64]) })
}

fn unlit(rgba: [f32; 4]) -> Material {
    Material { shading: Shading::Unlit, base_color: Vec4::from_array(rgba), ..Default::default() }
}

#[test]
fn a_shape_may_say_which_shadows_fall_on_it() {
    let mut shooter = Shooter::new();
    use ShadowMethod::{Map, None as Nothing, Volume};
    let own = |shadows| Light { shadows, ambient_intensity: 0.2, ..noon() };
    // Method, the floor's list, the middle, the corner; the floor reflects a half, ambient light is a fifth of the light's.
    type Row = (&'static str, ShadowMethod, Option<Vec<usize>>, f32, f32);
    let rows: [Row; 9] = [
        ("no list, map", Map, None, 0.1, 0.6),
        ("no list, volume", Volume, None, 0.1, 0.6),
        ("no list, none", Nothing, None, 0.6, 0.6),
        ("listed, map", Map, Some(vec![0]), 0.0, 0.6),
        ("listed, volume", Volume, Some(vec![0]), 0.0, 0.6),
        ("listed, does not cast else", Nothing, Some(vec![0]), 0.0, 0.6),
        ("another is listed, map", Map, Some(vec![1]), 0.6, 0.6),
        ("another is listed, volume", Volume, Some(vec![1]), 0.6, 0.6),
        ("none of the listed is there", Map, Some(vec![]), 0.6, 0.6),
    ];
    for (name, method, list, middle, corner) in rows {
        // The other one gives no light.
        let other = Light { intensity: 0.0, ..own(method) };
        let mut scene = ball_over(matt(0.5, 0.5, 0.5), vec![own(method), other]);
        scene.lights[1].ambient_intensity = 0.0;
        scene.drawables[0].receives = list.as_ref().map(|_| 1);
        scene.receive_lists = vec![vec![1], list.unwrap_or_default()];
        let shot = shooter.shoot(&scene, &look_down());
        assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
        assert_colour(shot.centre(), [middle; 3], name);
        assert_colour(shot.pixel(2, 2), [corner; 3], name);
    }
}

/// A lamp 6 m above the floor that only draws its map.
fn dark_lamp(map: MapSettings) -> Light {
    let kind = LightKind::Spot { inner_rad: 0.1, outer_rad: 0.8 };
    let position = Vec3::new(0.0, 6.0, 0.0);
    Light { kind, position, direction: Vec3::NEG_Y, shines: false, shadows: ShadowMethod::Map, map, ..noon() }
}

fn map_layer(compare: MapCompare, coordinates: Coordinates) -> Layer {
    let source = LayerSource::ShadowMap { texture: 0, compare };
    Layer { source, coordinates, mode: LayerMode::Modulate, factor: Vec4::ONE }
}

#[test]
fn a_map_is_a_texture() {
    let mut shooter = Shooter::new();
    let map = MapSettings { size: 256, near_far: Some([1.0, 11.0]), ..Default::default() };
    let sun = Light { kind: LightKind::Directional, ..dark_lamp(MapSettings { near_far: None, ..map }) };
    let by_hand = MapSettings { frustum: Some([-6.0, 6.0, -6.0, 6.0]), ..map };
    let hand_set_sun = Light { kind: LightKind::Directional, ..dark_lamp(by_hand) };
    let point = Light { kind: LightKind::Point, ..dark_lamp(map) };
    // The ball's top is 3.3 m below the lamp, the floor 6 m: of 1 m to 11 m.
    let (ball, floor) = (0.23, 0.5);
    use MapCompare::{GreaterEqual, LessEqual, None as Depth};
    for (name, light, compare, middle, corner) in [
        ("spot, lit", dark_lamp(map), LessEqual, 0.0, 1.0),
        ("spot, shadowed", dark_lamp(map), GreaterEqual, 1.0, 0.0),
        ("spot, depth", dark_lamp(map), Depth, ball, floor),
        ("sun, lit", sun.clone(), LessEqual, 0.0, 1.0),
        ("sun, shadowed", sun, GreaterEqual, 1.0, 0.0),
        ("sun by hand, depth", hand_set_sun, Depth, ball, floor),
        ("point, lit", point.clone(), LessEqual, 0.0, 1.0),
        ("point, depth", point, Depth, ball, floor),
    ] {
        let coordinates = Coordinates::Projected(0);
        let material = Material { layers: vec![map_layer(compare, coordinates)], ..unlit([1.0; 4]) };
        let mut scene = ball_over(material, vec![light]);
        // A light into all directions needs no projector, and has none.
        scene.projectors = vec![Some(Projector::Light(0))];
        if scene.lights[0].kind == LightKind::Point {
            let layer = map_layer(compare, Coordinates::Mesh);
            scene.drawables[0].material = Arc::new(Material { layers: vec![layer], ..unlit([1.0; 4]) });
        }
        scene.shadow_textures = vec![Some(0)];
        let shot = shooter.shoot(&scene, &look_down());
        assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
        let near = |pixel: [u8; 4], linear: f32| (i32::from(pixel[0]) - srgb(linear)).abs() <= 4;
        assert!(near(shot.centre(), middle), "{name}: {:?} where {} is right", shot.centre(), srgb(middle));
        assert!(near(shot.pixel(2, 2), corner), "{name}: {:?} where {} is right", shot.pixel(2, 2), srgb(corner));
    }
}

#[test]
fn a_light_that_does_not_shine_lights_nothing() {
    let mut scene = ball_over(matt(0.5, 0.5, 0.5), vec![dark_lamp(MapSettings::default())]);
    scene.lights[0].ambient_intensity = 1.0;
    scene.shadow_textures = vec![Some(0)];
    assert_colour(Shooter::new().shoot(&scene, &look_down()).pixel(2, 2), [0.0; 3], "dark");
}

#[test]
fn a_map_is_drawn_when_its_rule_says() {
    let mut shooter = Shooter::new();
    let map = |update, request| MapSettings { size: 256, update, request, ..Default::default() };
    let lamp = Light { shines: true, intensity: 200.0, ..dark_lamp(MapSettings::default()) };
    let still = ball_over(matt(0.5, 0.5, 0.5), vec![lamp]);
    use MapUpdate::{Always, Auto, Never};
    // Rule, how far the ball has moved, whether the map is drawn, whether the middle is dark.
    for (name, update, request, x, is_drawn, is_dark) in [
        ("never asked for: emptied once", Never, Some(0), 0.0, true, false),
        ("still not", Never, Some(0), 0.0, false, false),
        ("asked for", Never, Some(1), 0.0, true, true),
        ("the ball has gone, its shadow stays", Never, Some(1), 3.0, false, true),
        ("asked for again", Never, Some(2), 3.0, true, false),
        ("always", Always, Some(2), 0.0, true, true),
        ("always, though nothing changed", Always, Some(2), 0.0, true, true),
        ("automatic, nothing changed", Auto, Some(2), 0.0, false, true),
        ("automatic", Auto, Some(2), 3.0, true, false),
        ("kept as it is", Never, Some(2), 0.0, false, false),
        ("the light's own", Auto, None, 0.0, true, true),
        ("one in its place, never asked for", Never, Some(0), 0.0, true, false),
        ("asked for at last", Never, Some(1), 0.0, true, true),
    ] {
        let mut scene = still.clone();
        scene.lights[0].map = map(update, request);
        let moved = at(x, 0.0, 0.0) * scene.drawables[1].world_from_object;
        scene.drawables[1] = shape_of(&scene.drawables[1].mesh, &scene.drawables[1].material, moved);
        let shot = shooter.shoot(&scene, &look_down());
        assert_eq!(shot.stats.map_redraws, u32::from(is_drawn), "{name}");
        assert_eq!(shot.centre()[0] < 10, is_dark, "{name}: {:?}", shot.centre());
    }
}

#[test]
fn a_map_that_is_kept_goes_along_with_its_light() {
    let mut shooter = Shooter::new();
    let map = MapSettings { size: 256, update: MapUpdate::Never, request: Some(1), ..Default::default() };
    for (name, x, left_is_dark) in [("here", 0.0, false), ("there", -0.6, true)] {
        let mut light = Light { shines: true, intensity: 200.0, ..dark_lamp(map) };
        light.position.x = x;
        let scene = ball_over(matt(0.5, 0.5, 0.5), vec![light]);
        let shot = shooter.shoot(&scene, &look_down());
        assert_eq!(shot.pixel(2, 32)[0] < 10, left_is_dark, "{name}: {:?}", shot.pixel(2, 32));
    }
}

#[test]
fn outside_of_a_rectangle_is_dark_by_choice() {
    let mut shooter = Shooter::new();
    for (outside_in_shadow, corner) in [(false, 0.5), (true, 0.0)] {
        let map = MapSettings { size: 256, frustum: Some([-0.3, 0.3, -0.3, 0.3]), outside_in_shadow, ..Default::default() };
        let light = Light { shadows: ShadowMethod::Map, map, ..noon() };
        let mut scene = ball_over(matt(0.5, 0.5, 0.5), vec![light]);
        scene.drawables.truncate(1);
        let shot = shooter.shoot(&scene, &look_down());
        assert_colour(shot.centre(), [0.5; 3], "inside");
        assert_colour(shot.pixel(2, 2), [corner; 3], "outside");
    }
}

/// A texture of these texels, two across.
fn texels(rgba: &[[u8; 4]], wrap: Wrap) -> TextureRef {
    let height = (rgba.len() as u32).div_ceil(2);
    let image = Arc::new(Image { width: rgba.len() as u32 / height, height, rgba: rgba.concat().into() });
    let sampler = Sampler { filter: Filter::Nearest, mip_maps: false, wrap_u: wrap, wrap_v: wrap };
    TextureRef { image, sampler, uv_set: 0, uv_from_mesh: Default::default() }
}

fn picture(texture: TextureRef, border: bool, coordinates: Coordinates, mode: LayerMode) -> Layer {
    let source = LayerSource::Picture { texture, border: [border; 2] };
    Layer { source, coordinates, mode, factor: Vec4::splat(0.25) }
}

#[test]
fn every_mode_is_its_formula() {
    let mut shooter = Shooter::new();
    let (t, c) = (Vec4::new(0.2140, 1.0, 0.0, 128.0 / 255.0), Vec4::new(0.4, 0.3, 0.6, 0.75));
    let texture = texels(&[[127, 255, 0, 128]], Wrap::Repeat);
    let mixed = |share: f32| c + (t - c) * share;
    let half = Vec4::splat(0.5);
    for mode in LayerMode::ALL {
        let expected = match mode {
            LayerMode::Modulate => t * c,
            LayerMode::Modulate2x => 2.0 * t * c,
            LayerMode::Modulate4x => 4.0 * t * c,
            LayerMode::Replace => t,
            LayerMode::Add => t + c,
            LayerMode::AddSigned => t + c - half,
            LayerMode::AddSigned2x => 2.0 * (t + c - half),
            LayerMode::Subtract => t - c,
            LayerMode::AddSmooth => t + c - t * c,
            LayerMode::BlendDiffuseAlpha | LayerMode::BlendCurrentAlpha => mixed(c.w),
            LayerMode::BlendTextureAlpha => mixed(t.w),
            LayerMode::BlendFactorAlpha => mixed(0.25),
            LayerMode::Off => c,
        };
        let layers = vec![picture(texture.clone(), false, Coordinates::Mesh, mode)];
        let scene = ball_over(Material { layers, ..unlit(c.to_array()) }, vec![]);
        let [r, g, b, _] = expected.max(Vec4::ZERO).to_array();
        assert_colour(shooter.shoot(&scene, &look_down()).centre(), [r, g, b], &format!("{mode:?}"));
    }
    // One after the other: (T + C) T.
    let layers = [LayerMode::Add, LayerMode::Modulate].map(|mode| picture(texture.clone(), false, Coordinates::Mesh, mode));
    let scene = ball_over(Material { layers: layers.into(), ..unlit(c.to_array()) }, vec![]);
    let [r, g, b, _] = ((t + c) * t).to_array();
    assert_colour(shooter.shoot(&scene, &look_down()).centre(), [r, g, b], "two layers");
}

#[test]
fn a_picture_falls_where_it_is_projected() {
    let mut shooter = Shooter::new();
    let (red, green, blue, white) = ([255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]);
    let slide = |wrap| texels(&[red, green, blue, white].map(|[r, g, b]: [u8; 3]| [r, g, b, 255]), wrap);
    let kind = LightKind::Spot { inner_rad: 0.1, outer_rad: 45f32.to_radians() };
    let position = Vec3::new(0.0, 4.0, 0.0);
    let spot = Light { kind, position, direction: Vec3::NEG_Y, up: Some(Vec3::NEG_Z), shines: false, ..noon() };
    let map = MapSettings { frustum: Some([-4.0, 4.0, -4.0, 4.0]), ..Default::default() };
    let sun = Light { kind: LightKind::Directional, map, ..spot.clone() };
    let turned = Light { up: Some(Vec3::X), ..spot.clone() };
    let narrow = MapSettings { frustum: Some([-0.25, 0.25, -0.25, 0.25]), ..Default::default() };
    let narrow = Light { map: narrow, ..spot.clone() };
    let away = |light: &Light| Light { direction: Vec3::Y, ..light.clone() };
    let down = glam::camera::rh::view::look_at_mat4(position, Vec3::ZERO, Vec3::NEG_Z).inverse();
    let viewpoint =
        |world_from_camera| Projector::Viewpoint { world_from_view: down, angle_rad: 90f32.to_radians(), world_from_camera };
    // Seen from 12 m: the slide ends 4 m from the middle, the view at 5 m. The colours of the upper left and upper right
    // quarter, and far left.
    let grey = [187; 3];
    let light = Projector::Light(0);
    for (name, source, light, border, expected) in [
        ("spot", light, spot.clone(), true, [red, green, grey]),
        ("spot, again and again", light, spot.clone(), false, [red, green, green]),
        ("sun", light, sun.clone(), true, [red, green, grey]),
        ("another up", light, turned, true, [blue, red, grey]),
        ("a narrower angle", light, narrow, true, [grey; 3]),
        ("behind a spot", light, away(&spot), false, [grey; 3]),
        ("behind a sun", light, away(&sun), false, [grey; 3]),
        ("viewpoint", viewpoint(at(0.0, 99.0, 0.0)), spot.clone(), true, [red, green, grey]),
    ] {
        let (wrap, mode) = (if border { Wrap::Clamp } else { Wrap::Repeat }, LayerMode::Replace);
        let layers = vec![picture(slide(wrap), border, Coordinates::Projected(0), mode)];
        let mut scene = ball_over(Material { layers, ..unlit([0.5, 0.5, 0.5, 1.0]) }, vec![light]);
        scene.drawables.truncate(1);
        scene.projectors = vec![Some(source)];
        let shot = shooter.shoot(&scene, &Picture::mono(look("slide", Vec3::Y * 12.0, Vec3::ZERO, [100, 100])));
        assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
        for ((x, y), expected) in [(30, 30), (70, 30), (3, 30)].into_iter().zip(expected) {
            assert_bytes(&shot.pixel(x, y)[..3], &expected, name);
        }
    }
}

/// The same colour, whichever way a device rounds.
fn assert_bytes(found: &[u8], expected: &[u8], name: &str) {
    let is_near = found.iter().zip(expected).all(|(a, b)| a.abs_diff(*b) <= 1);
    assert!(is_near, "{name}: {found:?}, not {expected:?}");
}

#[test]
fn a_bound_viewpoint_projects_by_its_window() {
    let mut shooter = Shooter::new();
    let texture = texels(&[[255, 0, 0, 255], [0, 255, 0, 255]], Wrap::Clamp);
    let camera = glam::camera::rh::view::look_at_mat4(Vec3::Y * 4.0, Vec3::ZERO, Vec3::NEG_Z).inverse();
    let mut view = look("bound", Vec3::Y * 4.0, Vec3::ZERO, [128, 64]);
    view.frustum = Frustum::symmetric(1.0, 2.0, 0.1);
    for (name, world_from_camera, far_left) in
        [("bound", camera, [255, 0, 0]), ("not bound", at(0.0, 9.0, 0.0) * camera, [187; 3])]
    {
        let layers = vec![picture(texture.clone(), true, Coordinates::Projected(0), LayerMode::Replace)];
        let mut scene = ball_over(Material { layers, ..unlit([0.5, 0.5, 0.5, 1.0]) }, vec![]);
        scene.drawables.truncate(1);
        scene.projectors = vec![Some(Projector::Viewpoint { world_from_view: camera, angle_rad: 1.0, world_from_camera })];
        let shot = shooter.shoot(&scene, &Picture::mono(view.clone()));
        assert_bytes(&shot.pixel(2, 32)[..3], &far_left, name);
        assert_eq!([shot.pixel(60, 32)[0], shot.pixel(68, 32)[1]], [255, 255], "{name}");
    }
}
