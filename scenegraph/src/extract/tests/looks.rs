//! Meshes, materials, textures, surroundings: what is given, and what is wrong with it.

use super::World;
use crate::Extractor;
use glam::{Affine2, Vec2, Vec3, vec2, vec3};
use std::sync::Arc;
use umbriel_fields::{Color, Field, Image, NodeId, Value};
use umbriel_scene::{AlphaMode, Filter, Fog, FogKind, ShaderParam, Shading, Wrap};

fn painted(w: &mut World, kind: &str) -> [NodeId; 3] {
    let shape = w.shape(&[w.root()], "it");
    let (appearance, material) = (w.node("Appearance", "look"), w.node(kind, "paint"));
    w.set(appearance, "material", material);
    w.set(shape, "appearance", appearance);
    [shape, appearance, material]
}

fn picture(w: &mut World, side: u32) -> NodeId {
    let texture = w.node("ImageTexture", "picture");
    w.set(texture, "image", Image { width: side, height: side, rgba: vec![7; 4 * (side * side) as usize].into() });
    texture
}

#[test]
fn arrays_of_a_mesh_are_shared_with_its_fields() {
    let mut w = World::new();
    let shape = w.below(&[w.root()], "Shape", "it");
    let mesh = w.node("Mesh", "net");
    let positions: Arc<[Vec3]> = [Vec3::ZERO, Vec3::X, Vec3::Y].into();
    w.set(mesh, "position", positions.clone());
    w.set(shape, "geometry", mesh);
    w.update();
    assert!(Arc::ptr_eq(&positions, &w.drawable("it").mesh.positions));
    assert_eq!(&*w.drawable("it").mesh.indices, &[0, 1, 2]);
}

#[test]
fn a_broken_geometry_is_reported_and_all_else_is_shown() {
    let nan = vec3(f32::NAN, 0.0, 0.0);
    let rows: [(&str, &str, Value, &str); 8] = [
        ("Mesh", "index", [0, 1, 7].into(), "index 7"),
        ("Mesh", "index", [0, -1, 2].into(), "index -1"),
        ("Mesh", "normal", [Vec3::Y].into(), "normals has 1 entries"),
        ("Mesh", "position", Vec::<Vec3>::new().into(), "no vertices"),
        ("Mesh", "position", [Vec3::X, nan, Vec3::Y].into(), "position 1 is not finite"),
        ("Box", "size", vec3(1.0, 0.0, 1.0).into(), "size.y is 0"),
        ("Sphere", "radius", (-1.0f32).into(), "radius is -1"),
        ("Cylinder", "height", f32::NAN.into(), "height is NaN"),
    ];
    for (kind, field, value, expected) in rows {
        let mut w = World::new();
        let shape = w.below(&[w.root()], "Shape", "it");
        w.shape(&[w.root()], "other");
        let geometry = w.node(kind, "bad");
        if kind == "Mesh" {
            w.set(geometry, "position", [Vec3::ZERO, Vec3::X, Vec3::Y]);
        }
        let before = w.graph.value_named(geometry, field).unwrap();
        w.set(geometry, field, value);
        w.set(shape, "geometry", geometry);
        w.update();
        let problems = w.problems();
        assert_eq!((problems.len(), w.names()), (1, vec!["other"]), "{expected}: {problems:?}");
        assert!(problems[0].starts_with(&format!("{kind} 'bad', geometry: ")) && problems[0].contains(expected), "{problems:?}");
        w.set(geometry, field, before);
        w.update();
        assert_eq!(w.names(), ["it", "other"], "mended");
    }
    let mut w = World::new();
    let shape = w.below(&[w.root()], "Shape", "it");
    let light = w.node("PointLight", "lamp");
    w.set(shape, "geometry", light);
    w.update();
    assert_eq!(w.problems(), ["PointLight 'lamp', geometry: a PointLight is no geometry; the shape is not shown"]);
}

#[test]
fn solids_of_one_size_share_their_triangles() {
    let mut w = World::new();
    let root = w.root();
    let shapes = ["a", "b", "c"].map(|name| w.shape(&[root], name));
    let c = w.graph.get_named::<Option<NodeId>>(shapes[2], "geometry").unwrap().unwrap();
    w.set(c, "size", Vec3::ONE);
    w.update();
    assert!(Arc::ptr_eq(&w.drawable("a").mesh, &w.drawable("b").mesh));
    assert!(!Arc::ptr_eq(&w.drawable("a").mesh, &w.drawable("c").mesh));
}

