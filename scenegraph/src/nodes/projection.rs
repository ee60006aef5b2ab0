//! Shadow maps as textures, and textures that are projected (003).

use glam::{Vec3, Vec4};
use std::sync::Arc;
use umbriel_fields::{EnumValue, Field, NodeType};

/// Texels of a map as a texture, 003 section 4.4.
pub(crate) const SIZE: i32 = 128;
/// Default bias by slope.
pub(crate) const SCALE: f32 = 1.1;
/// Default constant bias.
pub(crate) const BIAS: f32 = 4.0;

/// What every light projects by.
pub(super) fn of_light() -> Vec<Field> {
    let metres = |name: &'static str, doc: &'static str| Field::new(name, 0.0f32).unit("m").doc(doc);
    vec![
        metres("projection_near", "Nearest distance of the map and of what is projected, along the light. 0: fitted."),
        metres("projection_far", "Farthest distance. 0: fitted."),
    ]
}

/// What is up in a picture that a light casts.
pub(super) fn up() -> Field {
    Field::new("up", Vec3::ZERO)
        .doc("What is up in the map and in what is projected; 0: chosen. Not along the light's direction.")
}

/// The window of parallel light.
pub(super) fn of_parallel_light() -> Vec<Field> {
    vec![
        Field::new("projection_rectangle", Vec4::ZERO)
            .unit("m")
            .doc("Left, bottom, right, top of the map and of what is projected, around `projection_location`. 0: fitted. Outside is shadow."),
        Field::new("projection_location", Vec3::ZERO).unit("m").doc("From where distances and the rectangle count."),
    ]
}

/// The window of a cone.
pub(super) fn angle() -> Field {
    Field::new("projection_angle", 0.0f32)
        .unit("rad")
        .range(0.0, 3.1)
        .doc("Whole angle of the map and of what is projected, across and up; 0: twice `cut_off_angle`.")
}

pub(super) fn types() -> Vec<NodeType> {
    vec![generated_shadow_map(), projected_texture_coordinate(), multi_texture()]
}

fn generated_shadow_map() -> NodeType {
    let (update, requests) = (0, 1);
    let updates = ["none", "always", "next_frame_only"];
    NodeType::new(
        "GeneratedShadowMap",
        "A light's shadow map as a texture of an Appearance, or as the `default_shadow_map` of a light (003 section 4.4).",
    )
    .field(Field::choice("update", &updates, "none").doc(
        "When it is drawn: never, whenever it would change, or once more in the next frame, after which it falls back to none.",
    ))
    .field(Field::new("requests", 0i32).output().doc("How often `update` was next_frame_only."))
    .field(Field::new("size", SIZE).unit("texels").doc("Side of the map."))
    .field(Field::node("light").doc("The light; none: no map. A light that stands nowhere else does not shine."))
    .field(Field::new("scale", SCALE).doc("Bias by slope, in texels; at the defaults of both, bias tunes itself."))
    .field(Field::new("bias", BIAS).unit("0.1 mm").doc("Constant bias."))
    .field(
        Field::choice("compare_mode", &["compare_r_lequal", "compare_r_gequal", "none"], "compare_r_lequal")
            .doc("What the texture gives: white where the light shines, white where it does not, or the depth as grey."),
    )
    .evaluate(move |evaluation| {
        let next_frame_only = EnumValue(2);
        if evaluation.get::<EnumValue>(update) != next_frame_only {
            return;
        }
        if evaluation.changed(update) {
            let asked: i32 = evaluation.get(requests);
            evaluation.set(requests, asked.wrapping_add(1).max(1));
            evaluation.again();
        } else {
            evaluation.set(update, EnumValue(0));
        }
    })
}

fn projected_texture_coordinate() -> NodeType {
    NodeType::new("ProjectedTextureCoordinate", "A texture lies where it falls from a projector (003 section 4.5).")
        .field(Field::node("projector").doc("A SpotLight, DirectionalLight or Viewpoint; none: the texture is left out."))
}

fn multi_texture() -> NodeType {
    NodeType::new("MultiTexture", "Several textures on one surface, each put over the one before (X3D).")
        .field(Field::nodes("texture").doc("ImageTextures and GeneratedShadowMaps."))
        .field(Field::many::<Arc<str>>("mode").doc(
            "How each is put over what is below: MODULATE (for those that are not listed), MODULATE2X, MODULATE4X, REPLACE, ADD, \
             ADDSIGNED, ADDSIGNED2X, SUBTRACT, ADDSMOOTH, BLENDDIFFUSEALPHA, BLENDTEXTUREALPHA, BLENDFACTORALPHA, \
             BLENDCURRENTALPHA, OFF.",
        ))
        .field(Field::new("alpha", 1.0f32).range(0.0, 1.0).doc("Share of the texture for BLENDFACTORALPHA."))
}

/// The field by which a geometry or an appearance says where textures lie.
pub(super) fn coordinates() -> Field {
    Field::nodes("texture_coordinates").doc(
        "A ProjectedTextureCoordinate for each `texture` of the appearance; none: where the mesh says. A geometry's own count first.",
    )
}
