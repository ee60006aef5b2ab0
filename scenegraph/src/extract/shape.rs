//! What a Shape node shows, wherever it stands.

use super::material::{Materials, Parts};
use super::mesh::Meshes;
use super::problem::Problems;
use super::projection::Projections;
use super::read::{Reader, label};
use super::reducer::Reducer;
use super::shader::Shaders;
use super::skin::{JointBounds, Skin};
use super::stand_in::{self, Caster};
use super::texture::Pictures;
use slotmap::SecondaryMap;
use std::collections::BTreeSet;
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Material, Mesh};

/// What a Shape shows.
pub(super) struct ShapeState {
    pub(super) name: String,
    /// None where there is nothing to show.
    pub(super) mesh: Option<Arc<Mesh>>,
    pub(super) joints: Option<Arc<JointBounds>>,
    pub(super) material: Arc<Material>,
    /// What casts in its place; none while it is being made.
    pub(super) caster: Option<Caster>,
    pub(super) visible: bool,
    pub(super) casts_shadow: bool,
    pub(super) receives_shadow: bool,
    pub(super) receives: Option<usize>,
    pub(super) skin: Option<Skin>,
    /// One per morph target of the mesh.
    pub(super) morph_weights: Vec<f32>,
    /// Nodes that it was made of, besides itself.
    deps: Vec<NodeId>,
}

/// All shapes that stand in the world, and which of them use a resource.
#[derive(Default)]
pub(super) struct Shapes {
    pub(super) states: SecondaryMap<NodeId, ShapeState>,
    /// Those that name a caster.
    pub(super) with_caster: BTreeSet<NodeId>,
    users: SecondaryMap<NodeId, BTreeSet<NodeId>>,
}

/// Where shapes get what they are made of.
pub(super) struct Resources {
    pub(super) meshes: Meshes,
    pub(super) materials: Materials,
    pub(super) pictures: Pictures,
    pub(super) shaders: Shaders,
    pub(super) projections: Projections,
    pub(super) problems: Problems,
    pub(super) reducer: Reducer,
    /// Of what is never seen.
    pub(super) unseen: Arc<Material>,
}

impl Shapes {
    /// The shapes that are made of this node.
    pub(super) fn users(&self, resource: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        self.users.get(resource).into_iter().flatten().copied()
    }

    /// Reads a shape anew. True if its skin is another one now, so that joints must be found again.
    pub(super) fn refresh(&mut self, graph: &Graph, shape: NodeId, resources: &mut Resources) -> bool {
        let state = read(graph, shape, resources);
        if Reader::new(graph, shape).node("caster").is_some() {
            self.with_caster.insert(shape);
        } else {
            self.with_caster.remove(&shape);
        }
        let before = self.states.remove(shape);
        let old_deps = before.as_ref().map_or(&[][..], |b| &b.deps);
        if old_deps != state.deps {
            for dep in old_deps {
                self.forget_use(*dep, shape);
            }
            for dep in &state.deps {
                // A dead resource has no entry and needs none: its user is written when it gets another.
                if let Some(entry) = self.users.entry(*dep) {
                    entry.or_default().insert(shape);
                }
            }
        }
        let rebind = before.is_some_and(|b| b.skin != state.skin) || state.skin.is_some() && !self.states.contains_key(shape);
        self.states.insert(shape, state);
        rebind
    }

    /// Forgets shapes that stand nowhere any more.
    pub(super) fn retain(&mut self, keep: impl Fn(NodeId) -> bool) {
        let gone: Vec<NodeId> = self.states.keys().filter(|id| !keep(*id)).collect();
        for shape in gone {
            self.with_caster.remove(&shape);
            for dep in self.states.remove(shape).map(|s| s.deps).unwrap_or_default() {
                self.forget_use(dep, shape);
            }
        }
    }

    fn forget_use(&mut self, resource: NodeId, shape: NodeId) {
        if let Some(users) = self.users.get_mut(resource) {
            users.remove(&shape);
            if users.is_empty() {
                self.users.remove(resource);
            }
        }
    }
}

