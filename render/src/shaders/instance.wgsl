// One drawable of the frame.
struct Instance {
    world_from_object: mat4x4<f32>,
    world_from_object_normal: mat3x3<f32>,
    flags: u32,
};

const RECEIVES_SHADOW: u32 = 1u;
const MIRRORED: u32 = 2u;
const FLAT: u32 = 4u;

@group(1) @binding(0) var<storage, read> instances: array<Instance>;
