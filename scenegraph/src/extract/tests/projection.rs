//! X3D's shadow nodes and projective texturing (003): what nodes become in the scene.

use super::{World, close3};
use glam::{Mat4, Quat, Vec3, Vec4, vec3};
use std::path::PathBuf;
use std::sync::Arc;
use umbriel_fields::{Image, NoHost, NodeId, Value};
use umbriel_scene::*;

/// A shape with an appearance.
fn painted(w: &mut World, name: &str) -> (NodeId, NodeId) {
    let shape = w.shape(&[w.root()], name);
    let appearance = w.node("Appearance", "look");
    w.set(shape, "appearance", appearance);
    (shape, appearance)
}

fn picture(w: &mut World, name: &str) -> NodeId {
    let texture = w.node("ImageTexture", name);
    w.set(texture, "image", Image { width: 1, height: 1, rgba: vec![7; 4].into() });
    texture
}

/// The numbers that follow a field's name in a classic X3D file, comments left out.
fn numbers(text: &str, field: &str) -> Option<Vec<f32>> {
    let words = text.lines().flat_map(|line| line.split('#').next().unwrap_or("").split_whitespace());
    let after = words.skip_while(|word| *word != field).skip(1);
    let numbers: Vec<f32> = after.map_while(|word| word.parse().ok()).collect();
    (!numbers.is_empty()).then_some(numbers)
}

#[test]
fn the_sample_scenes_mean_what_their_author_says() {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/samples");
    let samples = std::env::var_os("UMBRIEL_SAMPLES").map_or(beside, PathBuf::from);
    let folder = samples.join("x3d_shadow_gpl/shadow_maps/explicit_projection_parameters");
    let rows = [("DirectionalLight", "directional_params_explicit.x3dv"), ("SpotLight", "spot_params_explicit.x3dv")];
    for (kind, file) in rows {
        let Ok(text) = std::fs::read_to_string(folder.join(file)) else {
            assert!(std::env::var_os("UMBRIEL_REQUIRE_SAMPLES").is_none(), "the samples are required");
            return;
        };
        let mut w = World::new();
        let light = w.below(&[w.root()], kind, "light");
        let map = w.node("GeneratedShadowMap", "");
        let names = [
            "location",
            "direction",
            "projectionNear",
            "projectionFar",
            "projectionLocation",
            "projectionRectangle",
            "projectionAngle",
        ];
        for name in names {
            let Some(n) = numbers(&text, name) else { continue };
            let value: Value = match n[..] {
                [x] => x.into(),
                [x, y, z] => vec3(x, y, z).into(),
                [a, b, c, d] => Vec4::new(a, b, c, d).into(),
                _ => panic!("{name} {n:?}"),
            };
            w.set(light, name, value);
        }
        w.set(light, "shadows", text.contains("shadows TRUE"));
        w.set(map, "update", "ALWAYS");
        w.set(map, "size", numbers(&text, "size").unwrap()[0] as i32);
        w.set(map, "scale", numbers(&text, "scale").unwrap()[0]);
        w.set(light, "defaultShadowMap", map);
        w.update();
        assert_eq!(w.problems(), Vec::<String>::new(), "{file}");
        let light = w.light(light);
        assert_eq!((light.shadows, light.shines, light.up), (ShadowMethod::Map, true, None), "{file}");
        assert!(close3(light.direction, vec3(0.0, -1.0, -1.0).normalize()));
        let m = &light.map;
        assert_eq!((m.size, m.slope_bias, m.update), (1024, Some(10.0), MapUpdate::Auto), "{file}");
        assert!((m.constant_bias.unwrap() - 4e-4).abs() < 1e-6);
        if kind == "SpotLight" {
            let edge = 0.3f32.tan();
            assert_eq!((m.frustum, m.near_far), (Some([-edge, edge, -edge, edge]), Some([5.65, 29.59])));
            assert!(!m.outside_in_shadow && light.position == vec3(0.0, 10.0, 10.0));
        } else {
            assert_eq!((m.frustum, m.near_far), (Some([2.73, 5.47, -3.38, 0.11]), Some([1.75, 13.99])));
            assert!(m.outside_in_shadow && close3(light.position, vec3(-4.10, 6.42, 2.55)));
        }
    }
}

