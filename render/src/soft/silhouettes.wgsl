// The edges of a caster over which its shadow ends: those that carry a side of its volume.
// Concatenated after shaders/position.wgsl and volumes/{silhouette,caster}.wgsl.

struct Silhouette {
    p_in_world: vec4<f32>,
    q_in_world: vec4<f32>,
};

// Arguments of draw_indirect, then one entry per instance.
struct Silhouettes {
    vertex_count: u32,
    instance_count: atomic<u32>,
    first_vertex: u32,
    first_instance: u32,
    list: array<Silhouette>,
};

@group(0) @binding(5) var<storage, read_write> silhouettes: Silhouettes;

@compute @workgroup_size(64)
fn gather(
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
        let cast_by = cast_of(triangles[incidences[k] >> 1u]);
        sum += select(cast_by, -cast_by, (incidences[k] & 1u) != 0u);
    }
    if sum != 0 {
        let place = atomicAdd(&silhouettes.instance_count, 1u);
        // Seen from the light, the shadow is left of the way from p to q.
        let p = vec4<f32>(vertex_in_world(select(e.y, e.x, sum > 0)), 1.0);
        let q = vec4<f32>(vertex_in_world(select(e.x, e.y, sum > 0)), 1.0);
        silhouettes.list[place] = Silhouette(p, q);
    }
}
