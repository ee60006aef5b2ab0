//! What is behind and between everything.

use glam::{Vec3, vec3};
use umbriel_fields::{Color, Field, NodeType};

/// Dim sky where a world says nothing: enough to see by, dark enough not to wash out shadows.
pub(crate) const ZENITH: Vec3 = vec3(0.02, 0.04, 0.09);
/// See [`ZENITH`].
pub(crate) const HORIZON: Vec3 = vec3(0.10, 0.13, 0.18);
/// See [`ZENITH`].
pub(crate) const NADIR: Vec3 = vec3(0.03, 0.03, 0.03);
/// Memory of shadow maps where a world says nothing, MiB.
pub(crate) const SHADOW_MEMORY_MIB: i32 = 1024;
/// Samples per pixel where a world says nothing.
pub(crate) const SAMPLES: i32 = 4;
/// Ambient light where a world says nothing.
pub(crate) const AMBIENT: Vec3 = vec3(0.08, 0.08, 0.08);

pub(super) fn types() -> Vec<NodeType> {
    let color = |name: &'static str, value: Vec3, doc: &'static str| Field::new(name, Color(value)).doc(doc);
    vec![
        NodeType::new("Background", "The sky: a vertical gradient behind everything. The first bound one counts.")
            .field(color("zenith_color", ZENITH, "Linear RGB straight up."))
            .field(color("horizon_color", HORIZON, "Linear RGB at the horizon."))
            .field(color("nadir_color", NADIR, "Linear RGB straight down."))
            .field(Field::new("bound", true).doc("In use.")),
        NodeType::new("Fog", "Haze that hides what is far. The first one counts.")
            .field(color("color", Vec3::ONE, "Linear RGB."))
            .field(Field::choice("fog_type", &["linear", "exponential"], "linear").doc("How it thickens with distance."))
            .field(Field::new("visibility_range", 0.0f32).unit("m").doc("Distance at which nothing but fog is seen; 0: no fog.")),
        NodeType::new("Environment", "Light from everywhere, and the brightness of the picture. The first one counts.")
            .field(color("ambient", AMBIENT, "Linear RGB that reaches every surface."))
            .field(Field::new("exposure", 1.0f32).doc("Factor of the linear picture before it is encoded."))
            .field(
                Field::new("shadow_memory", SHADOW_MEMORY_MIB)
                    .unit("MiB")
                    .doc("Texture memory for all shadow maps. Where it is short, the least important lights get smaller maps."),
            )
            .field(
                Field::new("samples", SAMPLES)
                    .doc("Samples per pixel of every view: 4, or 1, which is faster and has hard edges."),
            ),
    ]
}
