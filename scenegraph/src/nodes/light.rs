//! Light sources.

use super::projection;
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::PI;
use umbriel_fields::{Color, Field, NodeType};

/// What every light has. `intensity` in lux or candela.
fn common(intensity: f32, unit: &'static str) -> Vec<Field> {
    let auto = "0: fitted to what is seen.";
    vec![
        Field::new("on", true).doc("Shines."),
        Field::new("color", Color(Vec3::ONE)).alias("diffuse").doc("Linear RGB."),
        Field::new("intensity", intensity)
            .unit(unit)
            .doc("Brightness; a white surface that a directional light of pi meets at right angles is 1."),
        Field::new("ambient_intensity", 0.0f32).doc("Share of the light that reaches everything in reach, shadowed or not."),
        Field::choice("shadows", &["none", "map", "volume"], "none").doc("How it casts shadows; true is map."),
        Field::new("shadow_enable", false).doc("Casts shadows by a map, where `shadows` is none (000 section 4.1)."),
        Field::new("shadow_intensity", 1.0f32).range(0.0, 1.0).doc("Share of the light that a shadow takes away."),
        Field::new("shadow_brightness", 0.0f32)
            .range(0.0, 255.0)
            .doc("Grey of the shadow where a white sheet beside it is 255 (004 Table 2); 0: as dark as `shadow_intensity` says."),
        Field::choice("soft", &["none", "size", "range"], "none")
            .doc("Penumbrae of shadow volumes (004), from the light's size or from `soft_range`; true is size."),
        Field::new("soft_range", 10.0f32)
            .unit("cm/m")
            .doc("With `soft` range: how much farther out the shadow ends per metre behind the caster; 0 is hard (004 Table 2)."),
        Field::new("shadow_size", 2048i32).unit("texels").doc("Side of the shadow map."),
        Field::new("shadow_frustum", Vec4::ZERO)
            .alias("shadow_frust")
            .doc(format!("Left, right, bottom, top of the map: at distance 1, or in metres for parallel light. {auto}")),
        Field::new("shadow_near_far", Vec2::ZERO).unit("m").doc(format!("Nearest and farthest distance of the map. {auto}")),
        Field::new("displace_scale", -1.0f32)
            .unit("texels")
            .alias("shadow_displace_scale")
            .doc("Bias by slope; negative: tunes itself."),
        Field::new("displace_offset", -1.0f32)
            .unit("m")
            .alias("shadow_displace_offset")
            .doc("Constant bias; negative: tunes itself."),
        Field::choice("volume_counting", &["auto", "z_fail"], "auto")
            .alias("volume_caps")
            .doc("Where shadow volumes are counted. auto: in front of what is seen where that is safe, else behind it."),
        Field::choice("volume_silhouettes", &["compute", "quads"], "compute")
            .doc("How silhouettes are found: once for all views, or by degenerate quads in each view (000 section 4.2)."),
        Field::new("volume_culling", true).doc("Leaves out shadow volumes and caps that cannot be seen."),
        Field::new("volume_depth_bounds", true).doc(
            "With `volume_culling`, on software devices: draws a volume only where something is seen in it on which its shadow may \
             fall (001 section 5.3).",
        ),
        Field::new("volume_fitted", true).doc("Shadow volumes end behind the last shape that receives, not at infinity."),
        Field::new("volume_length", f32::INFINITY).unit("m").doc("Volume shadows end this far behind what casts them."),
        Field::new("volume_floor", f32::NEG_INFINITY)
            .unit("m")
            .doc("Height below which nothing is seen, such as that of the sea; volumes end there."),
        Field::choice("volume_holes", &["rays", "map"], "rays").doc(
            "How leaves and fences that alpha cuts out cast by volume: exactly, by a ray through their texture for each sample, or by a \
             map of them alone. Soft volumes take the map.",
        ),
        Field::node("default_shadow_map")
            .doc("A GeneratedShadowMap whose size, update, scale and bias the light's map takes (003 section 4.3)."),
        Field::choice("filter", &["none", "hardware", "pcf4", "pcf16", "poisson", "pcss"], "pcf16")
            .doc("How the map is looked up; pcss makes penumbrae that follow from the light's size."),
        Field::choice("shadow_update", &["auto", "none", "always", "next_frame_only"], "auto")
            .doc("When the map is drawn anew; after next_frame_only it is none (003 section 4.1)."),
        Field::choice("shadow_outside", &["lit", "shadow"], "lit")
            .doc("What is outside of a `shadow_frustum` set by hand (003)."),
    ]
}

