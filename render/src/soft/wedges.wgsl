// The penumbra's place and width. Every silhouette edge sweeps a wedge: outside, the extrusion leaves the light's direction
// L by L + kN, where the soft shadow ends; inside by L - kN, where the hard one begins (004 section 3.2.1 and figure 5). N is
// the edge's own normal across the light, not the mean of its vertices' normals, so that nothing need be closed or smooth;
// k is the light's size over its distance, so that the width grows with the distance behind the caster (004 table 1).
// The wedges are those of Assarsson and Akenine-Moller 2003 (A geometry-based soft shadow volume algorithm, section 3).
// Concatenated after shaders/view.wgsl and soft/source.wgsl.

struct Silhouette {
    p_in_world: vec4<f32>,
    q_in_world: vec4<f32>,
};

struct Silhouettes {
    vertex_count: u32,
    instance_count: u32,
    first_vertex: u32,
    first_instance: u32,
    list: array<Silhouette>,
};

@group(1) @binding(2) var<storage, read> silhouettes: Silhouettes;

// Corners of the hull: 0 p, 1 q, and the ends at infinity of the cones from p (2, 3) and q (4, 5), below and above.
const HULL = array<u32, 24>(
    0u, 2u, 3u, 1u, 5u, 4u, // behind p, beyond q
    0u, 3u, 5u, 0u, 5u, 1u, // above
    0u, 1u, 4u, 0u, 4u, 2u, // below
    2u, 4u, 5u, 2u, 5u, 3u, // at infinity
);

// Cones from two points of an edge differ in direction by more than their widths say; hulls are this much wider.
const MARGIN = 1.15;

struct Wedge {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) edge: u32,
};

// Direction in which light passes the point, length 1, and the tangent of the light's half angle seen from there; below 0
// where the point is inside of the light.
fn past(p: vec3<f32>) -> vec4<f32> {
    if source.toward_light.w == 0.0 {
        return vec4<f32>(-source.toward_light.xyz, source.size);
    }
    let away = p - source.toward_light.xyz;
    let d = length(away);
    if d <= 1.5 * source.size {
        return vec4<f32>(0.0, 0.0, 0.0, -1.0);
    }
    return vec4<f32>(away / d, source.size * inverseSqrt(d * d - source.size * source.size));
}

@vertex
fn wedge(@builtin(vertex_index) vertex: u32, @builtin(instance_index) edge: u32) -> Wedge {
    let ends = silhouettes.list[edge];
    var p = ends.p_in_world.xyz;
    var q = ends.q_in_world.xyz;
    var at_p = past(p);
    var at_q = past(q);
    let nowhere = Wedge(vec4<f32>(0.0, 0.0, 0.0, 1.0), edge);
    // An edge that touches the light has no wedge: its shadow stays hard.
    if at_p.w <= 0.0 || at_q.w <= 0.0 {
        return nowhere;
    }
    // p is the end nearer to the light: the hull's sides then fold outward.
    if dot(q - p, at_p.xyz) < 0.0 {
        let o = p; p = q; q = o;
        let at_o = at_p; at_p = at_q; at_q = at_o;
    }
    let k = MARGIN * max(at_p.w, at_q.w);
    let along = dot(q - p, at_p.xyz);
    let lateral = q - p - along * at_p.xyz;
    let width = length(lateral);
    var across = lateral / max(width, 1e-20);
    if width <= k * along || width < 1e-6 * length(q - p) {
        // q lies in the cone of p, which holds the cones of the whole edge.
        q = p;
        at_q = at_p;
        let axis = select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), abs(at_p.x) > 0.7);
        across = normalize(axis - at_p.xyz * dot(axis, at_p.xyz));
    }
    let up = cross(at_p.xyz, across);
    let corner = HULL[vertex];
    if corner < 2u {
        return Wedge(view.clip_from_world * vec4<f32>(select(p, q, corner == 1u), 1.0), edge);
    }
    let is_q = corner >= 4u;
    let direction = select(at_p.xyz, at_q.xyz, is_q);
    let outward = cross(up, direction) * select(-1.0, 1.0, is_q);
    let above = select(-1.0, 1.0, (corner & 1u) != 0u);
    return Wedge(view.clip_from_world * vec4<f32>(direction + k * (outward + above * up), 0.0), edge);
}

// Radius of the penumbra at what the eye sees, across the light, metres, where the edge hides a part of the source.
@fragment
fn penumbra_radius(w: Wedge) -> @location(0) f32 {
    let pixel = floor(w.position.xy);
    let own = textureLoad(hard, vec2<i32>(pixel), 0).xy;
    if own.y <= 0.0 {
        discard;
    }
    let here = world_at(pixel, own.y);
    let light = toward_light_at(here);
    let ends = silhouettes.list[w.edge];
    var p = ends.p_in_world.xyz - here;
    var q = ends.q_in_world.xyz - here;
    var p_along = dot(p, light.unit);
    var q_along = dot(q, light.unit);
    // Only what stands between here and the light.
    let far = select(1e30, light.distance - source.size, light.distance > 0.0);
    if max(p_along, q_along) <= 0.0 || min(p_along, q_along) >= far {
        discard;
    }
    let near_share = -min(p_along, q_along) / max(abs(q_along - p_along), 1e-20);
    if p_along < 0.0 {
        p = mix(p, q, near_share);
        p_along = 0.0;
    } else if q_along < 0.0 {
        q = mix(q, p, near_share);
        q_along = 0.0;
    }
    if max(p_along, q_along) > far {
        discard;
    }
    // The edge and its penumbra thrown onto the plane across the light through here.
    var p_throw = 1.0;
    var q_throw = 1.0;
    if light.distance > 0.0 {
        p_throw = light.distance / (light.distance - p_along);
        q_throw = light.distance / (light.distance - q_along);
    }
    let foot = (p - light.unit * p_along) * p_throw;
    let edge = (q - light.unit * q_along) * q_throw - foot;
    let scale = select(source.size, source.size / max(light.distance, 1e-9), light.distance > 0.0);
    let share = saturate(-dot(foot, edge) / max(dot(edge, edge), 1e-20));
    let radius = scale * mix(p_along * p_throw, q_along * q_throw, share);
    let to_edge = foot + edge * share;
    if length(to_edge) >= radius {
        discard;
    }
    // Here lies beside the caster, and yet in a hard shadow: in that of something else, which hides the source whatever
    // this edge does.
    let pixel_size = length(world_at(pixel + vec2<f32>(1.0, 0.0), own.y) - here);
    let is_beside = dot(to_edge, cross(light.unit, edge)) > 4.0 * pixel_size * length(edge) && share > 0.0 && share < 1.0;
    if is_beside && own.x > 0.99 {
        discard;
    }
    return radius;
}
