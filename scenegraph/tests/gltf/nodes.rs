//! What the parts of a small model become.

use crate::tiny::{Folder, Tiny, get, load_new, node, of_type, png};
use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use std::sync::Arc;
use umbriel_fields::{Color, Graph, Image, NodeId};
use umbriel_scenegraph::gltf::{LoadOptions, Model, load};

fn loaded(tiny: &Tiny) -> (Graph, Model) {
    let (graph, model) = tiny.load();
    (graph, model.unwrap_or_else(|e| panic!("{e}")))
}

/// The name of an enum field's value.
fn choice(graph: &Graph, of: NodeId, field: &str) -> String {
    let id = graph.field(of, field).unwrap();
    let value = get(graph, of, field);
    graph.declaration(id).unwrap().choice_name(value).unwrap().to_owned()
}

fn children(graph: &Graph, of: NodeId) -> Vec<NodeId> {
    get::<Arc<[Option<NodeId>]>>(graph, of, "children").iter().flatten().copied().collect()
}

#[test]
fn the_whole_small_model() {
    let (graph, model) = loaded(&Tiny::new());
    assert_eq!(graph.name(model.root), Some("tiny"));
    let top = graph.find("top").unwrap();
    let triangle = graph.find("triangle").unwrap();
    let scene = children(&graph, model.root)[0];
    assert_eq!((model.scenes.clone(), children(&graph, scene)), (vec![scene], vec![top]));
    assert_eq!(get::<Vec3>(&graph, top, "translation"), Vec3::Y);

    let shape = children(&graph, triangle)[0];
    assert_eq!(graph.name(shape), Some("triangle.1"));
    let mesh = node(&graph, shape, "geometry");
    assert_eq!(graph.name(mesh), Some("triangle mesh"));
    assert_eq!(choice(&graph, mesh, "topology"), "triangles");
    assert_eq!(*get::<Arc<[Vec3]>>(&graph, mesh, "position"), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(*get::<Arc<[Vec2]>>(&graph, mesh, "tex_coord"), [Vec2::ZERO, Vec2::X, Vec2::Y]);
    assert_eq!(*get::<Arc<[i32]>>(&graph, mesh, "index"), [0, 1, 2]);
    assert!(get::<Arc<[Vec3]>>(&graph, mesh, "normal").is_empty());
    // Joint 99 has no weight and is out of range.
    assert_eq!(*get::<Arc<[i32]>>(&graph, mesh, "joint"), [0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]);
    assert_eq!(get::<Arc<[Vec4]>>(&graph, mesh, "weight")[0], Vec4::new(0.5, 0.5, 0.0, 0.0));

    let skin = node(&graph, shape, "skin");
    let eye = graph.find("eye").unwrap();
    assert_eq!(*get::<Arc<[Option<NodeId>]>>(&graph, skin, "joints"), [Some(top), Some(eye)]);
    assert_eq!(*get::<Arc<[Mat4]>>(&graph, skin, "inverse_bind"), [Mat4::IDENTITY; 2]);

    let appearance = node(&graph, shape, "appearance");
    assert_eq!((graph.name(appearance), choice(&graph, appearance, "alpha_mode").as_str()), (Some("wood"), "opaque"));
    let material = node(&graph, appearance, "material");
    assert_eq!(get::<Color>(&graph, material, "base_color"), Color(Vec3::new(0.5, 0.25, 1.0)));
    for (field, value) in [("transparency", 0.25), ("roughness", 0.5), ("metallic", 0.0)] {
        assert_eq!(get::<f32>(&graph, material, field), value, "{field}");
    }
    let texture = node(&graph, material, "base_texture");
    let picture = get::<Option<Arc<Image>>>(&graph, texture, "image").unwrap();
    assert_eq!((picture.width, picture.height, &picture.rgba[4..8]), (2, 2, &[255, 0, 7, 255][..]));
    for (field, value) in [("wrap_s", "clamp"), ("wrap_t", "mirror"), ("filter", "nearest")] {
        assert_eq!(choice(&graph, texture, field), value, "{field}");
    }
    assert!(!get::<bool>(&graph, texture, "mip_maps"));

    let view = model.viewpoints[0];
    assert_eq!(children(&graph, eye), [view]);
    assert_eq!(get::<Vec3>(&graph, view, "position"), Vec3::ZERO);
    assert_eq!((get::<f32>(&graph, view, "field_of_view"), get::<f32>(&graph, view, "near")), (0.5, 0.2));
    assert_eq!(&*get::<Arc<str>>(&graph, view, "description"), "eye");
    assert_eq!(get::<Quat>(&graph, eye, "rotation"), Quat::from_xyzw(0.0, 1.0, 0.0, 0.0));

    let lamp = graph.find("lamp").unwrap();
    assert_eq!((model.lights.clone(), &*graph.type_of(lamp).name), (vec![lamp], "SpotLight"));
    assert_eq!(get::<Color>(&graph, lamp, "color"), Color(Vec3::new(1.0, 0.5, 0.0)));
    for (field, value) in [("intensity", 20.0), ("radius", 9.0), ("beam_width", 0.25), ("cut_off_angle", 0.5)] {
        assert_eq!(get::<f32>(&graph, lamp, field), value, "{field}");
    }
    assert!(graph.find("tiny/move").is_some_and(|clock| model.clocks == [clock]));
}

/// Edits the material of the small model and asks the material node for one field.
#[test]
fn materials() {
    type Row = (&'static str, Value, &'static str, &'static str, f32);
    let rows: [Row; 9] = [
        ("defaults", json!({}), "PhysicalMaterial", "metallic", 1.0),
        ("rough by default", json!({}), "PhysicalMaterial", "roughness", 1.0),
        (
            "unlit",
            json!({"extensions": {"KHR_materials_unlit": {}}, "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}}),
            "UnlitMaterial",
            "transparency",
            0.5,
        ),
        ("normal scale", json!({"normalTexture": {"index": 0, "scale": 0.25}}), "PhysicalMaterial", "normal_scale", 0.25),
        (
            "occlusion",
            json!({"occlusionTexture": {"index": 0, "strength": 0.75}}),
            "PhysicalMaterial",
            "occlusion_strength",
            0.75,
        ),
        (
            "glossy",
            json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {"glossinessFactor": 0.75}}}),
            "PhysicalMaterial",
            "roughness",
            0.25,
        ),
        (
            "gold",
            json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0, 0, 0, 1], "specularFactor": [1, 1, 1]}}}),
            "PhysicalMaterial",
            "metallic",
            1.0,
        ),
        (
            "plastic",
            json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {"specularFactor": [0.02, 0.02, 0.02]}}}),
            "PhysicalMaterial",
            "metallic",
            0.0,
        ),
        (
            "out of range",
            json!({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 7]}}),
            "PhysicalMaterial",
            "transparency",
            0.0,
        ),
    ];
    for (name, material, kind, field, value) in rows {
        let mut tiny = Tiny::new();
        let extensions = ["KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness", "KHR_materials_emissive_strength"];
        tiny.json["extensionsUsed"] = json!(extensions);
        tiny.json["materials"][0] = material;
        let (graph, model) = loaded(&tiny);
        let look = of_type(&graph, kind)[0];
        assert!((get::<f32>(&graph, look, field) - value).abs() < 1e-3, "{name}: {}", get::<f32>(&graph, look, field));
        let approximated = name == "glossy" || name == "gold" || name == "plastic";
        assert_eq!(model.warnings.iter().any(|w| w.contains("approximated")), approximated, "{name}: {:?}", model.warnings);
    }
}

