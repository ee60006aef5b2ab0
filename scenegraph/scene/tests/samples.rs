//! The tracer against masks that another ray tracer (Embree) made of the sample town.

use glam::{Mat4, Vec3, Vec4};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use umbriel_scene::{
    AlphaMode, Drawable, Frustum, Light, LightKind, Mask, Material, Mesh, Scene, TraceOptions, Tracer, View, score,
};

/// Share of the pixels that are lit or in shadow in the given mask and have another class in ours.
const TOLERANCE: f64 = 0.0005;

#[test]
fn the_town_is_traced_as_embree_does() {
    let samples = std::env::var_os("UMBRIEL_SAMPLES")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/samples"), PathBuf::from);
    let town = samples.join("worlds/town_square.glb");
    if !town.exists() {
        // Straight to the terminal: what a passing test prints is not shown.
        let _ = std::io::Write::write_all(&mut std::io::stderr(), b"not run: the samples are absent\n");
        let required = std::env::var("UMBRIEL_REQUIRE_SAMPLES").is_ok_and(|v| v == "1");
        assert!(!required, "{} is missing", town.display());
        return;
    }
    let scene = load(&town);
    let start = std::time::Instant::now();
    let tracer = Tracer::new(&scene);
    println!("{} triangles in {:?}", tracer.triangle_count(), start.elapsed());
    let mut failed = Vec::new();
    for light in ["sun", "spot", "lamp"] {
        for camera in ["overview", "eye_level"] {
            let name = format!("town_square__{light}__{camera}");
            let json = std::fs::read_to_string(samples.join(format!("worlds/scenes/{name}.json"))).unwrap();
            let json: Value = serde_json::from_str(&json).unwrap();
            let start = std::time::Instant::now();
            let mask = tracer.visibility(&light_of(&json["light"]), &view_of(&json), &TraceOptions::default(), &|_| ()).unwrap();
            let seconds = start.elapsed().as_secs_f64();
            let truth = image::open(samples.join(format!("gt/{name}_mask.png"))).unwrap().into_luma8();
            let truth = Mask::from_grey(truth.width(), truth.height(), truth.as_raw()).unwrap();
            let pairs = truth.classes.iter().zip(&mask.classes);
            let compared = pairs.clone().filter(|(t, _)| matches!(**t, Mask::LIT | Mask::SHADOW));
            let wrong = compared.clone().filter(|(t, m)| t != m).count() as f64 / compared.count() as f64;
            let any = pairs.filter(|(t, m)| t != m).count();
            let iou = score(&truth, &mask.visibility()).unwrap().iou;
            println!("{name}: {:.5} % disagree, {any} pixels of any class differ, iou {iou:.5}, {seconds:.1} s", wrong * 100.0);
            if wrong > TOLERANCE {
                failed.push(name);
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

fn vec3(value: &Value) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|i| value[i].as_f64().unwrap() as f32))
}

fn light_of(json: &Value) -> Light {
    let kind = match json["type"].as_str().unwrap() {
        "directional" => LightKind::Directional,
        "spot" => LightKind::Spot { inner_rad: 0.0, outer_rad: json["cutoff"].as_f64().unwrap() as f32 },
        _ => LightKind::Point,
    };
    let optional = |key: &str| json.get(key).map_or(Vec3::NEG_Z, vec3);
    Light { kind, position: optional("pos"), direction: optional("dir"), ..Light::default() }
}

fn view_of(json: &Value) -> View {
    let camera = &json["camera"];
    let size = [0, 1].map(|i| json["size"][i].as_u64().unwrap() as u32);
    let eye = vec3(&camera["eye"]);
    let fovy_rad = camera["fovy_deg"].as_f64().unwrap().to_radians() as f32;
    View {
        name: "camera".into(),
        view_from_world: glam::camera::rh::view::look_at_mat4(eye, vec3(&camera["target"]), vec3(&camera["up"])),
        frustum: Frustum::symmetric(fovy_rad, size[0] as f32 / size[1] as f32, 1.0),
        size,
    }
}

/// Triangles, places, sides and alpha modes of a glTF file: what a tracer needs, without the importer.
fn load(path: &Path) -> Scene {
    let (document, buffers, _) = gltf::import(path).unwrap();
    let mut scene = Scene::default();
    let root = document.default_scene().unwrap();
    let mut open: Vec<(gltf::Node<'_>, Mat4)> = root.nodes().map(|n| (n, Mat4::IDENTITY)).collect();
    while let Some((node, world_from_parent)) = open.pop() {
        let world_from_object = world_from_parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        open.extend(node.children().map(|child| (child, world_from_object)));
        for primitive in node.mesh().iter().flat_map(|m| m.primitives()) {
            let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
            let positions: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from_array).collect();
            let count = positions.len() as u32;
            let indices: Vec<u32> = reader.read_indices().map_or_else(|| (0..count).collect(), |i| i.into_u32().collect());
            let mesh = Mesh { positions: positions.into(), indices: indices.into(), ..Mesh::default() };
            let material = primitive.material();
            let alpha = match material.alpha_mode() {
                gltf::material::AlphaMode::Opaque => AlphaMode::Opaque,
                // The given masks were made without textures, so that nothing is cut out.
                gltf::material::AlphaMode::Mask => AlphaMode::Opaque,
                gltf::material::AlphaMode::Blend => AlphaMode::Blend,
            };
            let material =
                Material { double_sided: material.double_sided(), alpha, base_color: Vec4::ONE, ..Material::default() };
            scene.drawables.push(Drawable {
                name: node.name().unwrap_or_default().into(),
                mesh: Arc::new(mesh.checked().unwrap()),
                material: Arc::new(material),
                world_from_object,
                pose: None,
                bounds_in_world: Default::default(),
                visible: true,
                casts_shadow: true,
                receives_shadow: true,
                receives: None,
                revision: 0,
            });
        }
    }
    scene
}
