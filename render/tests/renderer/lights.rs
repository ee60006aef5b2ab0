//! Colours of lit surfaces against closed forms.

use crate::support::*;
use glam::{Mat4, Vec3, Vec4};
use umbriel_scene::*;

fn floor_under(light: Light) -> Scene {
    Scene {
        drawables: vec![shape(plane(20.0), matt(0.5, 0.25, 0.125), Mat4::IDENTITY)].into(),
        lights: vec![light],
        ..Default::default()
    }
}

fn from_above(name: &str) -> Picture {
    Picture::mono(look(name, Vec3::new(0.0, 4.0, 0.0), Vec3::ZERO, [64, 64]))
}

#[test]
fn light_follows_its_law() {
    let albedo = Vec3::new(0.5, 0.25, 0.125);
    let slanted = Vec3::new(1.0, -1.0, 0.0).normalize();
    let lamp = |kind, range| Light {
        kind,
        position: Vec3::new(0.0, 2.0, 0.0),
        direction: Vec3::NEG_Y,
        intensity: 4.0 * std::f32::consts::PI,
        range,
        ..noon()
    };
    let cone = |inner_rad, outer_rad| LightKind::Spot { inner_rad, outer_rad };
    let rows = [
        ("noon", noon(), 1.0),
        ("slanted", Light { direction: slanted, ..noon() }, 0.5f32.sqrt()),
        ("from below", Light { direction: Vec3::Y, ..noon() }, 0.0),
        ("point", lamp(LightKind::Point, f32::INFINITY), 1.0),
        ("linear law", Light { attenuation: Vec3::Y, ..lamp(LightKind::Point, f32::INFINITY) }, 2.0),
        ("beyond range", lamp(LightKind::Point, 1.9), 0.0),
        ("fading to range", lamp(LightKind::Point, 4.0), 1.0 - 1.0 / 16.0),
        ("in the cone", lamp(cone(0.2, 0.4), f32::INFINITY), 1.0),
        ("beside the cone", Light { direction: Vec3::X, ..lamp(cone(0.2, 0.4), f32::INFINITY) }, 0.0),
    ];
    for (name, light, share) in rows {
        let shot = shoot(&floor_under(light), &from_above("light_law"));
        assert_colour(shot.centre(), (albedo * share).to_array(), name);
        assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
    }
}

#[test]
fn what_needs_no_light() {
    let mut scene = floor_under(Light { color: Vec3::ZERO, ..noon() });
    scene.ambient = Vec3::splat(0.3);
    let shot = shoot(&scene, &from_above("ambient"));
    assert_colour(shot.centre(), [0.15, 0.075, 0.0375], "ambient");
    scene.exposure = 2.0;
    assert_colour(shoot(&scene, &from_above("exposure")).centre(), [0.3, 0.15, 0.075], "exposure");
    scene.exposure = 1.0;
    let unlit = Material { shading: Shading::Unlit, base_color: Vec4::new(0.2, 0.4, 0.6, 1.0), ..Default::default() };
    scene.drawables = vec![shape(plane(20.0), unlit, Mat4::IDENTITY)].into();
    assert_colour(shoot(&scene, &from_above("unlit")).centre(), [0.2, 0.4, 0.6], "unlit");
    scene.drawables[0].material = Material { emissive: Vec3::new(0.1, 0.0, 0.0), ..matt(0.0, 0.0, 0.0) }.into();
    assert_colour(shoot(&scene, &from_above("emissive")).centre(), [0.1, 0.0, 0.0], "emissive");
}

#[test]
fn many_objects() {
    let mut scene =
        floor_under(Light { direction: Vec3::new(-0.5, -1.0, -0.4).normalize(), shadows: ShadowMethod::Map, ..noon() });
    scene.ambient = Vec3::splat(0.05);
    scene.background =
        Background { zenith: Vec3::new(0.1, 0.2, 0.6), horizon: Vec3::new(0.5, 0.6, 0.8), nadir: Vec3::splat(0.1) };
    scene.drawables.push(shape(
        ball(24),
        Material { base_color: Vec4::new(0.8, 0.2, 0.1, 1.0), ..Default::default() },
        at(0.0, 1.0, 0.0),
    ));
    scene.drawables.push(shape(cuboid(Vec3::ONE), matt(0.2, 0.6, 0.3), at(2.0, 0.5, 1.0)));
    let shot = shoot(&scene, &Picture::mono(look("objects", Vec3::new(4.0, 4.0, 8.0), Vec3::ZERO, [480, 360])));
    assert_eq!(shot.problems, Vec::<String>::new());
}
