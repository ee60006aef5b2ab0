// Filters over discs of the shadow map, as wide as 16 bilinear comparisons or as penumbrae. Concatenated after shadow_filter.wgsl.

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
