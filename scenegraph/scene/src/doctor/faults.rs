//! Where the faults of a surface are, for whoever shows them.

use super::soup::Soup;
use crate::Mesh;
use glam::Vec3;

/// Faulty edges as pairs of places, metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultyEdges {
    /// Edges of one triangle.
    pub open: Vec<[Vec3; 2]>,
    /// Edges of more than two triangles.
    pub crowded: Vec<[Vec3; 2]>,
    /// Edges whose two triangles wind against each other.
    pub clashing: Vec<[Vec3; 2]>,
}

/// The faulty edges of a mesh at rest.
pub fn faulty_edges(mesh: &Mesh) -> FaultyEdges {
    let mut out = FaultyEdges::default();
    if mesh.triangle_count() == 0 {
        return out;
    }
    let soup = Soup::new(mesh, 0.0);
    let edges = soup.edges();
    for edge in &edges.edges {
        let signs: i32 = edges.triangles(edge).map(|(_, sign)| sign).sum();
        let list = match edge.count {
            1 => &mut out.open,
            2 if signs == 0 => continue,
            2 => &mut out.clashing,
            _ => &mut out.crowded,
        };
        list.push([edge.a, edge.b].map(|c| soup.places[c as usize]));
    }
    out
}
