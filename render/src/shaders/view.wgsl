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
};

@group(0) @binding(0) var<uniform> view: View;
