// Surfaces as the eye sees them. Concatenated after shaders/{position,view,instance,material,light,shade,brdf,
// shadow_map,shadow_filter,shadow_disc,projection}, the functions that a shape's own shader may replace (`author/`), and
// shaders/{layers,holes}.

struct Vertex {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) tangent: vec4<f32>,
    @location(3) uv0: vec2<f32>,
    @location(4) uv1: vec2<f32>,
    @location(5) color: vec4<f32>,
    // Place in the frame's list, from the view's list of what it sees.
    @location(6) instance: u32,
};

struct Fragment {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) p_in_world: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) tangent: vec4<f32>,
    @location(3) uv0: vec2<f32>,
    @location(4) uv1: vec2<f32>,
    @location(5) color: vec4<f32>,
    @location(6) @interpolate(flat) flags: u32,
};

// For passes that write depth or stencil alone.
@vertex
fn solid(@location(0) position: vec3<f32>, @location(6) instance: u32) -> @builtin(position) @invariant vec4<f32> {
    return clip_from_point(view.clip_from_world, world_from_vertex(instances[instance].world_from_object, position));
}

@vertex
fn vertex(v: Vertex) -> Fragment {
    let instance = instances[v.instance];
    let p_in_world = world_from_vertex(instance.world_from_object, v.position);
    var f: Fragment;
    f.clip = clip_from_point(view.clip_from_world, p_in_world);
    f.p_in_world = p_in_world.xyz;
    f.normal = instance.world_from_object_normal * v.normal;
    let tangent = (instance.world_from_object * vec4<f32>(v.tangent.xyz, 0.0)).xyz;
    f.tangent = vec4<f32>(tangent, select(v.tangent.w, -v.tangent.w, (instance.flags & MIRRORED) != 0u));
    f.uv0 = v.uv0;
    f.uv1 = v.uv1;
    f.color = v.color;
    f.flags = instance.flags;
    return f;
}

// Alpha as the material has it, before layers and a shape's own shader.
var<private> own_alpha: f32;

// What all variants need to know. `covered` are the pixel's samples that are on the shape. Called in uniform control flow: it
// takes derivatives.
fn place(f: Fragment, covered: u32) -> Surface {
    load_params();
    var s: Surface;
    s.base_color = base_color_at(f.uv0, f.uv1, f.color);
    if HOLES > 1u {
        s.base_color = color_there(look_of(f), s.base_color, f.color, covered);
    }
    own_alpha = s.base_color.a;
    s.emissive = material.emissive;
    if has_texture(4u) {
        s.emissive *= textureSample(emissive_texture, emissive_sampler, texture_place(4u, f.uv0, f.uv1)).rgb;
    }
    s.occlusion = 1.0;
    if has_texture(3u) {
        let o = textureSample(occlusion_texture, occlusion_sampler, texture_place(3u, f.uv0, f.uv1)).r;
        s.occlusion = 1.0 + material.occlusion_strength * (o - 1.0);
    }
    s.metallic = material.metallic;
    s.roughness = material.roughness;
    if has_texture(1u) {
        let m = textureSample(metallic_roughness_texture, metallic_roughness_sampler, texture_place(1u, f.uv0, f.uv1));
        s.metallic *= m.b;
        s.roughness *= m.g;
    }
    let across = dpdx(f.p_in_world);
    let down = dpdy(f.p_in_world);
    s.position = f.p_in_world;
    if MAPS {
        // The middle of a pixel may lie beyond the shape's edge, and so behind the next wall of a corner. (Interpolation at centroids would do,
        // were it exact on all devices.)
        footprint = Footprint(across, down, samples_of(covered));
        s.position += mat2x3<f32>(across, down) * middle_of_footprint();
    }
    s.uv0 = f.uv0;
    s.uv1 = f.uv1;
    s.vertex_color = f.color;
    s.pixel = f.clip.xy - view.window.xy;
    let to_eye = view.eye_in_world.xyz - f.p_in_world;
    s.distance = length(to_eye);
    s.towards_eye = to_eye / max(s.distance, 1e-9);

    let area_normal = cross(across, down);
    let has_normal = dot(f.normal, f.normal) > 1e-12;
    s.is_unlit = shading() == UNLIT || !has_normal;
    var n = f.normal * inverseSqrt(max(dot(f.normal, f.normal), 1e-24));
    s.face_normal = n;
    if dot(area_normal, area_normal) > 0.0 {
        s.face_normal = normalize(area_normal);
    }
    if dot(s.face_normal, s.towards_eye) < 0.0 {
        s.face_normal = -s.face_normal;
    }
    if (f.flags & FLAT) != 0u {
        n = s.face_normal;
    }
    // The side that is seen, whatever the winding says: real models have triangles that turn against their normals.
    let side = select(-1.0, 1.0, dot(n, s.face_normal) >= 0.0);
    if has_texture(2u) {
        n = bumped(f, n, across, down);
    }
    s.normal = side * n;
    s.receives_shadow = (f.flags & RECEIVES_SHADOW) != 0u;
    s.base_color = layered(f, s);
    return surface(s);
}

