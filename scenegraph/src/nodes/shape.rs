//! Shape, Appearance, and shaders of authors.

use super::projection;
use umbriel_fields::{Field, NodeType};

pub(super) fn types() -> Vec<NodeType> {
    vec![
        NodeType::new("Shape", "Something visible: a geometry and how it looks.")
            .field(Field::node("geometry").doc("A Mesh, Box, Sphere, Cone, Cylinder or Plane."))
            .field(Field::node("appearance").doc("An Appearance; none is matt light grey."))
            .field(Field::node("skin").doc("A Skin that bends the mesh by its joints."))
            .field(Field::many::<f32>("morph_weights").doc("Share of each morph target of the mesh."))
            .field(
                Field::node("caster").doc("Casts in its place, unseen: a geometry, or a ReducedCaster; none: it casts itself."),
            )
            .field(Field::new("visible", true).doc("Drawn, and casting shadows."))
            .field(Field::new("cast_shadow", true).doc("Throws shadows."))
            .field(Field::new("receive_shadow", true).doc("Shadows fall on it.")),
        NodeType::new(
            "ReducedCaster",
            "Fewer triangles that throw the shadow of a Shape, by maps and by volumes (000 future work).",
        )
        .field(Field::node("geometry").doc("A closed geometry a little smaller than what is shown; none: it is made."))
        .field(
            Field::new("max_error", 0.0f32)
                .unit("m")
                .range(0.0, f64::INFINITY)
                .doc("How far what is made may be from what is shown; 0: a hundredth of its size."),
        )
        .field(
            Field::new("angle", 0.0f32)
                .unit("rad")
                .range(0.0, std::f64::consts::PI)
                .doc("Used where the user's head sees the error under less than this; 0: always."),
        ),
        NodeType::new("Appearance", "How a shape looks.")
            .field(Field::node("material").doc("A PhysicalMaterial, Material or UnlitMaterial."))
            .field(Field::nodes("texture").alias("textures").doc(
                "ImageTextures, GeneratedShadowMaps and MultiTextures, put over the material's base colour one after the other.",
            ))
            .field(projection::coordinates().alias("tex_coord"))
            .field(Field::nodes("receive_shadows").doc(
                "The only lights whose shadows fall on it, whether or not they cast on others; all their light is shadowed, ambient too \
                 (003 section 4.1). None: the lights that cast.",
            ))
            .field(
                Field::choice("alpha_mode", &["auto", "opaque", "mask", "blend"], "auto")
                    .doc("What alpha means. auto: blend if the material is transparent, else opaque."),
            )
            .field(Field::new("alpha_cutoff", 0.5f32).range(0.0, 1.0).doc("Smallest alpha that is there, for mask."))
            .field(Field::new("shadow_caster", true).doc("Shapes with this appearance throw shadows."))
            .field(
                Field::new("transparent_caster", false).doc("Half-transparent shapes throw shadows too, as if they were opaque."),
            )
            .field(Field::new("double_sided", false).doc("Seen and lit from both sides."))
            .field(Field::node("shader").alias("shaders").doc("A FragmentShader that replaces parts of the shading.")),
        NodeType::new(
            "FragmentShader",
            "WGSL that replaces parts of the shading of shapes. Fields that are added to it are its `params`.",
        )
        .field(Field::new("url", "").doc("File below the asset root; used where `source` is empty."))
        .field(Field::new("source", "").doc("The text itself.")),
    ]
}
