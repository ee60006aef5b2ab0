//! Lights: by their place in the graph, and with settings that make no sense.

use super::{World, close3};
use glam::{Quat, Vec2, Vec3, Vec4, vec2, vec3, vec4};
use std::f32::consts::FRAC_PI_2;
use umbriel_fields::Value;
use umbriel_scene::{Light, LightKind, ShadowMethod};

#[test]
fn lights_stand_where_the_graph_places_them() {
    let mut w = World::new();
    let t = w.below(&[w.root()], "Transform", "");
    let lamp = w.below(&[t], "SpotLight", "lamp");
    w.set(lamp, "location", Vec3::Y);
    w.set(lamp, "radius", 10.0f32);
    w.set(lamp, "shadow_near_far", vec2(1.0, 4.0));
    w.set(lamp, "displace_offset", 0.01f32);
    w.set(t, "translation", vec3(5.0, 0.0, 0.0));
    w.set(t, "rotation", Quat::from_rotation_y(FRAC_PI_2));
    w.set(t, "scale", Vec3::splat(3.0));
    w.update();
    let light = w.light(lamp);
    assert!(close3(light.position, vec3(5.0, 3.0, 0.0)));
    assert!(close3(light.direction, Vec3::NEG_X));
    assert!((light.range - 30.0).abs() < 1e-3);
    assert_eq!(light.map.near_far.map(|d| d.map(f32::round)), Some([3.0, 12.0]));
    assert!((light.map.constant_bias.unwrap() - 0.03).abs() < 1e-5);
    // Moving the transform writes this light and nothing else.
    w.set(t, "translation", vec3(6.0, 0.0, 0.0));
    let stats = w.update();
    assert_eq!((stats.lights_changed, stats.drawables_changed, stats.rebuilt), (1, 0, false));
    assert!(close3(w.light(lamp).position, vec3(6.0, 3.0, 0.0)));
}

