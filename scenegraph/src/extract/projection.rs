//! What shapes receive and what is projected: lists of the scene that materials name by numbers, so that moving lights and
//! projectors leave materials as they are.

use super::instance::{Instances, unit};
use super::light::{LightEntry, place_light, read_any_light};
use super::map_settings::of_generated_map;
use super::problem::Problems;
use super::read::{Reader, label, type_name};
use super::role::Role;
use super::room::{Room, rigid};
use super::{Extractor, light_slot};
use glam::{Mat4, Quat, Vec3};
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Light, Projector, Scene, ShadowMethod};

/// Numbers of nodes, steady as long as a node lives.
#[derive(Default)]
pub(super) struct Numbers {
    nodes: Vec<Option<NodeId>>,
}

impl Numbers {
    /// The number of a node.
    pub(super) fn of(&mut self, node: NodeId) -> usize {
        let place = |wanted| self.nodes.iter().position(|n| *n == wanted);
        let number = place(Some(node)).or_else(|| place(None)).unwrap_or(self.nodes.len());
        if number == self.nodes.len() {
            self.nodes.push(None);
        }
        self.nodes[number] = Some(node);
        number
    }

    fn sweep(&mut self, graph: &Graph) {
        self.nodes.iter_mut().for_each(|n| *n = n.filter(|id| graph.contains(*id)));
    }
}

/// The nodes behind the scene's lists.
#[derive(Default)]
pub(super) struct Projections {
    /// Appearances that list lights.
    pub(super) receive_lists: Numbers,
    /// GeneratedShadowMaps that are textures.
    pub(super) shadow_textures: Numbers,
    /// Lights and viewpoints.
    pub(super) projectors: Numbers,
}

impl Extractor {
    /// Writes the lists anew, and behind the lights that shine those that only draw maps or project.
    pub(super) fn update_projections(&mut self, graph: &Graph, scene: &mut Scene) {
        let Extractor { instances, lights, resources, room, .. } = self;
        let shining = lights.iter().filter(|l| l.slot.is_some()).count();
        scene.lights.truncate(shining);
        let problems = &mut resources.problems;
        let projections = &mut resources.projections;
        for numbers in [&mut projections.receive_lists, &mut projections.shadow_textures, &mut projections.projectors] {
            numbers.sweep(graph);
        }
        let each = |numbers: &Numbers| numbers.nodes.clone();
        scene.receive_lists = each(&projections.receive_lists)
            .into_iter()
            .map(|node| node.map_or(Vec::new(), |node| receive_list(graph, node, instances, lights, problems)))
            .collect();
        let around = Around { graph, instances, lights, room };
        scene.shadow_textures = each(&projections.shadow_textures)
            .into_iter()
            .map(|node| {
                let light = map_light(&around, node?, problems)?;
                scene.lights.push(light);
                Some(scene.lights.len() - 1)
            })
            .collect();
        scene.projectors =
            each(&projections.projectors).into_iter().map(|node| projector(&around, node?, scene, problems)).collect();
    }
}

struct Around<'a> {
    graph: &'a Graph,
    instances: &'a Instances,
    lights: &'a [LightEntry],
    room: &'a Room,
}

impl Around<'_> {
    /// Where a node stands first; one that is named by fields only stands at the world's origin.
    fn room_from_local(&self, node: NodeId) -> Option<Mat4> {
        match self.instances.of(node).next().map(|place| self.instances.at(place)) {
            Some(standing) => standing.finite.then_some(standing.room_from_local),
            None => Some(self.room.room_from_world),
        }
    }

    /// A light that does not shine.
    fn dark(&self, node: NodeId, problems: &mut Problems) -> Option<Light> {
        let local = read_any_light(self.graph, node, problems);
        let light = place_light(&local, &self.room_from_local(node)?, self.room.world_per_room)?;
        Some(Light { shines: false, shadows: ShadowMethod::None, ..light })
    }
}

fn is_light(graph: &Graph, node: NodeId) -> bool {
    matches!(&*type_name(graph, node), "DirectionalLight" | "SpotLight" | "PointLight" | "LightSource")
}

/// The lights that an appearance lists, as far as they shine.
fn receive_list(
    graph: &Graph,
    appearance: NodeId,
    instances: &Instances,
    lights: &[LightEntry],
    problems: &mut Problems,
) -> Vec<usize> {
    let named = Reader::new(graph, appearance).nodes("receive_shadows");
    let nowhere = |node: NodeId| !instances.of(node).any(|place| instances.at(place).role == Role::Light);
    let stranger = named.iter().find(|(_, node)| nowhere(*node));
    let problem = stranger.map(|(_, node)| format!("'{}' is no light of this world; it casts no shadow", label(graph, *node)));
    problems.set(graph, appearance, "receive_shadows", problem);
    named.into_iter().filter_map(|(_, node)| light_slot(instances, lights, node)).collect()
}

/// The light that draws the map of a GeneratedShadowMap.
fn map_light(around: &Around<'_>, node: NodeId, problems: &mut Problems) -> Option<Light> {
    let read = Reader::new(around.graph, node);
    let light = read.node("light")?;
    let is_light = is_light(around.graph, light);
    let problem = (!is_light).then(|| format!("'{}' is no light; no map", label(around.graph, light)));
    problems.set(around.graph, node, "light", problem);
    if !is_light {
        return None;
    }
    let mut drawn = around.dark(light, problems)?;
    drawn.name = label(around.graph, node);
    drawn.shadows = ShadowMethod::Map;
    of_generated_map(around.graph, &read, &mut drawn.map, problems);
    Some(drawn)
}

fn projector(around: &Around<'_>, node: NodeId, scene: &mut Scene, problems: &mut Problems) -> Option<Projector> {
    if is_light(around.graph, node) {
        let light = match light_slot(around.instances, around.lights, node) {
            Some(shining) => shining,
            None => {
                scene.lights.push(around.dark(node, problems)?);
                scene.lights.len() - 1
            }
        };
        return Some(Projector::Light(light));
    }
    let read = Reader::new(around.graph, node);
    let pose = Mat4::from_rotation_translation(unit(read.get::<Quat>("orientation")), read.get::<Vec3>("position"));
    let room_from_view = around.room_from_local(node)? * pose;
    Some(Projector::Viewpoint {
        world_from_view: rigid(room_from_view)?,
        angle_rad: read.get::<f32>("field_of_view").clamp(0.01, 3.1),
        world_from_camera: rigid(around.room.world_from_room * room_from_view)?,
    })
}
