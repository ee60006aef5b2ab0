//! Every declared type, under every name, with its defaults.

use super::{World, close3};
use crate::nodes::{environment, new_graph, node_types};
use glam::{Mat4, Vec2, Vec3, Vec4, vec3};
use std::f32::consts::PI;
use umbriel_fields::Value;
use umbriel_scene::{
    AlphaMode, Background, LightKind, MapFilter, MapSettings, MapUpdate, Shading, ShadowMethod, Silhouettes, VolumeCounting,
    VolumeSettings,
};

#[test]
fn every_type_is_declared_well_and_found_by_all_its_names() {
    let mut graph = new_graph();
    for node_type in node_types() {
        let names = std::iter::once(&node_type.name).chain(&node_type.aliases);
        for name in names {
            let id = graph.create(name).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(graph.type_of(id).name, node_type.name);
            for field in &node_type.fields {
                assert!(!field.doc.is_empty(), "{name}.{} has no doc", field.name);
                for spelling in std::iter::once(&field.name).chain(&field.aliases) {
                    graph.field(id, spelling).unwrap_or_else(|e| panic!("{name}: {e}"));
                }
            }
        }
        assert!(!node_type.doc.is_empty(), "{} has no doc", node_type.name);
    }
}

#[test]
fn names_of_x3d_avango_and_the_papers_resolve() {
    let rows: [(&str, &str, Value); 30] = [
        ("fpDCS", "scaleOrientation", Value::Quat(glam::Quat::IDENTITY)),
        ("DCS", "Matrix", Value::Mat4(Mat4::IDENTITY)),
        ("Switch", "whichChoice", Value::I32(-1)),
        ("Shape", "castShadow", Value::Bool(true)),
        ("Appearance", "shadowCaster", Value::Bool(true)),
        ("Appearance", "alphaCutoff", Value::F32(0.5)),
        ("PhysicalMaterial", "baseColor", Value::Color(umbriel_fields::Color(Vec3::ONE))),
        ("PhysicalMaterial", "metallicRoughnessTexture", Value::Node(None)),
        ("Material", "ambientIntensity", Value::F32(0.2)),
        ("Material", "specularColor", Value::Color(umbriel_fields::Color(Vec3::ZERO))),
        ("UnlitMaterial", "emissiveColor", Value::Color(umbriel_fields::Color(Vec3::ONE))),
        ("Cone", "bottomRadius", Value::F32(1.0)),
        ("SpotLight", "cutOffAngle", Value::F32(0.785)),
        ("SpotLight", "SpotDir", Value::Vec3(Vec3::NEG_Z)),
        ("SpotLight", "Position", Value::Vec3(Vec3::ZERO)),
        ("PointLight", "ambientIntensity", Value::F32(0.0)),
        ("DirectionalLight", "shadowIntensity", Value::F32(1.0)),
        ("fpLightSource", "Position", Value::Vec4(Vec4::Z)),
        ("fpLightSource", "SpotDir", Value::Vec3(Vec3::NEG_Z)),
        ("fpLightSource", "SpotCone", Value::Vec2(Vec2::new(0.0, 180.0))),
        ("fpLightSource", "ShadowEnable", Value::Bool(false)),
        ("fpLightSource", "ShadowSize", Value::I32(2048)),
        ("fpLightSource", "ShadowFrustum", Value::Vec4(Vec4::ZERO)),
        ("fpLightSource", "ShadowNearFar", Value::Vec2(Vec2::ZERO)),
        ("fpLightSource", "ShadowDisplaceScale", Value::F32(-1.0)),
        ("fpStencilShadow", "ShadowQuad", Value::Node(None)),
        ("fpStencilShadow", "Caster", Value::Nodes([].into())),
        ("Viewpoint", "fieldOfView", Value::F32(PI / 4.0)),
        ("Fog", "visibilityRange", Value::F32(0.0)),
        ("User", "eyeDistance", Value::F32(0.064)),
    ];
    let mut graph = new_graph();
    for (type_name, field, expected) in rows {
        let id = graph.create(type_name).unwrap();
        assert_eq!(graph.value_named(id, field).unwrap(), expected, "{type_name}.{field}");
    }
}

