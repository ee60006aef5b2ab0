//! Tests of the whole: what the command does, and who may depend on whom. One binary, one module per subject.

#[cfg(feature = "cluster")]
mod applications;
mod cluster;
mod command;
mod layers;
mod recording;
mod shadows;
mod support;
mod views;
mod window;
mod worlds;
