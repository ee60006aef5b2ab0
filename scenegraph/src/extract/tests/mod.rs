//! Worlds of a few nodes, and what must come out.

mod contours;
mod cost;
mod lights;
mod looks;
mod projection;
mod random;
mod skins;
mod stand_ins;
mod stencils;
mod tree;
mod types;

use super::{ExtractStats, Extractor};
use crate::nodes::new_graph;
use glam::{Mat4, Vec3};
use umbriel_fields::{Graph, NodeId, Value};
use umbriel_scene::{Drawable, Light, Scene};

/// A graph, its extractor, and its scene.
pub(super) struct World {
    pub(super) graph: Graph,
    pub(super) extractor: Extractor,
    pub(super) scene: Scene,
}

impl World {
    pub(super) fn new() -> World {
        World { graph: new_graph(), extractor: Extractor::new(), scene: Scene::default() }
    }

    pub(super) fn root(&self) -> NodeId {
        self.graph.find("world").unwrap()
    }

    /// A new node; named, if the name is not empty.
    pub(super) fn node(&mut self, type_name: &str, name: &str) -> NodeId {
        let id = self.graph.create(type_name).unwrap();
        if !name.is_empty() {
            self.graph.set_name(id, name).unwrap();
        }
        id
    }

    pub(super) fn set(&mut self, node: NodeId, field: &str, value: impl Into<Value>) {
        self.graph.set_named(node, field, value).unwrap();
    }

    /// A new node below others.
    pub(super) fn below(&mut self, parents: &[NodeId], type_name: &str, name: &str) -> NodeId {
        let id = self.node(type_name, name);
        for parent in parents {
            self.adopt(*parent, id);
        }
        id
    }

    pub(super) fn adopt(&mut self, parent: NodeId, child: NodeId) {
        let mut children = self.graph.get_named::<std::sync::Arc<[Option<NodeId>]>>(parent, "children").unwrap().to_vec();
        children.push(Some(child));
        self.set(parent, "children", children);
    }

    /// A box of size 2 that shows what it stands under.
    pub(super) fn shape(&mut self, parents: &[NodeId], name: &str) -> NodeId {
        let shape = self.below(parents, "Shape", name);
        let geometry = self.node("Box", "");
        self.set(shape, "geometry", geometry);
        shape
    }

    pub(super) fn update(&mut self) -> ExtractStats {
        self.extractor.update(&self.graph, &mut self.scene)
    }

    /// Messages of new problems.
    pub(super) fn problems(&mut self) -> Vec<String> {
        self.extractor.problems().iter().map(ToString::to_string).collect()
    }

    /// What is visible, in tree order.
    pub(super) fn visible(&self) -> Vec<&Drawable> {
        let all = self.extractor.drawables_of(self.root());
        all.into_iter().map(|i| &self.scene.drawables[i]).filter(|d| d.visible).collect()
    }

    pub(super) fn names(&self) -> Vec<&str> {
        self.visible().into_iter().map(|d| d.name.as_str()).collect()
    }

    pub(super) fn drawable(&self, name: &str) -> &Drawable {
        self.visible().into_iter().find(|d| d.name == name).unwrap_or_else(|| panic!("'{name}' is not visible"))
    }

    pub(super) fn light(&self, node: NodeId) -> &Light {
        &self.scene.lights[self.extractor.light_of(node).expect("the light is on")]
    }
}

pub(super) fn close(a: Mat4, b: Mat4) -> bool {
    a.abs_diff_eq(b, 1e-4)
}

pub(super) fn close3(a: Vec3, b: Vec3) -> bool {
    a.abs_diff_eq(b, 1e-4)
}
