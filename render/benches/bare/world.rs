//! A grid of balls.

use glam::{Mat4, Vec3, Vec4};
use std::sync::Arc;
use umbriel_scene::{Aabb, Drawable, Frustum, Light, MapSettings, Material, Mesh, Scene, ShadowMethod, View};

/// `objects` balls of `kinds` meshes and materials, all in sight of [`view`].
pub(crate) fn grid(objects: usize, kinds: usize) -> Scene {
    grid_of(objects, kinds, |kind| 5 + kind % 3)
}

/// The same, with the number of rings of the balls of each kind.
pub(crate) fn grid_of(objects: usize, kinds: usize, rings: impl Fn(u32) -> u32) -> Scene {
    let looks: Vec<(Arc<Mesh>, Arc<Material>)> = (0..kinds)
        .map(|i| {
            let hue = i as f32 / kinds as f32;
            let base_color = Vec4::new(0.3 + 0.7 * hue, 0.9 - 0.6 * hue, 0.5, 1.0);
            (Arc::new(ball(rings(i as u32))), Arc::new(Material { base_color, ..Default::default() }))
        })
        .collect();
    let side = (objects as f32).sqrt().ceil() as usize;
    let place = |i: usize| {
        let [x, y] = [i % side, i / side].map(|v| (v as f32 + 0.5) / side as f32 * 2.0 - 1.0);
        Mat4::from_translation(Vec3::new(x, y, 0.0)) * Mat4::from_scale(Vec3::splat(0.8 / side as f32))
    };
    let drawables = (0..objects).map(|i| drawable(looks[i % kinds].clone(), place(i)));
    let light = Light { direction: Vec3::new(-0.3, -0.4, -1.0).normalize(), ..Default::default() };
    Scene { drawables: drawables.collect(), lights: vec![light], ambient: Vec3::splat(0.1), ..Default::default() }
}

/// The same in front of a rounded wall, on which the light throws the shadows of the balls by one map.
pub(crate) fn shadowed(objects: usize, kinds: usize) -> Scene {
    let mut scene = grid(objects, kinds);
    let wall = Mat4::from_translation(Vec3::NEG_Z * 0.3) * Mat4::from_scale(Vec3::new(1.4, 1.4, 0.05));
    scene.drawables.push(drawable((Arc::new(ball(6)), scene.drawables[0].material.clone()), wall));
    let light = &mut scene.lights[0];
    light.shadows = ShadowMethod::Map;
    light.map = MapSettings { frustum: Some([-2.0, 2.0, -2.0, 2.0]), near_far: Some([-3.0, 3.0]), ..light.map };
    scene
}

/// The same grid at the back of [`view`], which sees a single ball: all that is drawn goes into the map.
pub(crate) fn shadowed_behind_the_viewer(objects: usize, kinds: usize) -> Scene {
    let mut scene = shadowed(objects, kinds);
    let back = Mat4::from_translation(Vec3::Z * 6.0);
    for d in &mut scene.drawables {
        *d = drawable((d.mesh.clone(), d.material.clone()), back * d.world_from_object);
    }
    scene.lights[0].position = Vec3::Z * 6.0;
    let seen = Mat4::from_scale(Vec3::splat(0.01));
    scene.drawables.push(drawable((Arc::new(ball(6)), scene.drawables[0].material.clone()), seen));
    scene
}

/// All of the grid, from a number of eye distances (6.5 cm) beside its middle.
pub(crate) fn view(size: [u32; 2], beside: f32) -> View {
    View {
        name: "grid".into(),
        view_from_world: Mat4::from_translation(Vec3::new(-0.065 * beside, 0.0, -3.0)),
        frustum: Frustum::symmetric(0.8, size[0] as f32 / size[1] as f32, 0.1),
        size,
    }
}

fn drawable((mesh, material): (Arc<Mesh>, Arc<Material>), world_from_object: Mat4) -> Drawable {
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
