// Look-up of shadow maps. All maps are tiles in the layers of one array; a light has one face (spot), several nested
// ones (directional: the first that holds the point counts) or six (all directions: by major axis).
//
// Every texel that the filter covers is compared with the receiver's own plane at the texel's centre, and at the edges of shadows the
// caster's plane with the receiver's place. A plane of the world stays a plane in the map's space, so neither flat receivers nor bent
// ones nor corners need a bias; what is left of it covers how exactly maps are drawn.

struct MapFace {
    map_from_world: mat4x4<f32>,
    world_from_map: mat4x4<f32>,
    // Left and top of the tile, its side in texels, its layer.
    tile: vec4<u32>,
    // w = 0: unit vector towards the light; w = 1: position of the light.
    light: vec4<f32>,
    // Size of a texel at distance 1 from a position, or everywhere for parallel light, metres.
    texel: f32,
    // Parallel light: metres per depth. From a position: distance along the axis is x / (depth + y).
    depth: vec2<f32>,
};

@group(3) @binding(2) var<storage, read> map_faces: array<MapFace>;
@group(3) @binding(3) var maps: texture_depth_2d_array;
@group(3) @binding(4) var maps_sampler: sampler;

// Receiver at `p_in_world` with the unit normal of its triangle, which points to the side that is seen.
// 1: lit, 0: in shadow.
fn map_visibility(light: Light, p_in_world: vec3<f32>, face_normal: vec3<f32>) -> f32 {
    var face_index = light.first_face;
    var found = false;
    if (light.map_flags & MAP_CUBE) != 0u {
        face_index += major_axis(map_faces[face_index], p_in_world);
        found = true;
    } else {
        for (var i = 0u; i < light.face_count; i++) {
            let within = inside(light, map_faces[light.first_face + i], p_in_world);
            if within > 0u {
                face_index = light.first_face + i;
                found = true;
            }
            if within == 2u {
                break;
            }
        }
    }
    if !found {
        return select(1.0, 0.0, (light.map_flags & MAP_DARK_OUTSIDE) != 0u);
    }
    return face_visibility(light, map_faces[face_index], p_in_world, face_normal);
}

// +x -x +y -y +z -z of the map's own axes, which may have turned since: the first face looks along +x, +z at its
// right and +y above.
fn major_axis(first: MapFace, p_in_world: vec3<f32>) -> u32 {
    let clip = first.map_from_world * vec4<f32>(p_in_world, 1.0);
    let edge = 0.5 * first.texel * f32(first.tile.z);
    let d = vec3<f32>(clip.w, clip.y * edge, clip.x * edge);
    let a = abs(d);
    if a.x >= a.y && a.x >= a.z {
        return select(0u, 1u, d.x < 0.0);
    }
    if a.y >= a.z {
        return select(2u, 3u, d.y < 0.0);
    }
    return select(4u, 5u, d.z < 0.0);
}

// 1: inside of the tile, with a margin of three texels for filters and bias; 2: with all that its penumbra may need, so that
// penumbrae do not end where a finer map ends.
fn inside(light: Light, face: MapFace, p_in_world: vec3<f32>) -> u32 {
    let clip = face.map_from_world * vec4<f32>(p_in_world, 1.0);
    if clip.w <= 0.0 || clip.z < 0.0 {
        return 0u;
    }
    let place = max(abs(clip.x), abs(clip.y)) / clip.w;
    if place >= 1.0 - 6.0 / f32(face.tile.z) {
        return 0u;
    }
    var margin = 3.0;
    if (light.map_flags & MAP_PCSS) != 0u && face.light.w < 0.5 {
        margin += widest_penumbra(light, face, clip.z);
    }
    return select(1u, 2u, place < 1.0 - 2.0 * margin / f32(face.tile.z));
}

