//! The command in a window on a virtual screen: it shows the world, a drag orbits, a saved script is read again.
#![cfg(target_os = "linux")]

use crate::support::screen::Screen;
use crate::support::until;
use image::RgbImage;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

/// A world with one large red ball.
const RED: &str = r#"
world.add(shape(make("Sphere", #{ radius: 1.0 }), make("Material", #{ diffuse_color: color(0.0, 0.0, 0.0), emissive_color: color(0.9, 0.0, 0.0) })));
world.add(transform(#{ translation: vec3(1.2, 0.0, 1.2) }, [shape(make("Box", #{ size: vec3(0.4, 0.4, 0.4) }), make("UnlitMaterial", #{ emissive_color: color(1.0, 1.0, 1.0) }))]));
world.add(make("Viewpoint", #{ position: vec3(0.0, 0.0, 6.0) }));
"#;

struct Program(Child);

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn run(screen: &Screen, world: &Path) -> Program {
    let child = Command::new(env!("CARGO_BIN_EXE_umbriel"))
        .arg("run")
        .arg(world)
        .args(["--size", "320x240"])
        .env("DISPLAY", &screen.display)
        .env_remove("WAYLAND_DISPLAY")
        .stdout(Stdio::null())
        .spawn()
        .expect("the command can be started");
    Program(child)
}

/// The colour of the middle of the picture.
fn middle(picture: &RgbImage) -> [u8; 3] {
    picture.get_pixel(picture.width() / 2, picture.height() / 2).0
}

/// Mean place across of the white pixels, if there are any.
fn white_place(picture: &RgbImage) -> Option<f32> {
    let places: Vec<f32> =
        picture.enumerate_pixels().filter(|(_, _, p)| p.0.iter().all(|c| *c > 200)).map(|(x, ..)| x as f32).collect();
    (places.len() > 20).then(|| places.iter().sum::<f32>() / places.len() as f32)
}

#[test]
fn a_window_shows_the_world_orbits_and_reads_a_saved_script_again() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("window");
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    let world = folder.join("ball.rhai");
    std::fs::write(&world, RED).expect("a world can be written");
    let screen = Screen::start();
    let _program = run(&screen, &world);

    let window = screen.window("ball", PATIENCE).expect("a window with the world's name opens");
    let is = |want: [u8; 3]| move |p: &RgbImage| middle(p).iter().zip(want).all(|(a, b)| a.abs_diff(b) < 40);
    let seen = |what: &dyn Fn(&RgbImage) -> bool| until(PATIENCE, || screen.look(window).filter(|p| what(p)));
    let before = seen(&is([243, 0, 0])).expect("the ball is red");
    let place = white_place(&before).expect("the white box is seen");

    screen.drag((200, 100), (160, 100));
    let moved = seen(&|p| white_place(p).is_some_and(|x| (x - place).abs() > 10.0)).expect("a drag moves the white box");
    assert!(is([243, 0, 0])(&moved), "a drag orbits about the ball");

    std::fs::write(&world, RED.replace("color(0.9, 0.0, 0.0)", "color(0.0, 0.9, 0.0)")).expect("a world can be written");
    seen(&is([0, 243, 0])).expect("the saved script is read again: the ball is green");

    std::fs::write(&world, "this is no script").expect("a world can be written");
    std::thread::sleep(Duration::from_secs(2));
    seen(&is([0, 243, 0])).expect("a broken script leaves the world as it was");
}
