//! Sessions that are recorded, replayed bit by bit, and explained.

use crate::support::{root, umbriel};
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("recording");
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    folder.join(name)
}

fn text(path: &Path) -> &str {
    path.to_str().expect("paths are text")
}

/// Records the market, its walking figure and the head of its visitor.
fn market(name: &str, frames: &str) -> PathBuf {
    let (world, recording, picture) =
        (root().join("scripts/worlds/market.rhai"), file(&format!("{name}.rec")), file(&format!("{name}.png")));
    let size = ["--headless", "--size", "32x18", "--frames", frames, "--fps", "10"];
    let run = umbriel(&[&["run", text(&world), "--record", text(&recording), "--out", text(&picture)], &size[..]].concat());
    assert!(run.ok && run.stdout.contains(&format!("{frames} frames recorded")), "{}{}", run.stdout, run.stderr);
    recording
}

#[test]
fn a_session_is_replayed_bit_by_bit_and_explained() {
    let recording = market("market", "12");
    let replay = umbriel(&["replay", text(&recording), "--headless"]);
    assert!(replay.ok && replay.stdout.contains("12 frames replayed"), "{}{}", replay.stdout, replay.stderr);
    let part = umbriel(&["replay", text(&recording), "--headless", "--seek", "5"]);
    assert!(part.ok && part.stdout.contains("7 frames replayed"), "{}{}", part.stdout, part.stderr);

    // Field, and what must stand in the chain of its causes, root last.
    let rows = [
        ("foot.L", "rotation", ["foot.L.rotation", "OrientationInterpolator", "figure/walk"]),
        ("visitor", "position", ["visitor.position", "PositionInterpolator", "TimeSensor"]),
    ];
    for (node, field, parts) in rows {
        let why = umbriel(&["explain", text(&recording), node, field, "--frame", "9"]);
        assert!(why.ok && why.stdout.contains("in frame 9"), "{}{}", why.stdout, why.stderr);
        let mut rest = why.stdout.as_str();
        for part in parts {
            let place = rest.find(part).unwrap_or_else(|| panic!("'{part}' is not in its place in\n{}", why.stdout));
            rest = &rest[place..];
        }
    }
    let costs = umbriel(&["explain", text(&recording), "--costs"]);
    assert!(costs.ok && costs.stdout.contains("12 evaluations"), "{}", costs.stdout);
    let dot = umbriel(&["explain", text(&recording), "--dot"]);
    assert!(dot.ok && dot.stdout.starts_with("digraph") && dot.stdout.contains("fraction_changed to set_fraction"));
}

#[test]
fn damaged_recordings_are_told() {
    let bytes = std::fs::read(market("damaged", "4")).expect("the recording can be read");
    let cut = &bytes[..bytes.len() - 64];
    let mut version = bytes.clone();
    version[4..12].fill(0xff);
    let rows: [(&str, &[u8], &str); 4] = [
        ("cut", cut, "good up to frame"),
        ("empty", &[], "no recording"),
        ("text", b"world.add(1);", "no recording"),
        ("version", &version, "recording"),
    ];
    for (name, bytes, expected) in rows {
        let path = file(&format!("{name}.rec"));
        std::fs::write(&path, bytes).expect("a file can be written");
        let run = umbriel(&["replay", text(&path), "--headless"]);
        assert!(!run.ok && run.stderr.contains(expected) && run.stderr.contains(name), "{name}: {}{}", run.stdout, run.stderr);
        println!("{name}: {}", run.stderr.trim());
    }
}

#[test]
fn a_world_is_not_recorded_over() {
    let world = file("over.rhai");
    let script = "world.add(shape(sphere(1)));";
    std::fs::write(&world, script).expect("a world can be written");
    let run = umbriel(&["run", text(&world), "--headless", "--size", "8x8", "--record", text(&world)]);
    assert!(!run.ok && run.stderr.contains("over.rhai: the world is made of this file"), "{}", run.stderr);
    assert_eq!(std::fs::read_to_string(&world).expect("the world is there"), script);
}