#[test]
fn zero_is_fitted_and_avangos_fields_count_first() {
    let inf = f32::INFINITY;
    let four = |l: f32, b: f32, r: f32, t: f32| Value::from(Vec4::new(l, b, r, t));
    type Row = (&'static str, Vec<(&'static str, Value)>, Option<[f32; 4]>, Option<[f32; 2]>, bool);
    let rows: Vec<Row> = vec![
        ("SpotLight", vec![], None, None, false),
        ("SpotLight", vec![("projection_near", 2.0f32.into())], None, Some([2.0, inf]), false),
        ("SpotLight", vec![("projection_far", 9.0f32.into())], None, Some([-inf, 9.0]), false),
        ("PointLight", vec![("projectionNear", 1.0f32.into()), ("projectionFar", 9.0f32.into())], None, Some([1.0, 9.0]), false),
        ("DirectionalLight", vec![("projectionRectangle", four(-1.0, -2.0, 3.0, 4.0))], Some([-1.0, 3.0, -2.0, 4.0]), None, true),
        (
            "DirectionalLight",
            vec![
                ("projectionRectangle", four(-1.0, -2.0, 3.0, 4.0)),
                ("ShadowFrustum", four(-5.0, 5.0, -6.0, 6.0)),
                ("projection_near", 1.0f32.into()),
                ("ShadowNearFar", glam::vec2(2.0, 3.0).into()),
            ],
            Some([-5.0, 5.0, -6.0, 6.0]),
            Some([2.0, 3.0]),
            false,
        ),
    ];
    for (kind, fields, frustum, near_far, outside_in_shadow) in rows {
        let mut w = World::new();
        let light = w.below(&[w.root()], kind, "");
        for (field, value) in &fields {
            w.set(light, field, value.clone());
        }
        w.update();
        assert_eq!(w.problems(), Vec::<String>::new());
        let map = w.light(light).map;
        assert_eq!(
            (map.frustum, map.near_far, map.outside_in_shadow),
            (frustum, near_far, outside_in_shadow),
            "{kind} {fields:?}"
        );
    }
}