#[test]
fn emission_alpha_and_sides() {
    let mut tiny = Tiny::new();
    tiny.json["materials"][0] = json!({"emissiveFactor": [1, 0.5, 0], "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}});
    let (graph, _) = loaded(&tiny);
    let (look, appearance) = (of_type(&graph, "PhysicalMaterial")[0], of_type(&graph, "Appearance")[0]);
    assert_eq!(get::<Color>(&graph, look, "emissive_color"), Color(Vec3::new(8.0, 4.0, 0.0)));
    assert_eq!(choice(&graph, appearance, "alpha_mode"), "mask");
    assert_eq!((get::<f32>(&graph, appearance, "alpha_cutoff"), get::<bool>(&graph, appearance, "double_sided")), (0.25, true));
}

#[test]
fn textures_are_shared_and_transformed() {
    let mut tiny = Tiny::new();
    let moved = json!({"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 1], "rotation": 0.25, "scale": [2, 3], "texCoord": 1}}});
    tiny.json["materials"][0] = json!({"pbrMetallicRoughness": {"baseColorTexture": moved, "metallicRoughnessTexture": {"index": 0}},
        "normalTexture": moved, "occlusionTexture": {"index": 0}, "emissiveTexture": {"index": 0, "texCoord": 1}});
    let (graph, _) = loaded(&tiny);
    let look = of_type(&graph, "PhysicalMaterial")[0];
    let [base, metal, normal, occlusion, emissive] =
        ["base_texture", "metallic_roughness_texture", "normal_texture", "occlusion_texture", "emissive_texture"]
            .map(|f| node(&graph, look, f));
    assert_eq!((base, metal), (normal, occlusion), "equal uses share a node");
    assert!(base != metal && metal != emissive && base != emissive);
    assert_eq!(get::<Vec2>(&graph, base, "translation"), Vec2::new(0.5, 1.0));
    assert_eq!(get::<Vec2>(&graph, base, "scale"), Vec2::new(2.0, 3.0));
    assert_eq!(get::<f32>(&graph, base, "rotation"), 0.25);
    assert_eq!([base, metal, emissive].map(|t| get::<i32>(&graph, t, "uv_set")), [1, 0, 1]);
    let picture = |t| get::<Option<Arc<Image>>>(&graph, t, "image").unwrap();
    assert!(Arc::ptr_eq(&picture(base), &picture(metal)), "the picture is kept once");
}

#[test]
fn topologies() {
    for (mode, name, expected) in [
        (0, "points", vec![0, 1, 2]),
        (1, "lines", vec![0, 1]),
        (2, "lines", vec![0, 1, 1, 2, 2, 0]),
        (3, "lines", vec![0, 1, 1, 2]),
        (4, "triangles", vec![0, 1, 2]),
        (5, "triangles", vec![0, 1, 2]),
        (6, "triangles", vec![1, 2, 0]),
    ] {
        for indexed in [true, false] {
            let mut tiny = Tiny::new();
            let primitive = &mut tiny.json["meshes"][0]["primitives"][0];
            primitive["mode"] = mode.into();
            if !indexed {
                primitive.as_object_mut().unwrap().remove("indices");
            }
            let (graph, _) = loaded(&tiny);
            let mesh = of_type(&graph, "Mesh")[0];
            assert_eq!(
                (choice(&graph, mesh, "topology").as_str(), &*get::<Arc<[i32]>>(&graph, mesh, "index")),
                (name, &expected[..]),
                "mode {mode}"
            );
        }
    }
}

#[test]
fn colours_normals_tangents_and_eight_joints() {
    let mut tiny = Tiny::new();
    let normal = tiny.accessor(5120, "VEC3", 3, &[0, 0, 127, 0, 0, 127, 0, 0x81, 0]);
    tiny.json["accessors"][normal]["normalized"] = true.into();
    let tangent = tiny.floats("VEC4", &[1., 0., 0., -1., 1., 0., 0., -1., 1., 0., 0., 1.]);
    let color = tiny.accessor(5121, "VEC3", 3, &[255, 0, 0, 0, 255, 0, 0, 0, 51]);
    tiny.json["accessors"][color]["normalized"] = true.into();
    let joints = tiny.accessor(5121, "VEC4", 3, &[1; 12]);
    let weights = tiny.floats("VEC4", &[0.75, 0.25, 0., 0., 0., 0., 0., 0., 0., 0., 0., 0.]);
    for (name, accessor) in
        [("NORMAL", normal), ("TANGENT", tangent), ("COLOR_0", color), ("JOINTS_1", joints), ("WEIGHTS_1", weights)]
    {
        tiny.json["meshes"][0]["primitives"][0]["attributes"][name] = accessor.into();
    }
    let (graph, model) = loaded(&tiny);
    let mesh = of_type(&graph, "Mesh")[0];
    assert_eq!(*get::<Arc<[Vec3]>>(&graph, mesh, "normal"), [Vec3::Z, Vec3::Z, Vec3::NEG_Y]);
    assert_eq!(get::<Arc<[Vec4]>>(&graph, mesh, "tangent")[1], Vec4::new(1.0, 0.0, 0.0, -1.0));
    let colors = get::<Arc<[Vec4]>>(&graph, mesh, "color");
    assert_eq!(*colors, [Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 1.0, 0.0, 1.0), Vec4::new(0.0, 0.0, 0.2, 1.0)]);
    // 0.5 and 0.5 of the first set and 0.75 and 0.25 of the second, made to sum to 1.
    assert_eq!(get::<Arc<[Vec4]>>(&graph, mesh, "weight")[0], Vec4::new(0.375, 0.25, 0.25, 0.125));
    assert_eq!(get::<Arc<[i32]>>(&graph, mesh, "joint")[..4], [1, 0, 1, 1]);
    assert!(model.warnings[0].contains("4 strongest"), "{:?}", model.warnings);
}

#[test]
fn morph_targets_and_sparse_accessors() {
    let mut tiny = Tiny::new();
    let indices = tiny.view(&[2]);
    let values = tiny.view(&[0f32, 0.0, 5.0].map(f32::to_le_bytes).concat());
    tiny.json["accessors"].as_array_mut().unwrap().push(json!({"componentType": 5126, "count": 3, "type": "VEC3",
        "sparse": {"count": 1, "indices": {"bufferView": indices, "componentType": 5121}, "values": {"bufferView": values}}}));
    tiny.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 8}, {"NORMAL": 8}]);
    tiny.json["meshes"][0]["weights"] = json!([0.5, 0.25]);
    tiny.json["nodes"].as_array_mut().unwrap().push(json!({"mesh": 0, "weights": [1, 0]}));
    let (graph, _) = loaded(&tiny);
    let mesh = of_type(&graph, "Mesh")[0];
    let targets = get::<Arc<[Option<NodeId>]>>(&graph, mesh, "targets");
    let offsets = |t: usize, field| get::<Arc<[Vec3]>>(&graph, targets[t].unwrap(), field).to_vec();
    assert_eq!((offsets(0, "position"), offsets(0, "normal")), (vec![Vec3::ZERO, Vec3::ZERO, Vec3::Z * 5.0], vec![]));
    assert_eq!(offsets(1, "normal")[2], Vec3::Z * 5.0);
    let weights: Vec<_> =
        of_type(&graph, "Shape").iter().map(|s| get::<Arc<[f32]>>(&graph, *s, "morph_weights").to_vec()).collect();
    assert_eq!(weights, [[0.5, 0.25], [1.0, 0.0]], "of the mesh, then of the node");
}

