// What a shape's own shader may replace, one function a paragraph; see `author/`.

fn surface(s: Surface) -> Surface {
    return s;
}

fn shade(s: Surface, light: LightSample) -> vec3<f32> {
    return standard_shade(s, light);
}

fn ambient(s: Surface, light: vec3<f32>) -> vec3<f32> {
    return standard_ambient(s, light);
}

fn finish(s: Surface, lit: vec3<f32>) -> vec4<f32> {
    return standard_finish(s, lit);
}
