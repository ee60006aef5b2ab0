//! Nodes that gather, place and choose other nodes.

use super::{children, transform_fields};
use glam::Vec3;
use umbriel_fields::{Field, NodeType};

pub(super) fn types() -> Vec<NodeType> {
    vec![
        NodeType::new("Group", "Gathers nodes.").alias("fpGroup").alias("StaticGroup").field(children()),
        NodeType::new("Transform", "Places its children: translation, rotation and scale as in X3D, then `matrix`.")
            .alias("DCS")
            .alias("fpDCS")
            .alias("MatrixTransform")
            .fields(transform_fields())
            .field(children()),
        NodeType::new("Switch", "Shows one of its children, or none.")
            .alias("fpSwitch")
            .field(Field::new("which_choice", -1i32).doc("Place in `children` of the one that is shown, from 0; -1 for none."))
            .field(children()),
        NodeType::new("LOD", "Shows the child that suits the distance of the user's head.")
            .alias("fpLOD")
            .field(
                Field::many::<f32>("range")
                    .unit("m")
                    .doc("Ascending distances at which the next child takes over; empty shows the first child."),
            )
            .field(Field::new("center", Vec3::ZERO).unit("m").doc("Where the distance is measured to."))
            .field(children()),
    ]
}