#[test]
fn up_turns_and_bad_values_are_told() {
    let nan = f32::NAN;
    let rows: [(&str, &str, Value, &str); 10] = [
        ("SpotLight", "up", vec3(0.0, 0.0, -2.0).into(), "up"),
        ("SpotLight", "up", vec3(nan, 0.0, 0.0).into(), "up"),
        ("SpotLight", "projection_near", (-1.0f32).into(), "projection_near"),
        ("SpotLight", "projection_near", nan.into(), "projection_near"),
        ("SpotLight", "projection_far", (-1.0f32).into(), "projection_far"),
        ("PointLight", "projection_far", nan.into(), "projection_far"),
        ("DirectionalLight", "projection_rectangle", Vec4::new(1.0, 1.0, 1.0, 2.0).into(), "projection_rectangle"),
        ("DirectionalLight", "projection_rectangle", Vec4::new(nan, 0.0, 1.0, 2.0).into(), "projection_rectangle"),
        ("DirectionalLight", "projection_location", vec3(nan, 0.0, 0.0).into(), "projection_location"),
        ("SpotLight", "default_shadow_map", Value::Node(None), ""),
    ];
    for (kind, field, value, expected) in rows {
        let mut w = World::new();
        let light = w.below(&[w.root()], kind, "lamp");
        w.update();
        let usual = w.light(light).clone();
        w.set(light, field, value.clone());
        w.update();
        let problems = w.problems();
        assert_eq!(problems.len(), usize::from(!expected.is_empty()), "{field} {value:?}: {problems:?}");
        assert!(problems.iter().all(|p| p.starts_with(&format!("{kind} 'lamp', {expected}: "))), "{problems:?}");
        assert_eq!(*w.light(light), usual, "{field} {value:?}");
    }
    let mut w = World::new();
    let place = w.below(&[w.root()], "Transform", "");
    w.set(place, "rotation", Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
    let light = w.below(&[place], "SpotLight", "");
    w.set(light, "up", Vec3::X);
    w.update();
    assert!(close3(w.light(light).up.unwrap(), Vec3::Y));
    let stranger = w.node("Box", "crate");
    w.set(light, "default_shadow_map", stranger);
    w.update();
    assert_eq!(w.problems(), ["SpotLight 'unnamed SpotLight', default_shadow_map: 'crate' is no GeneratedShadowMap; left out"]);
}

#[test]
fn a_generated_map_is_drawn_as_its_update_says() {
    let mut w = World::new();
    let light = w.below(&[w.root()], "SpotLight", "lamp");
    let map = w.node("GeneratedShadowMap", "map");
    w.set(light, "default_shadow_map", map);
    let frame = |w: &mut World, update: Option<&str>| {
        if let Some(update) = update {
            w.set(map, "update", update);
        }
        w.graph.evaluate(0.0, &mut NoHost);
        w.update();
        let m = w.light(light).map;
        (m.update, m.request)
    };
    use MapUpdate::{Auto, Never};
    assert_eq!(frame(&mut w, None), (Never, Some(0)));
    let m = w.light(light).map;
    assert_eq!((m.size, m.slope_bias, m.constant_bias), (128, None, None), "the paper's defaults");
    for (step, update, expected) in [
        (1, Some("ALWAYS"), (Auto, Some(0))),
        (2, Some("NONE"), (Never, Some(0))),
        (3, Some("NEXT_FRAME_ONLY"), (Never, Some(1))),
        (4, None, (Never, Some(1))),
        (5, None, (Never, Some(1))),
        (6, Some("NEXT_FRAME_ONLY"), (Never, Some(2))),
        (7, Some("ALWAYS"), (Auto, Some(2))),
        (8, None, (Auto, Some(2))),
    ] {
        assert_eq!(frame(&mut w, update), expected, "step {step}");
        if step == 4 {
            assert_eq!(w.graph.get_named::<umbriel_fields::EnumValue>(map, "update").unwrap().0, 0, "it fell back to NONE");
        }
    }
}

#[test]
fn a_light_that_stands_nowhere_does_not_shine() {
    let mut w = World::new();
    let (_, appearance) = painted(&mut w, "wall");
    let sun = w.below(&[w.root()], "DirectionalLight", "sun");
    let [lamp, map, coordinates, slide_lamp] =
        [("SpotLight", "lamp"), ("GeneratedShadowMap", "map"), ("ProjectedTextureCoordinate", ""), ("SpotLight", "slide lamp")]
            .map(|(kind, name)| w.node(kind, name));
    w.set(lamp, "location", Vec3::X);
    w.set(map, "light", lamp);
    w.set(map, "update", "ALWAYS");
    w.set(coordinates, "projector", slide_lamp);
    let slide = picture(&mut w, "slide");
    w.set(appearance, "texture", [Some(map), Some(slide)].to_vec());
    w.set(appearance, "tex_coord", vec![Some(coordinates)]);
    w.update();
    assert_eq!(w.problems(), Vec::<String>::new());
    let shining = |w: &World| -> Vec<(String, bool, ShadowMethod)> {
        w.scene.lights.iter().map(|l| (l.name.clone(), l.shines, l.shadows)).collect()
    };
    let row = |name: &str, shines, shadows| (name.to_owned(), shines, shadows);
    let (none, by_map) = (ShadowMethod::None, ShadowMethod::Map);
    assert_eq!(shining(&w), [row("sun", true, none), row("map", false, by_map), row("slide lamp", false, none)]);
    assert_eq!((w.scene.shadow_textures.clone(), w.scene.lights[1].position), (vec![Some(1)], Vec3::X));
    assert_eq!(w.scene.projectors, [Some(Projector::Light(2))]);
    let material = w.drawable("wall").material.clone();
    // In the world the same light shines, from where it stands; its material stays the same.
    let place = w.below(&[w.root()], "Transform", "");
    w.set(place, "translation", Vec3::Y);
    w.adopt(place, lamp);
    w.adopt(place, slide_lamp);
    w.update();
    let now = [row("sun", true, none), row("lamp", true, none), row("slide lamp", true, none), row("map", false, by_map)];
    assert_eq!(shining(&w), now);
    assert_eq!((w.scene.projectors[0], w.scene.shadow_textures[0]), (Some(Projector::Light(2)), Some(3)));
    assert!(close3(w.scene.lights[3].position, vec3(1.0, 1.0, 0.0)));
    w.set(place, "translation", Vec3::Z);
    w.update();
    assert!(close3(w.scene.lights[3].position, vec3(1.0, 0.0, 1.0)), "the map goes along");
    assert!(Arc::ptr_eq(&material, &w.drawable("wall").material));
    assert!(w.extractor.light_of(sun).is_some());
}

#[test]
fn lists_of_lights_follow_the_lights() {
    let mut w = World::new();
    let [a, b] = ["a", "b"].map(|name| w.below(&[w.root()], "SpotLight", name));
    let (_, appearance) = painted(&mut w, "wall");
    w.shape(&[w.root()], "other");
    let stranger = w.node("SpotLight", "stranger");
    let lists = |w: &World| w.drawable("wall").receives.map(|list| w.scene.receive_lists[list].clone());
    w.update();
    assert_eq!(lists(&w), None);
    w.set(appearance, "receiveShadows", [Some(b)].to_vec());
    w.update();
    assert_eq!((lists(&w), w.drawable("other").receives), (Some(vec![1]), None));
    w.set(a, "on", false);
    w.update();
    assert_eq!(lists(&w), Some(vec![0]), "it moved up");
    w.set(b, "on", false);
    w.update();
    assert_eq!((lists(&w), w.problems()), (Some(vec![]), vec![]), "off is no mistake");
    w.set(appearance, "receiveShadows", [Some(b), Some(stranger)].to_vec());
    w.update();
    assert_eq!(w.problems(), ["Appearance 'look', receive_shadows: 'stranger' is no light of this world; it casts no shadow"]);
    w.set(appearance, "receiveShadows", Vec::<Option<NodeId>>::new());
    w.update();
    assert_eq!(lists(&w), None);
}

#[test]
fn textures_become_layers() {
    let mut w = World::new();
    let (shape, appearance) = painted(&mut w, "wall");
    let [p, q] = ["p", "q"].map(|name| picture(&mut w, name));
    let multi = w.node("MultiTexture", "multi");
    let coordinates = w.node("ProjectedTextureCoordinate", "ptc");
    let eye = w.node("Viewpoint", "eye");
    w.set(coordinates, "projector", eye);
    let shown = |w: &World| {
        let m = &w.drawable("wall").material;
        let layers: Vec<(LayerMode, Coordinates)> = m.layers.iter().map(|l| (l.mode, l.coordinates)).collect();
        (m.base_color_texture.is_some(), layers)
    };
    let (mesh, projected) = (Coordinates::Mesh, Coordinates::Projected(0));
    use LayerMode::{AddSmooth, Modulate, Replace};
    let one = |id| vec![Some(id)];
    // Textures of the appearance, coordinates of the appearance and of the geometry, the base, the layers.
    type Nodes = Vec<Option<NodeId>>;
    type Row = (Nodes, &'static [&'static str], Nodes, Nodes, bool, Vec<(LayerMode, Coordinates)>);
    let rows: Vec<Row> = vec![
        (vec![], &[], vec![], vec![], false, vec![]),
        (one(p), &[], vec![], vec![], true, vec![]),
        (vec![Some(p), Some(q)], &[], vec![], vec![], true, vec![(Modulate, mesh)]),
        (one(p), &[], one(coordinates), vec![], false, vec![(Modulate, projected)]),
        (one(p), &[], vec![], one(coordinates), false, vec![(Modulate, projected)]),
        (vec![Some(p), Some(q)], &[], vec![None, Some(coordinates)], vec![], true, vec![(Modulate, projected)]),
        (one(multi), &["REPLACE", "AddSmooth"], vec![], vec![], false, vec![(Replace, mesh), (AddSmooth, mesh)]),
        (one(multi), &["MODULATE"], vec![], one(coordinates), false, vec![(Modulate, projected), (Modulate, projected)]),
    ];
    w.set(multi, "texture", [Some(p), Some(q)].to_vec());
    let geometry = w.graph.get_named::<Option<NodeId>>(shape, "geometry").unwrap().unwrap();
    for (number, (textures, modes, of_appearance, of_geometry, base, layers)) in rows.into_iter().enumerate() {
        w.set(multi, "mode", modes.iter().map(|m| Arc::<str>::from(*m)).collect::<Vec<_>>());
        w.set(appearance, "texture", textures);
        w.set(appearance, "texture_coordinates", of_appearance);
        w.set(geometry, "texCoord", of_geometry);
        w.update();
        assert_eq!(w.problems(), Vec::<String>::new(), "row {number}");
        assert_eq!(shown(&w), (base, layers), "row {number}");
    }
    let Some(Projector::Viewpoint { world_from_view, angle_rad, .. }) = w.scene.projectors[0] else { panic!("a viewpoint") };
    assert!((angle_rad - std::f32::consts::FRAC_PI_4).abs() < 1e-6);
    assert!(world_from_view.abs_diff_eq(Mat4::from_translation(vec3(0.0, 0.0, 10.0)), 1e-5));
    // What moves a projector moves nothing else.
    let material = w.drawable("wall").material.clone();
    w.set(eye, "position", Vec3::X);
    w.update();
    let moved = w.scene.projectors[0];
    assert!(matches!(moved, Some(Projector::Viewpoint { world_from_view, .. }) if world_from_view.w_axis.x == 1.0));
    assert!(Arc::ptr_eq(&material, &w.drawable("wall").material));
}

