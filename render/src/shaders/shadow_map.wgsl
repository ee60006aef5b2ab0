// Look-up of shadow maps. All maps are tiles in the layers of one array; a light has one face (spot), several nested
// ones (directional: the first that holds the point counts) or six (all directions: by major axis).

struct MapFace {
    map_from_world: mat4x4<f32>,
    world_from_map: mat4x4<f32>,
    // Left and top of the tile, its side in texels, its layer.
    tile: vec4<u32>,
    // w = 0: unit vector towards the light; w = 1: position of the light.
    light: vec4<f32>,
    // Size of a texel at distance 1 from a position, or everywhere for parallel light, metres.
    texel: f32,
    // Parallel light: metres per depth. From a position: distance along the axis is x / (depth + y).
    depth: vec2<f32>,
};

@group(3) @binding(2) var<storage, read> map_faces: array<MapFace>;
@group(3) @binding(3) var maps: texture_depth_2d_array;
@group(3) @binding(4) var maps_sampler: sampler;

// Receiver at `p_in_world` with the unit normal of its triangle, which points to the side that is seen.
// 1: lit, 0: in shadow.
fn map_visibility(light: Light, p_in_world: vec3<f32>, face_normal: vec3<f32>) -> f32 {
    var face_index = light.first_face;
    var found = false;
    if (light.map_flags & MAP_CUBE) != 0u {
        face_index += major_axis(map_faces[face_index], p_in_world);
        found = true;
    } else {
        for (var i = 0u; i < light.face_count; i++) {
            let within = inside(light, map_faces[light.first_face + i], p_in_world);
            if within > 0u {
                face_index = light.first_face + i;
                found = true;
            }
            if within == 2u {
                break;
            }
        }
    }
    if !found {
        return select(1.0, 0.0, (light.map_flags & MAP_DARK_OUTSIDE) != 0u);
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

// 1: inside of the tile, with a margin of three texels for filters and bias; 2: with all that its penumbra may need, so that
// penumbrae do not end where a finer map ends.
fn inside(light: Light, face: MapFace, p_in_world: vec3<f32>) -> u32 {
    let clip = face.map_from_world * vec4<f32>(p_in_world, 1.0);
    if clip.w <= 0.0 || clip.z < 0.0 {
        return 0u;
    }
    let place = max(abs(clip.x), abs(clip.y)) / clip.w;
    if place >= 1.0 - 6.0 / f32(face.tile.z) {
        return 0u;
    }
    var margin = 3.0;
    if (light.map_flags & MAP_PCSS) != 0u && face.light.w < 0.5 {
        margin += widest_penumbra(light, face, clip.z);
    }
    return select(1u, 2u, place < 1.0 - 2.0 * margin / f32(face.tile.z));
}

fn face_visibility(light: Light, face: MapFace, p_in_world: vec3<f32>, face_normal: vec3<f32>) -> f32 {
    let offset = face.light.xyz - p_in_world * face.light.w;
    let distance = length(offset);
    let towards = offset / max(distance, 1e-9);
    let texel = face.texel * select(1.0, distance, face.light.w > 0.5);
    let cosine = max(abs(dot(face_normal, towards)), 0.03);
    let slope = sqrt(1.0 - cosine * cosine) / cosine;

    // Depth is compared as exactly as it is drawn: corners lie on steps of 1/256 texel, which count for more where the
    // receiver is steep, and numbers are rounded. By hand, the bias is what was asked for and nothing else.
    let is_by_hand = light.slope_bias >= 0.0 || light.constant_bias >= 0.0;
    var p = p_in_world;
    if is_by_hand {
        p += towards * (max(light.slope_bias, 0.0) * texel * slope + max(light.constant_bias, 0.0));
    }
    let clip = face.map_from_world * vec4<f32>(p, 1.0);
    if clip.w <= 0.0 || clip.z < 0.0 {
        return 1.0;
    }
    let ndc = clip.xyz / clip.w;
    let side = f32(face.tile.z);
    var r: Receiver;
    r.t = (ndc.xy * vec2<f32>(0.5, -0.5) + 0.5) * side;
    r.depth = ndc.z;

    // Plane of the receiver in the map's space: depth per texel. A clamped slope keeps grazing receivers finite.
    let plane_in_world = vec4<f32>(face_normal, -dot(face_normal, p));
    let plane = plane_in_world * face.world_from_map;
    if abs(plane.z) > 1e-20 {
        r.depth_per_texel = -plane.xy / plane.z * vec2<f32>(2.0, -2.0) / side;
    }
    if face.light.w > 0.5 {
        let steepest = 0.25 * ndc.z;
        r.depth_per_texel = clamp(r.depth_per_texel, vec2<f32>(-steepest), vec2<f32>(steepest));
    }
    if !is_by_hand {
        // What a texel's length towards the light is in depth.
        let step = face.map_from_world * vec4<f32>(towards * texel, 0.0);
        let depth_of_texel = (clip.z + step.z) / (clip.w + step.w) - ndc.z;
        let rounding = DEPTH_ROUNDING * select(1.0, ndc.z, face.light.w > 0.5);
        r.tolerance = depth_of_texel * (CLOSE + SNAP * slope) + rounding;
        r.beside = depth_of_texel * BESIDE;
        r.steepest = depth_of_texel * STEEPEST;
    }

    if (light.map_flags & MAP_PCSS) != 0u {
        return contact_hardening(light, face, r);
    }
    if (light.map_flags & MAP_POISSON) != 0u {
        return disc_filtered(face, r, DISC_RADIUS, DISC_SAMPLES);
    }
    if light.filter_width == 0.0 {
        let centre = clamp(floor(r.t), vec2<f32>(0.0), vec2<f32>(side - 1.0)) + 0.5;
        return select(1.0, 0.0, hides(face, r, centre));
    }
    let width = light.filter_width;
    let around = mat2x3<f32>(footprint.across - towards * dot(footprint.across, towards), footprint.down - towards * dot(footprint.down, towards));
    if width > 1.0 && max(length(around[0]), length(around[1])) > width * texel {
        return filtered_by_samples(face, r, p);
    }
    return filtered(face, width, r);
}