#[test]
fn instances_share_meshes_and_names_stay_unique() {
    let mut tiny = Tiny::new();
    let json = &mut tiny.json;
    json["nodes"] =
        json!([{"name": "tree", "mesh": 0}, {"name": "tree", "mesh": 0}, {"mesh": 0}, {"name": "tree.1"}, {"name": "tiny"}]);
    (json["scenes"], json["skins"], json["animations"]) = (json!([{"nodes": [0, 1, 2, 3, 4]}]), json!([]), json!([]));
    let (mut graph, _) = loaded(&tiny);
    let shapes = of_type(&graph, "Shape");
    assert_eq!((shapes.len(), of_type(&graph, "Mesh").len(), of_type(&graph, "Appearance").len()), (3, 1, 1));
    let mut names: Vec<_> = graph.names().filter(|n| n.starts_with("t")).map(str::to_owned).collect();
    names.sort();
    assert_eq!(names, ["tiny", "tiny.1", "tree", "tree.1", "tree.1.1", "tree.2", "tree.3", "triangle mesh", "triangle mesh.1"]);
    // The same file once more.
    let folder = Folder::new();
    let again = load(&mut graph, folder.write("tiny.glb", tiny.glb()), &LoadOptions::default()).unwrap();
    assert_eq!(graph.name(again.root), Some("tiny.2"));
}

