//! Which part of the world each shadow map shows.

use glam::{Mat4, Vec3, Vec4};
use umbriel_scene::{Aabb, Light, LightKind, MapSettings};

/// Half angle of a cone beyond which six maps see it better than one.
const WIDEST_CONE_RAD: f32 = 1.2;
/// Texels around a map that filters and bias may read.
pub(crate) const MARGIN_TEXELS: f32 = 8.0;
/// Nearest caster of a light with a position, metres. Reversed depth keeps its precision at any distance.
const NEAR: f32 = 1e-3;

/// What one map shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Projection {
    pub(crate) map_from_world: Mat4,
    /// Towards the light (w = 0) or its position (w = 1).
    pub(crate) eye: Vec4,
    /// Size of a texel at distance 1 (w = 1) or everywhere, metres.
    pub(crate) texel: f32,
    /// Parallel (w = 0): metres per depth. From a position (w = 1): distance along the axis is `[0] / (depth + [1])`.
    pub(crate) depth: [f32; 2],
}

/// A map, and the corners of what it has to show; without corners it shows all that its light reaches.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fit {
    pub(crate) projection: Projection,
    pub(crate) needed: Option<[Vec3; 8]>,
}

/// Rotation into the frame of a light that travels along `direction` = -z, with `up` above where it says something.
pub(crate) fn light_from_world(direction: Vec3, up: Option<Vec3>) -> Mat4 {
    let z = -direction;
    let usual = if z.y.abs() > 0.99 { Vec3::Z } else { Vec3::Y };
    let across = |up: Vec3| up.normalize_or_zero().cross(z);
    let x = up.map(across).filter(|x| x.length() > 1e-3).unwrap_or(across(usual)).normalize();
    Mat4::from_cols(x.extend(0.0), z.cross(x).extend(0.0), z.extend(0.0), Vec4::W).transpose()
}

/// Window at distance 1 and depth reversed; without `far` it is at infinity.
fn perspective([l, r, b, t]: [f32; 4], near: f32, far: Option<f32>) -> Mat4 {
    let (scale, offset) = match far {
        Some(far) => (near / (far - near), near * far / (far - near)),
        None => (0.0, near),
    };
    Mat4::from_cols(
        Vec4::new(2.0 / (r - l), 0.0, 0.0, 0.0),
        Vec4::new(0.0, 2.0 / (t - b), 0.0, 0.0),
        Vec4::new((r + l) / (r - l), (t + b) / (t - b), scale, -1.0),
        Vec4::new(0.0, 0.0, offset, 0.0),
    )
}

/// See [`Projection::depth`].
fn depth_of(near: f32, far: Option<f32>) -> [f32; 2] {
    far.map_or([near, 0.0], |far| [near * far / (far - near), near / (far - near)])
}

/// Box of parallel light: depth 1 at distance `near` along -z, 0 at `far`.
pub(crate) fn parallel([l, r, b, t]: [f32; 4], near: f32, far: f32) -> Mat4 {
    Mat4::from_cols(
        Vec4::new(2.0 / (r - l), 0.0, 0.0, 0.0),
        Vec4::new(0.0, 2.0 / (t - b), 0.0, 0.0),
        Vec4::new(0.0, 0.0, 1.0 / (far - near), 0.0),
        Vec4::new(-(r + l) / (r - l), -(t + b) / (t - b), far / (far - near), 1.0),
    )
}

/// A window that can be divided by, or nothing.
fn usable(settings: &MapSettings) -> (Option<[f32; 4]>, f32, Option<f32>) {
    let window = settings.frustum.filter(|[l, r, b, t]| r > l && t > b && [l, r, b, t].iter().all(|v| v.is_finite()));
    let [near, far] = settings.near_far.unwrap_or([NEAR, f32::INFINITY]);
    let near = if near.is_finite() && near > 0.0 { near } else { NEAR };
    (window, near, Some(far).filter(|f| f.is_finite() && *f > near))
}

/// Pose of a light as its maps take it, so that a map that is kept goes along with its light.
pub(crate) fn map_frame(light: &Light) -> Mat4 {
    let turn = match light.kind {
        LightKind::Point => Mat4::IDENTITY,
        _ => light_from_world(light.direction.normalize_or(Vec3::NEG_Z), light.up),
    };
    turn * Mat4::from_translation(-light.position)
}

/// Half angle of the widest cone that is projected.
const WIDEST_PROJECTOR_RAD: f32 = 1.55;

