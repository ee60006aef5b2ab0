//! Draws every view of a scene with shadow maps and stencil shadow volumes.

pub mod volumes;
