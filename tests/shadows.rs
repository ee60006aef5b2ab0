//! Shadows against ray-traced truth: the six scenes of the samples, and our own worlds.

use crate::support::{root, samples, umbriel};
use std::path::Path;

const SCENES: [&str; 6] =
    ["sun__overview", "sun__eye_level", "spot__overview", "spot__eye_level", "lamp__overview", "lamp__eye_level"];

/// Disagreement in percent, and intersection over union, from the last line of `umbriel shadow-error`.
fn scored(args: &[&str]) -> (f64, f64) {
    let run = umbriel(&[&["shadow-error"], args].concat());
    assert!(run.ok, "{args:?}: {}", run.stderr);
    let last = run.stdout.lines().last().unwrap_or_default();
    let value = |key: &str| {
        let text = last.split(' ').find_map(|w| w.strip_prefix(key)?.strip_prefix('='));
        text.and_then(|t| t.trim_end_matches('%').parse().ok()).unwrap_or_else(|| panic!("no {key} in '{last}'"))
    };
    assert!(value("pixels") > 0.0, "{args:?}: {last}");
    println!("{}: {last}", args.join(" "));
    (value("disagreement"), value("iou"))
}

/// Scores every town square scene; the last two numbers are the worst allowed.
fn town_square(args: &[&str], disagreement: f64, iou: f64) {
    let Some(samples) = samples() else { return };
    for name in SCENES {
        let scene = samples.join(format!("worlds/scenes/town_square__{name}.json"));
        let truth = samples.join(format!("gt/town_square__{name}_mask.png"));
        let [scene, truth] = [&scene, &truth].map(|p| p.to_str().expect("paths are text"));
        let found = scored(&[&["--scene", scene, "--truth", truth], args].concat());
        assert!(found.0 <= disagreement && found.1 >= iou, "{name} {args:?}: {found:?}");
    }
}

#[test]
fn the_tracer_agrees_with_an_independent_one() {
    town_square(&["--trace-only"], 0.05, 0.999);
}

#[test]
fn volumes_agree_with_the_truth() {
    town_square(&["--method", "volume"], 0.02, 0.99);
}

/// Places of the eye in and around volumes, and models on a floor under a light of each kind.
#[test]
fn volumes_agree_from_many_places() {
    let Some(samples) = samples() else { return };
    let path = |under: &str| samples.join(under).to_str().expect("paths are text").to_owned();
    let scene = path("worlds/scenes/town_square__sun__eye_level.json");
    for args in [&["--scene", &scene, "--eyes", "12"][..], &["--models", &path("ships"), "--eyes", "4"]] {
        let found = scored(args);
        assert!(found.0 <= 0.02 && found.1 >= 0.99, "{args:?}: {found:?}");
    }
    let table = umbriel(&["shadow-error", "--models", &path("ships"), "--size", "80x60"]).stdout;
    let rows = |light: &str| table.lines().filter(|l| l.starts_with("| ") && l.contains(light)).count();
    assert_eq!(["| directional |", "| spot |", "| point |"].map(rows), [2; 3], "{table}");
}

#[test]
fn maps_agree_with_the_truth() {
    town_square(&["--method", "map", "--map-size", "2048"], 0.5, 0.95);
}

#[test]
fn a_coarse_map_is_seen_to_be_worse() {
    let Some(samples) = samples() else { return };
    let scene = samples.join("worlds/scenes/town_square__sun__eye_level.json");
    let scene = scene.to_str().expect("paths are text");
    let at = |size: &str| scored(&["--scene", scene, "--method", "map", "--map-size", size]);
    assert!(at("64").1 + 0.02 < at("2048").1);
}

/// A box under the eye in worlds of several widths: maps are fine where one looks, not where the world ends.
#[test]
fn wide_worlds_keep_fine_maps_near_the_eye() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("wide");
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    for side_m in [20, 1_000, 10_000] {
        let path = folder.join(format!("floor_{side_m}.rhai"));
        let world = format!(
            "world.add(shape(plane({side_m}, {side_m})));\n\
             world.add(transform(#{{ translation: vec3(0, 0.5, 0) }}, shape(cuboid(vec3(1, 1, 1)))));\n\
             world.add(make(\"DirectionalLight\", #{{ name: \"sun\", direction: vec3(0.5, -0.6, 0.3), shadows: \"map\" }}));\n\
             world.add(make(\"Viewpoint\", #{{ position: vec3(4, 2, 7), orientation: look(vec3(4, 2, 7), vec3(0, 0.5, 0)) }}));\n"
        );
        std::fs::write(&path, world).expect("a world can be written");
        let found = scored(&[path.to_str().expect("paths are text"), "--light", "sun"]);
        assert!(found.1 >= 0.97, "floor of {side_m} m: {found:?}");
    }
}

#[test]
fn our_worlds_agree_with_the_tracer() {
    // World, light, view, worst disagreement in percent, worst IoU.
    let rows = [
        ("market", "lamp_west", "eye_level", 0.02, 0.99),
        ("market", "sun", "overview", 0.2, 0.98),
        ("two_methods", "by_volume", "front", 0.02, 0.99),
        ("two_methods", "by_map", "front", 0.2, 0.97),
        ("inside", "sun", "in_the_shadow", 0.02, 0.99),
        ("harbour", "sun", "bridge", 0.05, 0.98),
    ];
    for (world, light, view, disagreement, iou) in rows {
        let path = root().join(Path::new("scripts/worlds").join(world).with_extension("rhai"));
        let path = path.to_str().expect("paths are text");
        let found = scored(&[path, "--light", light, "--view", view, "--time", "2.5", "--fine-sub-samples", "8"]);
        assert!(found.0 <= disagreement && found.1 >= iou, "{world} {light}: {found:?}");
    }
}
