//! When shadow maps are drawn anew, who gets how many texels, and what is outside of them.

use crate::support::*;
use glam::{Mat4, Vec3};
use umbriel_render::{FrameStats, Renderer};
use umbriel_scene::*;

fn lamp(position: Vec3, kind: LightKind, size: u32) -> Light {
    let map = MapSettings { size, ..Default::default() };
    Light { kind, position, direction: Vec3::NEG_Y, shadows: ShadowMethod::Map, map, intensity: 60.0, ..noon() }
}

fn cone() -> LightKind {
    LightKind::Spot { inner_rad: 0.3, outer_rad: 0.4 }
}

/// A floor and balls of half a metre over it.
fn balls(places: &[[f32; 3]], lights: Vec<Light>) -> Scene {
    let mut drawables = vec![shape(plane(60.0), matt(0.6, 0.6, 0.6), Mat4::IDENTITY)];
    let (mesh, material) = (ball(16).into(), matt(0.8, 0.3, 0.2).into());
    let at = |p: &[f32; 3]| Mat4::from_translation(Vec3::from(*p)) * Mat4::from_scale(Vec3::splat(0.5));
    drawables.extend(places.iter().map(|p| shape_of(&mesh, &material, at(p))));
    Scene { drawables: drawables.into(), lights, ..Default::default() }
}

fn move_shape(scene: &mut Scene, index: usize, by: Vec3) {
    let old = scene.drawables[index].clone();
    scene.drawables[index] = shape_of(&old.mesh, &old.material, Mat4::from_translation(by) * old.world_from_object);
}

fn overview() -> Picture {
    Picture::mono(look("maps", Vec3::new(0.0, 9.0, 18.0), Vec3::ZERO, [80, 60]))
}

