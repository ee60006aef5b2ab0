//! Who may depend on whom, proved from the Cargo.toml files: what ARCHITECTURE.md states as absences.

use crate::support::root;
use std::collections::{BTreeMap, BTreeSet};

/// Crate, its folder, our crates that it may reach, and crates of others that neither it nor what it reaches may name.
const LAYERS: [(&str, &str, &[&str], &[&str]); 6] = [
    ("umbriel-fields", "fields", &[], &["wgpu", "rhai", "winit", "gltf", "image", "zenoh"]),
    ("umbriel-scene", "scenegraph/scene", &[], &["wgpu", "rhai", "winit", "gltf", "image", "zenoh"]),
    ("umbriel-scenegraph", "scenegraph", &["umbriel-fields", "umbriel-scene"], &["wgpu", "rhai", "winit", "zenoh"]),
    ("umbriel-render", "render", &["umbriel-scene"], &["rhai", "winit", "gltf", "zenoh"]),
    ("umbriel-scripts", "scripts", &["umbriel-fields", "umbriel-scene", "umbriel-scenegraph"], &["wgpu", "winit", "zenoh"]),
    ("umbriel-displays", "displays", &["umbriel-fields", "umbriel-scene", "umbriel-scenegraph", "umbriel-render"], &["rhai"]),
];

/// Names of the dependencies that a manifest declares, for every target; development dependencies do not count.
fn dependencies(folder: &str) -> BTreeSet<String> {
    let path = root().join(folder).join("Cargo.toml");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let manifest: toml::Table = text.parse().unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let targets = manifest.get("target").and_then(|t| t.as_table()).into_iter().flatten().filter_map(|(_, t)| t.as_table());
    std::iter::once(&manifest)
        .chain(targets)
        .flat_map(|t| ["dependencies", "build-dependencies"].map(|k| t.get(k).and_then(|d| d.as_table())))
        .flatten()
        .flat_map(|d| d.keys().cloned())
        .collect()
}

fn reached(name: &str, all: &BTreeMap<&str, BTreeSet<String>>) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open = vec![name.to_string()];
    while let Some(next) = open.pop() {
        for dependency in all.get(next.as_str()).into_iter().flatten() {
            if found.insert(dependency.clone()) {
                open.push(dependency.clone());
            }
        }
    }
    found
}

#[test]
fn every_crate_reaches_only_what_lies_below_it() {
    let all: BTreeMap<&str, BTreeSet<String>> = LAYERS.iter().map(|(name, folder, ..)| (*name, dependencies(folder))).collect();
    for (name, folder, ours, forbidden) in LAYERS {
        let reached = reached(name, &all);
        assert!(!all[name].is_empty(), "{folder}/Cargo.toml declares nothing: is it read rightly?");
        for dependency in &reached {
            let is_ours = dependency.starts_with("umbriel");
            assert!(!is_ours || ours.contains(&dependency.as_str()), "{name} must not reach {dependency}");
            assert!(!forbidden.contains(&dependency.as_str()), "{name} must not reach {dependency}");
        }
    }
}

#[test]
fn every_crate_is_in_the_table() {
    let manifest: toml::Table = std::fs::read_to_string(root().join("Cargo.toml")).unwrap().parse().unwrap();
    let members: BTreeSet<&str> = manifest["workspace"]["members"]
        .as_array()
        .unwrap()
        .iter()
        .map(|m| m.as_str().unwrap())
        .filter(|m| *m != "xtask")
        .collect();
    let table: BTreeSet<&str> = LAYERS.iter().map(|(_, folder, ..)| *folder).collect();
    assert_eq!(members, table);
}
