//! Meshes that are clean, and meshes as they come.

use glam::{Mat4, Vec3};
use std::f32::consts::{PI, TAU};
use std::sync::Arc;
use umbriel_scene::Mesh;

/// A mesh at a place.
#[derive(Clone)]
pub(crate) struct Thing {
    /// As it is seen.
    pub(crate) mesh: Arc<Mesh>,
    /// Before it was deformed.
    pub(crate) at_rest: Arc<Mesh>,
    pub(crate) world_from_object: Mat4,
    pub(crate) bounds_known: bool,
}

impl Thing {
    pub(crate) fn at(self, translation: Vec3) -> Thing {
        self.under(Mat4::from_translation(translation))
    }

    pub(crate) fn under(mut self, outer: Mat4) -> Thing {
        self.world_from_object = outer * self.world_from_object;
        self
    }

    /// Changes the lists of the mesh.
    pub(crate) fn edited(self, edit: impl FnOnce(&mut Vec<Vec3>, &mut Vec<u32>)) -> Thing {
        let (mut positions, mut indices) = (self.mesh.positions.to_vec(), self.mesh.indices.to_vec());
        edit(&mut positions, &mut indices);
        Thing { world_from_object: self.world_from_object, ..soup(positions, indices) }
    }

    /// Moves vertices as a skin or a morph target does.
    pub(crate) fn deformed(mut self, to: impl Fn(Vec3) -> Vec3) -> Thing {
        Arc::make_mut(&mut self.mesh).positions = self.at_rest.positions.iter().map(|p| to(*p)).collect();
        self
    }
}

pub(crate) fn soup(positions: Vec<Vec3>, indices: Vec<u32>) -> Thing {
    let mesh = Mesh { positions: positions.into(), indices: indices.into(), ..Mesh::default() };
    let mesh = Arc::new(mesh);
    Thing { at_rest: mesh.clone(), mesh, world_from_object: Mat4::IDENTITY, bounds_known: true }
}

/// All triangles of several things in one mesh.
pub(crate) fn merged(things: &[Thing]) -> Thing {
    let (mut positions, mut indices) = (vec![], vec![]);
    for t in things {
        let first = positions.len() as u32;
        positions.extend(t.mesh.positions.iter().map(|p| t.world_from_object.transform_point3(*p)));
        indices.extend(t.mesh.indices.iter().map(|i| first + i));
    }
    soup(positions, indices)
}

/// A square in the xz plane that looks up.
pub(crate) fn sheet(half: f32) -> Thing {
    let p = |x: f32, z: f32| Vec3::new(x * half, 0.0, z * half);
    soup(vec![p(-1., -1.), p(1., -1.), p(1., 1.), p(-1., 1.)], vec![0, 2, 1, 0, 3, 2])
}

/// A box with corners at +-half, wound outward; the lid (the side at +y) is its last two triangles.
pub(crate) fn cuboid(half: Vec3) -> Thing {
    let corner = |i: u32| half * Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -1.0 } else { 1.0 }));
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [0, 4, 6, 2], [1, 3, 7, 5], [2, 6, 7, 3]];
    let indices = sides.iter().flat_map(|[a, b, c, d]| [a, b, c, a, c, d]).copied().collect();
    soup((0..8).map(corner).collect(), indices)
}

/// A sphere wound outward.
pub(crate) fn sphere(radius: f32, around: u32, rings: u32) -> Thing {
    let mut positions = vec![Vec3::Y * radius, Vec3::NEG_Y * radius];
    for ring in 1..rings {
        let polar = PI * ring as f32 / rings as f32;
        positions.extend((0..around).map(|i| {
            let a = TAU * i as f32 / around as f32;
            radius * Vec3::new(polar.sin() * a.cos(), polar.cos(), -polar.sin() * a.sin())
        }));
    }
    let at = |ring: u32, i: u32| 2 + (ring - 1) * around + i % around;
    let mut indices = vec![];
    for i in 0..around {
        indices.extend([0, at(1, i), at(1, i + 1), 1, at(rings - 1, i + 1), at(rings - 1, i)]);
        for ring in 1..rings - 1 {
            let [a, b, c, d] = [at(ring, i), at(ring + 1, i), at(ring + 1, i + 1), at(ring, i + 1)];
            indices.extend([a, b, c, a, c, d]);
        }
    }
    soup(positions, indices)
}

/// Three blades that share an edge.
pub(crate) fn three_blades() -> Thing {
    let spine = [Vec3::new(0.0, -0.7, 0.0), Vec3::new(0.1, 0.8, 0.05)];
    let tips = [0.0f32, 2.0, 4.1].map(|a| Vec3::new(a.cos(), 0.2 * a.sin(), a.sin()));
    soup(spine.into_iter().chain(tips).collect(), vec![0, 1, 2, 0, 1, 3, 1, 0, 4])
}

/// Every triangle with three vertices of its own.
pub(crate) fn exploded(thing: Thing) -> Thing {
    thing.edited(|positions, indices| {
        *positions = indices.iter().map(|i| positions[*i as usize]).collect();
        *indices = (0..positions.len() as u32).collect();
    })
}

/// Every third triangle turned over.
pub(crate) fn inconsistent(thing: Thing) -> Thing {
    thing.edited(|_, indices| {
        for t in indices.chunks_exact_mut(3).step_by(3) {
            t.swap(1, 2);
        }
    })
}
