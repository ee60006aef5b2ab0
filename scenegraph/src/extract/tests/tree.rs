//! Places: transforms, shared nodes, switches, levels of detail, cycles, the room.

use super::{World, close, close3};
use glam::{Mat4, Quat, Vec3, vec3};
use std::f32::consts::FRAC_PI_2;

#[test]
fn transforms_are_those_of_x3d() {
    let turn = Quat::from_rotation_z(FRAC_PI_2);
    let about_center = Mat4::from_translation(Vec3::X) * Mat4::from_quat(turn) * Mat4::from_translation(-Vec3::X);
    let slanted = Mat4::from_quat(turn) * Mat4::from_scale(vec3(2.0, 1.0, 1.0)) * Mat4::from_quat(turn.inverse());
    let shear =
        Mat4::from_cols_array_2d(&[[1.0, 0.5, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 3.0, 1.0]]);
    type Fields = Vec<(&'static str, umbriel_fields::Value)>;
    let rows: [(Fields, Mat4); 6] = [
        (vec![], Mat4::IDENTITY),
        (vec![("translation", Vec3::X.into()), ("scale", vec3(-1.0, 2.0, 1.0).into())], {
            Mat4::from_translation(Vec3::X) * Mat4::from_scale(vec3(-1.0, 2.0, 1.0))
        }),
        (vec![("rotation", turn.into()), ("center", Vec3::X.into())], about_center),
        (vec![("scale", vec3(2.0, 1.0, 1.0).into()), ("scale_orientation", turn.into())], slanted),
        (vec![("matrix", shear.into()), ("translation", Vec3::Y.into())], Mat4::from_translation(Vec3::Y) * shear),
        // A quaternion that is not of unit length turns, and does not stretch.
        (vec![("rotation", (turn * 3.0).into())], Mat4::from_quat(turn)),
    ];
    for (fields, expected) in rows {
        let mut w = World::new();
        let t = w.below(&[w.root()], "Transform", "t");
        w.shape(&[t], "box");
        for (field, value) in &fields {
            w.set(t, field, value.clone());
        }
        w.update();
        assert!(close(w.drawable("box").world_from_object, expected), "{fields:?}");
        let b = w.drawable("box").bounds_in_world;
        assert!(close3(b.centre(), expected.transform_point3(Vec3::ZERO)), "{fields:?}");
        assert!(w.problems().is_empty());
    }
}

#[test]
fn a_node_with_two_parents_stands_twice() {
    let mut w = World::new();
    let root = w.root();
    let [a, b] = [1.0, -1.0].map(|x| {
        let t = w.below(&[root], "Transform", "");
        w.set(t, "translation", vec3(x * 5.0, 0.0, 0.0));
        w.set(t, "scale", vec3(x, 1.0, 1.0));
        t
    });
    let house = w.below(&[a, b], "Transform", "house");
    let shape = w.shape(&[house], "wall");
    w.update();
    let x = |w: &World| w.visible().iter().map(|d| d.world_from_object.w_axis.x).collect::<Vec<_>>();
    assert_eq!(x(&w), [5.0, -5.0]);
    assert!(w.visible()[1].world_from_object.determinant() < 0.0, "the second is mirrored");
    assert_eq!(w.extractor.drawables_of(shape).len(), 2);
    assert!(std::sync::Arc::ptr_eq(&w.visible()[0].mesh, &w.visible()[1].mesh));
    // One write moves both; the mirrored one to the other side.
    w.set(house, "translation", Vec3::X);
    assert!(!w.update().rebuilt);
    assert_eq!(x(&w), [6.0, -6.0]);
}

#[test]
fn switches_show_one_child_or_none() {
    let mut w = World::new();
    let switch = w.below(&[w.root()], "Switch", "");
    let t = w.below(&[switch], "Transform", "");
    w.shape(&[t], "zero");
    w.shape(&[switch], "one");
    w.update();
    for (choice, expected) in [(0, vec!["zero"]), (1, vec!["one"]), (-1, vec![]), (2, vec![]), (-7, vec![]), (0, vec!["zero"])] {
        w.set(switch, "which_choice", choice);
        assert!(!w.update().rebuilt);
        assert_eq!(w.names(), expected, "which_choice {choice}");
    }
}

#[test]
fn levels_of_detail_follow_head_and_place() {
    let mut w = World::new();
    let user = w.node("User", "");
    w.set(user, "position", Vec3::ZERO);
    let t = w.below(&[w.root()], "Transform", "");
    let lod = w.below(&[t], "LOD", "");
    for name in ["near", "middle", "far"] {
        w.shape(&[lod], name);
    }
    w.set(lod, "range", [10.0f32, 20.0]);
    w.update();
    let rows = [
        (t, "translation", 5.0, "near"),
        (t, "translation", 15.0, "middle"),
        (t, "translation", 50.0, "far"),
        (user, "position", 45.0, "near"),
        (user, "position", 0.0, "far"),
        // Measured in its own space: at half the size, 24 m are 48.
        (t, "translation", 8.0, "near"),
    ];
    for (node, field, x, expected) in rows {
        w.set(node, field, vec3(x, 0.0, 0.0));
        assert!(!w.update().rebuilt);
        assert_eq!(w.names(), [expected], "{field} {x}");
    }
    w.set(t, "scale", Vec3::splat(0.5));
    w.update();
    assert_eq!(w.names(), ["middle"]);
}

#[test]
fn cycles_are_reported_and_left_out() {
    let mut w = World::new();
    let a = w.below(&[w.root()], "Group", "a");
    let b = w.below(&[a], "Group", "b");
    w.shape(&[b], "box");
    w.adopt(b, a);
    w.update();
    assert_eq!(w.names(), ["box"]);
    assert_eq!(w.problems(), ["Group 'b', children: 'a' below it is also above it; this branch is left out"]);
    w.set(b, "children", Vec::<umbriel_fields::NodeId>::new());
    w.update();
    assert!(w.names().is_empty() && w.problems().is_empty());
    w.adopt(b, a);
    w.update();
    assert_eq!(w.problems().len(), 1, "it is told again when it comes back");
}

#[test]
fn exponential_graphs_are_cut_with_a_report() {
    let mut w = World::new();
    w.extractor = super::Extractor::new().with_place_limit(5_000);
    let mut above = w.root();
    for _ in 0..40 {
        let both = w.below(&[above], "Group", "");
        w.adopt(above, both);
        above = both;
    }
    w.shape(&[above], "leaf");
    w.update();
    assert!(w.problems()[0].contains("more than 5000 places"));
    assert!(!w.names().is_empty() && w.names().len() < 5_000);
}

#[test]
fn deep_graphs_do_not_overflow_the_stack() {
    let mut w = World::new();
    let mut above = w.root();
    for _ in 0..50_000 {
        above = w.below(&[above], "Transform", "");
    }
    w.shape(&[above], "deepest");
    w.update();
    assert_eq!(w.names(), ["deepest"]);
}

#[test]
fn a_broken_transform_leaves_out_its_sub_tree_until_mended() {
    let mut w = World::new();
    let t = w.below(&[w.root()], "Transform", "crane");
    let inner = w.below(&[t], "Transform", "hook");
    w.shape(&[inner], "load");
    w.shape(&[w.root()], "ground");
    w.update();
    for (broken, told) in [(f32::NAN, 1), (f32::NAN, 0), (f32::INFINITY, 0), (0.0, 0), (f32::NAN, 1)] {
        w.set(t, "translation", vec3(broken, 0.0, 0.0));
        w.update();
        let problems = w.problems();
        assert_eq!(problems.len(), told, "{broken}: {problems:?}");
        assert!(problems.iter().all(|p| p.contains("'crane'")), "{problems:?}");
        let expected: &[&str] = if broken == 0.0 { &["load", "ground"] } else { &["ground"] };
        assert_eq!(w.names(), expected);
        assert!(w.scene.drawables.iter().all(|d| d.world_from_object.is_finite()), "no NaN reaches the renderer");
    }
    w.set(t, "translation", Vec3::ZERO);
    w.set(t, "scale", vec3(1.0, 0.0, 1.0));
    w.update();
    assert_eq!(w.names(), ["ground"], "what is flattened to nothing is not drawn");
}

#[test]
fn the_world_moves_lights_and_viewpoints_included() {
    let mut w = World::new();
    let root = w.root();
    w.shape(&[root], "box");
    let sun = w.below(&[root], "DirectionalLight", "");
    let lamp = w.below(&[root], "PointLight", "");
    w.set(lamp, "location", vec3(0.0, 3.0, 0.0));
    w.set(lamp, "radius", 8.0f32);
    let view = w.below(&[root], "Viewpoint", "view");
    w.set(view, "position", vec3(0.0, 1.0, 4.0));
    w.update();
    let navigation = w.node("Navigation", "");
    w.set(navigation, "position", vec3(10.0, 0.0, 0.0));
    w.set(navigation, "orientation", Quat::from_rotation_y(FRAC_PI_2));
    w.set(navigation, "scale", 2.0f32);
    let stats = w.update();
    assert!(!stats.rebuilt, "{stats:?}");
    // The room stands at x = 10, turned to the left, and a metre of it is two of the world.
    let world_from_room =
        Mat4::from_scale_rotation_translation(Vec3::splat(2.0), Quat::from_rotation_y(FRAC_PI_2), vec3(10.0, 0.0, 0.0));
    assert!(close(w.drawable("box").world_from_object, world_from_room.inverse()));
    assert!(close3(w.drawable("box").world_from_object.transform_point3(Vec3::ZERO), vec3(0.0, 0.0, -5.0)));
    assert!(close3(w.light(sun).direction, Quat::from_rotation_y(-FRAC_PI_2) * Vec3::NEG_Z));
    let light = w.light(lamp);
    assert!(close3(light.position, vec3(0.0, 1.5, -5.0)));
    assert!((light.range - 4.0).abs() < 1e-4);
    // As bright as before: 1 m in the room is 2 m of the world.
    assert!(close3(light.attenuation, vec3(0.0, 0.0, 4.0)));
    let view = &w.extractor.viewpoints()[0];
    assert!(close(view.world_from_view, Mat4::from_translation(vec3(0.0, 1.0, 4.0))));
    let eye = world_from_room.inverse().transform_point3(vec3(0.0, 1.0, 4.0));
    assert!(close3(view.room_from_view.transform_point3(Vec3::ZERO), eye));
    assert!((view.room_from_view.determinant() - 1.0).abs() < 1e-5, "a camera has no scale");
    w.set(navigation, "scale", 0.0f32);
    w.update();
    assert!(w.problems()[0].contains("makes no pose"));
    assert!(close(w.drawable("box").world_from_object, Mat4::IDENTITY));
}

#[test]
fn a_type_of_somebody_else_with_children_is_a_group() {
    let mut w = World::new();
    let door = umbriel_fields::NodeType::new("Door", "A script's own type.").field(umbriel_fields::Field::nodes("children"));
    w.graph.types().register(door).unwrap();
    let door = w.below(&[w.root()], "Door", "door");
    w.shape(&[door], "leaf");
    w.update();
    assert_eq!(w.names(), ["leaf"]);
    w.set(door, "children", Vec::<umbriel_fields::NodeId>::new());
    w.update();
    assert!(w.names().is_empty());
}

#[test]
fn without_a_world_nothing_is_shown_until_there_is_one() {
    let mut w = World::new();
    let root = w.root();
    let shape = w.shape(&[root], "box");
    w.below(&[root], "PointLight", "");
    w.below(&[root], "Viewpoint", "");
    let stencil = w.below(&[root], "StencilShadow", "");
    w.update();
    assert_eq!((w.scene.lights.len(), w.scene.stencil_groups.len(), w.extractor.viewpoints().len()), (1, 1, 1));
    w.graph.delete(root).unwrap();
    w.update();
    assert!(w.scene.drawables.iter().all(|d| !d.visible));
    assert_eq!((w.scene.lights.len(), w.scene.stencil_groups.len(), w.extractor.viewpoints().len()), (0, 0, 0));
    let again = w.node("Transform", "world");
    w.set(again, "children", [stencil, shape]);
    w.update();
    assert_eq!(w.names(), ["box"], "any node of that name is the world");
}
