// A light source.
struct Light {
    position: vec3<f32>,
    kind: u32,
    direction: vec3<f32>,
    range: f32,
    // Times intensity.
    color: vec3<f32>,
    shadow_intensity: f32,
    ambient: vec3<f32>,
    cos_outer: f32,
    attenuation: vec3<f32>,
    // 1 / (cos_inner - cos_outer)
    cone_scale: f32,
    first_face: u32,
    // 0: no map.
    face_count: u32,
    // Texels across; 0 is the nearest texel.
    filter_width: f32,
    // Manual bias; below 0 it tunes itself.
    slope_bias: f32,
    constant_bias: f32,
    map_flags: u32,
    // Of the source: tangent of half the angle under which it is seen (directional), or radius, metres.
    size: f32,
    flags: u32,
};

// One view of the frame, or one face of a shadow map.
struct View {
    clip_from_world: mat4x4<f32>,
    // Applied to (x, y, 0, 1) it gives the direction (w = 0) of the ray through that place of the screen.
    world_from_clip: mat4x4<f32>,
    view_from_world: mat4x4<f32>,
    // The eye in the world; w = 1. Of parallel light w = 0 and xyz is the direction towards the light.
    eye_in_world: vec4<f32>,
    // Left, top, width, height in the picture, pixels.
    viewport: vec4<f32>,
    // The same in the target that is drawn in, which several views may share.
    window: vec4<f32>,
    // Lights that the pass adds up, as a range of the frame's list.
    first_light: u32,
    light_count: u32,
    // Factor of the linear picture before it is encoded.
    exposure: f32,
    // Of a pass that shows one light's visibility: its place in the frame's list.
    shown_light: u32,
    // Where the first sample of a pixel lies, from its centre, pixels right and down.
    first_sample: vec2<f32>,
    // The first lights of the range. Software devices read a place that is known beforehand once for all pixels, and any other
    // pixel by pixel.
    lights: array<Light, 2>,
};

const LIGHTS_OF_VIEW = 2u;

@group(0) @binding(0) var<uniform> view: View;
