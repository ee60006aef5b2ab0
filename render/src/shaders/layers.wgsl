// Several textures on one surface (X3D MultiTexture), projected ones among them (003 section 4.5).

@group(2) @binding(11) var layer0_texture: texture_2d<f32>;
@group(2) @binding(12) var layer0_sampler: sampler;
@group(2) @binding(13) var layer1_texture: texture_2d<f32>;
@group(2) @binding(14) var layer1_sampler: sampler;
@group(2) @binding(15) var layer2_texture: texture_2d<f32>;
@group(2) @binding(16) var layer2_sampler: sampler;
@group(2) @binding(17) var layer3_texture: texture_2d<f32>;
@group(2) @binding(18) var layer3_sampler: sampler;

const PICTURE: u32 = 1u;
const SHADOW_MAP: u32 = 2u;

// What a shadow map gives.
const LESS_EQUAL: u32 = 0u;
const GREATER_EQUAL: u32 = 1u;
const DEPTH: u32 = 2u;

struct LayerPlace {
    uv: vec2<f32>,
    // False behind the projector, and outside of a picture with a border.
    is_there: bool,
};

fn layer_place(number: u32, f: Fragment) -> LayerPlace {
    let layer = material.layers[number];
    var uv = select(f.uv0, f.uv1, layer.uv_set == 1u);
    var is_there = true;
    if layer.projector != NOWHERE {
        let clip = projectors[layer.projector] * vec4<f32>(f.p_in_world, 1.0);
        is_there = clip.w > 0.0 && clip.z <= clip.w;
        uv = clip.xy / max(clip.w, 1e-9) * vec2<f32>(0.5, -0.5) + 0.5;
    }
    uv = layer.linear.xy * uv.x + layer.linear.zw * uv.y + layer.offset;
    let outside = (uv < vec2<f32>(0.0)) | (uv > vec2<f32>(1.0));
    if ((layer.flags & 1u) != 0u && outside.x) || ((layer.flags & 2u) != 0u && outside.y) {
        is_there = false;
    }
    return LayerPlace(uv, is_there);
}

// The base colour with all layers. Called in uniform control flow: it takes derivatives.
fn layered(f: Fragment, s: Surface) -> vec4<f32> {
    var color = s.base_color;
    if LAYERS > 0u && material.layer_count > 0u {
        let at = layer_place(0u, f);
        var t = vec4<f32>(1.0);
        if material.layers[0].kind == PICTURE {
            t = textureSample(layer0_texture, layer0_sampler, at.uv);
        }
        color = over(0u, f, s, at, t, color);
    }
    if LAYERS > 1u && material.layer_count > 1u {
        let at = layer_place(1u, f);
        var t = vec4<f32>(1.0);
        if material.layers[1].kind == PICTURE {
            t = textureSample(layer1_texture, layer1_sampler, at.uv);
        }
        color = over(1u, f, s, at, t, color);
    }
    if LAYERS > 2u && material.layer_count > 2u {
        let at = layer_place(2u, f);
        var t = vec4<f32>(1.0);
        if material.layers[2].kind == PICTURE {
            t = textureSample(layer2_texture, layer2_sampler, at.uv);
        }
        color = over(2u, f, s, at, t, color);
    }
    if LAYERS > 3u && material.layer_count > 3u {
        let at = layer_place(3u, f);
        var t = vec4<f32>(1.0);
        if material.layers[3].kind == PICTURE {
            t = textureSample(layer3_texture, layer3_sampler, at.uv);
        }
        color = over(3u, f, s, at, t, color);
    }
    return color;
}

// One layer over the colour so far; `picture` is the texel of a layer that has a picture.
fn over(number: u32, f: Fragment, s: Surface, at: LayerPlace, picture: vec4<f32>, below: vec4<f32>) -> vec4<f32> {
    let layer = material.layers[number];
    if !at.is_there {
        return below;
    }
    var t = picture;
    if layer.kind == SHADOW_MAP {
        t = vec4<f32>(vec3<f32>(shadow_texel(layer, f, s, at.uv)), 1.0);
    }
    switch layer.mode {
        case 1u: { return 2.0 * t * below; }
        case 2u: { return 4.0 * t * below; }
        case 3u: { return t; }
        case 4u: { return t + below; }
        case 5u: { return max(t + below - 0.5, vec4<f32>(0.0)); }
        case 6u: { return max(2.0 * (t + below - 0.5), vec4<f32>(0.0)); }
        case 7u: { return max(t - below, vec4<f32>(0.0)); }
        case 8u: { return t + below - t * below; }
        case 9u: { return mix(below, t, material.base_color.a); }
        case 10u: { return mix(below, t, t.a); }
        case 11u: { return mix(below, t, layer.factor); }
        case 12u: { return mix(below, t, below.a); }
        case 13u: { return below; }
        default: { return t * below; }
    }
}

fn shadow_texel(layer: Layer, f: Fragment, s: Surface, uv: vec2<f32>) -> f32 {
    let texture = shadow_textures[layer.shadow_texture];
    if texture.light == NOWHERE {
        return 1.0;
    }
    let compare = layer.flags >> 2u;
    if compare == DEPTH {
        return map_grey(texture, uv, f.p_in_world);
    }
    let light = lights[texture.light];
    var lit = 1.0;
    if light.face_count > 0u {
        lit = map_visibility(light, s.position, s.face_normal);
    }
    return select(lit, 1.0 - lit, compare == GREATER_EQUAL);
}
