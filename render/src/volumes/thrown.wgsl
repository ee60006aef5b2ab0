// Where volumes end. Whoever includes it declares `caster`, with `toward_light` and `reach_w` as those of `Caster` in silhouette.wgsl.

// A vertex thrown away from the light. At infinity it is a direction, with w = 0 in the world; view and projection then
// take it there (against 002, which says to set w after the transformation). Short of infinity it is the same sum with
// all four numbers divided by the distance, so that one expression serves both.
fn thrown(p: vec4<f32>) -> vec4<f32> {
    let light = caster.toward_light;
    let w = caster.reach_w;
    if light.w == 0.0 {
        return vec4<f32>(p.xyz * w - light.xyz, w);
    }
    return vec4<f32>(p.xyz - light.xyz * (1.0 - w), w);
}
