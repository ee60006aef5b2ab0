//! Plain data that a renderer draws: meshes, materials, lights, stencil groups, views.
//!
//! The one idea: a frame is a value. [`Scene`] says what there is, [`Picture`] says from where it is seen and how
//! the views are laid out; a renderer, a ray tracer or a test needs nothing else. Bulk data sits behind `Arc`, so a
//! scene is cheap to keep up to date and a cache may recognise a mesh by its pointer.
//!
//! This crate knows nothing of fields, nodes, files, scripts, GPUs or windows.
//!
//! Conventions: right-handed, y up, metres, radians, linear colour. Matrices are named `foo_from_bar`.

mod adjacency;
mod bounds;
mod deform;
mod distance;
pub mod doctor;
mod drawables;
mod far;
mod layer;
mod light;
mod material;
mod mesh;
mod pick;
mod reduce;
mod scene;
mod score;
mod specks;
mod tangents;
mod trace;
mod view;
mod volume;
mod winding;

pub use adjacency::{Edge, Edges};
pub use bounds::Aabb;
pub use deform::{Deformed, deformed};
pub use drawables::{Drawables, Stamp};
pub use far::origin_near_eyes;
pub use layer::{Coordinates, Layer, LayerMode, LayerSource, MapCompare, Projector};
pub use light::{Light, LightKind, MapFilter, MapSettings, MapUpdate, ShadowMethod};
pub use material::{
    AlphaMode, Filter, FragmentShader, Image, Material, Sampler, ShaderParam, ShaderSource, Shading, TextureRef, Wrap,
};
pub use mesh::{Mesh, MeshError, MorphTarget, Topology};
pub use pick::Picked;
pub use reduce::{ReduceError, ReducedMesh, reduce};
pub use scene::{
    Background, ContourGroup, ContourStyle, Drawable, Film, Fog, FogKind, Pose, Samples, Scene, StandIn, StencilGroup,
    StencilMode,
};
pub use score::{Score, difference, score};
pub use specks::{Specks, specks};
pub use tangents::tangents;
pub use trace::{Mask, MaskError, PenumbraScore, Shares, TraceError, TraceOptions, Tracer, trace_visibility};
pub use view::{Frustum, Layout, Picture, PictureKind, Rect, View};
pub use volume::{Silhouettes, VolumeCounting, VolumeSettings};
