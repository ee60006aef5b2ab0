//! Materials.

use glam::Vec3;
use umbriel_fields::{Color, Field, NodeType};

fn color(name: &'static str, value: f32, doc: &'static str) -> Field {
    Field::new(name, Color(Vec3::splat(value))).doc(doc)
}

fn texture(name: &'static str, doc: &'static str) -> Field {
    Field::node(name).doc(doc)
}

/// What Material and PhysicalMaterial have in common.
fn surface_fields() -> Vec<Field> {
    vec![
        color("emissive_color", 0.0, "Light that the surface emits, linear RGB."),
        Field::new("transparency", 0.0f32).range(0.0, 1.0).doc("0: opaque, 1: not there."),
        texture("emissive_texture", "ImageTexture, multiplied with `emissive_color`."),
        texture("normal_texture", "ImageTexture with tangent-space normals."),
        Field::new("normal_scale", 1.0f32).doc("Strength of `normal_texture`."),
        texture("occlusion_texture", "ImageTexture; red dims ambient light."),
        Field::new("occlusion_strength", 1.0f32).range(0.0, 1.0).doc("Strength of `occlusion_texture`."),
    ]
}

pub(super) fn types() -> Vec<NodeType> {
    vec![
        NodeType::new("PhysicalMaterial", "Metal and roughness, as glTF 2.0.")
            .field(color("base_color", 1.0, "Linear RGB; multiplied by texture and vertex colour."))
            .field(Field::new("metallic", 0.0f32).range(0.0, 1.0).doc("0: dielectric, 1: metal."))
            .field(Field::new("roughness", 0.8f32).range(0.0, 1.0).doc("Perceptual roughness."))
            .field(texture("base_texture", "ImageTexture of the base colour, with alpha."))
            .field(texture("metallic_roughness_texture", "ImageTexture; blue: metal, green: roughness."))
            .fields(surface_fields()),
        NodeType::new("Material", "Diffuse and highlight (Blinn-Phong), as X3D and OpenGL Performer.")
            .field(color("diffuse_color", 0.8, "Linear RGB; multiplied by texture and vertex colour."))
            .field(Field::new("ambient_intensity", 0.2f32).range(0.0, 1.0).doc("Share of ambient light that is reflected."))
            .field(color("specular_color", 0.0, "Linear RGB of the highlight."))
            .field(
                Field::new("shininess", 0.2f32)
                    .range(0.0, 1.0)
                    .doc("Sharpness of the highlight; the exponent is 128 times this."),
            )
            .field(texture("diffuse_texture", "ImageTexture of the diffuse colour, with alpha."))
            .fields(surface_fields()),
        NodeType::new("UnlitMaterial", "The same colour in any light.")
            .field(color("emissive_color", 1.0, "Linear RGB."))
            .field(Field::new("transparency", 0.0f32).range(0.0, 1.0).doc("0: opaque, 1: not there."))
            .field(texture("emissive_texture", "ImageTexture, multiplied with `emissive_color`, with alpha.")),
    ]
}
