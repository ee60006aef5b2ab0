// The one way from a vertex to the screen. Every pass that must meet another at the same depth (surfaces, light
// added at equal depth, caps of shadow volumes) goes through these two functions and declares its position
// @invariant; writing the same sum in another way may differ in the last bit.

// A vertex at rest or deformed, in the space of its object, as a point (w = 1) of the world.
fn world_from_vertex(world_from_object: mat4x4<f32>, p_in_object: vec3<f32>) -> vec4<f32> {
    return world_from_object * vec4<f32>(p_in_object, 1.0);
}

// A point (w = 1) or a direction (w = 0) of the world, in clip space: reversed depth, far plane at infinity.
fn clip_from_point(clip_from_world: mat4x4<f32>, p_in_world: vec4<f32>) -> vec4<f32> {
    return clip_from_world * p_in_world;
}