/// What a light projects textures by (003 section 4.5): its window, without margins. None for light into all directions.
pub(crate) fn projector(light: &Light, casters: Aabb) -> Option<Mat4> {
    match light.kind {
        LightKind::Directional => {
            let ([l, r, b, t], _, far) = parallel_window(light, casters)?;
            Some(parallel([l, r, b, t], 0.0, far.max(1e-3)) * map_frame(light))
        }
        LightKind::Spot { outer_rad, .. } => {
            let edge = outer_rad.clamp(1e-3, WIDEST_PROJECTOR_RAD).tan();
            let window = usable(&light.map).0.unwrap_or([-edge, edge, -edge, edge]);
            Some(perspective(window, NEAR, None) * map_frame(light))
        }
        LightKind::Point => None,
    }
}

/// Near and far distance of all casters from a light, or those set by hand, metres.
pub(crate) fn range(light: &Light, casters: Aabb) -> [f32; 2] {
    let depths = casters.corners().map(|p| -map_frame(light).transform_point3(p).z);
    let reach = casters.corners().map(|p| p.distance(light.position));
    let (nearest, farthest) = match light.kind {
        LightKind::Point => (NEAR, reach.into_iter().fold(0.0, f32::max)),
        _ => (depths.into_iter().fold(f32::INFINITY, f32::min), depths.into_iter().fold(f32::NEG_INFINITY, f32::max)),
    };
    let slack = 1e-3 * (1.0 + casters.radius());
    let [near, far] = light.map.near_far.unwrap_or([f32::NEG_INFINITY, f32::INFINITY]);
    let near = if near.is_finite() { near } else { nearest - slack };
    let near = if light.kind == LightKind::Directional { near } else { near.max(NEAR) };
    let far = if far.is_finite() { far } else { farthest + slack };
    [near, if far > near { far } else { near + 1.0 }]
}

/// Window and distances of one map of parallel light: by hand, or around all casters.
fn parallel_window(light: &Light, casters: Aabb) -> Option<([f32; 4], f32, f32)> {
    let (by_hand, ..) = usable(&light.map);
    if casters.is_empty() && by_hand.is_none() {
        return None;
    }
    let around = casters.transformed(&map_frame(light));
    let slack = 1e-3 * (1.0 + casters.radius());
    let window = by_hand.unwrap_or([around.min.x - slack, around.max.x + slack, around.min.y - slack, around.max.y + slack]);
    let [near, far] = range(light, casters);
    Some((window, near, far))
}

/// The one map of parallel light that a texture shows.
pub(crate) fn whole(light: &Light, size: u32, casters: Aabb) -> Vec<Fit> {
    let Some((window, near, far)) = parallel_window(light, casters) else { return Vec::new() };
    let [l, r, b, t] = window;
    let map_from_world = parallel(window, near, far) * map_frame(light);
    let eye = (-light.direction.normalize_or(Vec3::NEG_Z)).extend(0.0);
    let texel = (r - l).max(t - b) / size as f32;
    vec![Fit { projection: Projection { map_from_world, eye, texel, depth: [far - near, 0.0] }, needed: None }]
}

/// The map of a spot light, or six where its cone is too wide for one.
pub(crate) fn spot(light: &Light, size: u32) -> Vec<Fit> {
    let LightKind::Spot { outer_rad, .. } = light.kind else { return point(light, size) };
    if outer_rad > WIDEST_CONE_RAD {
        return point(light, size);
    }
    let (window, near, far) = usable(&light.map);
    // A texture shows the cone as it is.
    let margin = if light.shines { MARGIN_TEXELS } else { 0.0 };
    let edge = outer_rad.max(1e-3).tan() * (1.0 + 2.0 * margin / size as f32);
    let [l, r, b, t] = window.unwrap_or([-edge, edge, -edge, edge]);
    let map_from_world = perspective([l, r, b, t], near, far) * map_frame(light);
    let texel = (r - l).max(t - b) / size as f32;
    let depth = depth_of(near, far);
    let projection = Projection { map_from_world, eye: light.position.extend(1.0), texel, depth };
    vec![Fit { projection, needed: None }]
}

/// The six maps of a point light: +x -x +y -y +z -z. Each is a little wider than a right angle, for seams.
pub(crate) fn point(light: &Light, size: u32) -> Vec<Fit> {
    let (_, near, far) = usable(&light.map);
    let edge = 1.0 + 2.0 * MARGIN_TEXELS / size as f32;
    let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    axes.map(|axis| {
        let view = light_from_world(axis, None) * Mat4::from_translation(-light.position);
        let map_from_world = perspective([-edge, edge, -edge, edge], near, far) * view;
        let texel = 2.0 * edge / size as f32;
        let projection = Projection { map_from_world, eye: light.position.extend(1.0), texel, depth: depth_of(near, far) };
        Fit { projection, needed: None }
    })
    .to_vec()
}
