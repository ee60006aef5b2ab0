//! Draws every view of a scene with shadow maps and stencil shadow volumes.
//!
//! The one idea: a frame is drawn once, not a view at a time. All pictures and views of a frame come in one call;
//! deformed vertices, shadow maps and shadow volumes are made once and serve every view. What goes in is plain data
//! ([`umbriel_scene`]); copies on the GPU are recognised by the identity of its `Arc`s.
//!
//! This crate knows nothing of the field graph, of files, scripts, windows, trackers or sockets.

mod author;
mod buffer;
mod cache;
mod clock;
mod contours;
mod cull;
mod cutouts;
mod deform;
mod draws;
mod enclosed;
mod error;
mod gpu;
mod handover;
mod jobs;
mod layouts;
mod lighting;
mod lights;
mod maps;
mod plan;
mod projection;
mod read_back;
mod record;
mod renderer;
mod screen;
mod shaders;
mod sheets;
mod slots;
mod soft;
mod start;
mod stats;
mod surface;
mod surroundings;
mod targets;
mod uniforms;
pub mod volumes;

pub use author::WITHOUT_SHADER;
pub use error::Error;
pub use gpu::Gpu;
pub use read_back::{GreyPixels, RgbaPixels};
pub use renderer::Renderer;
pub use shaders::surface as surface_wgsl;
pub use start::Starting;
pub use stats::{FrameStats, MapShare};
