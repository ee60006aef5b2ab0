//! Node types, importers and extraction into a flat scene.
//!
//! The one idea: there is no second structure. A scene is field containers whose `children` fields name each other; the
//! [`Extractor`] compiles them once into flat lists and then follows revisions, so that a frame costs what changed and
//! not what there is.
//!
//! What it does not know: GPUs and how anything is drawn, scripts, sockets, windows, devices. Its result is a plain
//! [`umbriel_scene::Scene`].

mod embed;
pub mod extract;
pub mod geometry;
pub mod gltf;
pub mod nodes;
pub mod screens;

pub use embed::Embedder;
pub use extract::{ExtractStats, Extractor, Problem, Viewpoint, wants_map_once};
pub use nodes::{WORLD, new_graph, node_types};