#[test]
fn textures_that_cannot_be_shown_are_told() {
    type Make = fn(&mut World, NodeId, NodeId);
    let rows: [(&str, Make, usize); 7] = [
        (
            "MultiTexture 'multi', mode: there is no mode \"MULTIPLY\"; MODULATE is used",
            |w, appearance, p| {
                let multi = w.node("MultiTexture", "multi");
                w.set(multi, "texture", vec![Some(p)]);
                w.set(multi, "mode", vec![Arc::<str>::from("MULTIPLY")]);
                w.set(appearance, "texture", vec![Some(multi)]);
            },
            0,
        ),
        (
            "Box 'crate', texture: a Box is no texture; left out",
            |w, a, _| {
                let solid = w.node("Box", "crate");
                w.set(a, "texture", vec![Some(solid)]);
            },
            0,
        ),
        (
            "Appearance 'look', texture: 5 textures over the material's own; the first 4 are shown",
            |w, a, p| {
                w.set(a, "texture", vec![Some(p); 6]);
            },
            4,
        ),
        (
            "ProjectedTextureCoordinate 'ptc', projector: none is set; the texture is left out",
            |w, a, p| project(w, a, p, None),
            0,
        ),
        (
            "ProjectedTextureCoordinate 'ptc', projector: a PointLight has no direction to project along; the texture is left out",
            |w, a, p| project(w, a, p, Some("PointLight")),
            0,
        ),
        (
            "Appearance 'look', texture_coordinates: 'crate' is no ProjectedTextureCoordinate; the mesh's own are used",
            |w, a, p| {
                let solid = w.node("Box", "crate");
                w.set(a, "texture", vec![Some(p)]);
                w.set(a, "texture_coordinates", vec![Some(solid)]);
            },
            0,
        ),
        (
            "GeneratedShadowMap 'map', light: 'crate' is no light; no map",
            |w, a, _| {
                let (solid, map) = (w.node("Box", "crate"), w.node("GeneratedShadowMap", "map"));
                w.set(map, "light", solid);
                w.set(a, "texture", vec![Some(map)]);
            },
            1,
        ),
    ];
    for (expected, change, layers) in rows {
        let mut w = World::new();
        let (_, appearance) = painted(&mut w, "wall");
        let p = picture(&mut w, "p");
        change(&mut w, appearance, p);
        w.update();
        assert_eq!(w.problems(), [expected]);
        assert_eq!(w.drawable("wall").material.layers.len(), layers, "{expected}");
    }
}

fn project(w: &mut World, appearance: NodeId, texture: NodeId, projector: Option<&str>) {
    let coordinates = w.node("ProjectedTextureCoordinate", "ptc");
    if let Some(kind) = projector {
        let node = w.node(kind, "");
        w.set(coordinates, "projector", node);
    }
    w.set(appearance, "texture", vec![Some(texture)]);
    w.set(appearance, "texture_coordinates", vec![Some(coordinates)]);
}
