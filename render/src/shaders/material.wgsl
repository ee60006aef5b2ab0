// How a surface looks.
struct Texture {
    // Columns of the linear part of the map from the mesh's coordinates to the picture's.
    linear: vec4<f32>,
    offset: vec2<f32>,
    uv_set: u32,
    present: u32,
};

// A texture that is put over the base colour.
struct Layer {
    linear: vec4<f32>,
    offset: vec2<f32>,
    uv_set: u32,
    kind: u32,
    mode: u32,
    // NOWHERE: the mesh's own coordinates.
    projector: u32,
    shadow_texture: u32,
    // 1, 2: nothing outside of 0..1 across, up. From bit 2 on: what a shadow map gives.
    flags: u32,
    factor: vec4<f32>,
};

struct Material {
    base_color: vec4<f32>,
    emissive: vec3<f32>,
    alpha_cutoff: f32,
    specular: vec3<f32>,
    exponent: f32,
    metallic: f32,
    roughness: f32,
    normal_scale: f32,
    occlusion_strength: f32,
    // Share of ambient light that is reflected.
    ambient: f32,
    shading: u32,
    alpha_mode: u32,
    layer_count: u32,
    textures: array<Texture, 5>,
    // Of the shape's own shader.
    params: array<vec4<f32>, 16>,
    layers: array<Layer, 4>,
};

const METALLIC_ROUGHNESS: u32 = 0u;
const PHONG: u32 = 1u;
const UNLIT: u32 = 2u;

const OPAQUE: u32 = 0u;
const MASK: u32 = 1u;
const BLEND: u32 = 2u;

// What the shapes of a pipeline need; the rest is left out of it.
// A bit for each of the five textures.
override TEXTURES: u32 = 31u;
override LAYERS: u32 = 4u;
// One of the kinds of shading; another number leaves it open.
override SHADING: u32 = 3u;

@group(2) @binding(0) var<uniform> material: Material;
@group(2) @binding(1) var base_color_texture: texture_2d<f32>;
@group(2) @binding(2) var base_color_sampler: sampler;
@group(2) @binding(3) var metallic_roughness_texture: texture_2d<f32>;
@group(2) @binding(4) var metallic_roughness_sampler: sampler;
@group(2) @binding(5) var normal_texture: texture_2d<f32>;
@group(2) @binding(6) var normal_sampler: sampler;
@group(2) @binding(7) var occlusion_texture: texture_2d<f32>;
@group(2) @binding(8) var occlusion_sampler: sampler;
@group(2) @binding(9) var emissive_texture: texture_2d<f32>;
@group(2) @binding(10) var emissive_sampler: sampler;

fn has_texture(slot: u32) -> bool {
    return (TEXTURES & (1u << slot)) != 0u && material.textures[slot].present != 0u;
}

fn shading() -> u32 {
    if SHADING > UNLIT {
        return material.shading;
    }
    return SHADING;
}

fn texture_place(slot: u32, uv0: vec2<f32>, uv1: vec2<f32>) -> vec2<f32> {
    let t = material.textures[slot];
    let uv = select(uv0, uv1, t.uv_set == 1u);
    return t.linear.xy * uv.x + t.linear.zw * uv.y + t.offset;
}

// Alpha with texture and vertex colour, from the picture at its full size.
fn full_size_alpha(uv0: vec2<f32>, uv1: vec2<f32>, vertex_alpha: f32) -> f32 {
    return full_size_alpha_at(texture_place(0u, uv0, uv1), vertex_alpha);
}

// The same at a place in the base colour's texture.
fn full_size_alpha_at(place: vec2<f32>, vertex_alpha: f32) -> f32 {
    var alpha = material.base_color.a * vertex_alpha;
    if has_texture(0u) {
        alpha *= textureSampleLevel(base_color_texture, base_color_sampler, place, 0.0).a;
    }
    return alpha;
}

// Linear RGBA with texture and vertex colour.
fn base_color_at(uv0: vec2<f32>, uv1: vec2<f32>, vertex_color: vec4<f32>) -> vec4<f32> {
    var color = material.base_color * vertex_color;
    if has_texture(0u) {
        color *= textureSample(base_color_texture, base_color_sampler, texture_place(0u, uv0, uv1));
    }
    return color;
}