#[test]
fn geometry_defaults() {
    let rows = [
        ("Box", 12, Vec3::ONE),
        ("Sphere", 48 * 23 * 2, Vec3::ONE),
        ("Cone", 96, Vec3::ONE),
        ("Cylinder", 192, Vec3::ONE),
        ("Plane", 2, vec3(1.0, 0.0, 1.0)),
    ];
    for (kind, triangles, corner) in rows {
        let mut w = World::new();
        let shape = w.below(&[w.root()], "Shape", "it");
        let geometry = w.node(kind, "");
        w.set(shape, "geometry", geometry);
        w.update();
        assert!(w.problems().is_empty(), "{kind}");
        let d = w.drawable("it");
        assert_eq!(d.mesh.triangle_count(), triangles, "{kind}");
        assert!(close3(d.bounds_in_world.max, corner), "{kind} {:?}", d.bounds_in_world);
        assert!(d.casts_shadow && d.receives_shadow && d.pose.is_none());
        assert_eq!(d.world_from_object, Mat4::IDENTITY);
    }
}

#[test]
fn material_defaults() {
    let phong = |v: f32| Shading::Phong { specular: Vec3::ZERO, exponent: 128.0 * v, ambient_intensity: 0.2 };
    let rows = [
        (None, phong(0.2), 0.8),
        (Some("Material"), phong(0.2), 0.8),
        (Some("PhysicalMaterial"), Shading::MetallicRoughness { metallic: 0.0, roughness: 0.8 }, 1.0),
        (Some("UnlitMaterial"), Shading::Unlit, 1.0),
    ];
    for (kind, shading, grey) in rows {
        let mut w = World::new();
        let shape = w.shape(&[w.root()], "it");
        if let Some(kind) = kind {
            let (appearance, material) = (w.node("Appearance", ""), w.node(kind, "paint"));
            w.set(appearance, "material", material);
            w.set(shape, "appearance", appearance);
        }
        w.update();
        let found = &w.drawable("it").material;
        assert_eq!(found.shading, shading, "{kind:?}");
        assert_eq!(found.base_color, Vec3::splat(grey).extend(1.0), "{kind:?}");
        assert_eq!((found.alpha, found.double_sided, found.emissive), (AlphaMode::Opaque, false, Vec3::ZERO));
    }
}

#[test]
fn light_defaults() {
    let cone = |inner_rad, outer_rad| LightKind::Spot { inner_rad, outer_rad };
    let rows = [
        ("DirectionalLight", LightKind::Directional, PI, Vec3::Z),
        ("SpotLight", cone(0.589, 0.785), 100.0, Vec3::Z),
        ("PointLight", LightKind::Point, 100.0, Vec3::Z),
        // Performer's default is parallel light from +z.
        ("LightSource", LightKind::Directional, PI, Vec3::Z),
    ];
    for (kind, expected, intensity, attenuation) in rows {
        let mut w = World::new();
        let node = w.below(&[w.root()], kind, "");
        w.update();
        assert!(w.problems().is_empty(), "{kind}");
        let light = w.light(node);
        assert_eq!((light.kind, light.intensity, light.attenuation), (expected, intensity, attenuation), "{kind}");
        assert_eq!((light.direction, light.position), (Vec3::NEG_Z, Vec3::ZERO), "{kind}");
        assert_eq!((light.color, light.range, light.shadows), (Vec3::ONE, f32::INFINITY, ShadowMethod::None), "{kind}");
        assert_eq!((light.map, light.shadow_intensity, light.ambient_intensity), (MapSettings::default(), 1.0, 0.0));
    }
}

/// 000 section 4.1, line by line.
#[test]
fn the_light_of_the_paper() {
    let mut w = World::new();
    let light = w.below(&[w.root()], "fpLightSource", "newLight");
    w.set(light, "Position", Vec4::new(0.0, 0.0, 0.0, 1.0));
    w.set(light, "SpotDir", vec3(0.0, 0.0, -1.0));
    w.set(light, "SpotCone", Vec2::new(0.0, 180.0));
    w.set(light, "ShadowEnable", 1);
    w.set(light, "ShadowSize", 512);
    w.set(light, "ShadowFrustum", Vec4::new(-0.5, 0.5, -0.5, 0.5));
    w.set(light, "ShadowNearFar", Vec2::new(0.01, 100.0));
    w.update();
    assert!(w.problems().is_empty());
    let found = w.light(light);
    assert!(matches!(found.kind, LightKind::Spot { outer_rad, .. } if outer_rad > 3.1), "no cone, but a direction");
    assert_eq!((found.position, found.direction, found.shadows), (Vec3::ZERO, Vec3::NEG_Z, ShadowMethod::Map));
    let expected = MapSettings {
        size: 512,
        frustum: Some([-0.5, 0.5, -0.5, 0.5]),
        near_far: Some([0.01, 100.0]),
        filter: MapFilter::Pcf16,
        ..MapSettings::default()
    };
    assert_eq!(found.map, expected);
}

