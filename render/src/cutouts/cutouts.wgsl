// What one shape that alpha cuts holes into hides of one light. Its triangles throw volumes that say where to look; each sample
// in one asks whether its own ray to the light passes the triangle where the picture is there. Concatenated after
// shaders/{one_sample, four_samples}.wgsl, shaders/{view, position, material, samples}.wgsl and volumes/thrown.wgsl.

struct Cutout {
    world_from_object: mat4x4<f32>,
    // w = 1: position of the light. w = 0: direction towards it.
    toward_light: vec4<f32>,
    // As `Caster` of volumes/silhouette.wgsl.
    reach_w: f32,
};

@group(0) @binding(1) var depth: Depths;
@group(1) @binding(0) var<uniform> caster: Cutout;
@group(3) @binding(0) var<storage, read> positions: array<f32>;
@group(3) @binding(1) var<storage, read> indices: array<u32>;
// Both texture coordinates and the colour per vertex.
@group(3) @binding(2) var<storage, read> attributes: array<vec4<f32>>;

// Volumes are wider than their triangles by this share of them: devices place vertices on a grid of 1/256 pixel.
const WIDER = 0.01;
// What is this near to a triangle, in ways from pixel to pixel, lies on it. See volumes/draw.rs.
const ON_SURFACE_PIXELS = 1.0 / 32.0;
// Rounding of a ray, as a share of its length: neighbours must not leave a crack between them.
const ROUNDING = 1e-6;

// Of a triangle's volume; corners from the eye, metres in the world.
struct Volume {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) a: vec3<f32>,
    @location(1) @interpolate(flat) b: vec3<f32>,
    @location(2) @interpolate(flat) c: vec3<f32>,
    @location(3) @interpolate(flat) triangle: u32,
};

fn corner_in_world(triangle: u32, corner: u32) -> vec3<f32> {
    let i = 3u * indices[3u * triangle + corner];
    let p = vec3<f32>(positions[i], positions[i + 1u], positions[i + 2u]);
    return world_from_vertex(caster.world_from_object, p).xyz;
}

// Across the triangle towards the light, as long as twice its area; 0 where the light sees it edge-on.
fn toward_light_across(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, light: vec4<f32>) -> vec3<f32> {
    let n = cross(b - a, c - a);
    return n * sign(dot(n, light.xyz - light.w * a));
}

// Six corners per triangle: three where they are, counter-clockwise as the light sees them, and three thrown away from it.
@vertex
fn volume(@builtin(vertex_index) index: u32) -> Volume {
    let triangle = index / 6u;
    let a = corner_in_world(triangle, 0u);
    let b = corner_in_world(triangle, 1u);
    let c = corner_in_world(triangle, 2u);
    let light = caster.toward_light;
    let n = cross(b - a, c - a);
    let faces = dot(n, light.xyz - light.w * a);
    let eye = view.eye_in_world.xyz;
    if !(faces != 0.0) {
        return Volume(vec4<f32>(0.0, 0.0, 0.0, 1.0), a - eye, b - eye, c - eye, triangle);
    }
    let corner = index % 3u;
    let second = select(b, c, faces < 0.0);
    let third = select(c, b, faces < 0.0);
    let p = select(select(a, second, corner == 1u), third, corner == 2u);
    let wide = p + WIDER * (p - (a + b + c) / 3.0);
    var place = vec4<f32>(wide, 1.0);
    if index % 6u >= 3u {
        place = thrown(place);
    }
    return Volume(clip_from_point(view.clip_from_world, place), a - eye, b - eye, c - eye, triangle);
}

// The material's own alpha at a point of a triangle with these weights of its corners, from the picture at its full size.
fn alpha_at(triangle: u32, weights: vec3<f32>) -> f32 {
    let first = 3u * triangle;
    var uv = vec4<f32>(0.0);
    var alpha = 0.0;
    for (var k = 0u; k < 3u; k++) {
        let i = 2u * indices[first + k];
        uv += attributes[i] * weights[k];
        alpha += attributes[i + 1u].a * weights[k];
    }
    return full_size_alpha(uv.xy, uv.zw, alpha);
}

// Does the triangle hide the light from a sample?
fn hides(v: Volume, pixel: vec2<f32>, d: f32) -> bool {
    if d <= 0.0 {
        return false;
    }
    // From the eye to what the sample shows: its direction through the screen, one metre deep, and its depth.
    let at = ((pixel - view.window.xy) / view.window.zw * 2.0 - 1.0) * vec2<f32>(1.0, -1.0);
    let deep = 1.0 / (view.world_from_clip[2].w * d);
    let here = (view.world_from_clip * vec4<f32>(at, 0.0, 1.0)).xyz * deep;
    let pixel_size = 2.0 * length(view.world_from_clip[1].xyz) * deep / view.window.w;
    let eye = view.eye_in_world.xyz;
    let toward = caster.toward_light;
    let light = vec4<f32>(toward.xyz - eye * toward.w, toward.w);

    let across = toward_light_across(v.a, v.b, v.c, light);
    let height = dot(across, here - v.a);
    // On the triangle itself the side counts from which it is seen.
    let is_on = abs(height) <= ON_SURFACE_PIXELS * pixel_size * length(across);
    if select(height, dot(across, -v.a), is_on) > 0.0 {
        return false;
    }
    let ray = light.xyz - here * light.w;
    let rise = dot(across, ray);
    if !(rise > 0.0) {
        return false;
    }
    let way = -height / rise;
    // How far the shadow reaches.
    if (light.w == 0.0 && way * caster.reach_w > 1.0) || (light.w != 0.0 && (1.0 - way) < caster.reach_w) {
        return false;
    }
    let hit = here + ray * way;
    let area = dot(across, across);
    // Each corner's weight is the area across from it.
    let turn = select(-1.0, 1.0, dot(cross(v.b - v.a, v.c - v.a), across) > 0.0);
    let weights = turn * vec3<f32>(
        dot(cross(v.b - hit, v.c - hit), across),
        dot(cross(v.c - hit, v.a - hit), across),
        dot(cross(v.a - hit, v.b - hit), across),
    ) / area;
    let slack = ROUNDING * (1.0 + (length(hit) + length(hit - here)) * inverseSqrt(sqrt(area)));
    if !all(weights >= vec3<f32>(-slack)) {
        return false;
    }
    return !(alpha_at(v.triangle, weights) < material.alpha_cutoff);
}

@fragment
fn hidden_samples(v: Volume) -> @builtin(sample_mask) u32 {
    let pixel = floor(v.position.xy);
    var hidden = 0u;
    for (var i = 0; i < SAMPLES; i++) {
        let location = select(vec2<f32>(0.0), vec2<f32>(SAMPLES_X[i], SAMPLES_Y[i]), SAMPLES == 4);
        let d = textureLoad(depth, vec2<i32>(pixel), i);
        hidden |= select(0u, 1u << u32(i), hides(v, pixel + 0.5 + location, d));
    }
    if hidden == 0u {
        discard;
    }
    return hidden;
}
