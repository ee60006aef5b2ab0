//! Skins and morph targets.

use super::{World, close};
use glam::{Mat4, Quat, Vec3, Vec4, vec3};
use umbriel_fields::NodeId;

/// A triangle that follows two joints, one at the origin and one a metre above, in a figure with a place of its own.
fn figure(w: &mut World) -> [NodeId; 4] {
    let root = w.root();
    let place = w.below(&[root], "Transform", "figure");
    let hip = w.below(&[place], "Transform", "hip");
    let head = w.below(&[hip], "Transform", "head");
    w.set(head, "translation", Vec3::Y);
    let holder = w.below(&[place], "Transform", "holder");
    let shape = w.below(&[holder], "Shape", "body");
    let mesh = w.node("Mesh", "");
    w.set(mesh, "position", [Vec3::ZERO, Vec3::X, vec3(0.0, 2.0, 0.0)]);
    w.set(mesh, "joint", [0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]);
    w.set(mesh, "weight", [Vec4::X; 3]);
    let skin = w.node("Skin", "");
    w.set(skin, "joints", [hip, head]);
    w.set(skin, "inverse_bind", [Mat4::IDENTITY, Mat4::from_translation(-Vec3::Y)]);
    w.set(shape, "geometry", mesh);
    w.set(shape, "skin", skin);
    [place, holder, head, shape]
}

/// Where the drawable's pose and matrix bring a vertex.
fn posed(w: &World, joint: usize, p: Vec3) -> Vec3 {
    let d = w.drawable("body");
    d.world_from_object.transform_point3(d.pose.as_ref().unwrap().object_from_bind[joint].transform_point3(p))
}

#[test]
fn joints_move_vertices_wherever_the_shape_stands() {
    let mut w = World::new();
    let [place, holder, head, _] = figure(&mut w);
    w.update();
    assert!(w.problems().is_empty());
    let tip = vec3(0.0, 2.0, 0.0);
    assert!(posed(&w, 1, tip).abs_diff_eq(tip, 1e-5));
    // glTF: the place of the shape itself does not matter, that of the joints does.
    w.set(holder, "translation", Vec3::splat(7.0));
    w.update();
    assert!(posed(&w, 1, tip).abs_diff_eq(tip, 1e-5));
    w.set(head, "rotation", Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
    let stats = w.update();
    assert_eq!((stats.drawables_changed, stats.rebuilt), (1, false));
    assert!(posed(&w, 1, tip).abs_diff_eq(vec3(-1.0, 1.0, 0.0), 1e-5));
    w.set(place, "translation", Vec3::Z);
    w.update();
    assert!(posed(&w, 1, tip).abs_diff_eq(vec3(-1.0, 1.0, 1.0), 1e-5));
    let b = w.drawable("body").bounds_in_world;
    assert!(b.min.abs_diff_eq(vec3(-1.0, 0.0, 1.0), 1e-4) && b.max.abs_diff_eq(vec3(1.0, 1.0, 1.0), 1e-4), "{b:?}");
}

#[test]
fn each_copy_of_a_figure_has_its_own_joints() {
    let mut w = World::new();
    let [place, ..] = figure(&mut w);
    let second = w.below(&[w.root()], "Transform", "");
    w.adopt(second, place);
    w.set(second, "translation", vec3(10.0, 0.0, 0.0));
    w.update();
    let both = w.visible();
    assert_eq!(both.len(), 2);
    for (d, x) in both.iter().zip([0.0, 10.0]) {
        let m = d.world_from_object * d.pose.as_ref().unwrap().object_from_bind[1];
        assert!(close(m, Mat4::from_translation(vec3(x, 0.0, 0.0))), "{m}");
    }
}

#[test]
fn skins_that_do_not_fit_are_reported() {
    let mut w = World::new();
    let [_, _, head, shape] = figure(&mut w);
    let skin = w.graph.get_named::<Option<NodeId>>(shape, "skin").unwrap().unwrap();
    w.set(skin, "joints", [head]);
    w.update();
    assert!(w.names().is_empty());
    assert_eq!(w.problems(), ["Shape 'body', skin: the mesh uses joint 1, the skin has 1; the shape is not shown"]);
    w.set(skin, "joints", [head, head]);
    w.update();
    assert_eq!(w.names(), ["body"]);
    w.set(head, "translation", Vec3::NAN);
    w.update();
    assert!(w.names().is_empty(), "a joint that is nowhere bends to nowhere");
    w.set(head, "translation", Vec3::ZERO);
    w.set(skin, "inverse_bind", [Mat4::IDENTITY]);
    w.update();
    assert!(w.problems().iter().any(|p| p.contains("1 inverse_bind")));
}

#[test]
fn morph_weights_fit_the_targets() {
    let mut w = World::new();
    let shape = w.below(&[w.root()], "Shape", "face");
    let mesh = w.node("Mesh", "");
    let targets = [Vec3::Z, Vec3::X * 3.0].map(|offset| {
        let target = w.node("MorphTarget", "");
        w.set(target, "position", [offset; 3]);
        target
    });
    w.set(mesh, "position", [Vec3::ZERO, Vec3::X, Vec3::Y]);
    w.set(mesh, "targets", targets);
    w.set(shape, "geometry", mesh);
    let rows: [(&[f32], [f32; 2], f32, bool); 5] = [
        (&[], [0.0, 0.0], 0.0, true),
        (&[0.5], [0.5, 0.0], 0.5, true),
        (&[1.0, -1.0], [1.0, -1.0], 1.0, true),
        (&[1.0, 0.0, 2.0], [1.0, 0.0], 1.0, false),
        (&[f32::NAN, 1.0], [0.0, 1.0], 0.0, false),
    ];
    for (given, expected, far, fine) in rows {
        w.set(shape, "morph_weights", given);
        w.update();
        let d = w.drawable("face");
        assert_eq!(d.pose.as_ref().unwrap().morph_weights, expected);
        assert_eq!(d.bounds_in_world.max.z, far);
        assert_eq!(w.problems().is_empty(), fine, "{given:?}");
    }
    w.set(targets[0], "position", [Vec3::Z; 2]);
    w.update();
    assert!(w.names().is_empty() && w.problems().iter().any(|p| p.contains("morph target positions has 2 entries")));
}
