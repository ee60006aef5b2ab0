//! Pictures of rigs: seams between neighbours, a moving world against a moving camera, and eyes that are not swapped.

use crate::support::umbriel;
use image::{Rgb, RgbImage};
use std::path::Path;

/// Things with shadows by map and by volume around the origin, and a sky that differs in every direction.
const THINGS: &str = r#"
let white = physical(#{ base_color: color(0.8, 0.8, 0.75), roughness: 0.9 });
let red = physical(#{ base_color: color(0.8, 0.1, 0.1), roughness: 0.9 });
world.add(transform(#{ translation: vec3(0.0, -0.4, 0.0) }, [shape(make("Plane", #{ size: vec2(60.0, 60.0) }), white)]));
for i in 0..9 {
    let a = 2.0 * PI() * i / 9.0;
    world.add(transform(#{ translation: vec3(3.5 * sin(a), 1.0, 3.5 * cos(a)) }, [shape(make("Box", #{ size: vec3(0.6, 2.8, 0.6) }), red)]));
}
world.add(make("DirectionalLight", #{ direction: vec3(-0.5, -1.0, -0.3), intensity: 2.0, shadows: "volume" }));
world.add(make("SpotLight", #{ location: vec3(2.0, 6.0, 1.0), direction: vec3(-0.3, -1.0, -0.2), cut_off_angle: 0.9, intensity: 80.0, shadows: "map" }));
world.add(make("Background", #{ zenith_color: color(0.1, 0.3, 0.8), horizon_color: color(0.8, 0.8, 0.7), nadir_color: color(0.3, 0.2, 0.1) }));
"#;

fn draw(name: &str, script: &str, args: &[&str]) -> RgbImage {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("views");
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    let (world, out) = (folder.join(format!("{name}.rhai")), folder.join(format!("{name}.png")));
    std::fs::write(&world, script).expect("a world can be written");
    let [path, picture] = [&world, &out].map(|p| p.to_str().expect("paths are text"));
    let run = umbriel(&[&["run", path, "--headless", "--out", picture], args].concat());
    assert!(run.ok, "{name}: {}", run.stderr);
    image::open(&out).expect("the picture was written").to_rgb8()
}

fn apart(a: Rgb<u8>, b: Rgb<u8>) -> u8 {
    (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap_or(0)
}

/// Share of the pixels of two columns that differ visibly.
fn seam(picture: &RgbImage, left: u32, right: u32) -> f32 {
    let differ =
        (0..picture.height()).filter(|y| apart(*picture.get_pixel(left, *y), *picture.get_pixel(right, *y)) > 10).count();
    differ as f32 / picture.height() as f32
}

#[test]
fn neighbouring_walls_and_channels_agree_along_their_edge() {
    let room = r#"
let visitor = make("User", #{ position: vec3(0.4, 1.7, 0.3) });
fn wall(ll, lr, ul) { make("Screen", #{ lower_left: ll, lower_right: lr, upper_left: ul }) }
make("Display", #{ name: "room", user: visitor, layout: "row", size: vec2(256.0, 256.0), screens: [
    wall(vec3(-1.5, 0.0, 1.5), vec3(-1.5, 0.0, -1.5), vec3(-1.5, 3.0, 1.5)),
    wall(vec3(-1.5, 0.0, -1.5), vec3(1.5, 0.0, -1.5), vec3(-1.5, 3.0, -1.5)),
    wall(vec3(1.5, 0.0, -1.5), vec3(1.5, 0.0, 1.5), vec3(1.5, 3.0, -1.5)),
] });"#;
    let bridge = r#"
let helmsman = make("User", #{ position: vec3(0.0, 1.5, 0.0) });
make("Display", #{ name: "bridge", user: helmsman, layout: "row", size: vec2(256.0, 256.0),
    screens: cylinder_screens(7, 270.0.to_radians(), 4.0, 3.2, 1.5) });"#;
    for (name, rig, channels) in [("room", room, 3), ("bridge", bridge, 7)] {
        let picture = draw(name, &format!("{THINGS}{rig}"), &[]);
        assert_eq!(picture.dimensions(), (256 * channels, 256), "{name}");
        for edge in 1..channels {
            let share = seam(&picture, 256 * edge - 1, 256 * edge);
            assert!(share < 0.06, "{name}: {share} of the seam at channel {edge} differs");
        }
        // The measure sees channels that do not belong together.
        let wrong: f32 = (1..channels).map(|edge| seam(&picture, 256 * edge - 40, 256 * edge)).fold(0.0, f32::max);
        assert!(wrong > 0.12, "{name}: {wrong}");
    }
}

#[test]
fn a_moving_world_and_a_moving_camera_give_the_same_picture() {
    let pose = "position: vec3(1.5, 1.9, 6.5), orientation: axis_angle(vec3(0.1, 1.0, 0.05), 0.35)";
    let camera = draw("camera_moves", &format!("{THINGS}world.add(make(\"Viewpoint\", #{{ {pose} }}));"), &["--size", "320x240"]);
    let at_home = "world.add(make(\"Viewpoint\", #{ position: vec3(0.0, 0.0, 0.0) }));";
    let display = "make(\"Display\", #{ name: \"d\", viewpoint: find(\"home\"), size: vec2(320.0, 240.0) });";
    let at_home = at_home.replace("#{ ", "#{ name: \"home\", ");
    let world = draw("world_moves", &format!("{THINGS}{at_home}{display}make(\"Navigation\", #{{ {pose} }});"), &[]);
    assert_eq!(camera.dimensions(), world.dimensions());
    let differ = camera.pixels().zip(world.pixels()).filter(|(a, b)| apart(**a, **b) > 6).count() as f32;
    let share = differ / (320.0 * 240.0);
    println!("camera moves against world moves: {:.3} % of the pixels differ", 100.0 * share);
    assert!(share < 0.002, "{share}");
    let still = draw("nothing_moves", &format!("{THINGS}{at_home}{display}"), &[]);
    let moved = still.pixels().zip(world.pixels()).filter(|(a, b)| apart(**a, **b) > 6).count() as f32;
    assert!(moved / (320.0 * 240.0) > 0.2, "Navigation did nothing");
}

#[test]
fn eyes_are_not_swapped() {
    let scene = r#"
world.add(transform(#{ translation: vec3(0.0, 1.5, -0.6) }, [shape(make("Sphere", #{ radius: 0.05 }), make("UnlitMaterial", #{ emissive_color: color(1, 1, 1) }))]));
world.add(make("Background", #{ zenith_color: color(0, 0, 0), horizon_color: color(0, 0, 0), nadir_color: color(0, 0, 0) }));
let viewer = make("User", #{ position: vec3(0.0, 1.5, 0.0), eye_distance: 0.064 });
let screen = make("Screen", #{ lower_left: vec3(-1.0, 0.5, -1.5), lower_right: vec3(1.0, 0.5, -1.5), upper_left: vec3(-1.0, 2.5, -1.5) });
"#;
    let display = |layout: &str| {
        format!(
            "make(\"Display\", #{{ user: viewer, screens: [screen], stereo: true, layout: \"{layout}\", size: vec2(128.0, 128.0) }});"
        )
    };
    // Where a bright pixel of a channel lies on average, in pixels from the middle of its view.
    let place = |picture: &RgbImage, channel: usize, x0: u32, y0: u32| {
        let bright = (0..128)
            .flat_map(|y| (0..128).map(move |x| (x, y)))
            .filter(|(x, y)| picture.get_pixel(x0 + x, y0 + y)[channel] > 128);
        let places: Vec<f32> = bright.map(|(x, _)| x as f32 - 63.5).collect();
        assert!(!places.is_empty(), "nothing is seen");
        places.iter().sum::<f32>() / places.len() as f32
    };
    // A ball nearer than the screen stands to the right for the left eye.
    let beside = draw("side_by_side", &format!("{scene}{}", display("side_by_side")), &[]);
    let above = draw("top_bottom", &format!("{scene}{}", display("top_bottom")), &[]);
    let glasses = draw("anaglyph", &format!("{scene}{}", display("anaglyph")), &[]);
    let layers = draw("layers", &format!("{scene}{}", display("layers")), &[]);
    let rows = [
        ("side by side", place(&beside, 1, 0, 0), place(&beside, 1, 128, 0)),
        ("top and bottom", place(&above, 1, 0, 0), place(&above, 1, 0, 128)),
        ("anaglyph", place(&glasses, 0, 0, 0), place(&glasses, 2, 0, 0)),
        ("layers", place(&layers, 1, 0, 0), place(&layers, 1, 128, 0)),
    ];
    // Similar triangles: 32 mm times (1.5 - 0.6) / 0.6 on a screen of 2 m and 128 pixels.
    let expected = 0.032 * (1.5 - 0.6) / 0.6 * 64.0;
    for (name, left, right) in rows {
        assert!((left - expected).abs() < 0.6 && (right + expected).abs() < 0.6, "{name}: {left} {right}, expected {expected}");
    }
}
