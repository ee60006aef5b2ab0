//! Windows on a desktop: one per picture, with mouse and keys.

mod controls;
mod event_loop;
mod frame_rate;
mod pane;

pub use event_loop::run;

use crate::navigation;
use std::collections::BTreeMap;
use std::path::PathBuf;
use umbriel_render::RgbaPixels;
use umbriel_scene::{Picture, Scene};

/// How windows are run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// The clock starts here, seconds.
    pub start_s: f64,
    /// Ends after so many frames.
    pub frames: Option<u64>,
}

/// Pixels across and down of each window that can be seen, by the name of its picture.
pub type WindowSizes = BTreeMap<String, [u32; 2]>;

/// What is drawn now.
pub struct Frame<'a> {
    /// The scene, in the room.
    pub scene: &'a Scene,
    /// One window each. Pictures of the same name share a window from frame to frame.
    pub pictures: Vec<Picture>,
}

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Page Down.
    NextViewpoint,
    /// Page Up.
    PreviousViewpoint,
    /// Home: the room goes back to where it started.
    ResetNavigation,
    /// R.
    Reload,
}

/// The world behind the windows.
pub trait App {
    /// Makes the frame at `time_s`, the clock that stands still until the next frame.
    fn frame(&mut self, time_s: f64, windows: &WindowSizes) -> Frame<'_>;
    /// Mouse or keys were used to move.
    fn navigate(&mut self, input: navigation::Input<'_>);
    /// A key asks for something.
    fn command(&mut self, command: Command);
    /// The files to watch, when they are others than at the last call.
    fn files(&mut self) -> Option<Vec<PathBuf>>;
    /// Watched files have changed.
    fn files_changed(&mut self, files: &[PathBuf]);
    /// What the window is called; the name of the picture and the frames per second follow.
    fn title(&self) -> String;
    /// A screenshot of the picture or view `name` was asked for (P or F12).
    fn screenshot(&mut self, name: &str, pixels: &RgbaPixels);
}
