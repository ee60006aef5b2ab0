// A film as strong as the soft shadow, sample by sample. Concatenated after shaders/{one_sample, four_samples}.wgsl,
// shaders/view.wgsl, shaders/soft_shadow.wgsl, shaders/fullscreen.wgsl and film.wgsl.

@group(2) @binding(0) var depth: Depths;

@fragment
fn soft_tint(f: Fullscreen, @builtin(sample_index) sample: u32) -> @location(0) vec4<f32> {
    let d = textureLoad(depth, vec2<i32>(f.clip.xy), sample);
    if d <= 0.0 {
        discard;
    }
    return film.color * hidden_share(f.clip.xy, d, vec2<f32>(0.0));
}
