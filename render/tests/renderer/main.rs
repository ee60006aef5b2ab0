//! Pictures of scenes made in code, compared with numbers that follow from the scene.

mod layouts;
mod lights;
mod shadows;
mod shapes;
mod support;
mod town;
