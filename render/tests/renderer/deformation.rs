//! Skins and morph targets against the same on the CPU, in pictures with maps and volumes.

use crate::support::*;
use glam::{Mat4, Quat, Vec3, Vec4};
use std::sync::Arc;
use umbriel_scene::*;

/// A box of three storeys whose joints bend it, with a target that swells it.
fn tower() -> Mesh {
    let mut mesh = cuboid(Vec3::new(0.8, 2.0, 0.8));
    let (mut positions, mut normals, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    for storey in 0..4 {
        let first = positions.len() as u32;
        let lift = Vec3::Y * (0.25 + 0.5 * storey as f32);
        positions.extend(mesh.positions.iter().map(|p| *p * Vec3::new(1.0, 0.25, 1.0) + lift));
        normals.extend(mesh.normals.iter().copied());
        indices.extend(mesh.indices.iter().map(|i| first + i));
    }
    let bend = |p: &Vec3| Vec4::new(1.0 - p.y * 0.5, p.y * 0.5, 0.0, 0.0);
    mesh.weights = positions.iter().map(bend).collect();
    mesh.joints = positions.iter().map(|_| [0, 1, 0, 0]).collect();
    let swell: Arc<[Vec3]> = positions.iter().map(|p| Vec3::new(p.x, 0.0, p.z)).collect();
    mesh.morph_targets = vec![
        MorphTarget { positions: swell, ..Default::default() },
        MorphTarget { normals: normals.iter().map(|n| Vec3::Y * 0.5 - *n * 0.2).collect(), ..Default::default() },
    ];
    (mesh.positions, mesh.normals, mesh.indices) = (positions.into(), normals.into(), indices.into());
    mesh.checked().unwrap()
}

#[test]
fn the_gpu_deforms_as_the_cpu_does() {
    let lean = Mat4::from_rotation_z(-0.5)
        * Mat4::from_scale_rotation_translation(Vec3::new(1.0, 0.8, 1.5), Quat::from_rotation_y(0.4), Vec3::Y * 0.1);
    let mesh = Arc::new(tower());
    let pose =
        |joints: &[Mat4], weights: &[f32]| Arc::new(Pose { object_from_bind: joints.to_vec(), morph_weights: weights.to_vec() });
    for (name, pose) in [
        ("rest", pose(&[Mat4::IDENTITY, Mat4::IDENTITY], &[0.0, 0.0])),
        ("skin", pose(&[Mat4::IDENTITY, lean], &[])),
        ("morph", pose(&[], &[0.6, 0.0])),
        ("normals", pose(&[], &[0.0, 1.0])),
        ("both", pose(&[Mat4::from_rotation_y(0.3), lean], &[0.5, 0.7])),
    ] {
        for shadows in [ShadowMethod::Map, ShadowMethod::Volume] {
            let place = at(0.2, 0.0, 0.1);
            let floor = shape(plane(8.0), matt(0.5, 0.5, 0.5), Mat4::IDENTITY);
            let mut scene = Scene {
                lights: vec![Light { direction: Vec3::new(-0.6, -1.0, -0.5).normalize(), shadows, ..noon() }],
                ..Default::default()
            };
            scene.ambient = Vec3::splat(0.1);
            let mut posed = shape_of(&mesh, &Arc::new(matt(0.7, 0.4, 0.3)), place);
            let by_cpu = deformed(&mesh, &pose);
            let mut baked = Mesh {
                positions: by_cpu.positions.into(),
                normals: by_cpu.normals.into(),
                indices: mesh.indices.clone(),
                ..Default::default()
            };
            baked.bounds = Aabb::from_points(baked.positions.iter().copied());
            posed.bounds_in_world = baked.bounds.transformed(&place);
            posed.pose = Some(pose.clone());
            let picture =
                Picture::mono(look(&format!("deformed_{name}_{shadows:?}"), Vec3::new(3.0, 3.0, 5.0), Vec3::Y, [160, 120]));
            scene.drawables = vec![floor.clone(), posed].into();
            let ours = shoot(&scene, &picture);
            scene.drawables = vec![floor, shape(baked, matt(0.7, 0.4, 0.3), place)].into();
            let truth = shoot(&scene, &picture);
            let differ = ours.layers[0].rgba.iter().zip(&truth.layers[0].rgba).filter(|(a, b)| a.abs_diff(**b) > 8).count();
            assert!(differ < 30, "{name} {shadows:?}: {differ} bytes differ");
            assert_eq!(ours.stats.deformed, u32::from(name != "rest" || !pose.object_from_bind.is_empty()), "{name}");
            assert_eq!(ours.problems, Vec::<String>::new());
        }
    }
}

#[test]
fn each_pose_is_computed_once() {
    let (_turn, gpu) = gpu();
    let mut renderer = umbriel_render::Renderer::new(gpu).unwrap();
    let mesh = Arc::new(tower());
    let pose = |w: f32| Some(Arc::new(Pose { object_from_bind: vec![], morph_weights: vec![w] }));
    let mut posed = shape_of(&mesh, &Arc::new(matt(0.5, 0.5, 0.5)), Mat4::IDENTITY);
    posed.pose = pose(0.5);
    let mut scene = Scene {
        drawables: vec![posed.clone(), posed].into(),
        lights: vec![Light { shadows: ShadowMethod::Map, ..noon() }],
        ..Default::default()
    };
    scene.drawables[1].pose = pose(0.1);
    let picture = Picture::mono(look("poses", Vec3::new(3.0, 3.0, 5.0), Vec3::Y, [32, 24]));
    let other = Picture::mono(look("poses", Vec3::new(-3.0, 3.0, 5.0), Vec3::Y, [32, 24]));
    let mut frame = |scene: &Scene| {
        let stats = renderer.render(scene, &[picture.clone(), other.clone()]).unwrap();
        (stats.deformed, stats.map_redraws > 0)
    };
    assert_eq!(frame(&scene), (2, true), "two poses, however many views");
    assert_eq!(frame(&scene), (0, false), "nothing changed");
    scene.drawables[0].pose = pose(0.7);
    assert_eq!(frame(&scene), (1, true), "one changed, and its shadow with it");
    scene.drawables[0].pose = None;
    assert_eq!(frame(&scene), (0, true), "at rest");
    assert_eq!(renderer.problems(), Vec::<String>::new());
}
