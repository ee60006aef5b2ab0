//! Settings of a light's shadow map: AVANGO's fields (000), X3D's (003), and those of a GeneratedShadowMap.

use super::light::Check;
use super::problem::Problems;
use super::read::{Reader, label, type_name};
use crate::nodes::projection::{BIAS, SCALE, SIZE};
use glam::{Vec2, Vec4};
use umbriel_fields::{EnumValue, Graph, NodeId};
use umbriel_scene::{LightKind, MapFilter, MapSettings, MapUpdate};

/// The constant offset that `bias` of a GeneratedShadowMap counts, metres (003 section 4.4 leaves it to us).
const BIAS_M: f32 = 1e-4;

/// In the order of the node's choices.
const FILTERS: [MapFilter; 6] =
    [MapFilter::None, MapFilter::Hardware, MapFilter::Pcf4, MapFilter::Pcf16, MapFilter::Poisson, MapFilter::Pcss];
const UPDATES: [MapUpdate; 4] = [MapUpdate::Auto, MapUpdate::Never, MapUpdate::Always, MapUpdate::Next];

/// Does a light ask for its map in this frame only? Before the next one its `shadow_update` falls back to none (003 section 4.1), which is
/// up to whoever may write to the graph: [`Extractor::maps_drawn_once`](super::Extractor::maps_drawn_once) for those who extract, this for
/// those who do not.
pub fn wants_map_once(graph: &Graph, node: NodeId) -> bool {
    let update = graph.get_named::<EnumValue>(node, "shadow_update").ok();
    update.and_then(|update| UPDATES.get(update.0 as usize)) == Some(&MapUpdate::Next)
}

/// Zero means fitted; anything that makes no frustum is reported and fitted.
pub(super) fn map_settings(read: &Reader<'_>, kind: &LightKind, check: &mut Check<'_>) -> MapSettings {
    let parallel = *kind == LightKind::Directional;
    let size: i32 = check.finite("shadow_size", read.get("shadow_size"), 2048, |s: &i32| *s > 0);
    let mut bias = |field: &'static str| {
        let value = check.finite(field, read.get(field), -1.0, |x: &f32| x.is_finite());
        (value >= 0.0).then_some(value)
    };
    let mut map = MapSettings {
        slope_bias: bias("displace_scale"),
        constant_bias: bias("displace_offset"),
        size: size as u32,
        frustum: frustum(read, kind, check),
        near_far: near_far(read, parallel, check),
        filter: FILTERS[(read.choice("filter") as usize).min(FILTERS.len() - 1)],
        update: UPDATES[(read.choice("shadow_update") as usize).min(UPDATES.len() - 1)],
        outside_in_shadow: read.choice("shadow_outside") == 1,
        request: None,
    };
    // 003's rectangle ends the light too; AVANGO's frustum does not.
    map.outside_in_shadow |= parallel && map.frustum.is_some() && read.get::<Vec4>("shadow_frustum") == Vec4::ZERO;
    let implicit = read.node("default_shadow_map");
    let is_map = |node| type_name(check.graph, node) == "GeneratedShadowMap";
    let problem = implicit
        .filter(|node| !is_map(*node))
        .map(|node| format!("'{}' is no GeneratedShadowMap; left out", label(check.graph, node)));
    check.problems.set(check.graph, check.node, "default_shadow_map", problem);
    if let Some(node) = implicit.filter(|node| is_map(*node)) {
        of_generated_map(check.graph, &Reader::new(check.graph, node), &mut map, check.problems);
    }
    map
}

/// Left, right, bottom, top.
fn frustum(read: &Reader<'_>, kind: &LightKind, check: &mut Check<'_>) -> Option<[f32; 4]> {
    let of_paper: Vec4 = read.get("shadow_frustum");
    let window = |f: &Vec4| f.is_finite() && f.x < f.y && f.z < f.w || *f == Vec4::ZERO;
    let of_paper = check.finite("shadow_frustum", of_paper, Vec4::ZERO, window);
    let rectangle: Vec4 = read.get("projection_rectangle");
    let upright = |f: &Vec4| f.is_finite() && f.x < f.z && f.y < f.w || *f == Vec4::ZERO;
    let rectangle = check.finite("projection_rectangle", rectangle, Vec4::ZERO, upright);
    let angle = check.finite("projection_angle", read.get("projection_angle"), 0.0, |a: &f32| (0.0..=3.1).contains(a));
    if of_paper != Vec4::ZERO {
        return Some(of_paper.to_array());
    }
    match kind {
        LightKind::Directional if rectangle != Vec4::ZERO => {
            let [left, bottom, right, top] = rectangle.to_array();
            Some([left, right, bottom, top])
        }
        LightKind::Spot { .. } if angle > 0.0 => {
            let edge = (angle * 0.5).tan();
            Some([-edge, edge, -edge, edge])
        }
        _ => None,
    }
}

/// Near and far distance; what is fitted is infinite.
fn near_far(read: &Reader<'_>, parallel: bool, check: &mut Check<'_>) -> Option<[f32; 2]> {
    let of_paper: Vec2 = read.get("shadow_near_far");
    let span = |d: &Vec2| d.is_finite() && d.x < d.y && (parallel || d.x > 0.0) || *d == Vec2::ZERO;
    let of_paper = check.finite("shadow_near_far", of_paper, Vec2::ZERO, span);
    let near = check.finite("projection_near", read.get("projection_near"), 0.0, |n: &f32| n.is_finite() && *n >= 0.0);
    let far: f32 = read.get("projection_far");
    let is_beyond = far.is_finite() && (far == 0.0 || far > near);
    let problem =
        (!is_beyond).then(|| format!("{far:?} is not beyond projection_near, {near:?}; the farthest distance is fitted"));
    check.problems.set(check.graph, check.node, "projection_far", problem);
    if of_paper != Vec2::ZERO {
        return Some(of_paper.to_array());
    }
    let near = if near > 0.0 { near } else { f32::NEG_INFINITY };
    let far = if is_beyond && far > 0.0 { far } else { f32::INFINITY };
    (near.is_finite() || far.is_finite()).then_some([near, far])
}

/// What a GeneratedShadowMap says of its light's map (003 section 4.4).
pub(super) fn of_generated_map(graph: &Graph, read: &Reader<'_>, map: &mut MapSettings, problems: &mut Problems) {
    let mut check = Check { graph, node: read.node, problems };
    map.size = check.finite("size", read.get("size"), SIZE, |s: &i32| *s > 0) as u32;
    let usable = |x: &f32| x.is_finite() && *x >= 0.0;
    let scale = check.finite("scale", read.get("scale"), SCALE, usable);
    let bias = check.finite("bias", read.get("bias"), BIAS, usable);
    // As for glPolygonOffset, a scale of 1 is one texel of slope.
    let by_hand = (scale, bias) != (SCALE, BIAS);
    map.slope_bias = by_hand.then_some(scale);
    map.constant_bias = by_hand.then_some(bias * BIAS_M);
    // "Always" means that the map is always right: it is drawn when it would change.
    map.update = if read.choice("update") == 1 { MapUpdate::Auto } else { MapUpdate::Never };
    map.request = Some(read.get::<i32>("requests") as u32);
}
