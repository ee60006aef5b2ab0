// A linear picture brought to its place in the target. Concatenated after shaders/{view,fullscreen}.

@group(1) @binding(0) var picture: texture_2d<f32>;

// Whatever is the same for all pixels comes along from the corners: software devices would fetch it anew for every few of them.
struct Placed {
    // The whole viewport.
    @builtin(position) clip: vec4<f32>,
    // Place in the picture, texels.
    @location(0) at: vec2<f32>,
    @location(1) @interpolate(flat) first: vec2<f32>,
    @location(2) @interpolate(flat) last: vec2<f32>,
    // Factor of what is there.
    @location(3) @interpolate(flat) exposure: f32,
};

// `window` is left, top, width and height of what is brought.
fn placed(index: u32, window: vec4<f32>, exposure: f32) -> Placed {
    let ndc = corner_of_screen(index);
    let at = window.xy + (ndc * vec2<f32>(0.5, -0.5) + 0.5) * window.zw;
    return Placed(vec4<f32>(ndc, 0.0, 1.0), at, window.xy, window.xy + window.zw - 1.0, exposure);
}

// One view of the picture.
@vertex
fn of_view(@builtin(vertex_index) index: u32) -> Placed {
    return placed(index, view.window, view.exposure);
}

// All of the picture.
@vertex
fn whole(@builtin(vertex_index) index: u32) -> Placed {
    return placed(index, vec4<f32>(vec2<f32>(0.0), vec2<f32>(textureDimensions(picture))), 1.0);
}

fn texel(p: Placed) -> vec3<f32> {
    return textureLoad(picture, vec2<u32>(clamp(p.at, p.first, p.last)), 0).rgb;
}

// Times exposure; the target encodes.
@fragment
fn exposed(p: Placed) -> @location(0) vec4<f32> {
    return vec4<f32>(saturate(texel(p) * p.exposure), 1.0);
}

// As it is: data, or encoded already.
@fragment
fn plain(p: Placed) -> @location(0) vec4<f32> {
    return vec4<f32>(texel(p), 1.0);
}
