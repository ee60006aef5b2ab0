// A drawing: light in steps, ink where a surface turns away. The shadow counts as light that does not arrive.

fn shade(s: Surface, light: LightSample) -> vec3<f32> {
    let arrives = max(dot(s.normal, light.towards), 0.0) * light.shadow;
    let steps = ceil(arrives * params.bands - 0.1) / params.bands;
    return s.base_color.rgb * light.color * steps / PI;
}

fn finish(s: Surface, lit: vec3<f32>) -> vec4<f32> {
    let line = 1.0 - smoothstep(0.18, 0.26, dot(s.normal, s.towards_eye));
    return vec4<f32>(mix(s.emissive + lit, params.ink, line), s.base_color.a);
}
