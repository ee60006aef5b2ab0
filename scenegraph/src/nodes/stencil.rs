//! Stencil shadow volumes over a part of the scene (000 section 4.2).

use super::{children, transform_fields};
use glam::Vec3;
use umbriel_fields::{Color, Field, NodeType};

pub(super) fn types() -> Vec<NodeType> {
    vec![
        NodeType::new("StencilShadow", "A transform whose casters throw a stencil shadow (000 section 4.2).")
            .alias("fpStencilShadow")
            .fields(transform_fields())
            .field(children())
            .field(Field::nodes("caster").alias("casters").doc("Sub-trees that are shown and cast; empty: the children cast."))
            .field(Field::node("light").doc("The light whose shadow it is; none: the first light of the scene."))
            .field(
                Field::choice("mode", &["additive", "modulative"], "additive")
                    .doc("additive: the light is added outside the shadow. modulative: a film darkens the shadow."),
            )
            .field(Field::node("shadow_quad").doc("A ShadowQuad, for modulative; none: black at alpha 0.5.")),
        NodeType::new("ShadowQuad", "The half-transparent film that darkens a modulative shadow.")
            .field(Field::new("color", Color(Vec3::ZERO)).doc("Linear RGB."))
            .field(Field::new("alpha", 0.5f32).range(0.0, 1.0).doc("Opacity.")),
    ]
}
