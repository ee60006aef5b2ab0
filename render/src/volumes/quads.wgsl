// The volume of one caster as degenerate quads, one for each edge and each triangle that may raise it, that the vertex
// shader pulls apart over silhouettes (000 section 4.2). Nothing is stored; every vertex asks the triangles at its edge
// anew, in every view.

@group(1) @binding(0) var<uniform> caster: Caster;
@group(1) @binding(1) var<storage, read> positions: array<f32>;
@group(1) @binding(2) var<storage, read> triangles: array<vec4<u32>>;
@group(1) @binding(3) var<storage, read> edges: array<vec4<u32>>;
@group(1) @binding(4) var<storage, read> incidences: array<u32>;
// Edge of each incidence.
@group(1) @binding(5) var<storage, read> edge_of: array<u32>;

struct Placed {
    @builtin(position) @invariant position: vec4<f32>,
};

// Outside of every view, with all the other corners.
const NOWHERE = vec4<f32>(2.0, 2.0, 0.5, 1.0);

fn near_or_far(i: u32, is_far: bool) -> Placed {
    let p = point_in_world(i);
    if is_far {
        return Placed(clip_from_point(view.clip_from_world, thrown(p)));
    }
    return Placed(clip_from_point(view.clip_from_world, p));
}

@vertex
fn side(@builtin(vertex_index) index: u32) -> Placed {
    let quad = index / 6u;
    let corner = index % 6u;
    let e = edges[edge_of[quad]];
    var sum = 0;
    for (var k = e.z; k < e.z + e.w; k++) {
        let c = cast_of(triangles[incidences[k] >> 1u]);
        sum += select(c, -c, (incidences[k] & 1u) != 0u);
    }
    if quad - e.z >= u32(abs(sum)) {
        return Placed(NOWHERE);
    }
    // p, q, q thrown; p, q thrown, p thrown.
    let is_q = corner == 1u || corner == 2u || corner == 4u;
    let is_far = corner == 2u || corner > 3u;
    return near_or_far(select(e.x, e.y, is_q == (sum < 0)), is_far);
}

fn corner_of(t: vec4<u32>, corner: u32) -> u32 {
    return select(select(t.x, t.y, corner == 1u), t.z, corner == 2u);
}

@vertex
fn near_cap(@builtin(vertex_index) index: u32) -> Placed {
    let t = triangles[index / 3u];
    if t.w == SOLID || cast_of(t) <= 0 {
        return Placed(NOWHERE);
    }
    return near_or_far(corner_of(t, index % 3u), false);
}

@vertex
fn solid_cap(@builtin(vertex_index) index: u32) -> Placed {
    let t = triangles[index / 3u];
    if t.w != SOLID || cast_of(t) <= 0 {
        return Placed(NOWHERE);
    }
    return near_or_far(corner_of(t, index % 3u), false);
}

@vertex
fn turned_cap(@builtin(vertex_index) index: u32) -> Placed {
    let t = triangles[index / 3u];
    if cast_of(t) >= 0 {
        return Placed(NOWHERE);
    }
    return near_or_far(corner_of(t, index % 3u), false);
}

@vertex
fn far_cap(@builtin(vertex_index) index: u32) -> Placed {
    let t = triangles[index / 3u];
    let c = cast_of(t);
    if c == 0 {
        return Placed(NOWHERE);
    }
    let corner = index % 3u;
    return near_or_far(corner_of(t, select(corner, 3u - corner, c > 0 && corner > 0u)), true);
}

@fragment
fn no_colour() {}
