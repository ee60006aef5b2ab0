//! StencilShadow nodes: casters, light, film.

use super::World;
use glam::{Vec3, vec4};
use umbriel_fields::{Color, NodeId};
use umbriel_scene::{Film, StencilMode};

fn casters(w: &World) -> Vec<Vec<&str>> {
    let name = |i: &usize| w.scene.drawables[*i].name.as_str();
    w.scene.stencil_groups.iter().map(|g| g.casters.iter().map(name).collect()).collect()
}

#[test]
fn casters_are_the_named_sub_trees_or_the_children() {
    let mut w = World::new();
    let root = w.root();
    w.below(&[root], "DirectionalLight", "");
    let stencil = w.below(&[root], "fpStencilShadow", "group");
    let child = w.below(&[stencil], "Group", "");
    w.shape(&[child], "tower");
    let deep = w.shape(&[child], "flag");
    let outside = w.node("Transform", "");
    let ship = w.shape(&[outside], "ship");
    w.shape(&[root], "ground");
    let rows: [(&[NodeId], &[&str], usize); 5] = [
        (&[], &["tower", "flag"], 3),
        // A caster that stands below the children anyway is not shown twice.
        (&[deep], &["flag"], 3),
        (&[outside], &["ship"], 4),
        (&[outside, child], &["tower", "flag", "ship"], 4),
        (&[outside, ship], &["ship", "ship"], 5),
    ];
    for (list, expected, visible) in rows {
        w.set(stencil, "Caster", list);
        w.update();
        assert_eq!(casters(&w), [expected], "{list:?}");
        assert_eq!(w.visible().len(), visible, "{list:?}");
    }
    assert!(w.problems().is_empty());
}

#[test]
fn it_is_a_transform_and_hidden_casters_do_not_cast() {
    let mut w = World::new();
    let root = w.root();
    w.below(&[root], "DirectionalLight", "");
    let stencil = w.below(&[root], "StencilShadow", "");
    let switch = w.below(&[stencil], "Switch", "");
    let shape = w.shape(&[switch], "box");
    w.set(stencil, "translation", Vec3::X);
    w.set(switch, "which_choice", 0);
    w.update();
    assert_eq!(w.drawable("box").world_from_object.w_axis.x, 1.0);
    assert_eq!(casters(&w), [["box"]]);
    w.set(shape, "cast_shadow", false);
    w.update();
    assert_eq!(casters(&w), [[""; 0]]);
    w.set(shape, "cast_shadow", true);
    w.update();
    assert_eq!(casters(&w), [["box"]]);
    w.set(switch, "which_choice", -1);
    w.update();
    assert_eq!(casters(&w), [[""; 0]]);
}

#[test]
fn its_light_is_the_named_one_or_the_first() {
    let mut w = World::new();
    let root = w.root();
    let stencil = w.below(&[root], "StencilShadow", "group");
    w.shape(&[stencil], "box");
    w.update();
    assert!(w.scene.stencil_groups.is_empty());
    assert_eq!(w.problems(), ["StencilShadow 'group', light: none is set and the scene has no light; no shadow"]);
    let first = w.below(&[root], "PointLight", "first");
    let second = w.below(&[root], "PointLight", "second");
    let light = |w: &World| w.scene.stencil_groups.first().map(|g| w.scene.lights[g.light].name.clone());
    w.update();
    assert_eq!(light(&w).as_deref(), Some("first"));
    w.set(stencil, "light", second);
    w.update();
    assert_eq!(light(&w).as_deref(), Some("second"));
    // The place of the second in the list changes with the first one switched off.
    w.set(first, "on", false);
    w.update();
    assert_eq!(light(&w).as_deref(), Some("second"));
    w.set(second, "on", false);
    w.update();
    assert_eq!(light(&w), None);
    assert!(w.problems().is_empty(), "a light may be off");
    let wrong = [w.node("PointLight", "nowhere"), w.shape(&[root], "shape")];
    for (node, name) in wrong.into_iter().zip(["nowhere", "shape"]) {
        w.set(stencil, "light", node);
        w.update();
        assert!(w.problems()[0].contains(&format!("'{name}' is no light of this world")));
        assert_eq!((light(&w), w.extractor.light_of(node)), (None, None));
    }
}

#[test]
fn the_film_is_black_at_one_half() {
    let mut w = World::new();
    w.below(&[w.root()], "PointLight", "");
    let stencil = w.below(&[w.root()], "StencilShadow", "");
    w.update();
    assert_eq!(w.scene.stencil_groups[0].mode, StencilMode::Additive);
    w.set(stencil, "mode", "modulative");
    w.update();
    assert_eq!(w.scene.stencil_groups[0].mode, StencilMode::Modulative(Film { color: vec4(0.0, 0.0, 0.0, 0.5) }));
    let quad = w.node("ShadowQuad", "");
    w.set(stencil, "ShadowQuad", quad);
    w.set(quad, "color", Color(Vec3::X));
    w.update();
    w.set(quad, "alpha", 0.25f32);
    w.update();
    assert_eq!(w.scene.stencil_groups[0].mode, StencilMode::Modulative(Film { color: vec4(1.0, 0.0, 0.0, 0.25) }));
}
