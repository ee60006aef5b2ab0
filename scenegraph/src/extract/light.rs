//! Light nodes become lights in the room.

use super::map_settings::map_settings;
use super::problem::Problems;
use super::read::{Reader, label};
use glam::{Mat3, Mat4, Vec2, Vec3, Vec4};
use std::f32::consts::PI;
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Light, LightKind, ShadowMethod, Silhouettes, VolumeCounting, VolumeSettings};

/// One place of a light in the world.
pub(super) struct LightEntry {
    pub(super) node: NodeId,
    /// In the space of its node; None if it is off.
    pub(super) local: Option<Light>,
    /// In the room; None if it is off, hidden, or nowhere.
    pub(super) placed: Option<Light>,
    /// Place in the scene's list.
    pub(super) slot: Option<usize>,
}

/// Widest cone, so that its cosine still differs from that of pi.
const WIDEST_RAD: f32 = PI - 1e-3;

/// Reads a light node in its own space. None if it is off.
pub(super) fn read_light(graph: &Graph, node: NodeId, problems: &mut Problems) -> Option<Light> {
    Reader::new(graph, node).get::<bool>("on").then(|| read_any_light(graph, node, problems))
}

/// The same, on or off.
pub(super) fn read_any_light(graph: &Graph, node: NodeId, problems: &mut Problems) -> Light {
    let read = Reader::new(graph, node);
    let mut check = Check { graph, node, problems };
    let mut light = Light {
        name: label(graph, node),
        color: check.finite("color", read.color("color"), Vec3::ONE, |c| c.is_finite()),
        ambient_intensity: check.finite("ambient_intensity", read.get("ambient_intensity"), 0.0, |x: &f32| x.is_finite()),
        shadows: shadows(&read),
        shadow_intensity: check.finite("shadow_intensity", read.get("shadow_intensity"), 1.0, |x: &f32| x.is_finite()),
        soft: read.choice("soft") != 0,
        ..Light::default()
    };
    // Fields that say where the light is and where it shines.
    let (mut place, mut aim) = ("location", "direction");
    match &*graph.type_of(node).name {
        "DirectionalLight" => {
            light.direction = read.get("direction");
            place = "projection_location";
            light.position = read.get(place);
        }
        "PointLight" => {
            light.kind = LightKind::Point;
            light.position = read.get("location");
        }
        "LightSource" => {
            place = "position";
            aim = light_source(&read, &mut light);
        }
        _ => {
            let outer_rad = read.get::<f32>("cut_off_angle");
            light.kind = cone(outer_rad, read.get::<f32>("beam_width"));
            light.position = read.get("location");
            light.direction = read.get("direction");
        }
    }
    light.position = check.finite(place, light.position, Vec3::ZERO, |p| p.is_finite());
    light.direction = check.finite(aim, light.direction, Vec3::NEG_Z, |d| d.try_normalize().is_some());
    let parallel = light.kind == LightKind::Directional;
    let usual = if parallel { PI } else { 100.0 };
    light.intensity = check.finite("intensity", read.get("intensity"), usual, |x: &f32| x.is_finite() && *x >= 0.0);
    if !parallel {
        let reach = |x: &f32| !x.is_nan() && *x > 0.0;
        light.range = check.finite("radius", read.get("radius"), f32::INFINITY, reach);
        let fine = |a: &Vec3| a.is_finite() && a.min_element() >= 0.0 && a.max_element() > 0.0;
        light.attenuation = check.finite("attenuation", read.get("attenuation"), Vec3::Z, fine);
    }
    light.shadow_intensity *= 1.0 - brightness(&read, &mut check);
    light.size = size(&read, parallel, &mut check);
    light.up = up(&read, &light, &mut check);
    light.map = map_settings(&read, &light.kind, &mut check);
    light.volume = volume_settings(&read, &mut check);
    light
}

/// What is up in the light's map. Along its direction it says nothing.
fn up(read: &Reader<'_>, light: &Light, check: &mut Check<'_>) -> Option<Vec3> {
    let along = light.direction.normalize_or_zero();
    let says_something = |up: &Vec3| up.try_normalize().is_some_and(|up| up.cross(along).length() > 1e-3) || *up == Vec3::ZERO;
    let up = check.finite("up", read.get("up"), Vec3::ZERO, says_something);
    (up != Vec3::ZERO).then_some(up)
}

/// Share of the light that a shadow of this grey keeps: 004 gives greys as they are shown, sRGB encoded.
fn brightness(read: &Reader<'_>, check: &mut Check<'_>) -> f32 {
    let grey = check.finite("shadow_brightness", read.get("shadow_brightness"), 0.0, |b: &f32| (0.0..=255.0).contains(b)) / 255.0;
    if grey <= 0.04045 { grey / 12.92 } else { ((grey + 0.055) / 1.055).powf(2.4) }
}

/// Size of the source as [`Light::size`]. A range of 10 is the factor 0.1 of 004 section 3.2.1.
fn size(read: &Reader<'_>, parallel: bool, check: &mut Check<'_>) -> f32 {
    let fine = |x: &f32| x.is_finite() && *x >= 0.0;
    let by_range = check.finite("soft_range", read.get("soft_range"), 10.0, fine) / 100.0;
    let by_size = if parallel {
        let angle = |x: &f32| (0.0..3.0).contains(x);
        (check.finite("angular_diameter", read.get("angular_diameter"), 0.0093, angle) * 0.5).tan()
    } else {
        check.finite("light_radius", read.get("light_radius"), 0.05, fine)
    };
    if read.choice("soft") == 2 { by_range } else { by_size }
}

