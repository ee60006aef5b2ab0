//! Every sample model against its own JSON, read here a second time.

use crate::tiny::{get, load_new, node, of_type};
use glam::{Mat4, Quat, Vec3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Aabb, Scene};
use umbriel_scenegraph::Extractor;

/// Where the samples are; `None` (a failure where they are required) if they are not there.
pub(crate) fn samples() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/samples");
    let folder = std::env::var_os("UMBRIEL_SAMPLES").map_or(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    assert_ne!(std::env::var("UMBRIEL_REQUIRE_SAMPLES").as_deref(), Ok("1"), "samples are absent: {}", folder.display());
    // Straight to the terminal: what a passing test prints is not shown.
    let _ = std::io::Write::write_all(&mut std::io::stderr(), b"not run: the samples are absent\n");
    None
}

/// The JSON of a .gltf or .glb.
pub(crate) fn json_of(file: &Path) -> Value {
    let bytes = std::fs::read(file).unwrap();
    if !bytes.starts_with(b"glTF") {
        return serde_json::from_slice(&bytes).unwrap();
    }
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&bytes[20..20 + length]).unwrap()
}

pub(crate) fn files_below(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            files_below(&path, out);
        } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
            out.push(path);
        }
    }
}

fn list<'a>(json: &'a Value, key: &str) -> &'a [Value] {
    json.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn index(json: &Value, key: &str) -> Option<usize> {
    json.get(key).and_then(Value::as_u64).map(|i| i as usize)
}

/// What a model must have, by the JSON alone. All samples use plain triangles.
fn expected(json: &Value) -> BTreeMap<&'static str, usize> {
    let accessor_count = |i: usize| index(&list(json, "accessors")[i], "count").unwrap();
    let primitives = |node: &Value| index(node, "mesh").map_or(&[][..], |m| list(&list(json, "meshes")[m], "primitives"));
    let triangles = |p: &Value| accessor_count(index(p, "indices").or(index(&p["attributes"], "POSITION")).unwrap()) / 3;
    let nodes = list(json, "nodes");
    let channels: usize = list(json, "animations").iter().map(|a| list(a, "channels").len()).sum();
    let skinned = nodes.iter().filter(|n| n.get("skin").is_some()).flat_map(primitives).count();
    BTreeMap::from([
        ("transforms", nodes.len()),
        ("shapes", nodes.iter().flat_map(primitives).count()),
        ("meshes", list(json, "meshes").iter().map(|m| list(m, "primitives").len()).sum()),
        ("triangles", nodes.iter().flat_map(primitives).map(triangles).sum()),
        ("clocks", list(json, "animations").len()),
        ("routes from clocks", channels),
        ("routes to targets", channels),
        ("skins", list(json, "skins").len()),
        ("joints", list(json, "skins").iter().map(|s| list(s, "joints").len()).sum()),
        ("skinned shapes", skinned),
        ("viewpoints", nodes.iter().filter(|n| n.get("camera").is_some()).count()),
        ("lights", nodes.iter().filter(|n| n["extensions"].get("KHR_lights_punctual").is_some()).count()),
        ("named", nodes.iter().filter(|n| n["name"].as_str().is_some_and(|s| !s.is_empty())).count()),
    ])
}

/// What the graph has.
fn found(graph: &Graph, model: &umbriel_scenegraph::gltf::Model) -> BTreeMap<&'static str, usize> {
    let shapes = of_type(graph, "Shape");
    let triangles = |s: &NodeId| get::<Arc<[i32]>>(graph, node(graph, *s, "geometry"), "index").len() / 3;
    let interpolators = graph.nodes().filter(|n| graph.type_of(*n).name.ends_with("Interpolator"));
    let transforms = of_type(graph, "Transform");
    BTreeMap::from([
        ("transforms", transforms.len()),
        ("shapes", shapes.len()),
        ("meshes", of_type(graph, "Mesh").len()),
        ("triangles", shapes.iter().map(triangles).sum()),
        ("clocks", model.clocks.len()),
        (
            "routes from clocks",
            model.clocks.iter().map(|c| graph.routes_from(graph.field(*c, "fraction_changed").unwrap()).count()).sum(),
        ),
        ("routes to targets", interpolators.map(|i| graph.routes_from(graph.field(i, "value_changed").unwrap()).count()).sum()),
        ("skins", of_type(graph, "Skin").len()),
        ("joints", of_type(graph, "Skin").iter().map(|s| get::<Arc<[Option<NodeId>]>>(graph, *s, "joints").len()).sum()),
        ("skinned shapes", shapes.iter().filter(|s| get::<Option<NodeId>>(graph, **s, "skin").is_some()).count()),
        ("viewpoints", model.viewpoints.len()),
        ("lights", model.lights.len()),
        ("named", transforms.iter().filter(|t| graph.name(**t).is_some()).count()),
    ])
}

/// The bounds of all meshes must be those that the exporter wrote.
fn check_bounds(graph: &Graph, json: &Value, file: &Path) {
    let bound = |accessor: &Value, key: &str| {
        let at = |i: usize| accessor.get(key).and_then(|b| b[i].as_f64()).map(|x| x as f32);
        Some(Vec3::new(at(0)?, at(1)?, at(2)?))
    };
    let primitives = list(json, "meshes").iter().flat_map(|m| list(m, "primitives"));
    for (mesh, primitive) in of_type(graph, "Mesh").into_iter().zip(primitives) {
        let accessor = &list(json, "accessors")[index(&primitive["attributes"], "POSITION").unwrap()];
        let (Some(min), Some(max)) = (bound(accessor, "min"), bound(accessor, "max")) else { continue };
        let positions = get::<Arc<[Vec3]>>(graph, mesh, "position");
        let low = positions.iter().copied().reduce(Vec3::min).unwrap();
        let high = positions.iter().copied().reduce(Vec3::max).unwrap();
        let off = (low - min).abs().max((high - max).abs()).max_element();
        assert!(off <= 1e-4 * (max - min).length(), "{}: {low} to {high} instead of {min} to {max}", file.display());
    }
}

