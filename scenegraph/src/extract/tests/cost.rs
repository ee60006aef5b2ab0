//! What an update costs, counted in nodes.

use super::World;
use glam::Vec3;
use std::sync::Arc;

/// `count` transforms with one box each, that share one geometry, a hundred to a group.
fn town(count: usize) -> (World, Vec<umbriel_fields::NodeId>) {
    let mut w = World::new();
    let geometry = w.node("Box", "");
    let mut transforms = Vec::new();
    let root = w.root();
    let mut groups = Vec::new();
    for _ in 0..count.div_ceil(100) {
        let group = w.node("Group", "");
        let mut members = Vec::new();
        for _ in 0..100.min(count - transforms.len()) {
            let t = w.node("Transform", "");
            let shape = w.node("Shape", "");
            w.set(shape, "geometry", geometry);
            w.set(t, "children", [shape]);
            members.push(t);
            transforms.push(t);
        }
        w.set(group, "children", members);
        groups.push(group);
    }
    w.set(root, "children", groups);
    w.update();
    (w, transforms)
}

#[test]
fn an_update_costs_what_changed() {
    let (mut w, transforms) = town(10_000);
    assert_eq!(w.visible().len(), 10_000);
    let before: Vec<u64> = w.scene.drawables.iter().map(|d| d.revision).collect();
    let idle = w.update();
    assert_eq!((idle.nodes_touched, idle.drawables_changed, idle.rebuilt), (0, 0, false));
    w.set(transforms[5_000], "translation", Vec3::Y);
    let one = w.update();
    assert!(one.nodes_touched <= 3 && one.drawables_changed == 1 && !one.rebuilt, "{one:?}");
    let after = w.scene.drawables.iter().map(|d| d.revision);
    assert_eq!(before.iter().zip(after).filter(|(a, b)| **a != *b).count(), 1);
    for t in transforms.iter().step_by(100) {
        w.set(*t, "translation", Vec3::X);
    }
    let hundred = w.update();
    assert!(hundred.nodes_touched <= 300 && hundred.drawables_changed == 100, "{hundred:?}");
}

#[test]
fn a_new_branch_leaves_the_rest_as_it_was() {
    let (mut w, _) = town(300);
    let before: Vec<(u64, usize)> = w.scene.drawables.iter().map(|d| (d.revision, Arc::as_ptr(&d.mesh) as usize)).collect();
    let root = w.root();
    w.shape(&[root], "new");
    let stats = w.update();
    assert!(stats.rebuilt);
    assert_eq!(stats.drawables_changed, 1);
    let after: Vec<(u64, usize)> = w.scene.drawables.iter().map(|d| (d.revision, Arc::as_ptr(&d.mesh) as usize)).collect();
    assert_eq!(before, after[..300]);
}

#[test]
fn a_material_is_made_once_and_only_its_shapes_are_written() {
    let mut w = World::new();
    let root = w.root();
    let material = w.node("Material", "red");
    let appearance = w.node("Appearance", "");
    w.set(appearance, "material", material);
    let shapes: Vec<_> = (0..10).map(|i| w.shape(&[root], &format!("s{i}"))).collect();
    for shape in &shapes[..3] {
        w.set(*shape, "appearance", appearance);
    }
    w.update();
    let red = w.drawable("s0").material.clone();
    assert!(Arc::ptr_eq(&red, &w.drawable("s2").material) && !Arc::ptr_eq(&red, &w.drawable("s3").material));
    w.set(shapes[0], "cast_shadow", false);
    assert_eq!(w.update().drawables_changed, 1);
    assert!(Arc::ptr_eq(&red, &w.drawable("s0").material), "a write to the shape leaves its material");
    w.set(material, "transparency", 0.5f32);
    assert_eq!(w.update().drawables_changed, 3);
    assert!(Arc::ptr_eq(&w.drawable("s0").material, &w.drawable("s1").material));
    assert_eq!(w.drawable("s0").material.alpha, umbriel_scene::AlphaMode::Blend);
}
