// Light sources, and what surrounds everything.
struct Frame {
    ambient: vec4<f32>,
    zenith: vec4<f32>,
    horizon: vec4<f32>,
    nadir: vec4<f32>,
    fog_color: vec3<f32>,
    // 0: no fog.
    fog_range: f32,
    fog_kind: u32,
    light_count: u32,
    // Words of each list in `receive_lists`.
    receive_words: u32,
    // The room's pose in the world, for shaders of authors.
    world_from_room: mat4x4<f32>,
};

struct Light {
    position: vec3<f32>,
    kind: u32,
    direction: vec3<f32>,
    range: f32,
    // Times intensity.
    color: vec3<f32>,
    shadow_intensity: f32,
    ambient: vec3<f32>,
    cos_outer: f32,
    attenuation: vec3<f32>,
    // 1 / (cos_inner - cos_outer)
    cone_scale: f32,
    first_face: u32,
    // 0: no map.
    face_count: u32,
    // Texels across; 0 is the nearest texel.
    filter_width: f32,
    // Manual bias; below 0 it tunes itself.
    slope_bias: f32,
    constant_bias: f32,
    map_flags: u32,
    // Of the source: tangent of half the angle under which it is seen (directional), or radius, metres.
    size: f32,
    flags: u32,
};

const CASTS: u32 = 1u;

const DIRECTIONAL: u32 = 0u;
const SPOT: u32 = 1u;
const POINT: u32 = 2u;

const MAP_CUBE: u32 = 1u;
const MAP_DARK_OUTSIDE: u32 = 2u;
const MAP_POISSON: u32 = 4u;
const MAP_PCSS: u32 = 8u;

// What the lights and the air of a frame need.
override MAPS: bool = true;
override FOG: bool = true;

@group(3) @binding(0) var<uniform> frame: Frame;
@group(3) @binding(1) var<storage, read> lights: array<Light>;

// Unit vector towards the light, and its strength there (attenuation, range and cone).
struct Incidence {
    towards: vec3<f32>,
    strength: f32,
};

fn incidence(light: Light, p_in_world: vec3<f32>) -> Incidence {
    if light.kind == DIRECTIONAL {
        return Incidence(-light.direction, 1.0);
    }
    let offset = light.position - p_in_world;
    let d = max(length(offset), 1e-6);
    let towards = offset / d;
    var strength = 1.0 / max(dot(light.attenuation, vec3<f32>(1.0, d, d * d)), 1e-6);
    if d > light.range {
        strength = 0.0;
    } else if light.attenuation.x == 0.0 && light.attenuation.y == 0.0 {
        // The inverse square law fades to 0 at the range (KHR_lights_punctual); other laws end there (X3D).
        let x = d / light.range;
        strength *= 1.0 - x * x * x * x;
    }
    if light.kind == SPOT {
        let cone = saturate((dot(-towards, light.direction) - light.cos_outer) * light.cone_scale);
        strength *= cone * cone;
    }
    return Incidence(towards, strength);
}

// Share of fog at a distance from the eye (X3D Fog).
fn fog_share(distance: f32) -> f32 {
    if !FOG || frame.fog_range <= 0.0 {
        return 0.0;
    }
    if distance >= frame.fog_range {
        return 1.0;
    }
    if frame.fog_kind == 1u {
        return 1.0 - exp(-distance / (frame.fog_range - distance));
    }
    return distance / frame.fog_range;
}
