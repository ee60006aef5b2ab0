// The hard shadow out of the stencil (004 section 3.2.2, step 2). Concatenated after
// shaders/{one_sample, four_samples}.wgsl and shaders/fullscreen.wgsl.

@group(0) @binding(0) var depth: Depths;
@group(0) @binding(1) var stencil: Stencils;

// Share of the samples that are in shadow, of those on the surface of the first one; its depth.
@fragment
fn hard_shadow(@builtin(position) at: vec4<f32>) -> @location(0) vec2<f32> {
    let pixel = vec2<i32>(at.xy);
    let first = textureLoad(depth, pixel, 0);
    var dark = 0.0;
    var count = 0.0;
    for (var i = 0; i < SAMPLES; i++) {
        if abs(textureLoad(depth, pixel, i) - first) <= 0.05 * first {
            dark += select(0.0, 1.0, textureLoad(stencil, pixel, i).r != 0u);
            count += 1.0;
        }
    }
    return vec2<f32>(select(0.0, dark / count, first > 0.0), first);
}
