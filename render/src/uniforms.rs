//! What the shaders read, as Rust structs. A test compares their layouts with the WGSL.

use bytemuck::{Pod, Zeroable};

/// `View` of shaders/view.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct View {
    pub(crate) clip_from_world: [[f32; 4]; 4],
    pub(crate) world_from_clip: [[f32; 4]; 4],
    pub(crate) view_from_world: [[f32; 4]; 4],
    pub(crate) eye_in_world: [f32; 4],
    pub(crate) viewport: [f32; 4],
    pub(crate) window: [f32; 4],
    pub(crate) first_light: u32,
    pub(crate) light_count: u32,
    pub(crate) exposure: f32,
    pub(crate) shown_light: u32,
    pub(crate) first_sample: [f32; 2],
    pub(crate) spare: [u32; 2],
    /// The first ones of its range of lights.
    pub(crate) lights: [Light; View::LIGHTS],
}

impl View {
    /// How many lights it holds.
    pub(crate) const LIGHTS: usize = 2;
}

/// `Instance` of shaders/instance.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Instance {
    pub(crate) world_from_object: [[f32; 4]; 4],
    pub(crate) world_from_object_normal: [[f32; 4]; 3],
    pub(crate) flags: u32,
    pub(crate) spare: [u32; 3],
}

impl Instance {
    /// Shadows fall on it.
    pub(crate) const RECEIVES_SHADOW: u32 = 1;
    /// Its matrix mirrors.
    pub(crate) const MIRRORED: u32 = 2;
    /// Its mesh is flat.
    pub(crate) const FLAT: u32 = 4;
    /// From this bit on, 16 bits are the number of the list of lights that it receives, counted from 1.
    pub(crate) const RECEIVE_LIST_SHIFT: u32 = 8;
}

/// `Material` of shaders/material.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Material {
    pub(crate) base_color: [f32; 4],
    pub(crate) emissive: [f32; 3],
    pub(crate) alpha_cutoff: f32,
    pub(crate) specular: [f32; 3],
    pub(crate) exponent: f32,
    pub(crate) metallic: f32,
    pub(crate) roughness: f32,
    pub(crate) normal_scale: f32,
    pub(crate) occlusion_strength: f32,
    pub(crate) ambient: f32,
    pub(crate) shading: u32,
    pub(crate) alpha_mode: u32,
    pub(crate) layer_count: u32,
    pub(crate) textures: [Texture; 5],
    pub(crate) params: [[f32; 4]; 16],
    pub(crate) layers: [Layer; umbriel_scene::Material::MOST_LAYERS],
}

/// `Layer` of shaders/material.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Layer {
    /// Columns of the linear part of `uv_from_mesh`.
    pub(crate) linear: [f32; 4],
    pub(crate) offset: [f32; 2],
    pub(crate) uv_set: u32,
    pub(crate) kind: u32,
    pub(crate) mode: u32,
    pub(crate) projector: u32,
    pub(crate) shadow_texture: u32,
    pub(crate) flags: u32,
    pub(crate) factor: [f32; 4],
}

/// No place in a list.
pub(crate) const NOWHERE: u32 = u32::MAX;

/// `ShadowTexture` of shaders/projection.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct ShadowTexture {
    /// Place in the list of lights, or [`NOWHERE`].
    pub(crate) light: u32,
    /// Distances of the map, metres.
    pub(crate) near: f32,
    pub(crate) far: f32,
}

/// `Texture` of shaders/material.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Texture {
    /// Columns of the linear part of `uv_from_mesh`.
    pub(crate) linear: [f32; 4],
    pub(crate) offset: [f32; 2],
    pub(crate) uv_set: u32,
    pub(crate) present: u32,
}

/// `Light` of shaders/view.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Light {
    pub(crate) position: [f32; 3],
    pub(crate) kind: u32,
    pub(crate) direction: [f32; 3],
    pub(crate) range: f32,
    pub(crate) color: [f32; 3],
    pub(crate) shadow_intensity: f32,
    pub(crate) ambient: [f32; 3],
    pub(crate) cos_outer: f32,
    pub(crate) attenuation: [f32; 3],
    pub(crate) cone_scale: f32,
    pub(crate) first_face: u32,
    pub(crate) face_count: u32,
    pub(crate) filter_width: f32,
    pub(crate) slope_bias: f32,
    pub(crate) constant_bias: f32,
    pub(crate) map_flags: u32,
    pub(crate) size: f32,
    pub(crate) flags: u32,
}

impl Light {
    /// Six maps into all directions.
    pub(crate) const MAP_CUBE: u32 = 1;
    /// What is outside of the map is in shadow.
    pub(crate) const MAP_DARK_OUTSIDE: u32 = 2;
    /// Filter over a disc that is turned from place to place.
    pub(crate) const MAP_POISSON: u32 = 4;
    /// Penumbrae from the light's size.
    pub(crate) const MAP_PCSS: u32 = 8;
    /// Casts on every shape that lists no lights.
    pub(crate) const CASTS: u32 = 1;
}

/// `MapFace` of shaders/shadow_map.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct MapFace {
    pub(crate) map_from_world: [[f32; 4]; 4],
    pub(crate) world_from_map: [[f32; 4]; 4],
    /// Left, top of the tile in its layer; side, texels; layer.
    pub(crate) tile: [u32; 4],
    /// Towards the light (w = 0) or its position (w = 1).
    pub(crate) light: [f32; 4],
    /// Size of a texel at distance 1 (perspective) or everywhere (parallel), metres.
    pub(crate) texel: f32,
    pub(crate) spare: f32,
    /// Parallel (w = 0): metres per depth. From a position (w = 1): distance along the axis is `[0] / (depth + [1])`.
    pub(crate) depth: [f32; 2],
}

/// `Frame` of shaders/light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Frame {
    pub(crate) ambient: [f32; 4],
    pub(crate) zenith: [f32; 4],
    pub(crate) horizon: [f32; 4],
    pub(crate) nadir: [f32; 4],
    pub(crate) fog_color: [f32; 3],
    pub(crate) fog_range: f32,
    pub(crate) fog_kind: u32,
    pub(crate) light_count: u32,
    pub(crate) receive_words: u32,
    pub(crate) spare: u32,
    pub(crate) world_from_room: [[f32; 4]; 4],
}

/// `Film` of film.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Film {
    pub(crate) color: [f32; 4],
}
