//! The `Navigation` node: where the pose of the room is kept, so that scripts, saves and replicas see it.

use super::{Mode, Navigator};
use crate::Error;
use glam::{Quat, Vec3};
use umbriel_fields::{EnumValue, FieldId, Graph, NodeId};

/// A `Navigation` node and its fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NavigationNode {
    /// The node.
    pub node: NodeId,
    position: FieldId,
    orientation: FieldId,
    scale: FieldId,
    mode: FieldId,
    speed: FieldId,
    center: FieldId,
}

impl NavigationNode {
    /// `node` must be a `Navigation`.
    ///
    /// # Errors
    /// The node is gone or lacks a field.
    pub fn new(graph: &Graph, node: NodeId) -> Result<NavigationNode, Error> {
        Ok(NavigationNode {
            node,
            position: graph.field(node, "position")?,
            orientation: graph.field(node, "orientation")?,
            scale: graph.field(node, "scale")?,
            mode: graph.field(node, "mode")?,
            speed: graph.field(node, "speed")?,
            center: graph.field(node, "center")?,
        })
    }

    /// The first `Navigation` of `graph`. A world that has none gets one that examines `center`, so that it can be looked at
    /// from all sides.
    ///
    /// # Errors
    /// The graph does not know the type `Navigation`.
    pub fn find_or_create(graph: &mut Graph, center: Vec3) -> Result<NavigationNode, Error> {
        let found = graph.nodes().filter(|node| *graph.type_of(*node).name == *"Navigation").min();
        if let Some(node) = found {
            return NavigationNode::new(graph, node);
        }
        let node = graph.create("Navigation")?;
        graph.set_named(node, "mode", "examine")?;
        graph.set_named(node, "center", center)?;
        NavigationNode::new(graph, node)
    }

    /// What the node says.
    ///
    /// # Errors
    /// The node is gone.
    pub fn read(&self, graph: &Graph) -> Result<Navigator, Error> {
        let choice = graph.get::<EnumValue>(self.mode)?;
        let mode_name = graph.declaration(self.mode)?.choice_name(choice);
        Ok(Navigator {
            position: graph.get(self.position)?,
            orientation: graph.get::<Quat>(self.orientation)?.normalize(),
            scale: graph.get(self.scale)?,
            mode: Mode::NAMES.iter().find(|(n, _)| Some(*n) == mode_name).map_or(Mode::None, |(_, m)| *m),
            speed: graph.get(self.speed)?,
            center: graph.get(self.center)?,
        })
    }

    /// Moves the room to where `navigator` is.
    ///
    /// # Errors
    /// The node is gone.
    pub fn write(&self, graph: &mut Graph, navigator: &Navigator) -> Result<(), Error> {
        graph.set(self.position, navigator.position)?;
        graph.set(self.orientation, navigator.orientation)?;
        Ok(graph.set(self.center, navigator.center)?)
    }
}
