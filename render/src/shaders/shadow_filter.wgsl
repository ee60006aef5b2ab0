// What hides a place in a shadow map, and bilinear filters over that. Concatenated after shadow_map.wgsl and samples.wgsl.
//
// Every texel that the filter covers is compared with the receiver's own plane at the texel's centre, and at the edges of shadows the
// caster's plane with the receiver's place. A plane of the world stays a plane in the map's space, so neither flat receivers nor bent
// ones nor corners need a bias; what is left of it covers how exactly maps are drawn.

// What a pixel shows of a triangle: how far its place moves to the next pixel to the right and down, metres, and the samples that are
// on it. Set before maps are asked.
struct Footprint {
    across: vec3<f32>,
    down: vec3<f32>,
    covered: vec4<f32>,
};

var<private> footprint: Footprint;

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
