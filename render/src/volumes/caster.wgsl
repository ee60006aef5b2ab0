// A part of a caster as compute passes read it. Concatenated after silhouette.wgsl.

@group(0) @binding(0) var<uniform> caster: Caster;
@group(0) @binding(1) var<storage, read> positions: array<f32>;
// Three vertices, and how its component is oriented: 1 outward, 2 inward, 0 not closed.
@group(0) @binding(2) var<storage, read> triangles: array<vec4<u32>>;
// Two vertices a and b, place and number of its incidences.
@group(0) @binding(3) var<storage, read> edges: array<vec4<u32>>;
// Triangle << 1, plus 1 where the triangle runs from b to a.
@group(0) @binding(4) var<storage, read> incidences: array<u32>;

fn item(group: vec3<u32>, groups: vec3<u32>, local: u32) -> u32 {
    return (group.y * groups.x + group.x) * 64u + local;
}