fn face_visibility(light: Light, face: MapFace, p_in_world: vec3<f32>, face_normal: vec3<f32>) -> f32 {
    let offset = face.light.xyz - p_in_world * face.light.w;
    let distance = length(offset);
    let towards = offset / max(distance, 1e-9);
    let texel = face.texel * select(1.0, distance, face.light.w > 0.5);
    let cosine = max(abs(dot(face_normal, towards)), 0.03);
    let slope = sqrt(1.0 - cosine * cosine) / cosine;

    // Depth is compared as exactly as it is drawn: corners lie on steps of 1/256 texel, which count for more where the
    // receiver is steep, and numbers are rounded. By hand, the bias is what was asked for and nothing else.
    let is_by_hand = light.slope_bias >= 0.0 || light.constant_bias >= 0.0;
    var p = p_in_world;
    if is_by_hand {
        p += towards * (max(light.slope_bias, 0.0) * texel * slope + max(light.constant_bias, 0.0));
    }
    let clip = face.map_from_world * vec4<f32>(p, 1.0);
    if clip.w <= 0.0 || clip.z < 0.0 {
        return 1.0;
    }
    let ndc = clip.xyz / clip.w;
    let side = f32(face.tile.z);
    var r: Receiver;
    r.t = (ndc.xy * vec2<f32>(0.5, -0.5) + 0.5) * side;
    r.depth = ndc.z;

    // Plane of the receiver in the map's space: depth per texel. A clamped slope keeps grazing receivers finite.
    let plane_in_world = vec4<f32>(face_normal, -dot(face_normal, p));
    let plane = plane_in_world * face.world_from_map;
    if abs(plane.z) > 1e-20 {
        r.depth_per_texel = -plane.xy / plane.z * vec2<f32>(2.0, -2.0) / side;
    }
    if face.light.w > 0.5 {
        let steepest = 0.25 * ndc.z;
        r.depth_per_texel = clamp(r.depth_per_texel, vec2<f32>(-steepest), vec2<f32>(steepest));
    }
    if !is_by_hand {
        // What a texel's length towards the light is in depth.
        let step = face.map_from_world * vec4<f32>(towards * texel, 0.0);
        let depth_of_texel = (clip.z + step.z) / (clip.w + step.w) - ndc.z;
        let rounding = DEPTH_ROUNDING * select(1.0, ndc.z, face.light.w > 0.5);
        r.tolerance = depth_of_texel * (CLOSE + SNAP * slope) + rounding;
        r.beside = depth_of_texel * BESIDE;
        r.steepest = depth_of_texel * STEEPEST;
    }

    if (light.map_flags & MAP_PCSS) != 0u {
        return contact_hardening(light, face, r);
    }
    if (light.map_flags & MAP_POISSON) != 0u {
        return disc_filtered(face, r, DISC_RADIUS, DISC_SAMPLES);
    }
    if light.filter_width == 0.0 {
        let centre = clamp(floor(r.t), vec2<f32>(0.0), vec2<f32>(side - 1.0)) + 0.5;
        return select(1.0, 0.0, hides(face, r, centre));
    }
    let width = light.filter_width;
    let around = mat2x3<f32>(footprint.across - towards * dot(footprint.across, towards), footprint.down - towards * dot(footprint.down, towards));
    if width > 1.0 && max(length(around[0]), length(around[1])) > width * texel {
        return filtered_by_samples(face, r, p);
    }
    return filtered(face, width, r);
}

// What a pixel shows of a triangle: how far its place moves to the next pixel to the right and down, metres, and the samples that are
// on it. Set before maps are asked.
struct Footprint {
    across: vec3<f32>,
    down: vec3<f32>,
    covered: vec4<f32>,
};

var<private> footprint: Footprint;

// The standard sample locations of Vulkan, Metal and Direct3D, from the middle of the pixel, pixels right and down.
const SAMPLES_X = vec4<f32>(-0.125, 0.375, -0.375, 0.125);
const SAMPLES_Y = vec4<f32>(-0.375, -0.125, 0.125, 0.375);

// Middle of the covered samples.
fn middle_of_footprint() -> vec2<f32> {
    let covered = footprint.covered;
    return vec2<f32>(dot(covered, SAMPLES_X), dot(covered, SAMPLES_Y)) / max(dot(covered, vec4<f32>(1.0)), 1.0);
}

