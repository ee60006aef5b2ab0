//! What 000 prints runs line by line: section 4.1's scheme, and section 4.2's node with its Caster and ShadowQuad.

use crate::support::world;
use glam::{Vec2, Vec3, Vec4};
use umbriel_fields::Graph;

/// Section 4.1. In scheme each line reads `(fp-set-value newLight 'ShadowSize 512)`.
const SHADOW_MAP: &str = r#"
let newLight = make_instance_by_name("fpLightSource");
fp_set_value(newLight, "Name", "newLight");
fp_set_value(newLight, "Position", make_vec4(0, 0, 0, 1));
fp_set_value(newLight, "SpotDir", make_vec3(0, 0, -1));
fp_set_value(newLight, "SpotCone", make_vec2(0, 180));

fp_set_value(newLight, "ShadowEnable", 1);
// resolution of the shadow texture:
fp_set_value(newLight, "ShadowSize", 512);
fp_set_value(newLight, "ShadowFrustum",
    make_vec4(-0.5, 0.5, -0.5, 0.5));
fp_set_value(newLight, "ShadowNearFar", make_vec2(0.01, 100));
"#;

#[test]
fn shadow_map_of_section_4_1() {
    let world = world(SHADOW_MAP);
    let graph: &Graph = world.graph();
    let light = graph.find("newLight").expect("the light has its name");
    assert_eq!(&*graph.type_of(light).name, "LightSource");
    assert_eq!(graph.get_named::<Vec4>(light, "position"), Ok(Vec4::new(0.0, 0.0, 0.0, 1.0)));
    assert_eq!(graph.get_named::<Vec3>(light, "spot_dir"), Ok(Vec3::NEG_Z));
    assert_eq!(graph.get_named::<Vec2>(light, "spot_cone"), Ok(Vec2::new(0.0, 180.0)));
    assert_eq!(graph.get_named::<bool>(light, "shadow_enable"), Ok(true));
    assert_eq!(graph.get_named::<i32>(light, "shadow_size"), Ok(512));
    assert_eq!(graph.get_named::<Vec4>(light, "shadow_frustum"), Ok(Vec4::new(-0.5, 0.5, -0.5, 0.5)));
    assert_eq!(graph.get_named::<Vec2>(light, "shadow_near_far"), Ok(Vec2::new(0.01, 100.0)));
}

/// Section 4.2: the Caster field gets an object, the ShadowQuad darkens with black at alpha 0.5.
const STENCIL_SHADOW: &str = r#"
let statue = shape(make("Sphere"));
let shadow = make_instance_by_name("fpStencilShadow");
fp_set_value(shadow, "Name", "shadow");
fp_set_value(shadow, "Caster", statue);
fp_set_value(shadow, "ShadowQuad", make_instance_by_name("ShadowQuad"));
fp_set_value(shadow, "Translation", make_vec3(0, 2, 0));
world.add(shadow);
"#;

#[test]
fn stencil_shadow_of_section_4_2() {
    let mut world = world(STENCIL_SHADOW);
    let row = |world: &mut umbriel_scripts::World, expression: &str| world.console(expression).unwrap_or_else(|p| panic!("{p}"));
    for (expression, expected) in [
        ("find(\"shadow\").type", "StencilShadow"),
        ("fp_get_value(shadow, \"Caster\") == [statue]", "true"),
        ("shadow.shadow_quad.alpha", "0.5"),
        ("fp_get_value(shadow, \"translation\")", "vec3(0, 2, 0)"),
        ("find(\"/world/shadow\") == shadow", "true"),
    ] {
        assert_eq!(row(&mut world, expression), expected, "{expression}");
    }
    // run-time change, as the paper's section 5 asks for: another caster
    row(&mut world, "fp_set_value(shadow, \"Caster\", [shape(make(\"Box\")), statue])");
    assert_eq!(row(&mut world, "shadow.caster.len()"), "2");
}
