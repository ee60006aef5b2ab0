// Look-up of shadow maps. All maps are tiles in the layers of one array; a light has one face (spot), several nested
// ones (directional: the first that holds the point counts) or six (all directions: by major axis).
//
// Every texel that the filter covers is compared with the receiver's own plane at the texel's centre. A plane of the
// world stays a plane in the map's space, so a flat receiver needs next to no bias; what is left covers curvature.

struct MapFace {
    map_from_world: mat4x4<f32>,
    world_from_map: mat4x4<f32>,
    // Left and top of the tile, its side in texels, its layer.
    tile: vec4<u32>,
    // w = 0: unit vector towards the light; w = 1: position of the light.
    light: vec4<f32>,
    // Size of a texel at distance 1 from a position, or everywhere for parallel light, metres.
    texel: f32,
};

@group(3) @binding(2) var<storage, read> map_faces: array<MapFace>;
@group(3) @binding(3) var maps: texture_depth_2d_array;
@group(3) @binding(4) var maps_sampler: sampler;

// Receiver at `p_in_world` with the unit normal of its triangle, which points to the side that is seen.
// 1: lit, 0: in shadow.
fn map_visibility(light: Light, p_in_world: vec3<f32>, face_normal: vec3<f32>) -> f32 {
    var face_index = light.first_face;
    var found = false;
    if light.face_count == 6u {
        face_index += major_axis(map_faces[face_index], p_in_world);
        found = true;
    } else {
        for (var i = 0u; i < light.face_count; i++) {
            face_index = light.first_face + i;
            found = is_inside(map_faces[face_index], p_in_world);
            if found {
                break;
            }
        }
    }
    if !found {
        return 1.0;
    }
    return face_visibility(light, map_faces[face_index], p_in_world, face_normal);
}

// +x -x +y -y +z -z of the map's own axes, which may have turned since: the first face looks along +x, +z at its
// right and +y above.
fn major_axis(first: MapFace, p_in_world: vec3<f32>) -> u32 {
    let clip = first.map_from_world * vec4<f32>(p_in_world, 1.0);
    let edge = 0.5 * first.texel * f32(first.tile.z);
    let d = vec3<f32>(clip.w, clip.y * edge, clip.x * edge);
    let a = abs(d);
    if a.x >= a.y && a.x >= a.z {
        return select(0u, 1u, d.x < 0.0);
    }
    if a.y >= a.z {
        return select(2u, 3u, d.y < 0.0);
    }
    return select(4u, 5u, d.z < 0.0);
}

// Inside of the tile, with a margin of three texels for filters and bias.
fn is_inside(face: MapFace, p_in_world: vec3<f32>) -> bool {
    let clip = face.map_from_world * vec4<f32>(p_in_world, 1.0);
    let edge = 1.0 - 6.0 / f32(face.tile.z);
    return clip.w > 0.0 && all(abs(clip.xy) < vec2<f32>(edge * clip.w)) && clip.z >= 0.0;
}