// A pixel that shows more of the map than a filter covers, as of a ground far away: one bilinear comparison for each of its samples, so
// that thin shadows are as smooth there as shapes are. `p` is the middle of the footprint.
fn filtered_by_samples(face: MapFace, middle: Receiver, p: vec3<f32>) -> f32 {
    let side = f32(face.tile.z);
    let centre = middle_of_footprint();
    var lit = 0.0;
    var count = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let step = vec2<f32>(SAMPLES_X[i], SAMPLES_Y[i]) - centre;
        let clip = face.map_from_world * vec4<f32>(p + footprint.across * step.x + footprint.down * step.y, 1.0);
        var r = middle;
        r.t = (clip.xy / clip.w * vec2<f32>(0.5, -0.5) + 0.5) * side;
        r.depth = clip.z / clip.w;
        // Beyond the map's edge other maps know.
        if footprint.covered[i] > 0.0 && clip.w > 0.0 && all(abs(r.t - 0.5 * side) < vec2<f32>(0.5 * side - 2.0)) {
            lit += filtered(face, 1.0, r);
            count += 1.0;
        }
    }
    if count == 0.0 {
        return filtered(face, 1.0, middle);
    }
    return lit / count;
}

// The receiver as the filters see it.
struct Receiver {
    // Place in the tile, texels.
    t: vec2<f32>,
    depth: f32,
    depth_per_texel: vec2<f32>,
    // How much nearer to the light a caster has to be, depth.
    tolerance: f32,
    // The same per texel beside the receiver.
    beside: f32,
    // Slope up to which the plane of a caster is believed, depth per texel. 0: planes of casters do not count.
    steepest: f32,
};

// Shares of a texel by which depths may be nearer: always, and times the slope of the receiver.
const CLOSE: f32 = 0.03;
const SNAP: f32 = 0.02;
// Texels of depth per texel beside the receiver, for what is smaller than a texel and shows no plane.
const BESIDE: f32 = 0.25;
// Of rounded numbers, depth.
const DEPTH_ROUNDING: f32 = 3e-7;
// See Receiver.steepest, texels of depth per texel.
const STEEPEST: f32 = 16.0;

fn stored_at(face: MapFace, t: vec2<f32>) -> f32 {
    let inside = clamp(floor(t), vec2<f32>(0.0), vec2<f32>(f32(face.tile.z) - 1.0));
    return textureLoad(maps, vec2<u32>(inside) + face.tile.xy, face.tile.w, 0);
}

// Depth from which on something hides the receiver, at an offset in texels.
fn expected_at(r: Receiver, offset: vec2<f32>) -> f32 {
    return r.depth + dot(r.depth_per_texel, offset) + r.tolerance;
}

// `width` bilinear comparisons in a row and in a column, as weighted single comparisons: four texels per gather.
fn filtered(face: MapFace, width: f32, r: Receiver) -> f32 {
    let t = r.t;
    let layer_size = vec2<f32>(textureDimensions(maps));
    let side = f32(face.tile.z);
    let first = floor(t - 0.5 * width);
    let gathers = i32(ceil((width + 1.0) * 0.5));
    var lit = 0.0;
    for (var y = 0; y < gathers; y++) {
        for (var x = 0; x < gathers; x++) {
            // Centres of the four texels: corner -0.5 and +0.5.
            let corner = first + vec2<f32>(f32(2 * x + 1), f32(2 * y + 1));
            let inside = clamp(corner, vec2<f32>(1.0), vec2<f32>(side - 1.0)) + vec2<f32>(face.tile.xy);
            let stored = textureGather(maps, maps_sampler, inside / layer_size, face.tile.w);
            let near = corner - 0.5 - t;
            let far = corner + 0.5 - t;
            let weight_x = saturate(0.5 * (width + 1.0) - abs(vec2<f32>(near.x, far.x)));
            let weight_y = saturate(0.5 * (width + 1.0) - abs(vec2<f32>(near.y, far.y)));
            // Order of textureGather: (near, far), (far, far), (far, near), (near, near).
            let expected = vec4<f32>(
                expected_at(r, vec2<f32>(near.x, far.y)),
                expected_at(r, far),
                expected_at(r, vec2<f32>(far.x, near.y)),
                expected_at(r, near),
            );
            let weights = vec4<f32>(
                weight_x.x * weight_y.y,
                weight_x.y * weight_y.y,
                weight_x.y * weight_y.x,
                weight_x.x * weight_y.x,
            );
            lit += dot(weights, select(vec4<f32>(0.0), vec4<f32>(1.0), stored <= expected));
        }
    }
    lit /= width * width;
    // Somewhere between: an edge of a shadow, or the other wall of a corner.
    if r.steepest > 0.0 && lit > 0.0 && lit < 1.0 {
        return filtered_by_planes(face, width, r);
    }
    return lit;
}

