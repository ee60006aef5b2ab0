// The half-transparent film of 000's ShadowQuad. Concatenated after shaders/fullscreen.

struct Film {
    // Premultiplied.
    color: vec4<f32>,
};

@group(1) @binding(0) var<uniform> film: Film;

@fragment
fn tint() -> @location(0) vec4<f32> {
    return film.color;
}
