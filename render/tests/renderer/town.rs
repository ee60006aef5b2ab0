//! Shadow maps of the sample town against masks that a ray tracer made.

use crate::support::*;
use glam::{Mat4, Vec2, Vec3, Vec4};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use umbriel_scene::*;

/// Where the samples are; `None` where they are absent and need not be there.
pub(crate) fn samples() -> Option<PathBuf> {
    let samples = std::env::var_os("UMBRIEL_SAMPLES")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/samples"), PathBuf::from);
    let exists = samples.join("worlds/town_square.glb").exists();
    let required = std::env::var("UMBRIEL_REQUIRE_SAMPLES").is_ok_and(|v| v == "1");
    assert!(exists || !required, "{} is missing", samples.display());
    if !exists {
        // Straight to the terminal: what a passing test prints is not shown.
        let _ = std::io::Write::write_all(&mut std::io::stderr(), b"not run: the samples are absent\n");
    }
    exists.then_some(samples)
}

/// The shapes of a glTF file, in plain grey or with their pictures.
pub(crate) fn load(path: &Path) -> Scene {
    let (document, buffers, images) = gltf::import(path).unwrap();
    let images: Vec<Arc<Image>> = images.iter().map(|i| Arc::new(rgba(i))).collect();
    let mut scene = Scene::default();
    let roots = document.default_scene().unwrap().nodes().map(|n| (n, Mat4::IDENTITY));
    let mut stack: Vec<_> = roots.collect();
    let mut meshes = std::collections::HashMap::new();
    while let Some((node, world_from_parent)) = stack.pop() {
        let world_from_node = world_from_parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        stack.extend(node.children().map(|c| (c, world_from_node)));
        let Some(mesh) = node.mesh() else { continue };
        let primitives = meshes.entry(mesh.index()).or_insert_with(|| {
            mesh.primitives().map(|p| (Arc::new(mesh_of(&p, &buffers)), Arc::new(material_of(&p, &images)))).collect::<Vec<_>>()
        });
        for (mesh, material) in primitives {
            let mut shape = shape_of(mesh, material, world_from_node);
            shape.name = node.name().unwrap_or_default().into();
            scene.drawables.push(shape);
        }
    }
    scene
}

fn mesh_of(primitive: &gltf::Primitive<'_>, buffers: &[gltf::buffer::Data]) -> Mesh {
    let reader = primitive.reader(|b| Some(&buffers[b.index()]));
    Mesh {
        positions: reader.read_positions().unwrap().map(Vec3::from).collect(),
        normals: reader.read_normals().into_iter().flatten().map(Vec3::from).collect(),
        uv0: reader.read_tex_coords(0).into_iter().flat_map(|t| t.into_f32()).map(Vec2::from).collect(),
        indices: reader.read_indices().unwrap().into_u32().collect(),
        ..Default::default()
    }
    .checked()
    .unwrap()
}

fn material_of(primitive: &gltf::Primitive<'_>, images: &[Arc<Image>]) -> Material {
    let material = primitive.material();
    let pbr = material.pbr_metallic_roughness();
    let texture = |t: gltf::texture::Info<'_>| TextureRef {
        image: images[t.texture().source().index()].clone(),
        sampler: Sampler::default(),
        uv_set: 0,
        uv_from_mesh: Default::default(),
    };
    Material {
        shading: Shading::MetallicRoughness { metallic: pbr.metallic_factor(), roughness: pbr.roughness_factor() },
        base_color: Vec4::from(pbr.base_color_factor()),
        base_color_texture: pbr.base_color_texture().map(texture),
        double_sided: material.double_sided(),
        ..Default::default()
    }
}

fn rgba(data: &gltf::image::Data) -> Image {
    let rgba = match data.format {
        gltf::image::Format::R8G8B8 => data.pixels.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect(),
        _ => data.pixels.clone(),
    };
    Image { width: data.width, height: data.height, rgba: Arc::from(rgba) }
}

fn vec3(value: &Value) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|i| value[i].as_f64().unwrap() as f32))
}

pub(crate) fn light_of(json: &Value) -> Light {
    let kind = match json["type"].as_str().unwrap() {
        "directional" => LightKind::Directional,
        "spot" => LightKind::Spot { inner_rad: 0.0, outer_rad: json["cutoff"].as_f64().unwrap() as f32 },
        _ => LightKind::Point,
    };
    let optional = |key: &str| json.get(key).map_or(Vec3::NEG_Z, vec3);
    let intensity = json["intensity"].as_f64().map_or(std::f32::consts::PI, |i| i as f32);
    Light { kind, position: optional("pos"), direction: optional("dir").normalize(), intensity, ..Light::default() }
}

pub(crate) fn view_of(json: &Value) -> View {
    let camera = &json["camera"];
    let size = [0, 1].map(|i| json["size"][i].as_u64().unwrap() as u32);
    let fovy_rad = camera["fovy_deg"].as_f64().unwrap().to_radians() as f32;
    View {
        name: "camera".into(),
        view_from_world: glam::camera::rh::view::look_at_mat4(vec3(&camera["eye"]), vec3(&camera["target"]), vec3(&camera["up"])),
        frustum: Frustum::symmetric(fovy_rad, size[0] as f32 / size[1] as f32, 0.1),
        size,
    }
}

/// Draws what a light lets through with the given method and compares it with the truth.
fn score_of(samples: &Path, scene: &mut Scene, name: &str, shadows: ShadowMethod) -> Score {
    let json = std::fs::read_to_string(samples.join(format!("worlds/scenes/{name}.json"))).unwrap();
    let json: Value = serde_json::from_str(&json).unwrap();
    let truth = image::open(samples.join(format!("gt/{name}_mask.png"))).unwrap().into_luma8();
    let truth = Mask::from_grey(truth.width(), truth.height(), truth.as_raw()).unwrap();
    let view = View { name: format!("{name}_{shadows:?}"), ..view_of(&json) };
    scene.lights = vec![Light { shadows, ..light_of(&json["light"]) }];
    shoot(scene, &Picture { name: format!("{}_colour", view.name), ..Picture::mono(view.clone()) });
    let shot = shoot(scene, &Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(view.clone()) });
    assert_eq!(shot.problems, Vec::<String>::new());
    let grey: Vec<u8> = shot.layers[0].rgba.chunks_exact(4).map(|p| p[0]).collect();
    let score = score(&truth, &grey).unwrap();
    println!("{name} {shadows:?}: IoU {:.4}, {:.3} % disagree", score.iou, score.disagreement * 100.0);
    let rgba = difference(&truth, &grey).unwrap();
    keep(&format!("{}_difference", view.name), &[umbriel_render::RgbaPixels { rgba, ..shot.layers[0].clone() }]);
    score
}

#[test]
fn shadows_agree_with_ray_tracing() {
    let Some(samples) = samples() else { return };
    let mut scene = load(&samples.join("worlds/town_square.glb"));
    scene.ambient = Vec3::splat(0.1);
    scene.background = Background { zenith: Vec3::new(0.1, 0.2, 0.6), horizon: Vec3::splat(0.6), nadir: Vec3::splat(0.1) };
    let mut failed = Vec::new();
    for (shadows, least) in [(ShadowMethod::Map, 0.99), (ShadowMethod::Volume, 0.9999)] {
        for light in ["sun", "spot", "lamp"] {
            for camera in ["overview", "eye_level"] {
                let name = format!("town_square__{light}__{camera}");
                let score = score_of(&samples, &mut scene, &name, shadows);
                if score.iou < least {
                    failed.push((name, shadows, score.iou));
                }
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}
