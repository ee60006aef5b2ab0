//! Pictures on surfaces.

use glam::Vec2;
use std::sync::Arc;
use umbriel_fields::{Field, Image, NodeType};

pub(super) fn types() -> Vec<NodeType> {
    let wrap =
        |name: &'static str, doc: &'static str| Field::choice(name, &["repeat", "mirror", "clamp", "border"], "repeat").doc(doc);
    vec![
        NodeType::new("ImageTexture", "A picture on a surface, from memory or from a file.")
            .alias("PixelTexture")
            .field(Field::new("url", "").doc("File below the asset root; used where `image` is empty."))
            .field(Field::new("image", None::<Arc<Image>>).doc("The picture itself, RGBA."))
            .field(wrap(
                "wrap_s",
                "What is left and right of the picture; border: nothing, where a texture of an Appearance says so.",
            ))
            .field(wrap("wrap_t", "What is above and below the picture."))
            .field(Field::choice("filter", &["linear", "nearest"], "linear").doc("How texels are interpolated."))
            .field(Field::new("mip_maps", true).doc("Use smaller copies of the picture for far surfaces."))
            .field(Field::new("uv_set", 0i32).range(0.0, 1.0).doc("Which texture coordinates of the mesh."))
            .field(Field::new("translation", Vec2::ZERO).doc("Moves the coordinates (KHR_texture_transform)."))
            .field(Field::new("rotation", 0.0f32).unit("rad").doc("Turns the coordinates, counter-clockwise as seen."))
            .field(Field::new("scale", Vec2::ONE).doc("Stretches the coordinates; 2 shows the picture twice.")),
    ]
}
