//! Reduced casters in the scene: drawables behind those of the shapes, which cast and are not seen.

use super::instance::Instances;
use super::problem::Problems;
use super::read::Reader;
use super::reducer::Reducer;
use super::shape::Shapes;
use glam::Vec3;
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Aabb, Drawable, Material, Mesh, Scene, StandIn};

/// What casts in place of a shape.
#[derive(Clone)]
pub(super) struct Caster {
    pub(super) mesh: Arc<Mesh>,
    /// NaN where the author gave it.
    pub(super) error_m: f32,
    /// Angle under which the error may be seen, radians; 0: whatever the distance.
    pub(super) angle_rad: f32,
}

/// A bound for whoever gives none: so much of the size of the shape.
const NATURAL_ERROR: f32 = 0.01;

/// Reads `Shape.caster`. `geometry` makes the mesh of a geometry node.
pub(super) fn read(
    graph: &Graph,
    shape: NodeId,
    node: NodeId,
    shown: Option<&Arc<Mesh>>,
    reducer: &mut Reducer,
    problems: &mut Problems,
    mut geometry: impl FnMut(NodeId, &mut Problems) -> Option<Arc<Mesh>>,
) -> Option<Caster> {
    if &*graph.type_of(node).name != "ReducedCaster" {
        return geometry(node, problems).map(|mesh| Caster { mesh, error_m: f32::NAN, angle_rad: 0.0 });
    }
    let read = Reader::new(graph, node);
    let sane = |field: &str| Some(read.get::<f32>(field)).filter(|x| x.is_finite() && *x > 0.0);
    let angle_rad = sane("angle").unwrap_or(0.0);
    if let Some(given) = read.node("geometry") {
        return geometry(given, problems).map(|mesh| Caster { mesh, error_m: f32::NAN, angle_rad });
    }
    let shown = shown?;
    let max_error_m = sane("max_error").unwrap_or(NATURAL_ERROR * 2.0 * shown.bounds.radius());
    match reducer.get(shown, max_error_m)? {
        Ok((mesh, error_m)) => {
            problems.mend(shape, "caster");
            Some(Caster { mesh, error_m, angle_rad })
        }
        Err(error) => {
            problems.report(graph, shape, "caster", format!("{error}; the shape casts itself"));
            None
        }
    }
}

/// Puts stand-ins behind the first `places` drawables of the scene, and takes their shadows from the shapes that they stand
/// for. True if some cast now that did not before, or the other way round.
pub(super) fn place(
    scene: &mut Scene,
    places: usize,
    instances: &Instances,
    shapes: &Shapes,
    head: Vec3,
    material: &Arc<Material>,
) -> bool {
    let before = std::mem::take(&mut scene.stand_ins);
    if before.is_empty() && shapes.with_caster.is_empty() {
        return false;
    }
    scene.drawables.truncate(places);
    let mut slots: Vec<(usize, NodeId)> = Vec::new();
    for shape in &shapes.with_caster {
        slots.extend(instances.of(*shape).map(|place| (instances.at(place).slot as usize, *shape)));
    }
    slots.sort_unstable_by_key(|(slot, _)| *slot);
    for (slot, shape) in slots {
        let Some(state) = shapes.states.get(shape) else { continue };
        let casts = state.casts_shadow;
        let chosen =
            state.caster.as_ref().filter(|c| casts && scene.drawables[slot].visible && suits(c, &scene.drawables[slot], head));
        let itself = casts && chosen.is_none();
        if scene.drawables[slot].visible && scene.drawables[slot].casts_shadow != itself {
            let shown = &mut scene.drawables[slot];
            shown.casts_shadow = itself;
            shown.revision += 1;
        }
        let Some(caster) = chosen else { continue };
        let shown = &scene.drawables[slot];
        let moves = !caster.mesh.joints.is_empty() || !caster.mesh.morph_targets.is_empty();
        let pose = shown.pose.clone().filter(|_| moves);
        let at_rest = caster.mesh.bounds.transformed(&shown.world_from_object);
        let bounds_in_world: Aabb = if pose.is_some() { shown.bounds_in_world } else { at_rest };
        let stand_in = Drawable {
            name: format!("{}, its caster", shown.name),
            mesh: caster.mesh.clone(),
            material: material.clone(),
            world_from_object: shown.world_from_object,
            pose,
            bounds_in_world,
            visible: true,
            casts_shadow: true,
            receives_shadow: false,
            receives: None,
            revision: shown.revision,
        };
        scene.stand_ins.push(StandIn { place: scene.drawables.len(), of: slot, error_m: caster.error_m });
        scene.drawables.push(stand_in);
    }
    let same = |a: &StandIn, b: &StandIn| (a.place, a.of) == (b.place, b.of);
    before.len() != scene.stand_ins.len() || !before.iter().zip(&scene.stand_ins).all(|(a, b)| same(a, b))
}

/// Is its error seen under a small enough angle from the user's head?
fn suits(caster: &Caster, shown: &Drawable, head: Vec3) -> bool {
    if caster.angle_rad == 0.0 {
        return true;
    }
    let error_m = if caster.error_m.is_finite() { caster.error_m } else { 0.0 };
    let scale = glam::Mat3::from_mat4(shown.world_from_object).x_axis.length();
    let nearest = head.clamp(shown.bounds_in_world.min, shown.bounds_in_world.max);
    error_m * scale <= caster.angle_rad * head.distance(nearest)
}
