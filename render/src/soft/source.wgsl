// The light of a soft shadow, and places on what the eye sees. Concatenated after shaders/view.wgsl.

struct Source {
    // w = 1: position of the light. w = 0: direction towards it.
    toward_light: vec4<f32>,
    // Radius, metres; of parallel light the tangent of half the angle under which it is seen.
    size: f32,
};

@group(1) @binding(0) var<uniform> source: Source;
// The hard shadow's share of each pixel, and the depth of its first sample.
@group(1) @binding(1) var hard: texture_2d<f32>;

fn ndc_at(pixel: vec2<f32>) -> vec2<f32> {
    let size = vec2<f32>(textureDimensions(hard));
    return ((pixel + 0.5 + view.first_sample) / size * 2.0 - 1.0) * vec2<f32>(1.0, -1.0);
}

fn world_at(pixel: vec2<f32>, depth: f32) -> vec3<f32> {
    let p = view.world_from_clip * vec4<f32>(ndc_at(pixel), depth, 1.0);
    return p.xyz / p.w;
}

// Unit vector towards the light, and its distance; parallel light has none (0).
struct Toward {
    unit: vec3<f32>,
    distance: f32,
};

fn toward_light_at(p_in_world: vec3<f32>) -> Toward {
    if source.toward_light.w == 0.0 {
        return Toward(source.toward_light.xyz, 0.0);
    }
    let offset = source.toward_light.xyz - p_in_world;
    let d = length(offset);
    return Toward(offset / max(d, 1e-9), d);
}
