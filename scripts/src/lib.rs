//! Worlds written in rhai.
//!
//! The one idea: a script holds no scene. It works on the field graph itself: [`World`] lends its graph to the script
//! while one runs and takes it back, so that a node, a field or a route made in a script is the same as one made in
//! Rust, and whoever reads the graph needs to know nothing of scripts.
//!
//! Scripts are bounded: time, depth, sizes, memory, nodes ([`Limits`]). A script that fails says where ([`Problem`]); a
//! handler that fails is switched off and the frame goes on.
//!
//! This crate knows nothing of rendering, windows, displays, networks. It opens only files below the world's folder.

mod definition;
mod engine;
mod error;
mod expression;
mod held;
mod limits;
mod property_names;
mod random;
mod reference;
mod sharing;
mod source;
mod stage;
mod values;
mod weigh;
mod words;
mod world;

pub use error::{Problem, ScriptError};
pub use limits::Limits;
pub use reference::{FunctionDoc, definitions, functions};
pub use sharing::{Request, Sharing};
pub use world::saved::SaveForm;
pub use world::{Settings, World, shared_graph};