#[test]
fn scenes() {
    for (name, scenes, shown, groups) in [
        ("one", json!([{"nodes": [0, 1]}]), None, 1),
        ("second is the default", json!([{"nodes": [0]}, {"nodes": [1]}]), Some(1), 2),
        ("the first if none is", json!([{"nodes": [0]}, {"nodes": [1]}]), Some(0), 2),
        ("a node of no scene", json!([{"nodes": [0]}]), Some(0), 2),
        ("no scene", json!([]), None, 1),
    ] {
        let mut tiny = Tiny::new();
        let json = &mut tiny.json;
        json["nodes"] = json!([{"name": "a"}, {"name": "b", "children": [2]}, {"name": "c"}]);
        (json["skins"], json["animations"], json["scenes"]) = (json!([]), json!([]), scenes.clone());
        match name {
            "second is the default" => json["scene"] = 1.into(),
            _ => drop(json.as_object_mut().unwrap().remove("scene")),
        }
        let (graph, model) = loaded(&tiny);
        let switches = of_type(&graph, "Switch");
        assert_eq!(switches.first().map(|s| get::<i32>(&graph, *s, "which_choice")), shown, "{name}");
        let below = children(&graph, *switches.first().unwrap_or(&model.root));
        assert_eq!((below.len(), model.scenes.len()), (groups, scenes.as_array().unwrap().len()), "{name}");
        let reached: usize = below.iter().map(|g| children(&graph, *g).len()).sum();
        assert_eq!(reached, 2, "{name}: every root is somewhere");
    }
}

