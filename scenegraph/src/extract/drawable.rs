//! The scene's list of drawables: a shape keeps its place as long as it stands where it stands.

use super::instance::{Instance, Instances, NONE};
use super::role::Role;
use super::shape::Shapes;
use super::skin::Bindings;
use glam::{Mat3, Mat4};
use slotmap::SecondaryMap;
use std::sync::Arc;
use umbriel_fields::NodeId;
use umbriel_scene::{Aabb, Drawable, Mesh, Pose, Scene};

/// Places in the scene's list, taken and free.
#[derive(Default)]
pub(super) struct Slots {
    /// Which instance is in a place; `NONE` in a free one.
    pub(super) places: Vec<u32>,
    free: Vec<u32>,
    by_shape: SecondaryMap<NodeId, Vec<u32>>,
    /// Grows with every written drawable.
    writes: u64,
}

impl Slots {
    /// Gives every shape of a newly compiled list its place: the one it had, else a free one. Returns the places that
    /// were given up.
    pub(super) fn assign(&mut self, instances: &mut Instances) -> Vec<u32> {
        self.places.fill(NONE);
        let mut standings: SecondaryMap<NodeId, usize> = SecondaryMap::new();
        let mut homeless = Vec::new();
        for place in 0..instances.list.len() as u32 {
            let Instance { node, role, .. } = instances.list[place as usize];
            if role != Role::Shape {
                continue;
            }
            // The n-th standing of a shape keeps the shape's n-th place.
            let nth = standings.insert(node, 0).unwrap_or(0);
            standings.insert(node, nth + 1);
            match self.by_shape.get(node).and_then(|places| places.get(nth)) {
                Some(slot) => give(&mut self.places, instances, place, *slot),
                None => homeless.push(place),
            }
        }
        let mut given_up = Vec::new();
        self.by_shape.retain(|node, places| {
            let kept = standings.get(node).copied().unwrap_or(0).min(places.len());
            given_up.extend(places.drain(kept..));
            kept > 0
        });
        self.free.extend(&given_up);
        self.free.sort_unstable_by(|a, b| b.cmp(a));
        for place in homeless {
            let slot = self.free.pop().unwrap_or_else(|| {
                self.places.push(NONE);
                self.places.len() as u32 - 1
            });
            give(&mut self.places, instances, place, slot);
            if let Some(entry) = self.by_shape.entry(instances.at(place).node) {
                entry.or_default().push(slot);
            }
        }
        given_up.into_iter().filter(|slot| self.places[*slot as usize] == NONE).collect()
    }

    /// Makes the scene's list as long as needed. New places are vacant.
    pub(super) fn fit(&self, scene: &mut Scene) {
        scene.drawables.truncate(self.places.len());
        if scene.drawables.len() < self.places.len() {
            scene.drawables.resize(self.places.len(), vacant());
        }
    }

    /// Empties a place. True if something was drawn there.
    pub(super) fn vacate(&mut self, scene: &mut Scene, slot: u32) -> bool {
        let was_visible = scene.drawables[slot as usize].visible;
        self.writes += 1;
        scene.drawables[slot as usize] = Drawable { revision: self.writes, ..vacant() };
        was_visible
    }

    /// Writes what an instance of a shape shows. Says whether anything changed, and whether it casts differently now.
    pub(super) fn write(
        &mut self,
        scene: &mut Scene,
        instances: &Instances,
        place: u32,
        shapes: &Shapes,
        bindings: &Bindings,
    ) -> Written {
        let instance = instances.at(place);
        let Some((new, slot)) = shapes.states.get(instance.node).and_then(|state| {
            let mesh = state.mesh.clone()?;
            let room_from_object = instance.room_from_local;
            let upright = instance.finite && Mat3::from_mat4(room_from_object).determinant() != 0.0;
            let pose = if upright { pose(instances, place, state, bindings) } else { None };
            let bounds_in_world = match (&state.joints, &pose) {
                (Some(joints), Some(Some(pose))) => joints.posed(&room_from_object, pose),
                _ => mesh.bounds.transformed(&room_from_object),
            };
            let drawable = Drawable {
                name: state.name.clone(),
                material: state.material.clone(),
                world_from_object: room_from_object,
                visible: instance.shown && state.visible && upright && pose.is_some() && !bounds_in_world.is_empty(),
                pose: pose.flatten(),
                bounds_in_world,
                casts_shadow: state.casts_shadow,
                receives_shadow: state.receives_shadow,
                receives: state.receives,
                revision: 0,
                mesh,
            };
            Some((drawable, instance.slot))
        }) else {
            let changed = scene.drawables[instance.slot as usize].visible && self.vacate(scene, instance.slot);
            return Written { changed, casting: changed };
        };
        let old = &scene.drawables[slot as usize];
        // What is not drawn keeps its last pose: a broken matrix must not reach the renderer.
        if !new.visible && !old.visible || same(old, &new) {
            return Written { changed: false, casting: false };
        }
        self.writes += 1;
        let casting = (old.visible && old.casts_shadow) != (new.visible && new.casts_shadow);
        let old = &mut scene.drawables[slot as usize];
        if new.visible {
            *old = Drawable { revision: self.writes, ..new };
        } else {
            old.visible = false;
            old.revision = self.writes;
        }
        Written { changed: true, casting }
    }
}

fn give(places: &mut [u32], instances: &mut Instances, place: u32, slot: u32) {
    instances.list[place as usize].slot = slot;
    places[slot as usize] = place;
}

/// What writing a drawable did.
pub(super) struct Written {
    pub(super) changed: bool,
    pub(super) casting: bool,
}

/// Some(None) for a rigid shape, None where a joint is not finite.
fn pose(instances: &Instances, place: u32, state: &super::shape::ShapeState, bindings: &Bindings) -> Option<Option<Arc<Pose>>> {
    let object_from_bind = match &state.skin {
        Some(skin) => bindings.object_from_bind(instances, place, skin)?,
        None => Vec::new(),
    };
    if object_from_bind.is_empty() && state.morph_weights.is_empty() {
        return Some(None);
    }
    Some(Some(Arc::new(Pose { object_from_bind, morph_weights: state.morph_weights.clone() })))
}

fn same(old: &Drawable, new: &Drawable) -> bool {
    old.visible == new.visible
        && old.world_from_object == new.world_from_object
        && Arc::ptr_eq(&old.mesh, &new.mesh)
        && Arc::ptr_eq(&old.material, &new.material)
        && old.bounds_in_world == new.bounds_in_world
        && old.casts_shadow == new.casts_shadow
        && old.receives_shadow == new.receives_shadow
        && old.receives == new.receives
        && old.pose == new.pose
        && old.name == new.name
}

fn vacant() -> Drawable {
    Drawable {
        name: String::new(),
        mesh: Arc::new(Mesh::default()),
        material: Arc::default(),
        world_from_object: Mat4::IDENTITY,
        pose: None,
        bounds_in_world: Aabb::EMPTY,
        visible: false,
        casts_shadow: false,
        receives_shadow: false,
        receives: None,
        revision: 0,
    }
}
