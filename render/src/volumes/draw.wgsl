// Places the vertices that `extract.wgsl` listed.

@group(1) @binding(0) var<uniform> caster: Caster;
@group(1) @binding(1) var<storage, read> positions: array<f32>;

struct Placed {
    @builtin(position) @invariant position: vec4<f32>,
};

@vertex
fn place(@builtin(vertex_index) index: u32) -> Placed {
    let p = point_in_world(index >> 1u);
    if (index & 1u) == 0u {
        return Placed(clip_from_point(view.clip_from_world, p));
    }
    return Placed(clip_from_point(view.clip_from_world, thrown(p)));
}

// A triangle over the whole viewport, for the step between groups.
@vertex
fn whole_view(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}

@fragment
fn no_colour() {}
