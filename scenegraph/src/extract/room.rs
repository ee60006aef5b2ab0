//! The room in the world, and what surrounds everything: Navigation, User, Background, Fog, Environment, Viewpoints.

use super::instance::{Instances, unit};
use super::problem::Problems;
use super::read::{Reader, label};
use crate::nodes::environment::{AMBIENT, HORIZON, NADIR, SAMPLES, SHADOW_MEMORY_MIB, ZENITH};
use glam::{Mat4, Quat, Vec3};
use std::collections::BTreeSet;
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Background, Fog, FogKind, Samples, Scene};

/// Nodes that are found by their type, wherever they stand. The smallest id of a type counts.
#[derive(Default)]
pub(super) struct Globals {
    pub(super) navigation: BTreeSet<NodeId>,
    pub(super) users: BTreeSet<NodeId>,
    /// Background, Fog, Environment.
    pub(super) environment: BTreeSet<NodeId>,
}

/// Where the room is in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Room {
    pub(super) world_from_room: Mat4,
    pub(super) room_from_world: Mat4,
    /// Metres of the world in a metre of the room.
    pub(super) world_per_room: f32,
}

impl Default for Room {
    fn default() -> Room {
        Room { world_from_room: Mat4::IDENTITY, room_from_world: Mat4::IDENTITY, world_per_room: 1.0 }
    }
}

/// The pose of the room; that of the world itself where there is no Navigation, or none that makes sense.
pub(super) fn read_room(graph: &Graph, globals: &Globals, problems: &mut Problems) -> Room {
    let Some(node) = globals.navigation.first().copied() else { return Room::default() };
    let read = Reader::new(graph, node);
    let (position, orientation) = (read.get::<Vec3>("position"), unit(read.get::<Quat>("orientation")));
    let scale: f32 = read.get("scale");
    let world_from_room = Mat4::from_scale_rotation_translation(Vec3::splat(scale), orientation, position);
    let room_from_world = world_from_room.inverse();
    let fine = scale > 0.0 && world_from_room.is_finite() && room_from_world.is_finite();
    let problem =
        (!fine).then(|| "position, orientation or scale makes no pose; the room stands at the world's origin".to_owned());
    problems.set(graph, node, "position", problem);
    if fine { Room { world_from_room, room_from_world, world_per_room: scale } } else { Room::default() }
}

/// Between the eyes of the first User, in the room.
pub(super) fn read_head(graph: &Graph, globals: &Globals) -> Vec3 {
    let standing = Vec3::new(0.0, 1.7, 0.0);
    let head = globals.users.first().map(|id| Reader::new(graph, *id).get::<Vec3>("position"));
    head.filter(|p| p.is_finite()).unwrap_or(standing)
}