#[test]
fn every_sample_has_what_its_json_says() {
    let Some(folder) = samples() else { return };
    let mut files = Vec::new();
    for sub in ["gltf", "meshes", "ships", "controllers", "worlds"] {
        files_below(&folder.join(sub), &mut files);
    }
    assert!(files.len() >= 45, "only {} samples below {}", files.len(), folder.display());
    for file in files {
        let (graph, model) = load_new(&file);
        let model = model.unwrap_or_else(|e| panic!("{e}"));
        let json = json_of(&file);
        assert_eq!(found(&graph, &model), expected(&json), "{}", file.display());
        check_bounds(&graph, &json, &file);
        let uris = list(&json, "images").iter().filter_map(|i| i["uri"].as_str());
        let missing = uris.filter(|uri| !uri.starts_with("data:") && !file.with_file_name(uri).exists()).count();
        let orthographic = list(&json, "cameras").iter().filter(|c| c["type"] == "orthographic").count();
        assert_eq!(model.warnings.len(), missing + orthographic, "{}: {:?}", file.display(), model.warnings);
    }
}

#[test]
fn missing_pictures_are_named() {
    let Some(folder) = samples() else { return };
    let (_, model) = load_new(&folder.join("meshes/pavement.glb"));
    let warning = &model.unwrap().warnings[0];
    for part in ["pavement.glb", "Textures/colormap.png", "texture 0", "does not exist"] {
        assert!(warning.contains(part), "{warning}");
    }
}

/// World bounds of the default scene by the JSON alone: the corners of each primitive's box under the nodes' matrices.
fn expected_bounds(json: &Value, node: usize, world_from_parent: Mat4, out: &mut Vec<Vec3>) {
    let node = &list(json, "nodes")[node];
    let number = |key: &str, i: usize, spare: f32| node.get(key).map_or(spare, |v| v[i].as_f64().unwrap() as f32);
    let matrix = match node.get("matrix") {
        Some(_) => Mat4::from_cols_array(&std::array::from_fn(|i| number("matrix", i, 0.0))),
        None => Mat4::from_scale_rotation_translation(
            Vec3::from_array(std::array::from_fn(|i| number("scale", i, 1.0))),
            Quat::from_array(std::array::from_fn(|i| number("rotation", i, if i == 3 { 1.0 } else { 0.0 }))),
            Vec3::from_array(std::array::from_fn(|i| number("translation", i, 0.0))),
        ),
    };
    let world_from_node = world_from_parent * matrix;
    for primitive in index(node, "mesh").map_or(&[][..], |m| list(&list(json, "meshes")[m], "primitives")) {
        let accessor = &list(json, "accessors")[index(&primitive["attributes"], "POSITION").unwrap()];
        let at = |key: &str, i: usize| accessor[key][i].as_f64().unwrap() as f32;
        for corner in 0..8 {
            let side = |i: usize| if corner >> i & 1 == 0 { at("min", i) } else { at("max", i) };
            out.push(world_from_node.transform_point3(Vec3::new(side(0), side(1), side(2))));
        }
    }
    for child in list(node, "children") {
        expected_bounds(json, child.as_u64().unwrap() as usize, world_from_node, out);
    }
}

#[test]
fn every_sample_becomes_a_scene() {
    let Some(folder) = samples() else { return };
    let mut files = Vec::new();
    for sub in ["gltf", "meshes", "ships", "controllers", "worlds"] {
        files_below(&folder.join(sub), &mut files);
    }
    for file in files {
        let (mut graph, model) = load_new(&file);
        let (model, json) = (model.unwrap(), json_of(&file));
        let world = graph.find("world").unwrap();
        graph.set_named(world, "children", Arc::<[Option<NodeId>]>::from([Some(model.root)])).unwrap();
        let (mut extractor, mut scene) = (Extractor::new(), Scene::default());
        extractor.update(&graph, &mut scene);
        let problems = extractor.problems();
        assert!(problems.is_empty(), "{}: {problems:?}", file.display());
        let shown: Vec<_> = scene.drawables.iter().filter(|d| d.visible).collect();
        let mut corners = Vec::new();
        for root in list(&list(&json, "scenes")[index(&json, "scene").unwrap_or(0)], "nodes") {
            expected_bounds(&json, root.as_u64().unwrap() as usize, Mat4::IDENTITY, &mut corners);
        }
        assert_eq!((shown.len(), scene.lights.len()), (corners.len() / 8, model.lights.len()), "{}", file.display());
        // Of skins only the joints place the vertices.
        if list(&json, "skins").is_empty() {
            let expected = Aabb::from_points(corners);
            let found = shown.iter().fold(Aabb::EMPTY, |b, d| b.union(d.bounds_in_world));
            let off = (found.min - expected.min).abs().max((found.max - expected.max).abs()).max_element();
            assert!(off <= 1e-4 * expected.radius(), "{}: {found:?} instead of {expected:?}", file.display());
        }
    }
}
