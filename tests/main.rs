//! Tests of the whole: what the command does, and who may depend on whom. One binary, one module per subject.

#[cfg(feature = "cluster")]
mod applications;
#[cfg(feature = "cluster")]
mod cluster;
mod command;
#[cfg(all(target_os = "linux", feature = "cluster"))]
mod display_window;
#[cfg(feature = "cluster")]
mod foreign;
mod layers;
mod recording;
mod shadows;
mod support;
mod views;
mod window;
mod worlds;
mod x3d_shadows;
