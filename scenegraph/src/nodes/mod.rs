//! The node types of the scene graph: one declaration each, which every reader shares.
//!
//! Names follow X3D 4 where X3D has the node; AVANGO's and the papers' names are aliases. Any spelling of a name
//! (`castShadow`, `CastShadow`, `cast_shadow`) is the same name, so only other words are listed as aliases.

mod aim;
mod contours;
pub(crate) mod environment;
mod geometry;
mod group;
mod light;
mod material;
pub(crate) mod projection;
mod shape;
mod skin;
mod sky;
mod stencil;
mod texture;
mod view;

use umbriel_fields::{Field, Graph, NodeType, builtin_types};

/// Every node type of the scene graph, in the order of the manual.
pub fn node_types() -> Vec<NodeType> {
    [
        group::types(),
        shape::types(),
        material::types(),
        texture::types(),
        projection::types(),
        geometry::types(),
        skin::types(),
        light::types(),
        stencil::types(),
        contours::types(),
        environment::types(),
        aim::types(),
        sky::types(),
        view::types(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// The name of the node under which everything visible stands.
pub const WORLD: &str = "world";

/// A graph that knows the scene graph's types and the dataflow types, with an empty Group named [`WORLD`].
pub fn new_graph() -> Graph {
    let mut types = builtin_types();
    types.extend(node_types());
    let mut graph = Graph::new(types);
    let world = graph.create("Group").expect("Group is among the types");
    graph.set_name(world, WORLD).expect("a new graph has no other names");
    graph
}

/// The field that makes a node a parent.
fn children() -> Field {
    Field::nodes("children").doc("What stands below this node, in drawing order of equals.")
}

/// The fields that make a node a transform, shared by Transform and StencilShadow.
fn transform_fields() -> Vec<Field> {
    use glam::{Mat4, Quat, Vec3};
    vec![
        Field::new("translation", Vec3::ZERO).unit("m").doc("Where the origin of the children is."),
        Field::new("rotation", Quat::IDENTITY).doc("Turns the children around `center`."),
        Field::new("scale", Vec3::ONE).doc("Stretches the children from `center`; negative values mirror."),
        Field::new("center", Vec3::ZERO).unit("m").doc("Fixed point of `rotation` and `scale`."),
        Field::new("scale_orientation", Quat::IDENTITY).doc("Axes along which `scale` stretches."),
        Field::new("matrix", Mat4::IDENTITY).doc("Applied to the children before all other fields of this node."),
    ]
}
