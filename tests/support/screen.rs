//! A virtual X screen: started for one test, looked at, and given mouse and keys.

use super::until;
use image::RgbImage;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{self, AtomEnum, ConnectionExt as _, ImageFormat, MapState, Window};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;

/// An Xvfb of its own; it ends with the value.
pub(crate) struct Screen {
    server: Child,
    /// Value of `DISPLAY` for programs that should open their windows on it.
    pub(crate) display: String,
    connection: RustConnection,
    root: Window,
}

impl Screen {
    /// Starts a screen of 1024 x 768 and waits until it answers.
    pub(crate) fn start() -> Screen {
        // The server chooses a free number and writes it to the descriptor that it is given.
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1024x768x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|e| panic!("Xvfb cannot be started ({e}); `cargo xtask test` installs it"));
        let mut line = String::new();
        let stdout = server.stdout.take().expect("piped");
        std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut line).expect("Xvfb names its display");
        let display = format!(":{}", line.trim());
        let (connection, number) = x11rb::connect(Some(&display)).expect("Xvfb accepts connections");
        let root = connection.setup().roots[number].root;
        Screen { server, display, connection, root }
    }

    /// Waits for a shown window whose title contains `title`.
    pub(crate) fn window(&self, title: &str, patience: Duration) -> Option<Window> {
        until(patience, || self.windows().into_iter().find(|w| self.title(*w).is_some_and(|t| t.contains(title))))
    }

    fn windows(&self) -> Vec<Window> {
        let mut found = Vec::new();
        let mut open = vec![self.root];
        while let Some(window) = open.pop() {
            let Some(tree) = self.connection.query_tree(window).ok().and_then(|c| c.reply().ok()) else { continue };
            for child in tree.children {
                open.push(child);
                let attributes = self.connection.get_window_attributes(child).ok().and_then(|c| c.reply().ok());
                if attributes.is_some_and(|a| a.map_state == MapState::VIEWABLE) {
                    found.push(child);
                }
            }
        }
        found
    }

    /// Title of a window.
    pub(crate) fn title(&self, window: Window) -> Option<String> {
        let name = self.connection.get_property(false, window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 256).ok()?.reply().ok()?;
        Some(String::from_utf8_lossy(&name.value).into_owned()).filter(|t| !t.is_empty())
    }

    /// What the window shows.
    pub(crate) fn look(&self, window: Window) -> Option<RgbImage> {
        let size = self.connection.get_geometry(window).ok()?.reply().ok()?;
        let (width, height) = (size.width, size.height);
        let image = self.connection.get_image(ImageFormat::Z_PIXMAP, window, 0, 0, width, height, !0).ok()?.reply().ok()?;
        let rgb = image.data.chunks_exact(4).flat_map(|p| [p[2], p[1], p[0]]).collect();
        RgbImage::from_raw(width.into(), height.into(), rgb)
    }

    /// Presses and lets go a key that has this symbol of X (`XK_Escape` is 0xff1b), at a window.
    #[cfg(feature = "cluster")]
    pub(crate) fn press(&self, window: Window, symbol: u32) {
        let setup = self.connection.setup();
        let (first, count) = (setup.min_keycode, setup.max_keycode - setup.min_keycode + 1);
        let keys = self.connection.get_keyboard_mapping(first, count).expect("sent").reply().expect("the keyboard is known");
        let mut rows = keys.keysyms.chunks_exact(keys.keysyms_per_keycode.into());
        let place = rows.position(|row| row.contains(&symbol)).expect("the keyboard has the key");
        self.connection.set_input_focus(xproto::InputFocus::PARENT, window, x11rb::CURRENT_TIME).expect("sent");
        self.fake(xproto::KEY_PRESS_EVENT, first + place as u8, (0, 0));
        self.fake(xproto::KEY_RELEASE_EVENT, first + place as u8, (0, 0));
    }

    fn fake(&self, kind: u8, detail: u8, (x, y): (i16, i16)) {
        self.connection.xtest_fake_input(kind, detail, 0, self.root, x, y, 0).expect("fake input is sent");
        self.connection.flush().expect("fake input is sent");
        std::thread::sleep(Duration::from_millis(30));
    }

    /// Presses the left button at one place of the screen, moves to another in steps, and lets go.
    pub(crate) fn drag(&self, from: (i16, i16), to: (i16, i16)) {
        let fake = |kind: u8, detail: u8, at: (i16, i16)| self.fake(kind, detail, at);
        fake(xproto::MOTION_NOTIFY_EVENT, 0, from);
        fake(xproto::BUTTON_PRESS_EVENT, 1, from);
        for step in 1..=10 {
            let along = |a: i16, b: i16| a + (b - a) * step / 10;
            fake(xproto::MOTION_NOTIFY_EVENT, 0, (along(from.0, to.0), along(from.1, to.1)));
        }
        fake(xproto::BUTTON_RELEASE_EVENT, 1, to);
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}
