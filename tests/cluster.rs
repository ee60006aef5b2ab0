//! Displays in other processes: what they show, and what goes wrong.

use crate::support::umbriel;
use std::path::{Path, PathBuf};

/// Two displays beside each other, and a box that moves across both.
const WORLD: &str = r#"
world.add(shape(make("Plane", #{ size: vec2(20.0, 20.0) }), physical(#{ base_color: color(0.5, 0.5, 0.45) })));
let turner = transform(#{ name: "turner", translation: vec3(0, 1, -4) }, [shape(make("Box"), physical(#{ base_color: color(0.8, 0.2, 0.1) }))]);
world.add(turner);
world.add(make("DirectionalLight", #{ name: "sun", direction: vec3(-0.5, -0.8, -0.4), shadows: "volume" }));
on_frame(|t, dt| { turner.translation = vec3(t.sin(), 1.0, -4.0); });
let user = make("User", #{ position: vec3(0, 1.6, 0) });
for i in 0..2 {
    let x = -2.0 + 2.0 * i;
    let screen = make("Screen", #{ lower_left: vec3(x, 0.6, -2), lower_right: vec3(x + 2.0, 0.6, -2), upper_left: vec3(x, 2.0, -2) });
    make("Display", #{ name: ["left", "right"][i], user: user, layout: "row", size: vec2(96, 64), screens: [screen] });
}
"#;

fn world() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cluster");
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    let path = folder.join("two.rhai");
    std::fs::write(&path, WORLD).expect("a world can be written");
    path
}

#[test]
fn displays_show_what_one_process_shows_and_repair_what_differs() {
    let world = world();
    let run = umbriel(&["cluster", world.to_str().unwrap(), "--check", "--frames", "8", "--corrupt", "2"]);
    let text = format!("{}{}", run.stdout, run.stderr);
    for part in [
        "left: 7 pictures compared, 0 differ, largest difference 0/255",
        "right: 7 pictures compared, 0 differ, largest difference 0/255",
        "disagreed=0",
        "Vec3(Vec3(0.25, 0.25, 0.25)) here",
    ] {
        assert!(text.contains(part), "{part:?} is missing in:\n{text}");
    }
    assert!(run.ok, "{text}");
}

#[test]
fn a_display_that_stood_still_comes_back_into_the_lock() {
    let world = world();
    let run = umbriel(&["cluster", world.to_str().unwrap(), "--frames", "40", "--fault", "freeze@10:left", "--check"]);
    let text = format!("{}{}", run.stdout, run.stderr);
    for part in ["Freeze@", ", back after", " 0 disagreed", " 0 differ"] {
        assert!(text.contains(part), "{part:?} is missing in:\n{text}");
    }
    assert!(run.ok, "{text}");
}

/// A display with a slash in its name, which the world takes away in its fifth frame and makes anew in its tenth.
const COMES_AND_GOES: &str = r#"
world.add(shape(make("Sphere")));
let user = make("User", #{ position: vec3(0, 1.7, 2) });
let front = make("Screen", #{ lower_left: vec3(-2, 0, 0), lower_right: vec3(2, 0, 0), upper_left: vec3(-2, 2.5, 0) });
let state = make("Group", #{ name: "state" });
state.add_field("frame", 0);
make("Display", #{ name: "wand/1 süd", user: user, screens: [front], size: vec2(1, 1) });
make("Display", #{ name: "wand/1", user: user, screens: [front], size: vec2(64, 40), stereo: true, layout: "side_by_side" });
on_frame(|t, dt| {
    state.frame += 1;
    if state.frame == 5 { delete(find("wand/1")); }
    if state.frame == 10 { make("Display", #{ name: "wand/1", user: user, screens: [front], size: vec2(64, 40) }); }
});
"#;

#[test]
fn a_display_that_the_world_takes_away_waits_until_it_is_there_again() {
    let path = world().with_file_name("comes_and_goes.rhai");
    std::fs::write(&path, COMES_AND_GOES).expect("a world can be written");
    let run = umbriel(&["cluster", path.to_str().unwrap(), "--frames", "20"]);
    let text = format!("{}{}", run.stdout, run.stderr);
    for part in ["the last picture of `wand/1` stays until it is there again", "wand/1: shown=20", "wand/1 süd: shown=20"] {
        assert!(text.contains(part), "{part:?} is missing in:\n{text}");
    }
    assert!(run.ok, "{text}");
}
