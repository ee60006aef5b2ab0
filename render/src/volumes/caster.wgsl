// A part of a caster under one light, as compute passes read it: which of its triangles throw a volume.
// Concatenated after shaders/position.wgsl.

const EVERY_TRIANGLE = 1u;
const MIRRORED = 2u;

struct Caster {
    world_from_object: mat4x4<f32>,
    // w = 1: position of the light. w = 0: direction towards it.
    toward_light: vec4<f32>,
    triangle_count: u32,
    edge_count: u32,
    flags: u32,
    unused: u32,
};

@group(0) @binding(0) var<uniform> caster: Caster;
@group(0) @binding(1) var<storage, read> positions: array<f32>;
// Three vertices, and how its component is oriented: 1 outward, 2 inward, 0 not closed.
@group(0) @binding(2) var<storage, read> triangles: array<vec4<u32>>;
// Two vertices a and b, place and number of its incidences.
@group(0) @binding(3) var<storage, read> edges: array<vec4<u32>>;
// Triangle << 1, plus 1 where the triangle runs from b to a.
@group(0) @binding(4) var<storage, read> incidences: array<u32>;

fn vertex_in_world(i: u32) -> vec3<f32> {
    let p = vec3<f32>(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
    return world_from_vertex(caster.world_from_object, p).xyz;
}

fn item(group: vec3<u32>, groups: vec3<u32>, local: u32) -> u32 {
    return (group.y * groups.x + group.x) * 64u + local;
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
