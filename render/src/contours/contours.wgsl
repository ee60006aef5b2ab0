// Contours of a shape as lines (001 section 4.3): every edge is a quad, which the vertex shader pulls apart where the edge is
// a contour. Concatenated after shaders/view.wgsl and shaders/position.wgsl.

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(1) var<storage, read> triangles: array<vec4<u32>>;
// Two vertices a and b, place and number of its incidences.
@group(1) @binding(2) var<storage, read> edges: array<vec4<u32>>;
// Triangle << 1, plus 1 where the triangle runs from b to a.
@group(1) @binding(3) var<storage, read> incidences: array<u32>;

struct Contour {
    world_from_object: mat4x4<f32>,
    color: vec3<f32>,
    // Half the width of thin lines, pixels.
    line_px: f32,
    // The same of strokes around the silhouette, whose inner half is not drawn.
    outline_px: f32,
    // Cosine of the angle from which on an edge is a crease.
    crease_cos: f32,
};

@group(2) @binding(0) var<uniform> contour: Contour;

// Lines lie on the surface whose edges they are: so much nearer, as a share of the distance.
const NEARER = 5e-4;
// Strokes lean towards the eye, away from their edge, as ground does that the eye sees at 14 degrees: else the ground that a
// shape stands on would hide the stroke along its foot. Cotangent of that angle.
const LEAN = 4.0;
const NOWHERE = vec4<f32>(2.0, 2.0, 0.5, 1.0);

fn corner_in_world(i: u32) -> vec3<f32> {
    let p = vec3<f32>(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
    return world_from_vertex(contour.world_from_object, p).xyz;
}

fn normal_of(t: vec4<u32>) -> vec3<f32> {
    let a = corner_in_world(t.x);
    return cross(corner_in_world(t.y) - a, corner_in_world(t.z) - a);
}

// The signed sum of the sides that the eye sees, as shadow volumes count them: 0 where what is seen goes on across the edge,
// whatever the winding of the triangles. Open edges always count.
fn is_contour(e: vec4<u32>) -> bool {
    var sum = 0;
    for (var k = e.z; k < e.z + e.w; k++) {
        let t = triangles[incidences[k] >> 1u];
        let d = dot(normal_of(t), view.eye_in_world.xyz - corner_in_world(t.x));
        let facing = select(select(0, -1, d < 0.0), 1, d > 0.0);
        sum += select(facing, -facing, (incidences[k] & 1u) != 0u);
    }
    if sum != 0 {
        return true;
    }
    if e.w != 2u || contour.crease_cos < -1.0 {
        return false;
    }
    let one = incidences[e.z];
    let other = incidences[e.z + 1u];
    // Of two that run alike along the edge, one is wound the other way round.
    let turned = select(1.0, -1.0, (one & 1u) == (other & 1u));
    let a = normal_of(triangles[one >> 1u]);
    let b = turned * normal_of(triangles[other >> 1u]);
    return dot(a, b) < contour.crease_cos * length(a) * length(b);
}

// How much nearer a stroke is at so many pixels from its edge, as a share of the distance.
fn leaning(px: f32) -> f32 {
    let clip_from_world = transpose(view.clip_from_world);
    let rad_per_px = 2.0 / (length(clip_from_world[1].xyz) * view.window.w);
    return LEAN * px * rad_per_px;
}

// A corner of a quad along the edge: at its end or its beginning, and `away_px` pixels aside. The ends are `half_px` beyond.
fn pulled(edge: u32, is_end: bool, away_px: f32, half_px: f32, nearer: f32) -> vec4<f32> {
    let e = edges[edge];
    if half_px <= 0.0 || !is_contour(e) {
        return NOWHERE;
    }
    var p = clip_from_point(view.clip_from_world, vec4<f32>(corner_in_world(e.x), 1.0));
    var q = clip_from_point(view.clip_from_world, vec4<f32>(corner_in_world(e.y), 1.0));
    // In front of the near plane z is above w.
    let p_ahead = p.w - p.z;
    let q_ahead = q.w - q.z;
    if p_ahead <= 0.0 && q_ahead <= 0.0 {
        return NOWHERE;
    }
    if p_ahead < 0.0 {
        p = mix(p, q, p_ahead / (p_ahead - q_ahead));
    } else if q_ahead < 0.0 {
        q = mix(q, p, q_ahead / (q_ahead - p_ahead));
    }
    let pixels = 0.5 * view.window.zw;
    let way = (q.xy / q.w - p.xy / p.w) * pixels;
    let along = select(vec2<f32>(1.0, 0.0), normalize(way), dot(way, way) > 1e-12);
    // Square ends, so that lines join.
    let beyond_px = select(-half_px, half_px, is_end);
    let offset_px = vec2<f32>(-along.y, along.x) * away_px + along * beyond_px;
    let at = select(p, q, is_end);
    // Depth goes on beyond the ends as between them, where it is linear over the picture.
    let depth_per_px = (q.z / q.w - p.z / p.w) / max(length(way), 1.0);
    let depth = (at.z / at.w + depth_per_px * beyond_px) * (1.0 + nearer);
    return vec4<f32>(at.xy + offset_px / pixels * at.w, clamp(depth, 0.0, 1.0) * at.w, at.w);
}

// Corners of a quad in two triangles: at its end, and on its second side.
fn at_end(corner: u32) -> bool {
    return corner == 1u || corner == 2u || corner == 4u;
}

fn on_second_side(corner: u32) -> bool {
    return corner == 2u || corner > 3u;
}

@vertex
fn line(@builtin(vertex_index) corner: u32, @builtin(instance_index) edge: u32) -> @builtin(position) vec4<f32> {
    let half_px = contour.line_px;
    return pulled(edge, at_end(corner), select(-half_px, half_px, on_second_side(corner)), half_px, NEARER);
}

// Two quads, one on each side of the edge.
@vertex
fn outline(@builtin(vertex_index) vertex: u32, @builtin(instance_index) edge: u32) -> @builtin(position) vec4<f32> {
    let half_px = contour.outline_px;
    let corner = vertex % 6u;
    let side = select(-1.0, 1.0, vertex > 5u);
    let away_px = select(0.0, side * half_px, on_second_side(corner));
    return pulled(edge, at_end(corner), away_px, half_px, NEARER + leaning(abs(away_px)));
}

@fragment
fn inked() -> @location(0) vec4<f32> {
    return vec4<f32>(contour.color, 1.0);
}
