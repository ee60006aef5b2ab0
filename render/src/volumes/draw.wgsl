// Places the vertices that `extract.wgsl` listed. The struct Caster is the one of that file.

struct Caster {
    world_from_object: mat4x4<f32>,
    toward_light: vec4<f32>,
    triangle_count: u32,
    edge_count: u32,
    flags: u32,
    unused: u32,
};

@group(1) @binding(0) var<uniform> caster: Caster;
@group(1) @binding(1) var<storage, read> positions: array<f32>;

struct Placed {
    @builtin(position) @invariant position: vec4<f32>,
};

@vertex
fn place(@builtin(vertex_index) index: u32) -> Placed {
    let i = index >> 1u;
    let p_in_object = vec3<f32>(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
    let p = world_from_vertex(caster.world_from_object, p_in_object);
    if (index & 1u) == 0u {
        return Placed(clip_from_point(view.clip_from_world, p));
    }
    // A direction has w = 0 in the world; view and projection then take it to infinity (against 002, which says to set
    // w after the transformation).
    let away = p.xyz * caster.toward_light.w - caster.toward_light.xyz;
    return Placed(clip_from_point(view.clip_from_world, vec4<f32>(away, 0.0)));
}

// A triangle over the whole viewport, for the step between groups.
@vertex
fn whole_view(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}

@fragment
fn no_colour() {}
