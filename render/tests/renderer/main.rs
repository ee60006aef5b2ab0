//! Pictures of scenes made in code, compared with numbers that follow from the scene.

mod lights;
mod support;
mod town;
