//! Meshes as the author made them: nothing here reorders or re-triangulates.

use crate::Aabb;
use glam::{Vec2, Vec3, Vec4};
use std::sync::Arc;

/// Vertices and indices of one shape, shared without copies. Optional attributes are empty or as long as `positions`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Name, for messages.
    pub name: String,
    /// What each run of indices is.
    pub topology: Topology,
    /// Positions in object space, metres.
    pub positions: Arc<[Vec3]>,
    /// Unit normals.
    pub normals: Arc<[Vec3]>,
    /// Shaded as the triangles lie, whatever `normals` says.
    pub flat: bool,
    /// Unit tangents; w is the sign of the bitangent.
    pub tangents: Arc<[Vec4]>,
    /// First texture coordinates, v down.
    pub uv0: Arc<[Vec2]>,
    /// Second texture coordinates.
    pub uv1: Arc<[Vec2]>,
    /// Linear RGBA vertex colours.
    pub colors: Arc<[Vec4]>,
    /// Indices into the joints of a [`crate::Pose`], four per vertex.
    pub joints: Arc<[[u16; 4]]>,
    /// Weights of `joints`; they sum to 1.
    pub weights: Arc<[Vec4]>,
    /// Offsets added with the weights of a [`crate::Pose`] (morph targets, blend shapes).
    pub morph_targets: Vec<MorphTarget>,
    /// Vertex numbers, three per triangle, two per line, one per point.
    pub indices: Arc<[u32]>,
    /// Bounds of `positions` at rest.
    pub bounds: Aabb,
}

/// Offsets of one morph target; each list is empty or as long as the mesh's positions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// Offsets of positions, metres.
    pub positions: Arc<[Vec3]>,
    /// Offsets of normals.
    pub normals: Arc<[Vec3]>,
    /// Offsets of tangents.
    pub tangents: Arc<[Vec3]>,
}

/// What each run of indices is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Topology {
    /// Three indices per triangle.
    #[default]
    Triangles,
    /// Two indices per line segment.
    Lines,
    /// One index per point.
    Points,
}

/// Why a mesh cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// An attribute is neither empty nor as long as the positions.
    #[error("mesh '{mesh}': {attribute} has {found} entries where the positions have {expected}")]
    Length {
        /// Name of the mesh.
        mesh: String,
        /// The attribute.
        attribute: &'static str,
        /// Its length.
        found: usize,
        /// Number of positions.
        expected: usize,
    },
    /// An index points behind the last vertex.
    #[error("mesh '{mesh}': index {index} at place {place} is outside of its {vertices} vertices")]
    Index {
        /// Name of the mesh.
        mesh: String,
        /// The index.
        index: u32,
        /// Its place in `indices`.
        place: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// The number of indices is no multiple of what the topology needs.
    #[error("mesh '{mesh}': {count} indices are no multiple of {per_primitive}")]
    Count {
        /// Name of the mesh.
        mesh: String,
        /// Number of indices.
        count: usize,
        /// Indices per primitive.
        per_primitive: usize,
    },
    /// A position is NaN or infinite.
    #[error("mesh '{mesh}': position {place} is not finite")]
    NotFinite {
        /// Name of the mesh.
        mesh: String,
        /// Number of the vertex.
        place: usize,
    },
}

impl Mesh {
    /// Checks lengths, indices and finiteness, computes `bounds`, and lets triangles without normals be flat (glTF 2.0,
    /// section 3.7.2.1), with smooth ones for what wants one for each vertex.
    pub fn checked(mut self) -> Result<Mesh, MeshError> {
        self.verify()?;
        self.bounds = Aabb::from_points(self.positions.iter().copied());
        if self.normals.is_empty() && self.topology == Topology::Triangles {
            self.normals = area_weighted_normals(&self.positions, &self.indices).into();
            self.flat = true;
        }
        Ok(self)
    }

    fn verify(&self) -> Result<(), MeshError> {
        let mesh = || self.name.clone();
        let expected = self.positions.len();
        let mut lengths = vec![
            ("normals", self.normals.len()),
            ("tangents", self.tangents.len()),
            ("uv0", self.uv0.len()),
            ("uv1", self.uv1.len()),
            ("colors", self.colors.len()),
            ("joints", self.joints.len()),
            ("weights", self.weights.len()),
        ];
        for t in &self.morph_targets {
            lengths.push(("morph target positions", t.positions.len()));
            lengths.push(("morph target normals", t.normals.len()));
            lengths.push(("morph target tangents", t.tangents.len()));
        }
        for (attribute, found) in lengths {
            if found != 0 && found != expected {
                return Err(MeshError::Length { mesh: mesh(), attribute, found, expected });
            }
        }
        let per_primitive = self.topology.indices_per_primitive();
        if !self.indices.len().is_multiple_of(per_primitive) {
            return Err(MeshError::Count { mesh: mesh(), count: self.indices.len(), per_primitive });
        }
        if let Some((place, &index)) = self.indices.iter().enumerate().find(|(_, i)| **i as usize >= expected) {
            return Err(MeshError::Index { mesh: mesh(), index, place, vertices: expected });
        }
        if let Some(place) = self.positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NotFinite { mesh: mesh(), place });
        }
        Ok(())
    }

    /// Number of triangles; 0 for lines and points.
    pub fn triangle_count(&self) -> usize {
        if self.topology == Topology::Triangles { self.indices.len() / 3 } else { 0 }
    }
}

impl Topology {
    /// How many indices make one primitive.
    pub fn indices_per_primitive(self) -> usize {
        match self {
            Topology::Triangles => 3,
            Topology::Lines => 2,
            Topology::Points => 1,
        }
    }
}

/// Vertex normals as the sum of the normals of the triangles around, weighted by area. Vertices without area get +y.
pub(crate) fn area_weighted_normals(positions: &[Vec3], indices: &[u32]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for t in indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i as usize]);
        let n = (b - a).cross(c - a);
        for &i in t {
            normals[i as usize] += n;
        }
    }
    normals.into_iter().map(|n| n.try_normalize().unwrap_or(Vec3::Y)).collect()
}
