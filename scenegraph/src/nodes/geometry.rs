//! Solids and meshes.

use super::projection::coordinates;
use glam::{Vec2, Vec3, Vec4};
use umbriel_fields::{Field, NodeType};

fn metres(name: &'static str, value: f32, doc: &'static str) -> Field {
    Field::new(name, value).unit("m").doc(doc)
}

fn segments(value: i32) -> Field {
    Field::new("segments", value).range(3.0, 4096.0).doc("Flat pieces around the axis.")
}

fn part(name: &'static str, doc: &'static str) -> Field {
    Field::new(name, true).doc(doc)
}

pub(super) fn types() -> Vec<NodeType> {
    let mut types: Vec<NodeType> = solids().into_iter().map(|t| t.field(coordinates().alias("tex_coord"))).collect();
    types.extend(meshes());
    types
}

fn solids() -> Vec<NodeType> {
    vec![
        NodeType::new("Box", "A box around the origin.")
            .alias("Cube")
            .field(Field::new("size", Vec3::splat(2.0)).unit("m").doc("Lengths along x, y and z.")),
        NodeType::new("Sphere", "A sphere around the origin.").field(metres("radius", 1.0, "Radius.")).field(segments(48)),
        NodeType::new("Cone", "A cone around the y axis, its tip up.")
            .field(metres("bottom_radius", 1.0, "Radius of the bottom."))
            .field(metres("height", 2.0, "Height; the origin is half way up."))
            .field(part("side", "With its round side."))
            .field(part("bottom", "With the disc below."))
            .field(segments(48)),
        NodeType::new("Cylinder", "A cylinder around the y axis.")
            .field(metres("radius", 1.0, "Radius."))
            .field(metres("height", 2.0, "Height; the origin is half way up."))
            .field(part("side", "With its round side."))
            .field(part("top", "With the disc above."))
            .field(part("bottom", "With the disc below."))
            .field(segments(48)),
        NodeType::new("Plane", "A flat rectangle around the origin in the xz plane, facing up.")
            .field(Field::new("size", Vec2::splat(2.0)).unit("m").doc("Lengths along x and z."))
            .field(Field::new("segments", 1i32).range(1.0, 1024.0).doc("Squares along each side.")),
        NodeType::new(
            "DepthPicture",
            "What a photo's camera at the origin saw along -z, for shadows to fall on (004 figure 19).",
        )
        .alias("Backdrop")
        .field(
            Field::node("depth").doc("An ImageTexture: depth is 256 red + green of 65535, or grey; the photo is the appearance."),
        )
        .field(
            Field::new("field_of_view", std::f32::consts::FRAC_PI_4)
                .unit("rad")
                .range(0.0, f64::from(std::f32::consts::PI))
                .doc("Whole vertical angle of the photo."),
        )
        .field(metres("near", 1.0, "Distance along -z where depth is black."))
        .field(metres("far", 10.0, "Distance along -z where depth is white.")),
    ]
}

fn meshes() -> Vec<NodeType> {
    vec![
        NodeType::new("Mesh", "Triangles, lines or points as the author made them.")
            .field(Field::choice("topology", &["triangles", "lines", "points"], "triangles").doc("What each run of indices is."))
            .field(Field::many::<Vec3>("position").unit("m").alias("coord").doc("Place of each vertex."))
            .field(Field::many::<Vec3>("normal").doc("Unit normal of each vertex; empty: each triangle is flat."))
            .field(Field::many::<Vec4>("tangent").doc("Unit tangent of each vertex; w is the sign of the bitangent."))
            .field(Field::many::<Vec2>("tex_coord").doc("Texture coordinates of each vertex, v down."))
            .field(Field::many::<Vec2>("tex_coord1").doc("Second texture coordinates."))
            .field(Field::many::<Vec4>("color").doc("Linear RGBA of each vertex."))
            .field(Field::many::<i32>("joint").doc("Places in the joints of the skin, four per vertex."))
            .field(Field::many::<Vec4>("weight").doc("Weights of the four joints of each vertex."))
            .field(Field::many::<i32>("index").doc("Vertex numbers from 0; empty: the vertices in their order."))
            // X3D's name `texCoord` is that of the mesh's own coordinates here.
            .field(coordinates())
            .field(Field::nodes("targets").doc("MorphTargets, in the order of the shape's `morph_weights`.")),
        NodeType::new("MorphTarget", "Offsets that a Mesh adds by weight (blend shape).")
            .field(Field::many::<Vec3>("position").unit("m").doc("Offset of each vertex."))
            .field(Field::many::<Vec3>("normal").doc("Offset of each normal."))
            .field(Field::many::<Vec3>("tangent").doc("Offset of each tangent.")),
    ]
}