// The same, where what is nearer must hide the receiver by its own plane too. The receiver's plane goes on behind the other wall of a
// corner, and so does that wall's plane behind the receiver: they hide each other only where each is in front of the other.
fn filtered_by_planes(face: MapFace, width: f32, r: Receiver) -> f32 {
    let first = floor(r.t - 0.5 * width) + 0.5;
    let count = i32(width) + 1;
    var lit = 0.0;
    for (var y = 0; y < count; y++) {
        for (var x = 0; x < count; x++) {
            let centre = first + vec2<f32>(f32(x), f32(y));
            let offset = centre - r.t;
            let weights = saturate(0.5 * (width + 1.0) - abs(offset));
            if !hides(face, r, centre) {
                lit += weights.x * weights.y;
            }
        }
    }
    return lit / (width * width);
}

fn hides(face: MapFace, r: Receiver, centre: vec2<f32>) -> bool {
    let offset = centre - r.t;
    let stored = stored_at(face, centre);
    if stored <= expected_at(r, offset) + r.beside * length(offset) {
        return false;
    }
    if r.steepest == 0.0 {
        return true;
    }
    // The caster's slope, from the neighbours that are farther out: those towards the receiver may be the receiver.
    let out = select(vec2<f32>(-1.0), vec2<f32>(1.0), offset > vec2<f32>(0.0));
    let across = vec2<f32>(out.x, 0.0);
    let along = vec2<f32>(0.0, out.y);
    var slope = vec2<f32>(stored_at(face, centre + across), stored_at(face, centre + along)) - stored;
    if abs(offset.x) < 0.5 {
        slope.x = smaller(slope.x, stored - stored_at(face, centre - across));
    }
    if abs(offset.y) < 0.5 {
        slope.y = smaller(slope.y, stored - stored_at(face, centre - along));
    }
    slope = clamp(slope, vec2<f32>(-r.steepest), vec2<f32>(r.steepest));
    return stored - dot(slope, abs(offset)) > r.depth + r.tolerance;
}

fn smaller(a: f32, b: f32) -> f32 {
    return select(b, a, abs(a) < abs(b));
}

const DISC_SAMPLES: u32 = 16u;
// As wide as 16 bilinear comparisons, texels.
const DISC_RADIUS: f32 = 2.5;
const PENUMBRA_SAMPLES: u32 = 32u;
const CONTACT_SAMPLES: u32 = 4u;
// No penumbra is looked for beyond this, texels.
const WIDEST_PENUMBRA: f32 = 160.0;

// Place of a sample of the unit disc (Vogel 1979), turned.
fn on_disc(i: u32, count: u32, turn: f32) -> vec2<f32> {
    let angle = f32(i) * 2.3999632 + turn;
    return sqrt((f32(i) + 0.5) / f32(count)) * vec2<f32>(cos(angle), sin(angle));
}

// The turn follows from the place in the map: it stays with the world, and both eyes see the same.
// (Jimenez 2014, Next generation post processing: interleaved gradient noise.)
fn turn_at(t: vec2<f32>) -> f32 {
    return 6.2831853 * fract(52.9829189 * fract(dot(floor(t * 4.0), vec2<f32>(0.06711056, 0.00583715))));
}

// The four texels around a place: their depths, which of them hide the receiver, and the place between them.
struct Quad {
    stored: vec4<f32>,
    hides: vec4<f32>,
    share: vec2<f32>,
};

// Texels around the receiver within which planes of casters are looked at.
const PLANES_WITHIN: f32 = 4.0;
// Farther out, what is so little nearer does not count either, times Receiver.steepest: the other wall of a corner.
const FAR_STEPS: f32 = 0.5;