#[test]
fn lights_that_are_off_or_hidden_leave_the_list() {
    let mut w = World::new();
    let first = w.below(&[w.root()], "PointLight", "first");
    let switch = w.below(&[w.root()], "Switch", "");
    let second = w.below(&[switch], "PointLight", "second");
    w.set(switch, "which_choice", 0);
    w.update();
    type Row = (&'static str, Value, Option<usize>, Option<usize>);
    let rows: [Row; 4] = [
        ("on", true.into(), Some(0), Some(1)),
        ("on", false.into(), None, Some(0)),
        ("which_choice", (-1).into(), None, None),
        ("on", true.into(), Some(0), None),
    ];
    for (field, value, a, b) in rows {
        w.set(if field == "on" { first } else { switch }, field, value.clone());
        assert!(!w.update().rebuilt);
        assert_eq!((w.extractor.light_of(first), w.extractor.light_of(second)), (a, b), "{field} {value:?}");
        assert_eq!(w.scene.lights.len(), a.iter().chain(&b).count());
    }
}

#[test]
fn shadow_methods() {
    let rows: [(&[(&str, Value)], ShadowMethod); 6] = [
        (&[], ShadowMethod::None),
        (&[("shadows", "volume".into())], ShadowMethod::Volume),
        (&[("shadows", true.into())], ShadowMethod::Map),
        (&[("ShadowEnable", true.into())], ShadowMethod::Map),
        (&[("ShadowEnable", true.into()), ("shadows", "volume".into())], ShadowMethod::Volume),
        (&[("shadows", "map".into()), ("shadow_enable", false.into())], ShadowMethod::Map),
    ];
    for (fields, expected) in rows {
        let mut w = World::new();
        let light = w.below(&[w.root()], "SpotLight", "");
        for (field, value) in fields {
            w.set(light, field, value.clone());
        }
        w.update();
        assert_eq!(w.light(light).shadows, expected, "{fields:?}");
    }
}

#[test]
fn sizes_of_sources() {
    // Type, fields, size, softness, share that the shadow takes.
    type Row = (&'static str, &'static [(&'static str, fn() -> Value)], f32, bool, f32);
    let rows: [Row; 7] = [
        ("DirectionalLight", &[], Light::SUN_SIZE, false, 1.0),
        ("DirectionalLight", &[("soft", || true.into())], Light::SUN_SIZE, true, 1.0),
        ("DirectionalLight", &[("soft", || "range".into())], 0.1, true, 1.0),
        ("DirectionalLight", &[("soft", || "range".into()), ("soft_range", || 6.0f32.into())], 0.06, true, 1.0),
        ("DirectionalLight", &[("angular_diameter", || 0.2f32.into())], 0.1f32.tan(), false, 1.0),
        // The paper's greys are as they are shown: 128 of 255 is a good fifth of the light.
        ("PointLight", &[("light_radius", || 0.2f32.into()), ("shadow_brightness", || 128.0f32.into())], 0.6, false, 0.784),
        ("SpotLight", &[("shadow_intensity", || 0.5f32.into())], 0.15, false, 0.5),
    ];
    for (node_type, fields, size, soft, taken) in rows {
        let mut w = World::new();
        let t = w.below(&[w.root()], "Transform", "");
        w.set(t, "scale", Vec3::splat(3.0));
        let node = w.below(&[t], node_type, "");
        for (field, value) in fields {
            w.set(node, field, value());
        }
        w.update();
        let light = w.light(node);
        assert!((light.size - size).abs() < 1e-5, "{node_type} {}", light.size);
        assert_eq!(light.soft, soft, "{node_type}");
        assert!((light.shadow_intensity - taken).abs() < 1e-3, "{node_type} {}", light.shadow_intensity);
    }
}

#[test]
fn performers_light_source() {
    let rows = [
        (vec4(0.0, 2.0, 0.0, 0.0), vec2(0.0, 180.0), Vec3::ZERO, Vec3::NEG_Y, None),
        (vec4(1.0, 2.0, 3.0, 1.0), vec2(0.0, 30.0), vec3(1.0, 2.0, 3.0), Vec3::NEG_Z, Some((29.97, 30.0))),
        (vec4(2.0, 4.0, 6.0, 2.0), vec2(10.0, 45.0), vec3(1.0, 2.0, 3.0), Vec3::NEG_Z, Some((5.8, 45.0))),
    ];
    for (position, cone, place, direction, expected_deg) in rows {
        let mut w = World::new();
        let node = w.below(&[w.root()], "fpLightSource", "");
        w.set(node, "Position", position);
        w.set(node, "SpotCone", cone);
        w.update();
        let light = w.light(node);
        assert!(close3(light.position, place) && close3(light.direction, direction), "{position}");
        let found = match light.kind {
            LightKind::Spot { inner_rad, outer_rad } => Some((inner_rad.to_degrees(), outer_rad.to_degrees())),
            _ => None,
        };
        assert_eq!(found.is_some(), expected_deg.is_some());
        if let Some(((a, b), (c, d))) = found.zip(expected_deg) {
            assert!((a - c).abs() < 0.05 && (b - d).abs() < 0.05, "{a} {b} against {c} {d}");
        }
    }
}

#[test]
fn settings_that_make_no_sense_are_reported_and_fitted() {
    let nan = f32::NAN;
    let rows: [(&str, Value); 15] = [
        ("soft_range", (-1.0f32).into()),
        ("soft_range", nan.into()),
        ("light_radius", (-0.1f32).into()),
        ("shadow_size", 0.into()),
        ("shadow_size", (-5).into()),
        ("shadow_near_far", Vec2::new(10.0, 1.0).into()),
        ("shadow_near_far", Vec2::new(0.0, 5.0).into()),
        ("shadow_near_far", Vec2::new(nan, 5.0).into()),
        ("shadow_frustum", Vec4::new(1.0, 1.0, -1.0, 1.0).into()),
        ("shadow_frustum", Vec4::new(-1.0, 1.0, nan, 1.0).into()),
        ("displace_scale", nan.into()),
        ("intensity", (-1.0f32).into()),
        ("direction", Vec3::ZERO.into()),
        ("attenuation", Vec3::ZERO.into()),
        ("radius", nan.into()),
    ];
    for (field, value) in rows {
        let mut w = World::new();
        let light = w.below(&[w.root()], "SpotLight", "lamp");
        w.update();
        let usual = w.light(light).clone();
        w.set(light, field, value.clone());
        w.update();
        let problems = w.problems();
        assert_eq!(problems.len(), 1, "{field} {value:?}: {problems:?}");
        assert!(problems[0].starts_with(&format!("SpotLight 'lamp', {field}: ")), "{problems:?}");
        assert_eq!(*w.light(light), usual, "{field} {value:?}");
        w.set(light, "color", umbriel_fields::Color(Vec3::X));
        w.update();
        assert!(w.problems().is_empty(), "told once");
    }
}