/// The light of Performer (000 section 4.1): the position's w tells its kind. Gives the field that says where it shines.
fn light_source(read: &Reader<'_>, light: &mut Light) -> &'static str {
    let position: Vec4 = read.get("position");
    if position.w == 0.0 {
        // The position of a parallel light is where it comes from.
        light.direction = -position.truncate();
        return "position";
    }
    light.position = position.truncate() / position.w;
    light.direction = read.get("spot_dir");
    let Vec2 { x: exponent, y: spread_deg } = read.get("spot_cone");
    // Without a cone it is still no PointLight: its shadow map looks along `spot_dir`, as in Performer.
    let outer_rad = spread_deg.to_radians();
    let inner_rad = if exponent > 0.0 { 0.95f32.powf(1.0 / exponent).acos() } else { outer_rad };
    light.kind = cone(outer_rad, inner_rad);
    "spot_dir"
}

fn cone(outer_rad: f32, inner_rad: f32) -> LightKind {
    let outer_rad = outer_rad.clamp(1e-3, WIDEST_RAD);
    LightKind::Spot { inner_rad: inner_rad.clamp(0.0, outer_rad * 0.999), outer_rad }
}

fn shadows(read: &Reader<'_>) -> ShadowMethod {
    match read.choice("shadows") {
        1 => ShadowMethod::Map,
        2 => ShadowMethod::Volume,
        _ if read.get::<bool>("shadow_enable") => ShadowMethod::Map,
        _ => ShadowMethod::None,
    }
}

fn volume_settings(read: &Reader<'_>, check: &mut Check<'_>) -> VolumeSettings {
    let floor: f32 = check.finite("volume_floor", read.get("volume_floor"), f32::NEG_INFINITY, |h: &f32| *h < f32::INFINITY);
    VolumeSettings {
        counting: [VolumeCounting::Auto, VolumeCounting::ZFail][usize::from(read.choice("volume_counting") == 1)],
        silhouettes: [Silhouettes::Compute, Silhouettes::Quads][usize::from(read.choice("volume_silhouettes") == 1)],
        culling: read.get("volume_culling"),
        depth_bounds: read.get("volume_depth_bounds"),
        fitted: read.get("volume_fitted"),
        length: check.finite("volume_length", read.get("volume_length"), f32::INFINITY, |l: &f32| *l > 0.0),
        lower_plane: floor.is_finite().then(|| Vec3::Y.extend(-floor)),
        holes_by_map: read.choice("volume_holes") == 1,
    }
}

/// Reports values that make no sense and gives the usual one instead.
pub(super) struct Check<'a> {
    pub(super) graph: &'a Graph,
    pub(super) node: NodeId,
    pub(super) problems: &'a mut Problems,
}

impl Check<'_> {
    pub(super) fn finite<T: std::fmt::Debug + Copy>(
        &mut self,
        field: &'static str,
        value: T,
        usual: T,
        fine: impl Fn(&T) -> bool,
    ) -> T {
        let is_fine = fine(&value);
        let problem = (!is_fine).then(|| format!("{value:?} makes no sense here; {usual:?} is used"));
        self.problems.set(self.graph, self.node, field, problem);
        if is_fine { value } else { usual }
    }
}

/// The light in the room. `world_per_room` is the Navigation's scale. None where its place or direction is not finite.
pub(super) fn place_light(local: &Light, room_from_local: &Mat4, world_per_room: f32) -> Option<Light> {
    let stretch = Mat3::from_mat4(*room_from_local).determinant().abs().cbrt();
    let mut light = local.clone();
    light.position = room_from_local.transform_point3(local.position);
    light.direction = match local.kind {
        LightKind::Point => Vec3::NEG_Z,
        _ => room_from_local.transform_vector3(local.direction).try_normalize()?,
    };
    if !light.position.is_finite() || stretch == 0.0 {
        return None;
    }
    light.up = local.up.map(|up| room_from_local.transform_vector3(up));
    light.range *= stretch;
    if local.kind != LightKind::Directional {
        light.size *= stretch;
    }
    // A world seen ten times smaller is as bright: distances count in metres of the world.
    light.attenuation *= Vec3::new(1.0, world_per_room, world_per_room * world_per_room);
    let scaled = |v: f32| v * stretch;
    light.map.near_far = local.map.near_far.map(|d| d.map(scaled));
    light.map.constant_bias = local.map.constant_bias.map(scaled);
    light.volume.length *= stretch;
    // Planes go by the inverse transpose; distances to them in metres of the room.
    light.volume.lower_plane = local.volume.lower_plane.and_then(|plane| {
        let plane = room_from_local.inverse().transpose() * plane;
        let length = plane.truncate().length();
        (length > 0.0 && plane.is_finite()).then(|| plane / length)
    });
    if local.kind == LightKind::Directional {
        light.map.frustum = local.map.frustum.map(|f| f.map(scaled));
    }
    Some(light)
}