/// Ambient light, sky, fog and exposure.
pub(super) fn read_environment(graph: &Graph, globals: &Globals, room: &Room, problems: &mut Problems, scene: &mut Scene) {
    let of_type = |name: &'static str| {
        let all = globals.environment.iter().map(|id| Reader::new(graph, *id));
        all.filter(move |read| &*graph.type_of(read.node).name == name)
    };
    let mut color = |read: &Reader<'_>, field: &'static str, usual: Vec3| {
        let value = read.color(field);
        let problem = (!value.is_finite()).then(|| format!("{value} makes no sense here; {usual} is used"));
        problems.set(graph, read.node, field, problem);
        if value.is_finite() { value } else { usual }
    };
    scene.background = Background { zenith: ZENITH, horizon: HORIZON, nadir: NADIR };
    if let Some(sky) = of_type("Background").find(|b| b.get("bound")) {
        scene.background = Background {
            zenith: color(&sky, "zenith_color", ZENITH),
            horizon: color(&sky, "horizon_color", HORIZON),
            nadir: color(&sky, "nadir_color", NADIR),
        };
    }
    scene.fog = of_type("Fog").next().and_then(|fog| {
        let range = fog.get::<f32>("visibility_range");
        let kind = if fog.choice("fog_type") == 1 { FogKind::Exponential } else { FogKind::Linear };
        let made = || Fog { color: color(&fog, "color", Vec3::ONE), kind, visibility_range: range / room.world_per_room };
        (range.is_finite() && range > 0.0).then(made)
    });
    (scene.ambient, scene.exposure, scene.samples) = (AMBIENT, 1.0, Samples::default());
    scene.map_memory_bytes = (SHADOW_MEMORY_MIB as u64) << 20;
    if let Some(surroundings) = of_type("Environment").next() {
        scene.ambient = color(&surroundings, "ambient", AMBIENT);
        let exposure: f32 = surroundings.get("exposure");
        let fine = exposure.is_finite() && exposure >= 0.0;
        let problem = (!fine).then(|| format!("{exposure} makes no sense here; 1 is used"));
        problems.set(graph, surroundings.node, "exposure", problem);
        scene.exposure = if fine { exposure } else { 1.0 };
        let memory: i32 = surroundings.get("shadow_memory");
        let problem = (memory < 1).then(|| format!("{memory} makes no sense here; {SHADOW_MEMORY_MIB} is used"));
        problems.set(graph, surroundings.node, "shadow_memory", problem);
        scene.map_memory_bytes = (if memory < 1 { SHADOW_MEMORY_MIB } else { memory } as u64) << 20;
        let count: i32 = surroundings.get("samples");
        let samples = u32::try_from(count).ok().and_then(Samples::of);
        let problem = samples.is_none().then(|| format!("{count} is neither 1 nor 4; {SAMPLES} is used"));
        problems.set(graph, surroundings.node, "samples", problem);
        scene.samples = samples.unwrap_or_default();
    }
}

/// A place to see the world from.
#[derive(Clone, Debug, PartialEq)]
pub struct Viewpoint {
    /// Its node.
    pub node: NodeId,
    /// Name of its node.
    pub name: String,
    /// Its `description`, or its name.
    pub description: String,
    /// Pose in the room, without scale; the camera looks along -z.
    pub room_from_view: Mat4,
    /// Pose in the world, without scale.
    pub world_from_view: Mat4,
    /// Whole vertical angle, radians.
    pub field_of_view_rad: f32,
    /// Nearest distance that is drawn, metres.
    pub near_m: f32,
}

/// All Viewpoints that stand in the world, in tree order. One whose pose is not finite is left out.
pub(super) fn read_viewpoints(graph: &Graph, instances: &Instances, places: &[u32], room: &Room) -> Vec<Viewpoint> {
    let one = |place: &u32| {
        let instance = instances.at(*place);
        let read = Reader::new(graph, instance.node);
        let pose = Mat4::from_rotation_translation(unit(read.get::<Quat>("orientation")), read.get::<Vec3>("position"));
        let room_from_view = rigid(instance.room_from_local * pose)?;
        let description: Arc<str> = read.get("description");
        let name = label(graph, instance.node);
        Some(Viewpoint {
            node: instance.node,
            description: if description.is_empty() { name.clone() } else { description.to_string() },
            name,
            room_from_view,
            world_from_view: rigid(room.world_from_room * instance.room_from_local * pose)?,
            field_of_view_rad: read.get::<f32>("field_of_view").clamp(0.01, 3.1),
            near_m: read.get::<f32>("near").max(1e-4),
        })
    };
    places.iter().filter(|p| instances.at(**p).finite).filter_map(one).collect()
}

/// The pose without stretching: a camera stays a camera under a scaled transform. None where there is none.
pub(super) fn rigid(m: Mat4) -> Option<Mat4> {
    let back = m.z_axis.truncate().try_normalize()?;
    let right = m.y_axis.truncate().cross(back).try_normalize()?;
    let up = back.cross(right);
    let pose = Mat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), m.w_axis);
    pose.is_finite().then_some(pose)
}
