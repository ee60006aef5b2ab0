//! Models written again: what was not mended keeps its bytes, and what was mended is sound when it is read again.

use crate::samples::{files_below, json_of, samples};
use crate::tiny::Folder;
use serde_json::Value;
use std::path::{Path, PathBuf};
use umbriel_scene::Topology;
use umbriel_scene::doctor::{Mended, Steps, examine, mend, natural_weld_m};
use umbriel_scenegraph::gltf::{LoadOptions, Objects};

fn read(path: &Path) -> Objects {
    Objects::read(path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn models() -> Vec<PathBuf> {
    let mut files = Vec::new();
    files_below(&PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../scripts/worlds/models"), &mut files);
    if let Some(samples) = samples() {
        files_below(&samples, &mut files);
    }
    files.sort();
    files
}

fn strings(json: &Value, key: &str) -> String {
    json.get(key).map(Value::to_string).unwrap_or_default()
}

#[test]
fn every_model_is_mended_and_read_again() {
    let folder = Folder::new();
    let mut mended_meshes = 0;
    for file in models() {
        let name = file.display().to_string();
        let objects = read(&file);
        let treat = |o: &umbriel_scenegraph::gltf::Object| {
            (o.mesh.topology == Topology::Triangles).then(|| mend(&o.mesh, &Steps::all(natural_weld_m(&o.mesh))))
        };
        let mended: Vec<Option<Mended>> = objects.list.iter().map(treat).collect();
        let (bytes, left_outside) = objects.write(&mended).unwrap_or_else(|e| panic!("{e}"));
        // Some samples name pictures that are not among them.
        assert!(left_outside.iter().all(|w| w.contains("does not exist")), "{name}: {left_outside:?}");
        let path = folder.write("mended.glb", bytes);
        let again = read(&path);
        assert_eq!(again.list.len(), objects.list.len(), "{name}");
        for ((before, after), mended) in objects.list.iter().zip(&again.list).zip(&mended) {
            let Some(mended) = mended else {
                assert_eq!(before.mesh, after.mesh, "{name}: {}", before.label);
                continue;
            };
            let (expected, got) = (mended.apply(&before.mesh), &after.mesh);
            let place = format!("{name}: {}", before.label);
            assert!(expected.positions == got.positions && expected.indices == got.indices, "{place}: places");
            assert!(expected.normals == got.normals && expected.tangents == got.tangents, "{place}: frames");
            let near = |(a, b): (&glam::Vec2, &glam::Vec2)| a.abs_diff_eq(*b, 1e-5);
            assert_eq!((expected.uv0.len(), expected.uv1.len()), (got.uv0.len(), got.uv1.len()), "{place}");
            assert!(expected.uv0.iter().zip(got.uv0.iter()).all(near), "{place}: texture coordinates");
            assert!(expected.colors.len() == got.colors.len(), "{place}: colours");
            assert!(expected.joints == got.joints && expected.weights == got.weights, "{place}: skin");
            assert!(expected.morph_targets == got.morph_targets, "{place}: morph targets");
            let findings = examine(&after.mesh, 0.0);
            assert!(findings.is_sound(), "{name}: {}: {findings}", before.label);
            mended_meshes += usize::from(!mended.is_unchanged());
        }
        // What nobody touched is the same text.
        let (old, new) = (json_of(&file), json_of(&path));
        for key in ["materials", "textures", "samplers", "animations", "skins", "nodes", "scenes", "extensionsUsed", "cameras"] {
            assert_eq!(strings(&old, key), strings(&new, key), "{name}: {key}");
        }
    }
    assert!(mended_meshes > 10, "{mended_meshes}");
}

#[test]
fn what_is_not_mended_keeps_its_bytes() {
    for file in models() {
        let objects = read(&file);
        let nothing: Vec<Option<Mended>> = vec![None; objects.list.len()];
        let (bytes, _) = objects.write(&nothing).unwrap_or_else(|e| panic!("{e}"));
        let folder = Folder::new();
        let path = folder.write("same.glb", bytes);
        let (old, new) = (json_of(&file), json_of(&path));
        assert_eq!(strings(&old, "meshes"), strings(&new, "meshes"));
        assert_eq!(strings(&old, "accessors"), strings(&new, "accessors"));
        for (before, after) in objects.list.iter().zip(&read(&path).list) {
            assert_eq!(before.mesh, after.mesh, "{}: {}", file.display(), before.label);
        }
    }
}