#[test]
fn alpha() {
    let rows: [(&str, f32, AlphaMode); 6] = [
        ("auto", 0.0, AlphaMode::Opaque),
        ("auto", 0.3, AlphaMode::Blend),
        ("opaque", 0.3, AlphaMode::Opaque),
        ("mask", 0.0, AlphaMode::Mask { cutoff: 0.25 }),
        ("blend", 0.0, AlphaMode::Blend),
        ("auto", 1.0, AlphaMode::Blend),
    ];
    for (mode, transparency, expected) in rows {
        let mut w = World::new();
        let [_, appearance, material] = painted(&mut w, "PhysicalMaterial");
        w.set(appearance, "alpha_mode", mode);
        w.set(appearance, "alpha_cutoff", 0.25f32);
        w.set(material, "transparency", transparency);
        w.update();
        let found = &w.drawable("it").material;
        assert_eq!((found.alpha, found.base_color.w), (expected, 1.0 - transparency), "{mode} {transparency}");
    }
}

#[test]
fn textures() {
    let mut w = World::new();
    let [_, _, material] = painted(&mut w, "PhysicalMaterial");
    let texture = picture(&mut w, 2);
    w.set(material, "base_texture", texture);
    w.set(material, "normal_texture", texture);
    w.set(material, "normal_scale", 0.5f32);
    w.set(texture, "wrap_s", "clamp");
    w.set(texture, "wrap_t", "mirror");
    w.set(texture, "filter", "nearest");
    w.set(texture, "uv_set", 1);
    w.set(texture, "translation", vec2(0.0, 1.0));
    w.set(texture, "rotation", std::f32::consts::FRAC_PI_2);
    w.set(texture, "scale", vec2(2.0, 3.0));
    w.update();
    assert!(w.problems().is_empty());
    let found = w.drawable("it").material.clone();
    let base = found.base_color_texture.as_ref().unwrap();
    assert_eq!((base.sampler.wrap_u, base.sampler.wrap_v, base.sampler.filter), (Wrap::Clamp, Wrap::Mirror, Filter::Nearest));
    assert_eq!((base.uv_set, found.normal_scale), (1, 0.5));
    assert!(Arc::ptr_eq(&base.image, &found.normal_texture.as_ref().unwrap().image));
    // KHR_texture_transform: a quarter turn counter-clockwise as seen brings u to -v.
    assert!(base.uv_from_mesh.transform_point2(vec2(1.0, 0.0)).abs_diff_eq(vec2(0.0, -1.0), 1e-6));
    assert!(base.uv_from_mesh.transform_point2(vec2(0.0, 1.0)).abs_diff_eq(vec2(3.0, 1.0), 1e-6));
    w.set(texture, "scale", Vec2::splat(f32::NAN));
    w.update();
    assert_eq!(w.problems().len(), 1);
    assert_eq!(w.drawable("it").material.base_color_texture.as_ref().unwrap().uv_from_mesh, Affine2::IDENTITY);
}

#[test]
fn pictures_that_cannot_be_read_are_reported_and_the_shape_is_shown() {
    let rows: [(&str, Value, &str); 4] = [
        ("url", "no/such.png".into(), "file 'no/such.png'"),
        ("url", "../../secret.png".into(), "not below the asset root"),
        ("url", "".into(), "neither image nor url"),
        ("image", Image { width: 9, height: 9, rgba: vec![0; 8].into() }.into(), "needs 324 bytes"),
    ];
    for (field, value, expected) in rows {
        let mut w = World::new();
        let [_, _, material] = painted(&mut w, "Material");
        let texture = w.node("ImageTexture", "poster");
        w.set(texture, field, value);
        w.set(material, "diffuse_texture", texture);
        w.update();
        let problems = w.problems();
        assert!(problems.len() == 1 && problems[0].contains("'poster'") && problems[0].contains(expected), "{problems:?}");
        assert!(w.drawable("it").material.base_color_texture.is_none());
        w.set(texture, "image", Image { width: 1, height: 1, rgba: vec![0; 4].into() });
        w.update();
        assert!(w.drawable("it").material.base_color_texture.is_some(), "mended");
    }
}