fn read(graph: &Graph, shape: NodeId, resources: &mut Resources) -> ShapeState {
    let read = Reader::new(graph, shape);
    let Resources { meshes, materials, pictures, shaders, projections, problems, reducer, .. } = resources;
    let geometry = read.node("geometry");
    let cached = geometry.map(|node| meshes.get(graph, node, pictures, problems));
    let mut parts = Parts { pictures, shaders, projections, problems };
    let material = materials.get(graph, read.node("appearance"), geometry, &mut parts);
    let skin_node = read.node("skin");
    let mut deps = cached.as_ref().map(|c| c.deps.clone()).unwrap_or_default();
    deps.extend(&material.deps);
    deps.extend(skin_node);
    let caster_node = read.node("caster");
    let caster = caster_node.and_then(|node| {
        let given = Reader::new(graph, node);
        deps.push(node);
        deps.extend((&*graph.type_of(node).name == "ReducedCaster").then(|| given.node("geometry")).flatten());
        let shown = cached.as_ref().and_then(|c| c.mesh.as_ref());
        stand_in::read(graph, shape, node, shown, reducer, problems, |node, problems| {
            meshes.get(graph, node, pictures, problems).mesh
        })
    });
    let joints = cached.as_ref().and_then(|c| c.joints.clone());
    let mut state = ShapeState {
        name: label(graph, shape),
        mesh: cached.and_then(|c| c.mesh),
        material: material.material,
        caster,
        visible: read.get("visible"),
        casts_shadow: read.get::<bool>("cast_shadow") && material.casts_shadow,
        receives_shadow: read.get("receive_shadow"),
        receives: material.receives,
        skin: None,
        morph_weights: morph_weights(&read, joints.as_deref(), problems),
        joints,
        deps,
    };
    let skin = skin(&read, skin_node, &state, problems);
    match skin {
        Ok(skin) => state.skin = skin,
        Err(()) => state.mesh = None,
    }
    state
}

/// The skin, if there is one and the mesh has joints. A mesh that asks for joints which the skin lacks cannot be shown.
fn skin(shape: &Reader<'_>, node: Option<NodeId>, state: &ShapeState, problems: &mut Problems) -> Result<Option<Skin>, ()> {
    let needed = state.joints.as_ref().map_or(0, |j| j.joint_count());
    let Some(node) = node.filter(|_| needed > 0) else {
        problems.mend(shape.node, "skin");
        return Ok(None);
    };
    let read = Reader::new(shape.graph, node);
    let list: Arc<[Option<NodeId>]> = read.get("joints");
    let skin = Skin {
        joints: list.iter().map(|id| id.filter(|id| shape.graph.contains(*id))).collect(),
        inverse_bind: read.get("inverse_bind"),
    };
    let binds = skin.inverse_bind.len();
    let problem = if needed > skin.joints.len() {
        Some(format!("the mesh uses joint {}, the skin has {}; the shape is not shown", needed - 1, skin.joints.len()))
    } else if binds != 0 && binds < skin.joints.len() {
        Some(format!("the skin has {} joints and {binds} inverse_bind matrices; the shape is not shown", skin.joints.len()))
    } else if skin.inverse_bind.iter().any(|m| !m.is_finite()) {
        Some("an inverse_bind matrix is not finite; the shape is not shown".to_owned())
    } else {
        None
    };
    let fine = problem.is_none();
    problems.set(shape.graph, shape.node, "skin", problem);
    if fine { Ok(Some(skin)) } else { Err(()) }
}

/// One finite weight per target of the mesh.
fn morph_weights(shape: &Reader<'_>, joints: Option<&JointBounds>, problems: &mut Problems) -> Vec<f32> {
    let given: Arc<[f32]> = shape.get("morph_weights");
    let targets = joints.map_or(0, JointBounds::target_count);
    let problem = if given.len() > targets {
        Some(format!("{} weights for {targets} morph targets; the rest is left out", given.len()))
    } else if given.iter().any(|w| !w.is_finite()) {
        Some("a weight is not finite; taken as 0".to_owned())
    } else {
        None
    };
    problems.set(shape.graph, shape.node, "morph_weights", problem);
    let weight = |i: usize| given.get(i).copied().filter(|w| w.is_finite()).unwrap_or(0.0);
    (0..targets).map(weight).collect()
}