/// Draws frames with one renderer; what each cost.
fn frames(scenes: &[Scene], pictures: &[Picture]) -> Vec<FrameStats> {
    let (_turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    scenes.iter().map(|scene| renderer.render(scene, pictures).unwrap()).collect()
}

#[test]
fn rules_say_when_maps_are_drawn() {
    use MapUpdate::{Always, Auto, Never, Next};
    let light = lamp(Vec3::new(0.0, 6.0, 0.0), cone(), 128);
    let still = balls(&[[0.0, 1.0, 0.0]], vec![light]);
    let with = |update, moved: f32| {
        let mut scene = still.clone();
        move_shape(&mut scene, 1, Vec3::X * moved);
        scene.lights[0].map.update = update;
        scene
    };
    // Rule and place of the ball, frame by frame; redraws of each.
    for (name, steps, expected) in [
        ("automatic", [(Auto, 0.0), (Auto, 0.0), (Auto, 0.1), (Auto, 0.1)], [1, 0, 1, 0]),
        ("always", [(Always, 0.0), (Always, 0.0), (Always, 0.1), (Always, 0.1)], [1, 1, 1, 1]),
        ("never, but there has to be one", [(Never, 0.0), (Never, 0.0), (Never, 0.1), (Never, 0.2)], [1, 0, 0, 0]),
        ("once", [(Auto, 0.0), (Never, 0.1), (Next, 0.1), (Never, 0.2)], [1, 0, 1, 0]),
        ("automatic again", [(Auto, 0.0), (Never, 0.1), (Auto, 0.1), (Auto, 0.1)], [1, 0, 1, 0]),
    ] {
        let scenes = steps.map(|(update, moved)| with(update, moved));
        let redraws: Vec<u32> = frames(&scenes, &[overview()]).iter().map(|s| s.map_redraws).collect();
        assert_eq!(redraws, expected, "{name}");
    }
}

#[test]
fn a_frozen_map_shows_what_was() {
    let light = Light { direction: Vec3::NEG_Y, ..lamp(Vec3::new(0.0, 6.0, 0.0), cone(), 256) };
    let mut scene = balls(&[[0.0, 1.0, 0.0]], vec![light]);
    // Past the ball to the middle of its shadow.
    let eye = Vec3::new(0.0, 0.45, 0.05);
    let picture = Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(look("frozen", eye, Vec3::ZERO, [32, 32])) };
    let (_turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    for (update, expected) in [(MapUpdate::Auto, 0), (MapUpdate::Never, 0), (MapUpdate::Next, 255), (MapUpdate::Never, 255)] {
        scene.lights[0].map.update = update;
        renderer.render(&scene, std::slice::from_ref(&picture)).unwrap();
        assert_eq!(renderer.read_back(0).unwrap()[0].pixel(16, 16)[0], expected, "{update:?}");
        if update == MapUpdate::Auto {
            move_shape(&mut scene, 1, Vec3::X * 3.0);
        }
    }
}

#[test]
fn a_caster_costs_only_the_maps_that_it_reaches() {
    let lights = vec![
        lamp(Vec3::new(-8.0, 5.0, 0.0), cone(), 128),
        lamp(Vec3::new(8.0, 5.0, 0.0), cone(), 128),
        lamp(Vec3::new(0.0, 2.0, 0.0), LightKind::Point, 128),
    ];
    // Balls under the first, under the second, and on the +z side of the third.
    let still = balls(&[[-8.0, 1.0, 0.0], [8.0, 1.0, 0.0], [0.0, 2.0, 6.0]], lights);
    let turn = Mat4::from_rotation_y(0.4) * Mat4::from_translation(Vec3::new(0.2, 0.0, 0.1));
    let turned = |mut scene: Scene| {
        for d in &mut scene.drawables {
            *d = Drawable { visible: d.visible, ..shape_of(&d.mesh, &d.material, turn * d.world_from_object) };
        }
        for l in &mut scene.lights {
            l.position = turn.transform_point3(l.position);
            l.direction = turn.transform_vector3(l.direction);
        }
        scene
    };
    let moved = |scene: &Scene, index: usize| {
        let mut scene = scene.clone();
        move_shape(&mut scene, index, Vec3::Y * 0.2);
        scene
    };
    let first = moved(&still, 1);
    let third = moved(&first, 3);
    let mut light = third.clone();
    light.lights[1].position.x += 0.1;
    let mut gone = light.clone();
    gone.drawables[2].visible = false;
    let around = turned(gone.clone());
    let strayed = moved(&around, 3);
    // The redrawn maps of each light.
    let steps = [
        ("all are new", still, [1, 1, 6]),
        // The floor is in reach of the lamp's sides too, but it did not move.
        ("the first ball", first, [1, 0, 1]),
        ("the third ball", third, [0, 0, 1]),
        ("the second light", light, [0, 1, 0]),
        ("the second ball left", gone, [0, 1, 1]),
        ("all turned", around, [0, 0, 0]),
        ("the third ball after all turned", strayed, [0, 0, 1]),
    ];
    let scenes: Vec<Scene> = steps.iter().map(|s| s.1.clone()).collect();
    for ((name, _, expected), stats) in steps.iter().zip(frames(&scenes, &[overview()])) {
        let redrawn: Vec<u32> = stats.map_shares.iter().map(|s| s.redrawn).collect();
        assert_eq!(redrawn, expected, "{name}");
        assert_eq!(stats.map_redraws, redrawn.iter().sum::<u32>(), "{name}");
    }
}

#[test]
fn maps_do_not_depend_on_the_number_of_views() {
    let sun = Light { direction: Vec3::new(0.3, -1.0, -0.2).normalize(), ..lamp(Vec3::ZERO, LightKind::Directional, 256) };
    let scene = balls(&[[-2.0, 1.0, 0.0], [2.0, 1.0, 0.0]], vec![sun]);
    let mut costs = Vec::new();
    for views in [1, 7, 14] {
        let picture = |i: u32| {
            let eye = Vec3::new(0.0, 3.0, 9.0) + Vec3::X * 0.065 * i as f32;
            Picture::mono(look(&format!("view_{i}"), eye, Vec3::ZERO, [32, 24]))
        };
        let pictures: Vec<Picture> = (0..views).map(picture).collect();
        let stats = frames(&[scene.clone(), scene.clone()], &pictures);
        assert_eq!(stats[1].map_redraws, 0, "{views} views of a world that stands still");
        costs.push((stats[0].map_redraws, stats[0].map_draws));
    }
    assert!(costs[0].0 > 0 && costs.iter().all(|c| c.0 == costs[0].0 && c.1 <= costs[0].1), "{costs:?}");
}

#[test]
fn many_lights_share_the_memory() {
    let light = |i: i32| lamp(Vec3::new(4.0 * (i % 8) as f32 - 14.0, 3.0, -4.0 * (i / 8) as f32), cone(), 512);
    let lights: Vec<Light> = (0..64).map(|i| Light { intensity: 2.0, ..light(i) }).collect();
    let places: Vec<[f32; 3]> = lights.iter().map(|l| [l.position.x, 1.0, l.position.z]).collect();
    let scene = Scene { map_memory_bytes: 8 << 20, ..balls(&places, lights) };
    let (_turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    let mut redraws = Vec::new();
    for step in 0..8 {
        // A head that trembles by a centimetre.
        let eye = Vec3::new(0.01 * (step % 2) as f32, 1.7, 4.0);
        let picture = Picture::mono(look("many_lights", eye, Vec3::new(0.0, 1.0, -4.0), [160, 120]));
        let stats = renderer.render(&scene, &[picture]).unwrap();
        let bytes: u64 = stats.map_shares.iter().map(|s| u64::from(s.maps) * 4 * u64::from(s.side) * u64::from(s.side)).sum();
        assert_eq!(stats.map_shares.len(), 64);
        assert!(bytes <= scene.map_memory_bytes && bytes * 4 > scene.map_memory_bytes, "{bytes} bytes");
        let [near, far] = [3, 59].map(|i| stats.map_shares[i].side);
        assert!(near > far, "{near} texels for a near light, {far} for a far one");
        redraws.push(stats.map_redraws);
    }
    keep("many_lights", &renderer.read_back(0).unwrap());
    assert_eq!(redraws, [64, 0, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn a_map_of_another_size_leaves_the_others_alone() {
    let lights = (0..4).map(|i| lamp(Vec3::new(4.0 * i as f32 - 6.0, 5.0, 0.0), cone(), 1)).collect();
    let still = balls(&[[0.0, 1.0, 0.0]], lights);
    let with = |sizes: [u32; 4]| {
        let mut scene = still.clone();
        scene.lights.iter_mut().zip(sizes).for_each(|(light, size)| light.map.size = size);
        scene
    };
    // Sizes, and which maps are drawn.
    let steps = [
        ("all are new", [256, 64, 64, 64], [1, 1, 1, 1]),
        ("the second grows", [256, 128, 64, 64], [0, 1, 0, 0]),
        ("the third shrinks", [256, 128, 16, 64], [0, 0, 1, 0]),
        ("two change", [256, 64, 100, 64], [0, 1, 1, 0]),
        ("the first shrinks", [200, 64, 100, 64], [1, 0, 0, 0]),
        ("the first is small", [32, 32, 32, 32], [1, 1, 1, 1]),
    ];
    let scenes: Vec<Scene> = steps.iter().map(|s| with(s.1)).collect();
    for ((name, _, expected), stats) in steps.iter().zip(frames(&scenes, &[overview()])) {
        let redrawn: Vec<u32> = stats.map_shares.iter().map(|s| s.redrawn).collect();
        assert_eq!(redrawn, expected, "{name}");
    }
}

/// The kind of a light may change while its map is frozen: six maps of a lamp are no map of the sun.
#[test]
fn a_frozen_map_of_another_kind_of_light_is_drawn() {
    let kinds = [LightKind::Point, LightKind::Directional, cone(), LightKind::Point];
    let still = balls(&[[0.0, 1.0, 0.0]], vec![lamp(Vec3::new(0.0, 6.0, 0.0), LightKind::Point, 64)]);
    let scene = |kind| {
        let mut scene = still.clone();
        (scene.lights[0].kind, scene.lights[0].map.update) = (kind, MapUpdate::Never);
        scene
    };
    let stats = frames(&kinds.map(scene), &[overview()]);
    assert!(stats.iter().all(|s| s.map_redraws > 0 && s.map_redraws == s.map_shares[0].maps), "{stats:?}");
}

#[test]
fn outside_of_a_frustum_by_hand_is_as_chosen() {
    let map = MapSettings { size: 128, frustum: Some([-1.0, 1.0, -1.0, 1.0]), ..Default::default() };
    let sun = Light { map, shadows: ShadowMethod::Map, ..noon() };
    let view = look("outside", Vec3::new(4.0, 3.0, 0.1), Vec3::new(4.0, 0.0, 0.0), [16, 16]);
    for (outside_in_shadow, frustum, expected) in
        [(false, map.frustum, 255), (true, map.frustum, 0), (true, Some([-9.0, 9.0, -9.0, 9.0]), 255), (true, None, 255)]
    {
        let mut scene = balls(&[[0.0, 1.0, 0.0]], vec![sun.clone()]);
        scene.lights[0].map = MapSettings { outside_in_shadow, frustum, ..map };
        let picture = Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(view.clone()) };
        assert_eq!(shoot(&scene, &picture).centre()[0], expected, "{outside_in_shadow} {frustum:?}");
    }
}
