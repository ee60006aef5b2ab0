//! What stays on the GPU from frame to frame, recognised by the identity of its `Arc`.

mod coverage;
mod material;
mod mesh;
mod slab;
mod texture;

pub(crate) use material::{GpuMaterial, MaterialCache};
pub(crate) use mesh::{GpuMesh, POSITION_BUFFERS, VERTEX_BUFFERS, make_mesh};
pub(crate) use slab::{KEEP_FRAMES, Slab};