#[test]
fn settings_of_maps_are_read() {
    let mut w = World::new();
    let light = w.below(&[w.root()], "DirectionalLight", "sun");
    let surroundings = w.below(&[w.root()], "Environment", "air");
    let filters = [
        ("none", MapFilter::None),
        ("hardware", MapFilter::Hardware),
        ("pcf4", MapFilter::Pcf4),
        ("pcf16", MapFilter::Pcf16),
        ("poisson", MapFilter::Poisson),
        ("pcss", MapFilter::Pcss),
    ];
    for (word, filter) in filters {
        w.set(light, "filter", word);
        w.update();
        assert_eq!(w.light(light).map.filter, filter);
    }
    let rules = [
        ("none", MapUpdate::Never),
        ("always", MapUpdate::Always),
        ("next_frame_only", MapUpdate::Next),
        ("auto", MapUpdate::Auto),
    ];
    for (word, update) in rules {
        w.set(light, "shadow_update", word);
        w.update();
        assert_eq!(w.light(light).map.update, update);
        let once: Vec<_> = if update == MapUpdate::Next { vec![light] } else { Vec::new() };
        assert_eq!(w.extractor.maps_drawn_once(), once, "{word}");
    }
    w.set(light, "shadow_outside", "shadow");
    w.set(surroundings, "shadow_memory", 64);
    w.update();
    assert!(w.light(light).map.outside_in_shadow && w.scene.map_memory_bytes == 64 << 20 && w.problems().is_empty());
    w.set(surroundings, "shadow_memory", 0);
    w.update();
    assert_eq!(w.problems(), ["Environment 'air', shadow_memory: 0 makes no sense here; 1024 is used"]);
    assert_eq!(w.scene.map_memory_bytes, 1 << 30);
}

/// Half-transparent shapes throw shadows where their appearance says so.
#[test]
fn transparent_casters_are_a_choice() {
    let mut w = World::new();
    let shape = w.shape(&[w.root()], "pane");
    let look = w.node("Appearance", "");
    w.set(shape, "appearance", look);
    for (mode, transparent_caster, expected) in
        [("opaque", false, true), ("mask", false, true), ("blend", false, false), ("blend", true, true), ("auto", false, true)]
    {
        w.set(look, "alpha_mode", mode);
        w.set(look, "transparent_caster", transparent_caster);
        w.update();
        assert_eq!(w.scene.drawables[0].casts_shadow, expected, "{mode} {transparent_caster}");
    }
}

#[test]
fn settings_of_volumes_are_read_and_follow_the_room() {
    let mut w = World::new();
    let lift = w.below(&[w.root()], "Transform", "lift");
    w.set(lift, "translation", vec3(0.0, 5.0, 0.0));
    w.set(lift, "scale", vec3(2.0, 2.0, 2.0));
    let light = w.below(&[lift], "PointLight", "lamp");
    w.update();
    assert_eq!(w.light(light).volume, VolumeSettings::default());
    w.set(light, "volume_counting", "z_fail");
    w.set(light, "volume_silhouettes", "quads");
    w.set(light, "volume_culling", false);
    w.set(light, "volume_fitted", false);
    w.set(light, "volume_depth_bounds", false);
    w.set(light, "volume_length", 3.0f32);
    w.set(light, "volume_floor", -1.0f32);
    w.set(light, "volume_holes", "map");
    w.update();
    assert!(w.problems().is_empty());
    let expected = VolumeSettings {
        counting: VolumeCounting::ZFail,
        silhouettes: Silhouettes::Quads,
        culling: false,
        depth_bounds: false,
        fitted: false,
        length: 6.0,
        lower_plane: Some(Vec4::new(0.0, 1.0, 0.0, -3.0)),
        holes_by_map: true,
    };
    assert_eq!(w.light(light).volume, expected);
    w.set(light, "volume_length", -1.0f32);
    w.set(light, "volume_floor", f32::INFINITY);
    w.update();
    assert_eq!(w.problems().len(), 2);
    let found = w.light(light).volume;
    assert_eq!((found.length, found.lower_plane), (f32::INFINITY, None));
}

#[test]
fn an_empty_world_has_a_dim_sky() {
    let mut w = World::new();
    w.update();
    let sky = Background { zenith: environment::ZENITH, horizon: environment::HORIZON, nadir: environment::NADIR };
    assert_eq!((w.scene.background, w.scene.ambient, w.scene.exposure), (sky, environment::AMBIENT, 1.0));
    assert!(w.scene.fog.is_none() && w.scene.lights.is_empty() && w.scene.drawables.is_empty());
    // The nodes' own defaults are the same.
    for kind in ["Background", "Environment", "Fog"] {
        w.node(kind, "");
    }
    w.update();
    assert_eq!((w.scene.background, w.scene.ambient, w.scene.exposure, w.scene.fog), (sky, environment::AMBIENT, 1.0, None));
}