fn face_visibility(light: Light, face: MapFace, p_in_world: vec3<f32>, face_normal: vec3<f32>) -> f32 {
    let offset = face.light.xyz - p_in_world * face.light.w;
    let distance = length(offset);
    let towards = offset / max(distance, 1e-9);
    let texel = face.texel * select(1.0, distance, face.light.w > 0.5);
    let cosine = max(abs(dot(face_normal, towards)), 0.03);
    let slope = sqrt(1.0 - cosine * cosine) / cosine;

    // Texels of height that a caster may have over the receiver's plane before it counts: some right above the
    // receiver, for curvature, and more to the sides, where filters meet the other wall of a corner.
    // Measured on the sample town: less of the second draws lines into corners, more loses what touches the ground.
    var tolerance = vec2<f32>(0.3, 2.5);
    var towards_light = 0.0;
    if light.slope_bias >= 0.0 || light.constant_bias >= 0.0 {
        tolerance = vec2<f32>(0.0);
        towards_light = max(light.slope_bias, 0.0) * texel * slope + max(light.constant_bias, 0.0);
    }
    let p = p_in_world + towards * towards_light;

    let clip = face.map_from_world * vec4<f32>(p, 1.0);
    if clip.w <= 0.0 || clip.z < 0.0 {
        return 1.0;
    }
    let ndc = clip.xyz / clip.w;
    let side = f32(face.tile.z);
    let t = (ndc.xy * vec2<f32>(0.5, -0.5) + 0.5) * side;

    // Plane of the receiver in the map's space: depth per texel. A clamped slope keeps grazing receivers finite.
    let step = face.map_from_world * vec4<f32>(towards * texel, 0.0);
    let depth_per_tolerance = (clip.z + step.z) / (clip.w + step.w) - ndc.z;
    tolerance *= depth_per_tolerance;

    let plane_in_world = vec4<f32>(face_normal, -dot(face_normal, p));
    let plane = plane_in_world * face.world_from_map;
    var depth_per_texel = vec2<f32>(0.0);
    if abs(plane.z) > 1e-20 {
        depth_per_texel = -plane.xy / plane.z * vec2<f32>(2.0, -2.0) / side;
    }
    let steepest = 0.25 * ndc.z;
    if face.light.w > 0.5 {
        depth_per_texel = clamp(depth_per_texel, vec2<f32>(-steepest), vec2<f32>(steepest));
    }

    if light.filter_width == 0.0 {
        let i = clamp(floor(t), vec2<f32>(0.0), vec2<f32>(side - 1.0));
        let stored = textureLoad(maps, vec2<u32>(i) + face.tile.xy, face.tile.w, 0);
        return select(0.0, 1.0, stored <= ndc.z + tolerance.x + dot(depth_per_texel, i + 0.5 - t));
    }
    return filtered(face, light.filter_width, t, ndc.z + tolerance.x, depth_per_texel, tolerance.y);
}

// `width` bilinear comparisons in a row and a column, as weighted single comparisons: four texels per gather.
fn filtered(face: MapFace, width: f32, t: vec2<f32>, depth: f32, depth_per_texel: vec2<f32>, tolerance: f32) -> f32 {
    let layer_size = vec2<f32>(textureDimensions(maps));
    let side = f32(face.tile.z);
    let first = floor(t - 0.5 * width);
    let gathers = i32(ceil((width + 1.0) * 0.5));
    var lit = 0.0;
    for (var y = 0; y < gathers; y++) {
        for (var x = 0; x < gathers; x++) {
            // Centres of the four texels: corner -0.5 and +0.5.
            let corner = first + vec2<f32>(f32(2 * x + 1), f32(2 * y + 1));
            let inside = clamp(corner, vec2<f32>(1.0), vec2<f32>(side - 1.0)) + vec2<f32>(face.tile.xy);
            let stored = textureGather(maps, maps_sampler, inside / layer_size, face.tile.w);
            let near = corner - 0.5 - t;
            let far = corner + 0.5 - t;
            let weight_x = saturate(0.5 * (width + 1.0) - abs(vec2<f32>(near.x, far.x)));
            let weight_y = saturate(0.5 * (width + 1.0) - abs(vec2<f32>(near.y, far.y)));
            // Order of textureGather: (near, far), (far, far), (far, near), (near, near).
            let expected = depth + vec4<f32>(
                dot(depth_per_texel, vec2<f32>(near.x, far.y)),
                dot(depth_per_texel, vec2<f32>(far.x, far.y)),
                dot(depth_per_texel, vec2<f32>(far.x, near.y)),
                dot(depth_per_texel, vec2<f32>(near.x, near.y)),
            ) + tolerance * vec4<f32>(
                length(vec2<f32>(near.x, far.y)),
                length(vec2<f32>(far.x, far.y)),
                length(vec2<f32>(far.x, near.y)),
                length(vec2<f32>(near.x, near.y)),
            );
            let weights = vec4<f32>(
                weight_x.x * weight_y.y,
                weight_x.y * weight_y.y,
                weight_x.y * weight_y.x,
                weight_x.x * weight_y.x,
            );
            lit += dot(weights, select(vec4<f32>(0.0), vec4<f32>(1.0), stored <= expected));
        }
    }
    return lit / (width * width);
}
