//! Collects vertices and triangles of a solid.

use glam::{Vec2, Vec3};
use umbriel_scene::{Aabb, Mesh};

/// Vertices and triangles under construction.
#[derive(Default)]
pub(crate) struct Builder {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    indices: Vec<u32>,
}

impl Builder {
    /// Adds a vertex and returns its number.
    pub(crate) fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        // -0.0 and 0.0 are one place, but two bit patterns: keep only the positive one.
        self.positions.push(position + Vec3::ZERO);
        self.normals.push(normal);
        self.uvs.push(uv);
        self.positions.len() as u32 - 1
    }

    /// Adds a triangle, counter-clockwise from outside.
    pub(crate) fn triangle(&mut self, a: u32, b: u32, c: u32) {
        self.indices.extend([a, b, c]);
    }

    /// Adds two triangles; corners counter-clockwise from outside.
    pub(crate) fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.indices.extend([a, b, c, a, c, d]);
    }

    /// The mesh, bounds included.
    pub(crate) fn finish(self, name: &str) -> Mesh {
        Mesh {
            name: name.to_owned(),
            bounds: Aabb::from_points(self.positions.iter().copied()),
            positions: self.positions.into(),
            normals: self.normals.into(),
            uv0: self.uvs.into(),
            indices: self.indices.into(),
            ..Mesh::default()
        }
    }
}

/// Unit vector number `step` of `steps` around the y axis: 0 is +z, a quarter is +x. Step `steps` is step 0, bit by bit.
pub(crate) fn around_y(step: u32, steps: u32) -> Vec3 {
    let angle_rad = std::f32::consts::TAU * (step % steps) as f32 / steps as f32;
    let (sin, cos) = angle_rad.sin_cos();
    Vec3::new(sin, 0.0, cos)
}
