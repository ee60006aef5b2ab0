// A view's linear picture brought to its place in the target. Concatenated after shaders/{view,fullscreen}.

@group(1) @binding(0) var picture: texture_2d<f32>;

fn texel(ndc: vec2<f32>) -> vec4<f32> {
    let size = view.window.zw;
    let at = clamp((ndc * vec2<f32>(0.5, -0.5) + 0.5) * size, vec2<f32>(0.0), size - 1.0);
    return textureLoad(picture, vec2<u32>(view.window.xy + at), 0);
}

// Times exposure; the target encodes.
@fragment
fn exposed(f: Fullscreen) -> @location(0) vec4<f32> {
    return vec4<f32>(saturate(texel(f.ndc).rgb * view.exposure), 1.0);
}

// As it is: data.
@fragment
fn plain(f: Fullscreen) -> @location(0) vec4<f32> {
    return vec4<f32>(texel(f.ndc).rgb, 1.0);
}

// The whole of a picture that is encoded already.
@fragment
fn shown(f: Fullscreen) -> @location(0) vec4<f32> {
    let size = vec2<f32>(textureDimensions(picture));
    let at = clamp((f.ndc * vec2<f32>(0.5, -0.5) + 0.5) * size, vec2<f32>(0.0), size - 1.0);
    return vec4<f32>(textureLoad(picture, vec2<u32>(at), 0).rgb, 1.0);
}
