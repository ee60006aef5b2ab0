// The volume of one caster under one light: lists of indices and the arguments of the draws that read them.
// Vertex i of the mesh is index 2i where it is and 2i + 1 thrown away from the light.

struct Draw {
    index_count: atomic<u32>,
    instance_count: u32,
    first_index: atomic<u32>,
    base_vertex: i32,
    first_instance: u32,
};

// Arguments of draw_indexed_indirect, in the order of `extract.rs`.
struct Draws {
    sides: Draw,
    caps: Draw,
    turned_caps: Draw,
    solid_caps: Draw,
    far_caps: Draw,
};

// What each triangle casts.
@group(0) @binding(5) var<storage, read_write> casts: array<i32>;
@group(0) @binding(6) var<storage, read_write> draws: Draws;
@group(0) @binding(7) var<storage, read_write> indices: array<u32>;

fn put(at: u32, a: u32, b: u32, c: u32) {
    indices[at] = a;
    indices[at + 1u] = b;
    indices[at + 2u] = c;
}

@compute @workgroup_size(64)
fn turn_triangles(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = item(group, groups, local);
    if i >= caster.triangle_count {
        return;
    }
    let t = triangles[i];
    let c = cast_of(t);
    casts[i] = c;
    if c == 0 {
        return;
    }
    // Near caps keep the order of their vertices, so that their depth is the surface's to the last bit; turned ones are
    // drawn with the stencil operations exchanged, and grow from the end of the list.
    if c > 0 && t.w == SOLID {
        let first = atomicLoad(&draws.solid_caps.first_index);
        put(first + atomicAdd(&draws.solid_caps.index_count, 3u), 2u * t.x, 2u * t.y, 2u * t.z);
    } else if c > 0 {
        let first = atomicLoad(&draws.caps.first_index);
        put(first + atomicAdd(&draws.caps.index_count, 3u), 2u * t.x, 2u * t.y, 2u * t.z);
    } else {
        put(atomicSub(&draws.turned_caps.first_index, 3u) - 3u, 2u * t.x, 2u * t.y, 2u * t.z);
        atomicAdd(&draws.turned_caps.index_count, 3u);
    }
    // The far cap looks away from the light.
    let second = select(t.y, t.z, c > 0);
    let third = select(t.z, t.y, c > 0);
    let first = atomicLoad(&draws.far_caps.first_index);
    put(first + atomicAdd(&draws.far_caps.index_count, 3u), 2u * t.x + 1u, 2u * second + 1u, 2u * third + 1u);
}

@compute @workgroup_size(64)
fn raise_edges(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = item(group, groups, local);
    if i >= caster.edge_count {
        return;
    }
    let e = edges[i];
    var sum = 0;
    for (var k = e.z; k < e.z + e.w; k++) {
        let cast_by = casts[incidences[k] >> 1u];
        sum += select(cast_by, -cast_by, (incidences[k] & 1u) != 0u);
    }
    if sum == 0 {
        return;
    }
    // The side runs against the triangles above it: p to q, then away from the light.
    let p = 2u * select(e.x, e.y, sum > 0);
    let q = 2u * select(e.y, e.x, sum > 0);
    let times = u32(abs(sum));
    // Under parallel light without end the far ends are one point, and the second triangle is none.
    let is_pointed = (caster.flags & POINTED) != 0u;
    var at = atomicAdd(&draws.sides.index_count, select(6u, 3u, is_pointed) * times);
    for (var k = 0u; k < times; k++) {
        if is_pointed {
            // All vertices are thrown to the same point, so that one index serves all.
            put(at, p, q, 1u);
            at += 3u;
            continue;
        }
        put(at, p, q, q + 1u);
        put(at + 3u, p, q + 1u, p + 1u);
        at += 6u;
    }
}
