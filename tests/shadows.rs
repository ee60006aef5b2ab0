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

#[test]
fn our_worlds_agree_with_the_tracer() {
    // World, light, view, worst disagreement in percent, worst IoU.
    let rows = [
        // Leaves that are cut out by alpha throw the shadow of whole cards by volume.
        ("market", "lamp_west", "eye_level", 0.5, 0.98),
        ("market", "sun", "overview", 1.5, 0.90),
        ("two_methods", "by_volume", "front", 0.02, 0.99),
        ("two_methods", "by_map", "front", 0.2, 0.97),
        ("inside", "sun", "in_the_shadow", 0.02, 0.99),
        ("harbour", "sun", "bridge", 0.05, 0.98),
    ];
    for (world, light, view, disagreement, iou) in rows {
        let path = root().join(Path::new("scripts/worlds").join(world).with_extension("rhai"));
        let path = path.to_str().expect("paths are text");
        let found = scored(&[path, "--light", light, "--view", view, "--time", "2.5"]);
        assert!(found.0 <= disagreement && found.1 >= iou, "{world} {light}: {found:?}");
    }
}
