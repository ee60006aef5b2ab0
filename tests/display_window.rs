//! A display process in a window on a virtual screen: it shows the world, its mouse moves it and picks, and it leaves the lock when closed.

use crate::support::process::{Process, prepare};
use crate::support::screen::Screen;
use crate::support::until;
use image::RgbImage;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

/// A ball that is red until somebody clicks on it, with a white box beside it.
const BALL: &str = r#"
let glow = make("Material", #{ diffuse_color: color(0, 0, 0), emissive_color: color(0.9, 0.0, 0.0) });
let ball = shape(make("Sphere", #{ radius: 1.0 }), glow);
world.add(ball);
world.add(transform(#{ translation: vec3(1.2, 0.0, 1.2) }, [shape(make("Box", #{ size: vec3(0.4, 0.4, 0.4) }), make("UnlitMaterial", #{ emissive_color: color(1, 1, 1) }))]));
let eye = make("Viewpoint", #{ position: vec3(0.0, 0.0, 6.0) });
world.add(eye);
make("Display", #{ name: "wall", viewpoint: eye, size: vec2(320, 240) });
let mouse = make("Pointer", #{ display: "wall" });
on_change(mouse, "picked", |node| {
    print(`picked on ${mouse.shown_on}`);
    if node == ball { glow.emissive_color = color(0.0, 0.9, 0.0); }
});
"#;

fn middle(picture: &RgbImage) -> [u8; 3] {
    picture.get_pixel(picture.width() / 2, picture.height() / 2).0
}

/// Mean place across of the white pixels, if there are any.
fn white_place(picture: &RgbImage) -> Option<f32> {
    let white = picture.enumerate_pixels().filter(|(_, _, p)| p.0.iter().all(|c| *c > 200));
    let places: Vec<f32> = white.map(|(x, ..)| x as f32).collect();
    (places.len() > 20).then(|| places.iter().sum::<f32>() / places.len() as f32)
}

#[test]
fn a_display_in_a_window_shows_moves_picks_and_leaves() {
    let (folder, address) = prepare("display_window", &[("ball.rhai", BALL)]);
    let world = folder.join("ball.rhai").to_string_lossy().into_owned();
    let screen = Screen::start();
    let host = Process::start(&["serve", &world, "--listen", &address, "--timeout-ms", "2000"]);
    host.says("is served at");
    let environment = [("DISPLAY", screen.display.as_str()), ("WAYLAND_DISPLAY", "")];
    let mut display = Process::start_in(&["display", "--show", "wall", "--connect", &address], &environment);
    let window = screen.window("wall", PATIENCE).unwrap_or_else(|| panic!("no window opens: {}", display.said()));
    let is = |want: [u8; 3]| move |p: &RgbImage| middle(p).iter().zip(want).all(|(a, b)| a.abs_diff(b) < 40);
    let seen = |what: &dyn Fn(&RgbImage) -> bool| until(PATIENCE, || screen.look(window).filter(|p| what(p)));
    let before = seen(&is([243, 0, 0])).unwrap_or_else(|| panic!("the ball is red: {}", display.said()));
    let place = white_place(&before).expect("the white box is seen");

    // Beside the ball, so that nothing is picked.
    screen.drag((20, 20), (60, 20));
    let moved = seen(&|p| white_place(p).is_some_and(|x| (x - place).abs() > 10.0));
    assert!(moved.as_ref().is_some_and(is([243, 0, 0])), "a drag orbits about the ball: {}", host.said());

    screen.drag((160, 120), (160, 120));
    assert!(seen(&is([0, 243, 0])).is_some(), "a click on the ball is told: {} {}", host.said(), display.said());
    host.says("picked on wall");

    const XK_ESCAPE: u32 = 0xff1b;
    screen.press(window, XK_ESCAPE);
    assert_eq!(display.ends(), 0, "{}", display.said());
    display.says("differences=0");
    host.says("display `wall` is gone");
}