#[test]
fn pictures_with_depth_are_surfaces_that_follow_their_pictures() {
    let mut w = World::new();
    let grey = |side: u32, level: u8| Image { width: side, height: side, rgba: vec![level; 4 * (side * side) as usize].into() };
    let (seen, depth) = (w.node("Backdrop", "seen"), w.node("ImageTexture", "depth"));
    let shape = w.below(&[w.root()], "Shape", "it");
    w.set(shape, "geometry", seen);
    // What is set, triangles, problem.
    type Row = (&'static str, Box<dyn Fn(&mut World)>, Option<&'static str>);
    let rows: Vec<Row> = vec![
        ("no depth", Box::new(|_| ()), Some("'seen', geometry: depth is no ImageTexture")),
        (
            "depth without picture",
            Box::new(move |w| w.set(seen, "depth", depth)),
            Some("'depth', image: neither image nor url is set"),
        ),
        ("too small", Box::new(move |w| w.set(depth, "image", grey(1, 0))), Some("it needs 2 x 2 at least")),
        ("fine", Box::new(move |w| w.set(depth, "image", grey(3, 0))), None),
        ("near is not finite", Box::new(move |w| w.set(seen, "near", f32::NAN)), Some("near is NaN, it must be above 0")),
        ("fine again", Box::new(move |w| w.set(seen, "near", 4.0f32)), None),
    ];
    for (name, change, problem) in rows {
        change(&mut w);
        w.update();
        let problems = w.problems();
        match problem {
            None => {
                assert!(problems.is_empty(), "{name}: {problems:?}");
                assert_eq!(w.drawable("it").mesh.triangle_count(), 8, "{name}");
            }
            Some(expected) => assert!(problems.iter().any(|p| p.contains(expected)), "{name}: {problems:?}"),
        }
    }
    let middle = |w: &World| w.drawable("it").mesh.positions[4];
    assert!(middle(&w).abs_diff_eq(vec3(0.0, 0.0, -4.0), 1e-5), "{}", middle(&w));
    w.set(depth, "image", grey(3, 255));
    w.update();
    assert!(middle(&w).abs_diff_eq(vec3(0.0, 0.0, -10.0), 1e-5), "{}", middle(&w));
}

#[test]
fn materials_that_are_not_finite_are_plain_grey() {
    let mut w = World::new();
    let [_, _, material] = painted(&mut w, "Material");
    w.set(material, "diffuse_color", Color(vec3(f32::NAN, 0.0, 0.0)));
    w.update();
    assert_eq!(w.problems(), ["Material 'paint', material: a number is not finite; shown in plain grey"]);
    assert_eq!(w.drawable("it").material.base_color, Vec3::splat(0.8).extend(1.0));
    w.set(material, "diffuse_color", Color(Vec3::X));
    w.set(material, "shininess", 0.5f32);
    w.update();
    assert!(matches!(w.drawable("it").material.shading, Shading::Phong { exponent: 64.0, .. }));
}

#[test]
fn surroundings() {
    let mut w = World::new();
    let [sky, fog, light] = ["Background", "Fog", "Environment"].map(|kind| w.node(kind, kind));
    w.set(sky, "zenith_color", Color(Vec3::X));
    w.set(fog, "visibility_range", 50.0f32);
    w.set(fog, "fog_type", "exponential");
    w.set(light, "ambient", Color(Vec3::Y));
    w.set(light, "exposure", 2.0f32);
    w.update();
    assert_eq!((w.scene.background.zenith, w.scene.ambient, w.scene.exposure), (Vec3::X, Vec3::Y, 2.0));
    assert_eq!(w.scene.fog, Some(Fog { color: Vec3::ONE, kind: FogKind::Exponential, visibility_range: 50.0 }));
    let navigation = w.node("Navigation", "");
    w.set(navigation, "scale", 10.0f32);
    w.update();
    assert_eq!(w.scene.fog.unwrap().visibility_range, 5.0, "metres of the room");
    w.set(sky, "bound", false);
    w.set(light, "exposure", f32::NAN);
    w.graph.delete(fog).unwrap();
    w.update();
    assert_eq!((w.scene.background.zenith, w.scene.exposure), (crate::nodes::environment::ZENITH, 1.0));
    assert!(w.scene.fog.is_none());
    assert_eq!(w.problems(), ["Environment 'Environment', exposure: NaN makes no sense here; 1 is used"]);
}

