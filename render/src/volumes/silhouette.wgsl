// A part of a caster under one light: which of its triangles throw a volume, and where to. Concatenated after
// shaders/position.wgsl. Whoever includes it declares `caster`, of this struct, and `positions`; caster.wgsl does so for
// compute passes.

const EVERY_TRIANGLE = 1u;
const MIRRORED = 2u;
const POINTED = 4u;

// Of a triangle of a convex solid, wound outward.
const SOLID = 3u;

struct Caster {
    world_from_object: mat4x4<f32>,
    // w = 1: position of the light. w = 0: direction towards it.
    toward_light: vec4<f32>,
    triangle_count: u32,
    edge_count: u32,
    flags: u32,
    // 1 / how far vertices are thrown, as metres of parallel light and as a multiple of their distance to a lamp. 0 is
    // infinity.
    reach_w: f32,
};

fn point_in_world(i: u32) -> vec4<f32> {
    let p = vec3<f32>(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
    return world_from_vertex(caster.world_from_object, p);
}

fn vertex_in_world(i: u32) -> vec3<f32> {
    return point_in_world(i).xyz;
}

// The one decision: 1 where the light sees the triangle counter-clockwise, -1 clockwise, 0 edge-on or degenerate.
// Taken in the world, so that mirrored and flattening matrices need no care.
fn facing(t: vec4<u32>) -> i32 {
    let a = vertex_in_world(t.x);
    let n = cross(vertex_in_world(t.y) - a, vertex_in_world(t.z) - a);
    let d = dot(n, caster.toward_light.xyz - caster.toward_light.w * a);
    return select(select(0, -1, d < 0.0), 1, d > 0.0);
}

// Whether a triangle that the light sees as `f` throws a volume. Of a closed component the side towards the light is
// enough while the light is outside; everything else throws with both sides.
fn contributes(t: vec4<u32>, f: i32) -> bool {
    if (caster.flags & EVERY_TRIANGLE) != 0u || t.w == 0u {
        return true;
    }
    let inward = (t.w == 2u) != ((caster.flags & MIRRORED) != 0u);
    return f == select(1, -1, inward);
}

// What a triangle throws: a volume as authored (1), one turned over (-1) or none.
fn cast_of(t: vec4<u32>) -> i32 {
    let f = facing(t);
    return select(0, f, contributes(t, f));
}
