//! Which triangles meet at which edge: what shadow volumes are extruded from.

use crate::{Mesh, Topology};
use glam::Vec3;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// The unique edges of a mesh. Two vertices are the same where their positions are equal (and, on a mesh that deforms,
/// where they move together); nothing else is welded.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Edges {
    /// Sorted by the two vertices.
    pub edges: Vec<Edge>,
    /// `triangle << 1 | sign`, grouped by edge. Sign 0: the triangle winds from `a` to `b`, 1: from `b` to `a`.
    /// Triangles two of whose corners are equal are left out.
    pub incidences: Vec<u32>,
    /// Every edge lies between exactly two triangles that wind through it in opposite directions: a consistently oriented
    /// 2-manifold without border. False for a mesh without triangles.
    pub closed: bool,
}

/// An edge and the triangles at it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Vertex index, the lower one; the lowest of the vertices that are welded.
    pub a: u32,
    /// Vertex index, the higher one.
    pub b: u32,
    /// First of its entries in [`Edges::incidences`].
    pub first: u32,
    /// Number of its entries.
    pub count: u32,
}

impl Edges {
    /// Edges of a mesh at rest. Vertices that are at one place at rest but have other joints, weights or morph offsets
    /// may part, so they are not welded. Empty for lines and points.
    pub fn of_mesh(mesh: &Mesh) -> Edges {
        if mesh.topology != Topology::Triangles {
            return Edges::default();
        }
        Edges::of_welded(&welded(mesh), &mesh.indices)
    }

    /// Edges of triangles whose vertices are the same where their positions are equal (-0.0 equals 0.0).
    pub fn of_positions(positions: &[Vec3], indices: &[u32]) -> Edges {
        Edges::of_welded(&weld_positions(positions), indices)
    }

    /// The entries of [`Edges::incidences`] of an edge, as triangle and sign (+1: winds from `a` to `b`, -1: against).
    pub fn triangles(&self, edge: &Edge) -> impl Iterator<Item = (u32, i32)> + '_ {
        let range = edge.first as usize..(edge.first + edge.count) as usize;
        self.incidences[range].iter().map(|i| (i >> 1, if i & 1 == 0 { 1 } else { -1 }))
    }

    /// `welded[v]` is the lowest vertex that is the same as `v`. Triangles with indices out of range are left out.
    pub(crate) fn of_welded(welded: &[u32], indices: &[u32]) -> Edges {
        let mut sides: Vec<(u64, u32)> = Vec::with_capacity(indices.len());
        for (triangle, corners) in (0u32..).zip(indices.chunks_exact(3)) {
            let [Some(&a), Some(&b), Some(&c)] = [0, 1, 2].map(|i| welded.get(corners[i] as usize)) else { continue };
            if a == b || b == c || c == a {
                continue;
            }
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
                sides.push((key, triangle << 1 | u32::from(from > to)));
            }
        }
        sides.sort_unstable();
        let mut edges: Vec<Edge> = Vec::with_capacity(sides.len() / 2);
        let mut closed = !sides.is_empty();
        let mut first = 0;
        for group in sides.chunk_by(|x, y| x.0 == y.0) {
            let count = group.len() as u32;
            edges.push(Edge { a: (group[0].0 >> 32) as u32, b: group[0].0 as u32, first, count });
            first += count;
            closed &= count == 2 && (group[0].1 ^ group[1].1) & 1 == 1;
        }
        Edges { edges, incidences: sides.into_iter().map(|(_, incidence)| incidence).collect(), closed }
    }
}

/// The lowest vertex that is the same as each: at one place, and moving together where the mesh deforms.
pub(crate) fn welded(mesh: &Mesh) -> Vec<u32> {
    let mut welded = weld_positions(&mesh.positions);
    part_by_motion(&mut welded, mesh);
    welded
}

/// Splits classes of vertices by what moves them; afterwards each class is named by its lowest vertex.
pub(crate) fn part_by_motion(welded: &mut [u32], mesh: &Mesh) {
    if mesh.joints.len() == mesh.positions.len() && mesh.weights.len() == mesh.joints.len() {
        refine(welded, |v| mesh.weights[v].to_array().map(bits));
        // The joint of a weight of zero means nothing; exporters leave anything there.
        refine(welded, |v| std::array::from_fn(|i| if mesh.weights[v][i] == 0.0 { 0 } else { u32::from(mesh.joints[v][i]) }));
    }
    for target in mesh.morph_targets.iter().filter(|t| t.positions.len() == mesh.positions.len()) {
        refine(welded, |v| position_key(target.positions[v]));
    }
}

fn weld_positions(positions: &[Vec3]) -> Vec<u32> {
    let mut welded = vec![0; positions.len()];
    refine(&mut welded, |v| position_key(positions[v]));
    welded
}

/// Splits the classes in `welded` by a further key; afterwards each class is named by its lowest vertex again.
fn refine(welded: &mut [u32], key: impl Fn(usize) -> [u32; 4]) {
    let mut lowest: HashMap<(u32, [u32; 4]), u32, BuildHasherDefault<WordHasher>> = HashMap::default();
    lowest.reserve(welded.len());
    for (vertex, class) in welded.iter_mut().enumerate() {
        *class = *lowest.entry((*class, key(vertex))).or_insert(vertex as u32);
    }
}

fn position_key(p: Vec3) -> [u32; 4] {
    [bits(p.x), bits(p.y), bits(p.z), 0]
}

/// The bits of a number, with -0.0 as 0.0.
fn bits(x: f32) -> u32 {
    (x + 0.0).to_bits()
}

/// Multiplies and folds whole words: coordinates need no protection from chosen collisions, a million of them need speed.
#[derive(Default)]
struct WordHasher(u64);

impl Hasher for WordHasher {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            let mixed = (self.0 ^ u64::from_le_bytes(word)).wrapping_add(0x2545_F491_4F6C_DD1D);
            let product = u128::from(mixed) * 0x9E37_79B9_7F4A_7C15;
            self.0 = (product >> 64) as u64 ^ product as u64;
        }
    }

    fn write_u32(&mut self, word: u32) {
        self.write(&word.to_le_bytes());
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests;
