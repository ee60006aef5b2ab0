//! Skinning.

use glam::Mat4;
use umbriel_fields::{Field, NodeType};

pub(super) fn types() -> Vec<NodeType> {
    vec![
        NodeType::new("Skin", "Joints that bend a mesh, as glTF 2.0.")
            .field(
                Field::nodes("joints")
                    .doc("Transforms somewhere in the world; a mesh's `joint` numbers are places in this list."),
            )
            .field(Field::many::<Mat4>("inverse_bind").doc("From the mesh at rest to each joint; empty: identities."))
            .field(Field::node("skeleton").doc("Root of the joints, for tools; has no effect.")),
    ]
}