#[test]
fn matrices_stay_unless_they_are_animated() {
    let matrix = Mat4::from_scale_rotation_translation(Vec3::new(1.0, 2.0, 3.0), Quat::from_rotation_z(0.5), Vec3::X);
    for animated in [false, true] {
        let mut tiny = Tiny::new();
        tiny.json["nodes"][0] = json!({"name": "top", "children": [1, 2, 3], "matrix": matrix.to_cols_array()});
        if !animated {
            tiny.json["animations"] = json!([]);
        }
        let (graph, _) = loaded(&tiny);
        let top = graph.find("top").unwrap();
        let field = get::<Mat4>(&graph, top, "matrix");
        let (t, r, s) = (get(&graph, top, "translation"), get(&graph, top, "rotation"), get(&graph, top, "scale"));
        let whole = Mat4::from_scale_rotation_translation(s, r, t) * field;
        assert!(whole.abs_diff_eq(matrix, 1e-5), "{whole}");
        assert_eq!(field == Mat4::IDENTITY, animated);
    }
}

#[test]
fn external_files_below_the_asset_root() {
    let folder = Folder::new();
    let mut tiny = Tiny::new();
    tiny.json["buffers"][0]["uri"] = "../shared%20data/tiny.bin".into();
    tiny.json["images"][0] = json!({"uri": "planks.png"});
    let file = folder.write("models/tiny.gltf", tiny.json.to_string());
    folder.write("shared data/tiny.bin", &tiny.binary);
    folder.write("models/planks.png", png());
    let error = load_new(&file).1.unwrap_err().to_string();
    assert!(error.contains("out of the asset root") && error.contains("buffer 0"), "{error}");
    let mut graph = umbriel_scenegraph::new_graph();
    let options = LoadOptions { asset_root: Some(folder.0.clone()), ..LoadOptions::default() };
    let model = load(&mut graph, &file, &options).unwrap();
    assert_eq!(model.warnings, [""; 0]);
    assert_eq!(of_type(&graph, "ImageTexture").len(), 1);
}

#[test]
fn data_uris() {
    let mut tiny = Tiny::new();
    let encoded = |kind: &str, bytes: &[u8]| format!("data:{kind};base64,{}", base64::encode(bytes));
    tiny.json["buffers"][0]["uri"] = encoded("application/octet-stream", &tiny.binary).into();
    tiny.json["images"][0] = json!({"uri": encoded("image/png", &png())});
    let folder = Folder::new();
    let (graph, model) = load_new(&folder.write("tiny.gltf", tiny.json.to_string()));
    assert_eq!(model.unwrap().warnings, [""; 0]);
    assert_eq!(of_type(&graph, "ImageTexture").len(), 1);
}