fn place(name: &'static str) -> Field {
    Field::new(name, Vec3::ZERO).unit("m").doc("Where it is.")
}

fn direction() -> Field {
    Field::new("direction", Vec3::NEG_Z).doc("Where it shines to.")
}

fn attenuation(value: Vec3) -> Field {
    Field::new("attenuation", value)
        .alias("atten")
        .doc("Constant, linear and quadratic: the light is divided by c + l d + q d^2. (0, 0, 1) is the inverse square law.")
}

fn radius() -> Field {
    Field::new("radius", f32::INFINITY).unit("m").alias("range").doc("No effect beyond this distance.")
}

/// The sun's mean diameter.
const SUN_RAD: f32 = 0.0093;

fn angular_diameter() -> Field {
    Field::new("angular_diameter", SUN_RAD).unit("rad").doc("Angle under which the source is seen; penumbrae follow from it.")
}

fn light_radius() -> Field {
    Field::new("light_radius", 0.05f32).unit("m").doc("Radius of the source; penumbrae follow from it.")
}

pub(super) fn types() -> Vec<NodeType> {
    vec![
        NodeType::new("DirectionalLight", "Parallel light, such as the sun's.")
            .field(direction())
            .field(angular_diameter())
            .fields(projection::of_light())
            .field(projection::up())
            .fields(projection::of_parallel_light())
            .fields(common(PI, "lx")),
        NodeType::new("SpotLight", "A cone of light.")
            .field(place("location").alias("position"))
            .field(direction().alias("spot_dir"))
            .field(Field::new("cut_off_angle", 0.785f32).unit("rad").range(0.0, f64::from(std::f32::consts::PI)).doc("Half angle of the cone; dark beyond."))
            .field(Field::new("beam_width", 0.589f32).unit("rad").range(0.0, f64::from(std::f32::consts::PI)).doc("Half angle of full brightness."))
            .field(attenuation(Vec3::Z))
            .field(radius())
            .field(light_radius())
            .fields(projection::of_light())
            .field(projection::up())
            .field(projection::angle())
            .fields(common(100.0, "cd")),
        NodeType::new("PointLight", "Light into all directions.")
            .field(place("location").alias("position"))
            .field(attenuation(Vec3::Z))
            .field(radius())
            .field(light_radius())
            .fields(projection::of_light())
            .fields(common(100.0, "cd")),
        NodeType::new("LightSource", "The light of OpenGL Performer and AVANGO (000 section 4.1): its place decides its kind.")
            .alias("fpLightSource")
            .alias("pfLightSource")
            .field(Field::new("position", Vec4::Z).unit("m").alias("location").doc(
                "w = 1: a place to shine from. w = 0: parallel light that comes from this direction.",
            ))
            .field(projection::up())
            .field(Field::new("spot_dir", Vec3::NEG_Z).alias("direction").doc("Where the cone and the shadow map point to."))
            .field(Field::new("spot_cone", Vec2::new(0.0, 180.0)).doc(
                "Fall-off exponent from the axis (0: even) and half angle of the cone in degrees (180: no cone), as in Performer.",
            ))
            .field(attenuation(Vec3::X))
            .field(radius())
            .field(light_radius())
            .field(angular_diameter())
            .fields(common(PI, "cd")),
    ]
}
