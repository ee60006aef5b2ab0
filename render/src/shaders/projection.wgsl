// What is projected onto surfaces, and on which surfaces the shadow of a light falls (003).

const NOWHERE: u32 = 0xffffffffu;

struct ShadowTexture {
    // Place in the list of lights, or NOWHERE.
    light: u32,
    // Distances of the map, metres.
    near: f32,
    far: f32,
};

// A bit for each light, list after list.
@group(3) @binding(5) var<storage, read> receive_lists: array<u32>;
// Zero where there is none.
@group(3) @binding(6) var<storage, read> projectors: array<mat4x4<f32>>;
@group(3) @binding(7) var<storage, read> shadow_textures: array<ShadowTexture>;

// Does a surface say itself which lights' shadows fall on it?
fn lists_lights(instance_flags: u32) -> bool {
    return LISTS && ((instance_flags >> 8u) & 0xffffu) != 0u;
}

// Does the numbered light cast on the surface?
fn casts_on(light: Light, number: u32, instance_flags: u32) -> bool {
    if (instance_flags & RECEIVES_SHADOW) == 0u {
        return false;
    }
    if !lists_lights(instance_flags) {
        return (light.flags & CASTS) != 0u;
    }
    let list = ((instance_flags >> 8u) & 0xffffu) - 1u;
    let word = receive_lists[list * frame.receive_words + number / 32u];
    return ((word >> (number % 32u)) & 1u) != 0u;
}

// The depths of a map as grey, at a place of its picture (v down); of a light into all directions where it falls on the
// world. 0 at the near distance, 1 at the far one.
fn map_grey(texture: ShadowTexture, uv: vec2<f32>, p_in_world: vec3<f32>) -> f32 {
    let light = lights[texture.light];
    if light.face_count == 0u {
        return 1.0;
    }
    var face = map_faces[light.first_face];
    var place = uv;
    if (light.map_flags & MAP_CUBE) != 0u {
        face = map_faces[light.first_face + major_axis(face, p_in_world)];
        let clip = face.map_from_world * vec4<f32>(p_in_world, 1.0);
        place = clip.xy / clip.w * vec2<f32>(0.5, -0.5) + 0.5;
    }
    let side = f32(face.tile.z);
    let t = clamp(place * side - 0.5, vec2<f32>(0.0), vec2<f32>(side - 1.0));
    let corner = vec2<u32>(t);
    let far_corner = min(corner + 1u, vec2<u32>(face.tile.z - 1u));
    let share = fract(t);
    let above = mix(texel_grey(texture, light, face, corner), texel_grey(texture, light, face, vec2<u32>(far_corner.x, corner.y)), share.x);
    let below =
        mix(texel_grey(texture, light, face, vec2<u32>(corner.x, far_corner.y)), texel_grey(texture, light, face, far_corner), share.x);
    return mix(above, below, share.y);
}

fn texel_grey(texture: ShadowTexture, light: Light, face: MapFace, texel: vec2<u32>) -> f32 {
    let depth = textureLoad(maps, texel + face.tile.xy, face.tile.w, 0);
    if light.kind == DIRECTIONAL {
        return saturate(1.0 - depth);
    }
    let range = texture.far - texture.near;
    let distance = texture.near * texture.far / (depth * range + texture.near);
    return saturate((distance - texture.near) / range);
}
