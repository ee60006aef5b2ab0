//! Lines over the edges of shapes (001 section 4.3).

use super::children;
use glam::Vec3;
use umbriel_fields::{Color, Field, NodeType};

pub(super) fn types() -> Vec<NodeType> {
    vec![
        NodeType::new(
            "Contours",
            "A group whose shapes are drawn with their contours and silhouettes as lines (001 section 4.3).",
        )
        .field(children())
        .field(Field::new("on", true).doc("Draws lines."))
        .field(Field::new("color", Color(Vec3::ZERO)).doc("Linear RGB of the lines."))
        .field(
            Field::new("line_width", 1.0f32)
                .unit("px")
                .range(0.0, 32.0)
                .doc("Of contours inside of a shape and around it; 0: none."),
        )
        .field(
            Field::new("outline_width", 3.0f32)
                .unit("px")
                .range(0.0, 32.0)
                .doc("Of the stroke around the silhouette of each shape, outside of it; 0: none."),
        )
        .field(
            Field::new("crease_angle", f32::INFINITY)
                .unit("rad")
                .range(0.0, f64::INFINITY)
                .doc("Edges whose triangles turn by more than this are drawn as contours, wherever they are seen from."),
        ),
    ]
}