// Which samples of the pixel are on the shape; all of them where there is one.
fn samples_of(covered: u32) -> vec4<f32> {
    if view.first_sample.x == 0.0 {
        return vec4<f32>(1.0);
    }
    return vec4<f32>((vec4<u32>(covered) >> vec4<u32>(0u, 1u, 2u, 3u)) & vec4<u32>(1u));
}

// Normal from the normal texture; where the mesh has no tangents they follow from the texture coordinates
// (Mikkelsen 2020, Surface gradient-based bump mapping, section 3: the cotangent frame).
fn bumped(f: Fragment, n: vec3<f32>, across: vec3<f32>, down: vec3<f32>) -> vec3<f32> {
    let uv = texture_place(2u, f.uv0, f.uv1);
    let uv_across = dpdx(uv);
    let uv_down = dpdy(uv);
    var m = textureSample(normal_texture, normal_sampler, uv).xyz * 2.0 - 1.0;
    m = vec3<f32>(m.xy * material.normal_scale, m.z);
    var t = f.tangent.xyz;
    var b = cross(n, t) * f.tangent.w;
    if dot(t, t) < 1e-12 {
        let down_perpendicular = cross(down, n);
        let across_perpendicular = cross(n, across);
        t = down_perpendicular * uv_across.x + across_perpendicular * uv_down.x;
        // v runs down the picture, the bitangent up.
        b = -(down_perpendicular * uv_across.y + across_perpendicular * uv_down.y);
        let scale = inverseSqrt(max(max(dot(t, t), dot(b, b)), 1e-30));
        // The screen's y runs down: both derivatives together turn the frame by the sign of the triangle's area.
        let turn = sign(dot(cross(across, down), n));
        t *= scale * turn;
        b *= scale * turn;
    } else {
        t = normalize(t);
        b = cross(n, t) * f.tangent.w;
    }
    return normalize(t * m.x + b * m.y + n * m.z);
}

// Light of the view's range of lights that the place reflects towards the eye. `shadow` is the share of it that other means
// than maps let through, `flags` are the instance's.
fn reflected(s: Surface, flags: u32, shadow: f32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    if LIGHTS > LIGHTS_OF_VIEW {
        for (var i = 0u; i < view.light_count; i++) {
            let number = view.first_light + i;
            sum += reflected_of(lights[number], number, s, flags, shadow);
        }
        return sum;
    }
    if LIGHTS > 0u {
        sum += reflected_of(view.lights[0], view.first_light, s, flags, shadow);
    }
    if LIGHTS > 1u {
        sum += reflected_of(view.lights[1], view.first_light + 1u, s, flags, shadow);
    }
    return sum;
}

// The same of the numbered light.
fn reflected_of(light: Light, number: u32, s: Surface, flags: u32, shadow: f32) -> vec3<f32> {
    let in_ = incidence(light, s.position);
    if in_.strength <= 0.0 {
        return vec3<f32>(0.0);
    }
    var share = shadow;
    if MAPS && light.face_count > 0u && casts_on(light, number, flags) {
        // What faces away stands in its own shadow.
        var lit = 0.0;
        if dot(s.normal, in_.towards) > 0.0 {
            lit = map_visibility(light, s.position, s.face_normal);
        }
        share *= 1.0 - light.shadow_intensity * (1.0 - lit);
    }
    let sum = shade(s, LightSample(in_.towards, light.color * in_.strength, share, light.kind));
    // Of a light that the surface lists, all is shadowed.
    if AMBIENTS && lists_lights(flags) && casts_on(light, number, flags) {
        return sum + ambient(s, light.ambient * in_.strength * share);
    }
    return sum;
}

// Light that reaches the place from everywhere.
fn ambient_light(s: Surface, flags: u32) -> vec3<f32> {
    var sum = frame.ambient.rgb;
    if AMBIENTS {
        for (var i = 0u; i < frame.light_count; i++) {
            let light = lights[i];
            let is_shadowed = lists_lights(flags) && casts_on(light, i, flags);
            if any(light.ambient > vec3<f32>(0.0)) && !is_shadowed {
                sum += light.ambient * incidence(light, s.position).strength;
            }
        }
    }
    return ambient(s, sum);
}

// Linear RGB and opacity.
fn base(s: Surface, flags: u32) -> vec4<f32> {
    var lit = s.base_color.rgb;
    if !s.is_unlit {
        lit = ambient_light(s, flags) + reflected(s, flags, 1.0);
    }
    let color = finish(s, lit);
    return vec4<f32>(mix(color.rgb, frame.fog_color, fog_share(s.distance)), color.a);
}

// Which samples of a shape with holes are there. Layers and a shape's own shader are asked once per pixel, and where they
// make another alpha, so much is decided for all of it.
fn kept(f: Fragment, s: Surface, covered: u32) -> u32 {
    var there = covered;
    if HOLES > 1u {
        there = samples_there(look_of(f), covered);
    }
    if s.base_color.a < material.alpha_cutoff {
        return 0u;
    }
    return select(covered, there, s.base_color.a == own_alpha);
}

