// What is behind everything. Concatenated after shaders/{view,light,fullscreen}.

// Whatever is the same for all pixels comes along from the corners: software devices would fetch it anew for every few of them.
struct Sky {
    // The whole screen, at infinity.
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) ray: vec3<f32>,
    @location(1) @interpolate(flat) horizon: vec3<f32>,
    @location(2) @interpolate(flat) zenith: vec3<f32>,
    @location(3) @interpolate(flat) nadir: vec3<f32>,
};

@vertex
fn sky(@builtin(vertex_index) index: u32) -> Sky {
    let clip = vec4<f32>(corner_of_screen(index), 0.0, 1.0);
    return Sky(clip, (view.world_from_clip * clip).xyz, frame.horizon.rgb, frame.zenith.rgb, frame.nadir.rgb);
}

@fragment
fn background(f: Sky) -> @location(0) vec4<f32> {
    let up = normalize(f.ray).y;
    let away = select(f.nadir, f.zenith, up >= 0.0);
    return vec4<f32>(exposed(mix(f.horizon, away, abs(up))), 1.0);
}
