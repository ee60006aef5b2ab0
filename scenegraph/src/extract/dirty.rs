//! Sorts the nodes that were written since the last update by what their change means.

use super::Extractor;
use super::role::{Role, TypeInfo};
use std::collections::BTreeSet;
use umbriel_fields::{Changes, FieldId, Graph, NodeId, Revision};

/// What has to be done.
#[derive(Debug, Default)]
pub(super) struct Dirty {
    /// Branches changed: compile the list anew.
    pub(super) structure: bool,
    /// The Navigation changed.
    pub(super) room: bool,
    /// The User changed.
    pub(super) head: bool,
    /// Background, Fog or Environment changed.
    pub(super) environment: bool,
    pub(super) stencils: bool,
    /// A Contours node changed.
    pub(super) contours: bool,
    pub(super) viewpoints: bool,
    /// Transforms, Switches and LODs that were written.
    pub(super) moved: BTreeSet<NodeId>,
    /// Shapes to read anew.
    pub(super) shapes: BTreeSet<NodeId>,
    pub(super) lights: BTreeSet<NodeId>,
    /// Places whose sub-trees are to be moved.
    pub(super) places: BTreeSet<u32>,
    /// Places whose drawables are to be written.
    pub(super) shown: Vec<u32>,
}

impl Dirty {
    pub(super) fn is_empty(&self) -> bool {
        let flags = [self.structure, self.room, self.head, self.environment, self.stencils, self.contours, self.viewpoints];
        !flags.contains(&true) && self.moved.is_empty() && self.shapes.is_empty() && self.lights.is_empty()
    }

    /// All that can be done.
    pub(super) fn everything(&mut self) {
        (self.structure, self.room, self.head) = (true, true, true);
        self.everything_stands();
    }

    /// All that a newly compiled list needs.
    pub(super) fn everything_stands(&mut self) {
        (self.environment, self.stencils, self.viewpoints) = (true, true, true);
    }
}

impl Extractor {
    /// Collects what was written, and takes note of new and dead nodes.
    pub(super) fn gather(&mut self, graph: &Graph) -> Dirty {
        let mut dirty = Dirty::default();
        let since = self.last.replace(graph.revision());
        match since.map(|since| (since, graph.changes_since(since))) {
            Some((since, Changes::Nodes(nodes))) => {
                for node in nodes {
                    self.gather_node(graph, node, since, &mut dirty);
                }
            }
            _ => self.gather_all(graph, &mut dirty),
        }
        let world = graph.find(crate::nodes::WORLD);
        if world != self.world {
            self.world = world;
            dirty.structure = true;
        }
        dirty
    }

    /// Without a list of changes everything is read anew; what is unchanged keeps its meshes and materials.
    fn gather_all(&mut self, graph: &Graph, dirty: &mut Dirty) {
        dirty.everything();
        self.instances = Default::default();
        self.known.clear();
        self.globals = Default::default();
        for node in graph.nodes() {
            self.learn(graph, node);
        }
        dirty.shapes.extend(self.shapes.states.keys());
    }

    fn gather_node(&mut self, graph: &Graph, node: NodeId, since: Revision, dirty: &mut Dirty) {
        dirty.shapes.extend(self.shapes.users(node));
        if !graph.contains(node) {
            self.forget(node, dirty);
            return;
        }
        let type_place = match self.known.get(node) {
            Some(place) => *place,
            None => self.learn(graph, node),
        };
        let info = self.types.get(type_place);
        if info.role.is_placed() && self.instances.first.contains_key(node) && branches_changed(graph, node, info, since) {
            dirty.structure = true;
        }
        match info.role {
            Role::Transform | Role::Switch | Role::Lod => drop(dirty.moved.insert(node)),
            Role::Stencil => {
                dirty.stencils = true;
                dirty.moved.insert(node);
            }
            Role::Shape => drop(dirty.shapes.insert(node)),
            Role::Light => drop(dirty.lights.insert(node)),
            Role::Viewpoint => dirty.viewpoints = true,
            Role::Navigation => dirty.room = true,
            Role::User => dirty.head = true,
            Role::Environment => dirty.environment = true,
            Role::ShadowQuad => dirty.stencils = true,
            Role::Contours => dirty.contours = true,
            Role::ShadowMap => dirty.lights.extend(self.lights.iter().map(|l| l.node)),
            Role::Group | Role::Inert => {}
        }
    }

    fn learn(&mut self, graph: &Graph, node: NodeId) -> u16 {
        let type_place = self.types.of(graph, node);
        self.known.insert(node, type_place);
        match self.types.get(type_place).role {
            Role::Navigation => drop(self.globals.navigation.insert(node)),
            Role::User => drop(self.globals.users.insert(node)),
            Role::Environment => drop(self.globals.environment.insert(node)),
            _ => {}
        }
        type_place
    }

    fn forget(&mut self, node: NodeId, dirty: &mut Dirty) {
        self.known.remove(node);
        dirty.structure |= self.instances.first.contains_key(node);
        dirty.room |= self.globals.navigation.remove(&node);
        dirty.head |= self.globals.users.remove(&node);
        dirty.environment |= self.globals.environment.remove(&node);
        dirty.stencils = true;
    }
}

fn branches_changed(graph: &Graph, node: NodeId, info: &TypeInfo, since: Revision) -> bool {
    info.branches.iter().any(|index| graph.field_revision(FieldId { node, index: *index }) > since)
}
