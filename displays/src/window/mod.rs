//! Windows on a desktop: one per picture, with mouse and keys.

mod controls;
mod event_loop;
mod frame_rate;
mod pane;
mod stage;

pub use event_loop::run;
pub use stage::Stage;

use crate::navigation;
use crate::rig::Aim;
use std::collections::BTreeMap;
use std::path::PathBuf;
use umbriel_render::RgbaPixels;

/// How windows are run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// The clock starts here, seconds.
    pub start_s: f64,
    /// Ends after so many turns.
    pub turns: Option<u64>,
    /// Windows fill this monitor, counted from zero.
    pub fullscreen: Option<usize>,
}

/// Pixels across and down of each window that can be seen, by the name of its picture.
pub type WindowSizes = BTreeMap<String, [u32; 2]>;

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
    /// Why it ends early.
    type Error: From<crate::Error>;
    /// A turn of the loop at `time_s`, a clock that stands still until the next one: draws and shows what is new.
    fn turn(&mut self, time_s: f64, stage: &mut Stage<'_>) -> Result<(), Self::Error>;
    /// Mouse or keys were used to move.
    fn navigate(&mut self, input: navigation::Input<'_>);
    /// The mouse is over a display.
    fn point(&mut self, display: &str, aim: Aim);
    /// A key asks for something.
    fn command(&mut self, command: Command);
    /// Has it seen enough?
    fn is_over(&self) -> bool {
        false
    }
    /// True if its turns wait for something that comes whether a window can be seen or not.
    fn waits(&self) -> bool {
        false
    }
    /// The files to watch, when they are others than at the last call.
    fn files(&mut self) -> Option<Vec<PathBuf>> {
        None
    }
    /// Watched files have changed.
    fn files_changed(&mut self, _files: &[PathBuf]) {}
    /// What the window is called; the name of the picture and the frames per second follow.
    fn title(&self) -> String;
    /// A screenshot of the picture or view `name` was asked for (P or F12).
    fn screenshot(&mut self, name: &str, pixels: &RgbaPixels);
}
