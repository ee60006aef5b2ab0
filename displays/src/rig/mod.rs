//! Rigs: users, screens and displays in a room, turned into views.

mod arrange;
mod camera;
mod display;
mod eyes;
mod nodes;
mod off_axis;
mod pictures;
mod pointer;
#[cfg(test)]
mod tests;

pub use crate::error::RigError;
pub use arrange::Arrangement;
pub use camera::{Camera, fit_camera};
pub use eyes::{Eye, Head};
pub use off_axis::off_axis;
pub use pictures::{DESKTOP, Pictures, Rig, Wanted};
pub use pointer::{Aim, Pointed, Pointers};
pub use umbriel_scenegraph::screens::{Room, ScreenCorners, cylinder_screens, room_screens};
