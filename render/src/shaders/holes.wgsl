// What alpha leaves of a pixel. Each of its samples asks at its own place, so that the edges inside of a triangle are as smooth as those
// around it. The pass that fills depth decides; later ones find their samples by their depth.

// Samples per pixel of shapes that alpha cuts holes into; 0: there are no holes.
override HOLES: u32 = 0u;

// Where the base colour's texture is looked up in a pixel.
struct Look {
    // Place in the texture and alpha of the vertices, each times the fourth, 1 / w: these run evenly over the screen.
    middle: vec4<f32>,
    across: vec4<f32>,
    down: vec4<f32>,
    // Ways in the texture that a sample stands for.
    uv_across: vec2<f32>,
    uv_down: vec2<f32>,
};

// Called in uniform control flow: it takes derivatives.
fn look_of(f: Fragment) -> Look {
    let uv = texture_place(0u, f.uv0, f.uv1);
    let w = (view.clip_from_world * vec4<f32>(f.p_in_world, 1.0)).w;
    let middle = vec4<f32>(uv, f.color.a, 1.0) / w;
    // Four samples share a pixel: each stands for half of it each way.
    return Look(middle, dpdx(middle), dpdy(middle), 0.5 * dpdx(uv), 0.5 * dpdy(uv));
}

fn place_of_sample(look: Look, i: u32) -> vec3<f32> {
    let place = look.middle + look.across * SAMPLES_X[i] + look.down * SAMPLES_Y[i];
    return place.xyz / place.w;
}

// The base colour at one sample, but for the vertices' own colour.
fn color_of_sample(look: Look, i: u32) -> vec4<f32> {
    let place = place_of_sample(look, i);
    var color = material.base_color * vec4<f32>(1.0, 1.0, 1.0, place.z);
    if has_texture(0u) {
        color *= textureSampleGrad(base_color_texture, base_color_sampler, place.xy, look.uv_across, look.uv_down);
    }
    return color;
}

// Those of the covered samples whose alpha is there.
fn samples_there(look: Look, covered: u32) -> u32 {
    var there = 0u;
    for (var i = 0u; i < 4u; i++) {
        there |= select(1u << i, 0u, color_of_sample(look, i).a < material.alpha_cutoff);
    }
    return covered & there;
}

// The same by the picture at its full size: holes are where rays find them, whatever smaller pictures of them show from afar.
fn samples_there_at_full_size(look: Look, covered: u32) -> u32 {
    var there = 0u;
    for (var i = 0u; i < 4u; i++) {
        let place = place_of_sample(look, i);
        there |= select(1u << i, 0u, full_size_alpha_at(place.xy, place.z) < material.alpha_cutoff);
    }
    return covered & there;
}

// The colour of a pixel with `middle` in its middle: where that lies in a hole, the colour of a sample that does not.
fn color_there(look: Look, middle: vec4<f32>, vertex_color: vec4<f32>, covered: u32) -> vec4<f32> {
    if middle.a >= material.alpha_cutoff {
        return middle;
    }
    for (var i = 0u; i < 4u; i++) {
        let color = color_of_sample(look, i);
        if (covered & (1u << i)) != 0u && color.a >= material.alpha_cutoff {
            return color * vec4<f32>(vertex_color.rgb, 1.0);
        }
    }
    return middle;
}
