// The soft shadow of the view's one light (`soft/`), bound beside the view.

// Share of the light that is hidden.
@group(0) @binding(1) var soft_shadow: texture_2d<f32>;
// Depth of the surface where it is, in y.
@group(0) @binding(2) var shadowed_depth: texture_2d<f32>;

// Share of the light that is hidden at a place of the given depth, whose change to the next pixels is `slopes`. A pixel at
// the rim of a surface shows several; the neighbour whose depth fits best belongs to this one.
fn hidden_share(at: vec2<f32>, depth: f32, slopes: vec2<f32>) -> f32 {
    let pixel = vec2<i32>(at);
    let last = vec2<i32>(textureDimensions(soft_shadow)) - 1;
    // Depths are those of the first sample.
    let sampled = depth + dot(slopes, view.first_sample);
    var best = abs(textureLoad(shadowed_depth, pixel, 0).y - sampled);
    if best <= 1e-3 * sampled {
        return textureLoad(soft_shadow, pixel, 0).x;
    }
    var fitting = pixel;
    for (var i = 0; i < 9; i++) {
        let step = vec2<i32>(i % 3 - 1, i / 3 - 1);
        let near = clamp(pixel + step, vec2<i32>(0), last);
        let misfit = abs(textureLoad(shadowed_depth, near, 0).y - sampled - dot(slopes, vec2<f32>(step)));
        if misfit < best {
            best = misfit;
            fitting = near;
        }
    }
    return textureLoad(soft_shadow, fitting, 0).x;
}
