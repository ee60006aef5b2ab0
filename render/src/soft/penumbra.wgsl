// The soft shadow: the neighbourhood of each pixel of the penumbra (004 section 3.2.3). There, the neighbourhood is a square
// that grows along the picture; here it is the light's disc as the place sees it past the caster's edge, laid through the
// receiver: a shadow is its hard one convolved with the picture of the light, exactly so where caster, receiver and light are
// parallel (Soler and Sillion 1998, Fast calculation of soft shadow textures using convolution, section 2).
// Concatenated after shaders/view.wgsl, soft/source.wgsl and shaders/fullscreen.wgsl.

@group(1) @binding(3) var radius: texture_2d<f32>;

const FEWEST_TAPS = 16.0;
const MOST_TAPS = 160.0;
// Cosine and sine of the golden angle: taps that turn by it spread evenly over a disc (Vogel 1979).
const TURN = vec2<f32>(-0.7373688780783197, 0.6754902942615238);
// Receivers that the light grazes are stretched no further than this.
const LEAST_SLOPE = 0.05;

// Change of depth from a pixel to the next, of the neighbour that belongs to the same surface.
fn slope(pixel: vec2<i32>, step: vec2<i32>, depth: f32) -> f32 {
    let last = vec2<i32>(textureDimensions(hard)) - 1;
    let before = textureLoad(hard, max(pixel - step, vec2<i32>(0)), 0).y;
    let after = textureLoad(hard, min(pixel + step, last), 0).y;
    let back = select(1e9, depth - before, all(pixel >= step));
    let ahead = select(1e9, after - depth, all(pixel + step <= last));
    let chosen = select(ahead, back, abs(back) < abs(ahead));
    return select(0.0, chosen, abs(chosen) < 1e8);
}

// Share of the light that is hidden.
@fragment
fn soft_shadow(f: Fullscreen) -> @location(0) f32 {
    let pixel = vec2<i32>(f.clip.xy);
    let own = textureLoad(hard, pixel, 0).xy;
    let r = textureLoad(radius, pixel, 0).x;
    if r <= 0.0 || own.y <= 0.0 {
        return own.x;
    }
    let at = vec2<f32>(pixel);
    let here = world_at(at, own.y);
    let toward = toward_light_at(here).unit;
    // Of a plane, depth is linear over the picture.
    let slopes = vec2<f32>(slope(pixel, vec2<i32>(1, 0), own.y), slope(pixel, vec2<i32>(0, 1), own.y));
    let right = world_at(at + vec2<f32>(1.0, 0.0), own.y + slopes.x) - here;
    let down = world_at(at + vec2<f32>(0.0, 1.0), own.y + slopes.y) - here;
    let normal = normalize(cross(down, right));
    let cosine = dot(normal, toward);
    let inclined = select(min(cosine, -LEAST_SLOPE), max(cosine, LEAST_SLOPE), cosine >= 0.0);

    // The axes of the disc across the light, moved along the light onto the receiver.
    let axis = select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), abs(toward.x) > 0.7);
    let across = normalize(axis - toward * dot(axis, toward));
    let up = cross(toward, across);
    let first = r * (across - toward * (dot(normal, across) / inclined));
    let second = r * (up - toward * (dot(normal, up) / inclined));
    let middle_in_clip = view.clip_from_world * vec4<f32>(here, 1.0);
    let first_in_clip = view.clip_from_world * vec4<f32>(first, 0.0);
    let second_in_clip = view.clip_from_world * vec4<f32>(second, 0.0);

    let size = vec2<f32>(textureDimensions(hard));
    let middle_in_ndc = middle_in_clip.xy / middle_in_clip.w;
    let half_pixels = 0.5 * size / middle_in_clip.w;
    let first_in_pixels = (first_in_clip.xy - middle_in_ndc * first_in_clip.w) * half_pixels;
    let second_in_pixels = (second_in_clip.xy - middle_in_ndc * second_in_clip.w) * half_pixels;
    let reach = sqrt(max(dot(first_in_pixels, first_in_pixels), dot(second_in_pixels, second_in_pixels)));
    if reach < 0.5 {
        return own.x;
    }
    let area = 3.14159 * abs(first_in_pixels.x * second_in_pixels.y - first_in_pixels.y * second_in_pixels.x);
    let count = clamp(ceil(max(area, 4.0 * reach)), FEWEST_TAPS, MOST_TAPS);
    // How far a neighbour may lie before or behind the receiver's plane, as a share of its distance from the eye.
    let pixel_size = length(right) + length(down);
    let tolerance = (0.3 * r + 0.2 * pixel_size) / middle_in_clip.w;

    var dark = 0.0;
    var weight = 0.0;
    var direction = vec2<f32>(1.0, 0.0);
    for (var i = 0.5; i < count; i += 1.0) {
        let place = direction * sqrt(i / count);
        direction = vec2<f32>(direction.x * TURN.x - direction.y * TURN.y, direction.x * TURN.y + direction.y * TURN.x);
        let in_clip = middle_in_clip + first_in_clip * place.x + second_in_clip * place.y;
        let ndc = in_clip.xy / max(in_clip.w, 1e-9);
        // What lies outside of the picture goes on as its edge.
        let tap = clamp((ndc * vec2<f32>(0.5, -0.5) + 0.5) * size - view.first_sample, vec2<f32>(0.5), size - 0.5);
        let tapped = textureLoad(hard, vec2<i32>(tap), 0).xy;
        let expected = own.y + dot(slopes, floor(tap) - at);
        if abs(tapped.y - expected) <= tolerance * expected {
            dark += tapped.x;
            weight += 1.0;
        }
    }
    return select(own.x, dark / max(weight, 1.0), weight > 0.0);
}
