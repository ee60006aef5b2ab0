//! Shapes and lights that tests put together.

use crate::{Drawable, Light, LightKind, Material, Mesh};
use glam::{Mat4, Vec2, Vec3, vec3};
use std::sync::Arc;

pub(super) fn mesh(positions: Vec<Vec3>, indices: Vec<u32>) -> Mesh {
    Mesh { positions: positions.into(), indices: indices.into(), ..Mesh::default() }
}

pub(super) fn drawable(mesh: Mesh, world_from_object: Mat4) -> Drawable {
    Drawable {
        name: mesh.name.clone(),
        mesh: Arc::new(mesh.checked().unwrap()),
        material: Arc::new(Material::default()),
        world_from_object,
        pose: None,
        bounds_in_world: Default::default(),
        visible: true,
        casts_shadow: true,
        receives_shadow: true,
        receives: None,
        revision: 0,
    }
}

pub(super) fn with(mut drawable: Drawable, change: impl FnOnce(&mut Drawable, &mut Material)) -> Drawable {
    let mut material = (*drawable.material).clone();
    change(&mut drawable, &mut material);
    drawable.material = Arc::new(material);
    drawable
}

/// A square of 2 by 2 around the origin in the xz plane, normal +y, texture over its whole.
pub(super) fn square() -> Mesh {
    let corner = |x: f32, z: f32| vec3(x, 0.0, z);
    Mesh {
        uv0: [Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X].into(),
        ..mesh(vec![corner(-1., -1.), corner(-1., 1.), corner(1., 1.), corner(1., -1.)], vec![0, 1, 2, 0, 2, 3])
    }
}

/// The cube from -1 to 1, seen from outside.
pub(super) fn cube() -> Mesh {
    let positions = (0..8).map(|i| vec3((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3]];
    mesh(positions, faces.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]).collect())
}

/// A unit sphere of `rings` by twice as many quads, its vertices on the sphere.
pub(super) fn sphere(rings: u32) -> Mesh {
    let segments = rings * 2;
    let angle = |i: u32, n: u32| i as f32 / n as f32 * std::f32::consts::PI;
    let positions = (0..=rings)
        .flat_map(|r| {
            (0..=segments).map(move |s| {
                let (y, around) = (angle(r, rings), angle(s % segments, rings));
                vec3(y.sin() * around.cos(), y.cos(), -y.sin() * around.sin())
            })
        })
        .collect();
    let quad = |r: u32, s: u32| {
        let a = r * (segments + 1) + s;
        let b = a + segments + 1;
        [a, b, a + 1, a + 1, b, b + 1]
    };
    mesh(positions, (0..rings).flat_map(|r| (0..segments).flat_map(move |s| quad(r, s))).collect())
}

pub(super) fn ground(half_size: f32) -> Drawable {
    drawable(square(), Mat4::from_scale(Vec3::splat(half_size)))
}

pub(super) fn box_at(centre: Vec3) -> Drawable {
    drawable(cube(), Mat4::from_translation(centre))
}

pub(super) fn sun(direction: Vec3) -> Light {
    Light { direction, ..Light::default() }
}

pub(super) fn lamp(position: Vec3) -> Light {
    Light { kind: LightKind::Point, position, ..Light::default() }
}

pub(super) fn spot(position: Vec3, outer_rad: f32) -> Light {
    Light { kind: LightKind::Spot { inner_rad: 0.0, outer_rad }, position, direction: Vec3::NEG_Y, ..Light::default() }
}
