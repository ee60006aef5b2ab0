// What is behind everything. Concatenated after shaders/{view,light,fullscreen}.

@fragment
fn background(f: Fullscreen) -> @location(0) vec4<f32> {
    let ray = view.world_from_clip * vec4<f32>(f.ndc, 0.0, 1.0);
    let up = normalize(ray.xyz).y;
    let away = select(frame.nadir, frame.zenith, up >= 0.0);
    return vec4<f32>(mix(frame.horizon.rgb, away.rgb, abs(up)), 1.0);
}