fn quad_at(face: MapFace, r: Receiver, offset: vec2<f32>) -> Quad {
    let side = f32(face.tile.z);
    let corner = floor(r.t + offset + 0.5);
    let inside = clamp(corner, vec2<f32>(1.0), vec2<f32>(side - 1.0));
    let near = inside - 0.5 - r.t;
    let far = inside + 0.5 - r.t;
    let place = (inside + vec2<f32>(face.tile.xy)) / vec2<f32>(textureDimensions(maps));
    let stored = textureGather(maps, maps_sampler, place, face.tile.w);
    // Order of textureGather: (near, far), (far, far), (far, near), (near, near).
    let x = vec4<f32>(near.x, far.x, far.x, near.x);
    let y = vec4<f32>(far.y, far.y, near.y, near.y);
    var expected = r.depth + r.tolerance + r.depth_per_texel.x * x + r.depth_per_texel.y * y;
    var hides = stored > expected;
    if r.steepest > 0.0 && any(hides) {
        let slope = 0.5 * vec2<f32>(stored.y - stored.x + stored.z - stored.w, stored.x - stored.w + stored.y - stored.z);
        let twist = abs(stored.x - stored.y + stored.z - stored.w);
        if length(offset) > PLANES_WITHIN {
            hides = stored > expected + r.steepest * FAR_STEPS;
        } else if twist <= 0.25 * (abs(slope.x) + abs(slope.y)) + r.tolerance {
            let steep = clamp(slope, vec2<f32>(-r.steepest), vec2<f32>(r.steepest));
            hides = hides & (stored - steep.x * x - steep.y * y > vec4<f32>(r.depth + r.tolerance));
        }
    }
    let share = saturate(r.t + offset + 0.5 - corner);
    return Quad(stored, select(vec4<f32>(0.0), vec4<f32>(1.0), hides), share);
}

fn disc_filtered(face: MapFace, r: Receiver, radius: f32, count: u32) -> f32 {
    let turn = turn_at(r.t);
    var lit = 0.0;
    for (var i = 0u; i < count; i++) {
        let q = quad_at(face, r, radius * on_disc(i, count, turn));
        let one = 1.0 - q.hides;
        // Order of textureGather: (near, far), (far, far), (far, near), (near, near).
        lit += mix(mix(one.w, one.z, q.share.x), mix(one.x, one.y, q.share.x), q.share.y);
    }
    return lit / f32(count);
}

// Half the penumbra of parallel light if its caster were as far in front as the map begins, texels.
fn widest_penumbra(light: Light, face: MapFace, depth: f32) -> f32 {
    return clamp(light.size * (1.0 - depth) * face.depth.x / face.texel, 1.0, WIDEST_PENUMBRA);
}

// Fernando 2005, Percentage-closer soft shadows: how far the casters around are tells how wide the penumbra is.
fn contact_hardening(light: Light, face: MapFace, r: Receiver) -> f32 {
    let turn = turn_at(r.t);
    let is_parallel = face.light.w < 0.5;
    let distance = select(face.depth.x / max(r.depth + face.depth.y, 1e-9), 0.0, is_parallel);
    // As far as the nearest possible caster could be: the front of the map, or a tenth of the way to the light.
    var search = widest_penumbra(light, face, r.depth);
    if !is_parallel {
        search = clamp(9.0 * light.size / (distance * face.texel), 1.0, WIDEST_PENUMBRA);
    }
    var depth = 0.0;
    var casters = 0.0;
    for (var i = 0u; i < PENUMBRA_SAMPLES; i++) {
        let q = quad_at(face, r, search * on_disc(i, PENUMBRA_SAMPLES, turn));
        depth += dot(q.hides, q.stored);
        casters += dot(q.hides, vec4<f32>(1.0));
    }
    if casters == 0.0 {
        // Samples so far apart miss what is thin.
        return disc_filtered(face, r, 1.0, CONTACT_SAMPLES);
    }
    depth /= casters;
    var width = light.size * max(depth - r.depth, 0.0) * face.depth.x / face.texel;
    if !is_parallel {
        let caster = face.depth.x / max(depth + face.depth.y, 1e-9);
        width = light.size * max(distance - caster, 0.0) / max(caster * distance * face.texel, 1e-9);
    }
    return disc_filtered(face, r, clamp(width, 1.0, search), PENUMBRA_SAMPLES);
}