#[test]
fn shaders_come_from_text_and_files_and_files_are_read_again() {
    let folder = std::env::temp_dir().join(format!("umbriel-shaders-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("own.wgsl");
    std::fs::write(&file, "first").unwrap();
    let mut w = World::new();
    w.extractor = Extractor::new().with_asset_root(&folder);
    let [_, appearance, _] = painted(&mut w, "PhysicalMaterial");
    let shader = w.node("FragmentShader", "mine");
    w.graph.add_field(shader, Field::new("tint", Color(Vec3::X))).unwrap();
    let bands = w.graph.add_field(shader, Field::new("bands", 3i64)).unwrap();
    w.set(appearance, "shader", shader);
    w.set(shader, "source", "text");
    let seen = |w: &mut World| {
        w.update();
        w.drawable("it").material.shader.clone().map(|s| (s.source.name.clone(), s.source.text.clone(), s.params.len()))
    };
    assert_eq!(seen(&mut w), Some(("FragmentShader 'mine', source".into(), "text".into(), 2)));
    w.set(shader, "source", "");
    w.set(shader, "url", "own.wgsl");
    assert_eq!(seen(&mut w), Some(("own.wgsl".into(), "first".into(), 2)));
    std::fs::write(&file, "second").unwrap();
    assert!(!w.extractor.forget_shaders(&[folder.join("other.wgsl")]));
    assert_eq!(seen(&mut w).unwrap().1, "first", "nobody said that it changed");
    assert_eq!(w.extractor.shader_files().collect::<Vec<_>>(), [file.as_path()]);
    assert!(w.extractor.forget_shaders(std::slice::from_ref(&file)));
    assert_eq!(seen(&mut w).unwrap().1, "second");
    w.graph.set(bands, 4i64).unwrap();
    w.update();
    let params = w.drawable("it").material.shader.clone().unwrap().params;
    assert_eq!(params, [("tint".into(), ShaderParam::Vec3(Vec3::X)), ("bands".into(), ShaderParam::Scalar(4.0))]);
    assert_eq!(w.problems(), Vec::<String>::new());
    // A file that is not there is told, and used when it comes.
    std::fs::remove_file(&file).unwrap();
    w.extractor.forget_shaders(std::slice::from_ref(&file));
    assert_eq!(seen(&mut w), None);
    assert!(w.problems()[0].starts_with("FragmentShader 'mine', url: file 'own.wgsl': "));
    std::fs::write(&file, "third").unwrap();
    w.extractor.forget_shaders(std::slice::from_ref(&file));
    assert_eq!(seen(&mut w).unwrap().1, "third");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn wrong_shader_nodes_are_reported() {
    let rows: [(&str, Option<Field>, &str); 5] = [
        ("", None, "url: neither source nor url is set; the surface is shown without it"),
        ("../own.wgsl", None, "url: file '../own.wgsl' is not below the asset root; the surface is shown without it"),
        ("no.wgsl", None, "url: file 'no.wgsl': No such file"),
        ("x", Some(Field::new("strength", f32::NAN)), "params: `strength` is not finite and taken as 0"),
        ("x", Some(Field::new("word", "text")), "params: `word` is string"),
    ];
    for (text, field, expected) in rows {
        let mut w = World::new();
        let [_, appearance, _] = painted(&mut w, "PhysicalMaterial");
        let shader = w.node("FragmentShader", "mine");
        w.set(shader, if field.is_some() { "source" } else { "url" }, text);
        if let Some(field) = field {
            w.graph.add_field(shader, field).unwrap();
        }
        w.set(appearance, "shader", shader);
        w.update();
        let problems = w.problems();
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert!(problems[0].contains(expected), "{problems:?} without {expected}");
        assert_eq!(w.names(), ["it"]);
    }
}
