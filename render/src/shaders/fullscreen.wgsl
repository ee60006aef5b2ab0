// A triangle that covers the screen, at infinity.
struct Fullscreen {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) ndc: vec2<f32>,
};

fn corner_of_screen(index: u32) -> vec2<f32> {
    return vec2<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0);
}

@vertex
fn fullscreen(@builtin(vertex_index) index: u32) -> Fullscreen {
    let ndc = corner_of_screen(index);
    return Fullscreen(vec4<f32>(ndc, 0.0, 1.0), ndc);
}
