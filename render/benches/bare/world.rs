//! A grid of balls.

use glam::{Mat4, Vec3, Vec4};
use std::sync::Arc;
use umbriel_scene::{Aabb, Drawable, Frustum, Light, Material, Mesh, Scene, View};

/// `objects` balls of `kinds` meshes and materials, all in sight of [`view`].
pub(crate) fn scene(objects: usize, kinds: usize) -> Scene {
    let looks: Vec<(Arc<Mesh>, Arc<Material>)> = (0..kinds)
        .map(|i| {
            let hue = i as f32 / kinds as f32;
            let base_color = Vec4::new(0.3 + 0.7 * hue, 0.9 - 0.6 * hue, 0.5, 1.0);
            (Arc::new(ball(5 + i as u32 % 3)), Arc::new(Material { base_color, ..Default::default() }))
        })
        .collect();
    let side = (objects as f32).sqrt().ceil() as usize;
    let place = |i: usize| {
        let [x, y] = [i % side, i / side].map(|v| (v as f32 + 0.5) / side as f32 * 2.0 - 1.0);
        Mat4::from_translation(Vec3::new(x, y, 0.0)) * Mat4::from_scale(Vec3::splat(0.8 / side as f32))
    };
    let drawables = (0..objects).map(|i| {
        let (mesh, material) = looks[i % kinds].clone();
        let world_from_object = place(i);
        Drawable {
            name: String::new(),
            bounds_in_world: mesh.bounds.transformed(&world_from_object),
            mesh,
            material,
            world_from_object,
            pose: None,
            visible: true,
            casts_shadow: true,
            receives_shadow: true,
            receives: None,
            revision: 0,
        }
    });
    let light = Light { direction: Vec3::new(-0.3, -0.4, -1.0).normalize(), ..Default::default() };
    Scene { drawables: drawables.collect(), lights: vec![light], ambient: Vec3::splat(0.1), ..Default::default() }
}

/// All of the grid.
pub(crate) fn view(size: [u32; 2]) -> View {
    View {
        name: "grid".into(),
        view_from_world: Mat4::from_translation(Vec3::new(0.0, 0.0, -3.0)),
        frustum: Frustum::symmetric(0.8, size[0] as f32 / size[1] as f32, 0.1),
        size,
    }
}

fn ball(rings: u32) -> Mesh {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    let segments = 2 * rings;
    for r in 0..=rings {
        for s in 0..=segments {
            let lat = std::f32::consts::PI * r as f32 / rings as f32;
            let lon = std::f32::consts::TAU * s as f32 / segments as f32;
            positions.push(Vec3::new(lat.sin() * lon.cos(), lat.cos(), -lat.sin() * lon.sin()));
        }
    }
    for r in 0..rings {
        for s in 0..segments {
            let (a, b) = (r * (segments + 1) + s, (r + 1) * (segments + 1) + s);
            indices.extend([a, b, b + 1, a, b + 1, a + 1]);
        }
    }
    let normals = positions.iter().map(|p: &Vec3| p.normalize()).collect();
    let bounds = Aabb::from_points(positions.iter().copied());
    Mesh { positions: positions.into(), normals, indices: indices.into(), bounds, ..Default::default() }
}
