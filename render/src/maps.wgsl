// Shadow maps: depth seen from a light. Concatenated after shaders/{position,view,instance,material}.

struct Caster {
    @builtin(position) clip: vec4<f32>,
    @location(0) uv0: vec2<f32>,
    @location(1) uv1: vec2<f32>,
    @location(2) color: vec4<f32>,
};

@vertex
fn solid(@location(0) position: vec3<f32>, @location(6) instance: u32) -> @builtin(position) vec4<f32> {
    return clip_from_point(view.clip_from_world, world_from_vertex(instances[instance].world_from_object, position));
}

@vertex
fn holed(
    @location(0) position: vec3<f32>,
    @location(3) uv0: vec2<f32>,
    @location(4) uv1: vec2<f32>,
    @location(5) color: vec4<f32>,
    @location(6) instance: u32,
) -> Caster {
    let p_in_world = world_from_vertex(instances[instance].world_from_object, position);
    return Caster(clip_from_point(view.clip_from_world, p_in_world), uv0, uv1, color);
}

// Leaves and fences: below the cutoff nothing casts.
@fragment
fn cut(c: Caster) {
    if base_color_at(c.uv0, c.uv1, c.color).a < material.alpha_cutoff {
        discard;
    }
}

// Empties one tile: depth 0 is infinitely far.
@vertex
fn empty(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
