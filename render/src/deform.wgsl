// Morph targets and skins: rest vertices to deformed ones, in the space of their object (glTF 2.0 section 3.7).

struct Deformation {
    vertex_count: u32,
    target_count: u32,
    joint_count: u32,
};

struct Influence {
    joints: vec4<u32>,
    weights: vec4<f32>,
};

@group(0) @binding(0) var<uniform> deformation: Deformation;
// x y z per vertex.
@group(0) @binding(1) var<storage, read> rest_positions: array<f32>;
// Normal and tangent: seven numbers per vertex.
@group(0) @binding(2) var<storage, read> rest_frames: array<f32>;
@group(0) @binding(3) var<storage, read> influences: array<Influence>;
// Offsets of position, normal and tangent: nine numbers per vertex, target after target.
@group(0) @binding(4) var<storage, read> offsets: array<f32>;
@group(0) @binding(5) var<storage, read> object_from_bind: array<mat4x4<f32>>;
@group(0) @binding(6) var<storage, read> morph_weights: array<f32>;
@group(0) @binding(7) var<storage, read_write> positions: array<f32>;
@group(0) @binding(8) var<storage, read_write> frames: array<f32>;

fn unit(v: vec3<f32>, otherwise: vec3<f32>) -> vec3<f32> {
    let squared = dot(v, v);
    return select(otherwise, v * inverseSqrt(max(squared, 1e-30)), squared > 1e-24);
}

@compute @workgroup_size(64)
fn deform(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.x + id.y * groups.x * 64u;
    if i >= deformation.vertex_count {
        return;
    }
    let r = 7u * i;
    var p = vec3<f32>(rest_positions[3u * i], rest_positions[3u * i + 1u], rest_positions[3u * i + 2u]);
    var n = vec3<f32>(rest_frames[r], rest_frames[r + 1u], rest_frames[r + 2u]);
    var t = vec3<f32>(rest_frames[r + 3u], rest_frames[r + 4u], rest_frames[r + 5u]);
    for (var k = 0u; k < deformation.target_count; k++) {
        let w = morph_weights[k];
        let o = 9u * (k * deformation.vertex_count + i);
        p += w * vec3<f32>(offsets[o], offsets[o + 1u], offsets[o + 2u]);
        n += w * vec3<f32>(offsets[o + 3u], offsets[o + 4u], offsets[o + 5u]);
        t += w * vec3<f32>(offsets[o + 6u], offsets[o + 7u], offsets[o + 8u]);
    }
    if deformation.joint_count > 0u {
        let influence = influences[i];
        var m = mat4x4<f32>();
        for (var k = 0u; k < 4u; k++) {
            m += influence.weights[k] * object_from_bind[min(influence.joints[k], deformation.joint_count - 1u)];
        }
        p = (m * vec4<f32>(p, 1.0)).xyz;
        // Cofactors: the normal's matrix up to a factor, for flattened joints too.
        let cofactors = mat3x3<f32>(cross(m[1].xyz, m[2].xyz), cross(m[2].xyz, m[0].xyz), cross(m[0].xyz, m[1].xyz));
        n = cofactors * n * sign(dot(m[0].xyz, cofactors[0]));
        t = (m * vec4<f32>(t, 0.0)).xyz;
    }
    n = unit(n, vec3<f32>(0.0));
    t = unit(t, vec3<f32>(0.0));
    positions[3u * i] = p.x;
    positions[3u * i + 1u] = p.y;
    positions[3u * i + 2u] = p.z;
    frames[r] = n.x;
    frames[r + 1u] = n.y;
    frames[r + 2u] = n.z;
    frames[r + 3u] = t.x;
    frames[r + 4u] = t.y;
    frames[r + 5u] = t.z;
    frames[r + 6u] = rest_frames[r + 6u];
}
