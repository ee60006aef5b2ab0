// What authors' shaders know: a place of a surface, the light that reaches it, and our own shading to build upon.
// docs/shaders.md is the manual of this file.

// A place of a surface. Places and directions are in the space of the room.
struct Surface {
    // Linear RGB and opacity, textures and vertex colours included.
    base_color: vec4<f32>,
    // Unit normal, normal texture included, on the side that is seen.
    normal: vec3<f32>,
    // Unit normal of the triangle, towards the eye.
    face_normal: vec3<f32>,
    towards_eye: vec3<f32>,
    // On what of the triangle the pixel shows.
    position: vec3<f32>,
    // From the eye, metres.
    distance: f32,
    emissive: vec3<f32>,
    occlusion: f32,
    metallic: f32,
    // Perceptual.
    roughness: f32,
    uv0: vec2<f32>,
    uv1: vec2<f32>,
    vertex_color: vec4<f32>,
    // Middle of the pixel in its view.
    pixel: vec2<f32>,
    // Lights do not count: an UnlitMaterial, or lines and points without normals.
    is_unlit: bool,
    receives_shadow: bool,
};

// What one light sends to a place.
struct LightSample {
    // Unit vector towards the light.
    towards: vec3<f32>,
    // Linear RGB that arrives at right angles, distance and cone included, shadow not.
    color: vec3<f32>,
    // Share that arrives: 1 is lit, 0 is in full shadow. Of a map, of a volume, or 1 where the light casts none.
    shadow: f32,
    // DIRECTIONAL, SPOT or POINT.
    kind: u32,
};

// Light that is reflected towards the eye.
fn standard_shade(s: Surface, light: LightSample) -> vec3<f32> {
    if shading() == PHONG {
        return phong_brdf(s, light.towards) * light.color * light.shadow;
    }
    return metallic_roughness_brdf(s, light.towards) * light.color * light.shadow;
}

// The same of `light` that comes from everywhere.
fn standard_ambient(s: Surface, light: vec3<f32>) -> vec3<f32> {
    return light * material.ambient * s.occlusion * s.base_color.rgb;
}

// What is seen of a surface that reflects `lit`, before fog.
fn standard_finish(s: Surface, lit: vec3<f32>) -> vec4<f32> {
    return vec4<f32>(s.emissive + lit, s.base_color.a);
}

// A place or a direction of the room, in the world.
fn place_in_world(p_in_room: vec3<f32>) -> vec3<f32> {
    return (frame.world_from_room * vec4<f32>(p_in_room, 1.0)).xyz;
}

fn direction_in_world(d_in_room: vec3<f32>) -> vec3<f32> {
    return normalize((frame.world_from_room * vec4<f32>(d_in_room, 0.0)).xyz);
}

// The material's own textures at any place, 0 is the largest copy; white where there is none.
fn base_texture_at(uv: vec2<f32>, level: f32) -> vec4<f32> {
    return textureSampleLevel(base_color_texture, base_color_sampler, uv, level);
}

fn emissive_texture_at(uv: vec2<f32>, level: f32) -> vec4<f32> {
    return textureSampleLevel(emissive_texture, emissive_sampler, uv, level);
}