// Of two shapes in one place, depth does not tell which of them is in a pixel.
fn is_hole(s: Surface) -> bool {
    return HOLES > 0u && s.base_color.a < material.alpha_cutoff;
}

struct Kept {
    @location(0) color: vec4<f32>,
    @builtin(sample_mask) samples: u32,
};

// Opaque surfaces: ambient and emitted light, and the view's lights.
@fragment
fn opaque(f: Fragment, @builtin(sample_mask) covered: u32) -> @location(0) vec4<f32> {
    let s = place(f, covered);
    if is_hole(s) {
        discard;
    }
    return vec4<f32>(exposed(base(s, f.flags).rgb), 1.0);
}

// The same where holes are not in depth yet.
@fragment
fn masked(f: Fragment, @builtin(sample_mask) covered: u32) -> Kept {
    let s = place(f, covered);
    let samples = kept(f, s, covered);
    if samples == 0u {
        discard;
    }
    return Kept(vec4<f32>(exposed(base(s, f.flags).rgb), 1.0), samples);
}

// Mixed over what is behind: premultiplied.
@fragment
fn blended(f: Fragment, @builtin(sample_mask) covered: u32) -> @location(0) vec4<f32> {
    let s = place(f, covered);
    let color = base(s, f.flags);
    let alpha = saturate(color.a);
    return vec4<f32>(color.rgb * alpha, alpha);
}

// The view's lights alone, to be added to what is there.
fn addition(f: Fragment, covered: u32, shadow: f32) -> vec4<f32> {
    let s = place(f, covered);
    if s.is_unlit || is_hole(s) {
        discard;
    }
    return vec4<f32>(finished_addition(s, reflected(s, f.flags, shadow)) * (1.0 - fog_share(s.distance)), 0.0);
}

@fragment
fn added(f: Fragment, @builtin(sample_mask) covered: u32) -> @location(0) vec4<f32> {
    return addition(f, covered, 1.0);
}

// The same where the light's shadow volumes are, for shapes whose own shader may make something of the shadow.
@fragment
fn added_in_shadow(f: Fragment, @builtin(sample_mask) covered: u32) -> @location(0) vec4<f32> {
    return addition(f, covered, 1.0 - view.lights[0].shadow_intensity);
}

// Share of one light that a map lets through. Cone, distance and orientation do not count.
fn share_through_map(f: Fragment, covered: u32) -> vec4<f32> {
    let s = place(f, covered);
    // Light that is added outside of its shadow volumes starts from black.
    if view.light_count == 0u {
        return vec4<f32>(0.0, 0.0, 0.0, 1.0);
    }
    let light = lights[view.shown_light];
    var lit = 1.0;
    if MAPS && light.face_count > 0u && casts_on(light, view.shown_light, f.flags) {
        lit = map_visibility(light, s.position, s.face_normal);
    }
    return vec4<f32>(vec3<f32>(lit), 1.0);
}

@fragment
fn visibility(f: Fragment, @builtin(sample_mask) covered: u32) -> @location(0) vec4<f32> {
    return share_through_map(f, covered);
}

// The same where holes are not in depth yet. A picture that measures has them where rays find them.
@fragment
fn visibility_masked(f: Fragment, @builtin(sample_mask) covered: u32) -> Kept {
    var samples = covered;
    if material.layer_count > 0u {
        samples = kept(f, place(f, covered), covered);
    } else if HOLES > 1u {
        samples = samples_there_at_full_size(look_of(f), covered);
    } else if full_size_alpha(f.uv0, f.uv1, f.color.a) < material.alpha_cutoff {
        samples = 0u;
    }
    let share = share_through_map(f, samples);
    if samples == 0u {
        discard;
    }
    return Kept(share, samples);
}

// Share of the view's one light that its shadow texture shows.
fn shown_share(f: Fragment) -> f32 {
    let hidden = hidden_share(f.clip.xy, f.clip.z, vec2<f32>(dpdx(f.clip.z), dpdy(f.clip.z)));
    return select(1.0, 1.0 - hidden, (f.flags & RECEIVES_SHADOW) != 0u);
}

// The view's one light, to be added to what is there, as far as its shadow texture shows it.
@fragment
fn added_soft(f: Fragment, @builtin(sample_mask) covered: u32) -> @location(0) vec4<f32> {
    let shown = 1.0 - view.lights[0].shadow_intensity * (1.0 - shown_share(f));
    return addition(f, covered, shown);
}

// The share alone.
@fragment
fn visibility_soft(f: Fragment, @builtin(sample_mask) covered: u32) -> @location(0) vec4<f32> {
    let shown = shown_share(f);
    return share_through_map(f, covered) * shown;
}

// Depth of what has holes.
@fragment
fn holes(f: Fragment, @builtin(sample_mask) covered: u32) -> Kept {
    let samples = kept(f, place(f, covered), covered);
    if samples == 0u {
        discard;
    }
    return Kept(vec4<f32>(0.0), samples);
}

// For what it does to depth or stencil.
@fragment
fn nothing() -> @location(0) vec4<f32> {
    return vec4<f32>(0.0);
}
