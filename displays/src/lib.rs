//! Rigs, windows and devices of an installation.
//!
//! The one idea: the displays stand still in the room and the world moves. A rig is a few nodes (`User`, `Screen`,
//! `Display`, `Navigation`) that this crate turns into plain [`Picture`](umbriel_scene::Picture)s every frame; a window shows a
//! picture, and the mouse writes the pose of the room in the world.
//!
//! This crate does not know scripts, files of worlds, or how anything is drawn.

pub mod cluster;
mod error;
pub mod navigation;
pub mod rig;
mod watch;
pub mod window;

pub use error::Error;
pub use watch::FileWatch;
pub use window::WindowSizes;
