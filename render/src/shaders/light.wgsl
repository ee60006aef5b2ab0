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

const CASTS: u32 = 1u;

const DIRECTIONAL: u32 = 0u;
const SPOT: u32 = 1u;
const POINT: u32 = 2u;

const MAP_CUBE: u32 = 1u;
const MAP_DARK_OUTSIDE: u32 = 2u;
const MAP_POISSON: u32 = 4u;
const MAP_PCSS: u32 = 8u;

// What the lights and the air of a frame need; the rest is left out of a pipeline.
override MAPS: bool = true;
// Some light shines from a position.
override LAMPS: bool = true;
// Some light adds to what comes from everywhere.
override AMBIENTS: bool = true;
// Some surface lists the lights whose shadows fall on it.
override LISTS: bool = true;
// 0: none, 1: linear, 2: exponential; another number leaves it open.
override FOG: u32 = 3u;
// How many lights a pass adds up; more than the view holds leaves it open.
override LIGHTS: u32 = 3u;
// What is drawn is the picture itself, not linear light that is exposed afterwards.
override IS_PICTURE: bool = false;

@group(3) @binding(0) var<uniform> frame: Frame;
@group(3) @binding(1) var<storage, read> lights: array<Light>;

// Light from the scene as it is drawn.
fn exposed(light: vec3<f32>) -> vec3<f32> {
    if IS_PICTURE {
        return light * view.exposure;
    }
    return light;
}

// Unit vector towards the light, and its strength there (attenuation, range and cone).
struct Incidence {
    towards: vec3<f32>,
    strength: f32,
};

fn incidence(light: Light, p_in_world: vec3<f32>) -> Incidence {
    if !LAMPS || light.kind == DIRECTIONAL {
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
    if FOG == 0u || frame.fog_range <= 0.0 {
        return 0.0;
    }
    if distance >= frame.fog_range {
        return 1.0;
    }
    if FOG == 2u || (FOG != 1u && frame.fog_kind == 1u) {
        return 1.0 - exp(-distance / (frame.fog_range - distance));
    }
    return distance / frame.fog_range;
}
