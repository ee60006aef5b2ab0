//! Tells whether the triangles of a mesh are closed, two-manifold and consistently oriented, and mends them.
//!
//! The one idea: *topology* and *looks* are kept apart. Vertices that are at one place are one corner of the surface,
//! whatever their normals and texture coordinates; [`mend`] works on corners, and gives back a [`Mended`]: new indices,
//! and what became of vertices, so that whoever stores the mesh (a scene, a glTF file) applies it to all attributes that
//! he knows. Nothing is done that [`Steps`] does not ask for, and all that was done is counted in [`Done`].
//!
//! Surfaces that cut through themselves are not looked for: shadow volumes do not mind them (000 future work 1 asks for
//! closed and two-manifold).

mod apply;
mod cap;
mod drop;
mod examine;
mod faults;
mod findings;
mod junctions;
mod orient;
mod pairs;
mod soup;
mod split;
#[cfg(test)]
mod tests;
mod turn;

pub use examine::examine;
pub use faults::{FaultyEdges, faulty_edges};
pub use findings::Findings;

use crate::{Mesh, Topology};
use glam::Vec3;
use soup::Soup;

/// What [`mend`] may do. Nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Steps {
    /// Moves vertices that are at most so far apart to one place, metres; 0 joins only -0.0 and 0.0.
    pub weld_m: Option<f32>,
    /// Leaves out triangles without area, and all but one of triangles that are there several times.
    pub drop: bool,
    /// Splits triangles of open edges at the corners of others that lie on these edges (T-junctions).
    pub stitch: bool,
    /// Parts surfaces that meet at edges of more than two triangles, or at single corners, by a millionth of their size.
    pub split: bool,
    /// Turns triangles so that neighbours wind alike, and closed surfaces outward; open ones keep their side.
    pub orient: bool,
    /// Closes holes with triangles of their own.
    pub cap: bool,
}

impl Steps {
    /// Every step; vertices are welded over `weld_m`.
    pub fn all(weld_m: f32) -> Steps {
        Steps { weld_m: Some(weld_m), drop: true, stitch: true, split: true, orient: true, cap: true }
    }

    /// Is nothing asked for?
    pub fn is_none(&self) -> bool {
        *self == Steps::default()
    }
}

/// A distance over which vertices of a mesh may be welded where nobody says one: a millionth of its size, metres.
pub fn natural_weld_m(mesh: &Mesh) -> f32 {
    1e-6 * 2.0 * crate::Aabb::from_points(mesh.positions.iter().copied()).radius()
}

/// A vertex that mending added behind those of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Added {
    /// The vertex that its attributes come from; itself no added one.
    pub from: u32,
    /// The vertex that they go towards.
    pub to: u32,
    /// Share of `to`, 0..=1.
    pub share: f32,
    /// The vertex whose joints, weights and morph offsets it has: one that stands at its place, if there is any.
    pub moves_like: u32,
    /// Its place, metres.
    pub position: Vec3,
    /// Its unit normal, where it is not that of `from` and `to`.
    pub normal: Option<Vec3>,
}

/// How often each step did something.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Done {
    /// Vertices moved to the place of another.
    pub welded: usize,
    /// Triangles without area left out.
    pub dropped: usize,
    /// Triangles left out because they were there already.
    pub dropped_copies: usize,
    /// Corners that triangles were split at.
    pub stitched: usize,
    /// Corners that surfaces were parted at.
    pub split: usize,
    /// Triangles turned round.
    pub turned: usize,
    /// Holes closed.
    pub capped: usize,
    /// Triangles that close them.
    pub cap_triangles: usize,
}

impl Done {
    /// Was nothing done?
    pub fn is_nothing(&self) -> bool {
        *self == Done::default()
    }
}

impl std::fmt::Display for Done {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parts = [
            (self.welded, "vertices welded"),
            (self.dropped, "triangles without area left out"),
            (self.dropped_copies, "copies of triangles left out"),
            (self.stitched, "T-junctions stitched"),
            (self.split, "corners split"),
            (self.turned, "triangles turned"),
            (self.capped, "holes capped"),
            (self.cap_triangles, "triangles added for that"),
        ];
        let parts: Vec<String> = parts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
        f.write_str(if parts.is_empty() { "nothing" } else { "" })?;
        f.write_str(&parts.join(", "))
    }
}

/// What became of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mended {
    /// The triangles, which name vertices of the mesh and, behind these, added ones.
    pub indices: Vec<u32>,
    /// Vertices of the mesh that moved, ascending, and their new places, metres.
    pub moved: Vec<(u32, Vec3)>,
    /// Vertices of the mesh whose normal and tangent point to the other side now, ascending.
    pub turned: Vec<u32>,
    /// Vertices that were added.
    pub added: Vec<Added>,
    /// What was done.
    pub done: Done,
    /// The surface as it is now.
    pub findings: Findings,
}

/// Mends the triangles of a mesh, at rest. Lines and points stay as they are.
pub fn mend(mesh: &Mesh, steps: &Steps) -> Mended {
    if mesh.topology != Topology::Triangles {
        let findings = Findings { vertices: mesh.positions.len(), ..Findings::default() };
        return Mended { indices: mesh.indices.to_vec(), findings, ..Mended::default() };
    }
    let mut soup = Soup::new(mesh, steps.weld_m.unwrap_or(0.0));
    let mut done = Done { welded: if steps.weld_m.is_some() { soup.welded } else { 0 }, ..Done::default() };
    if steps.drop {
        drop::triangles(&mut soup, &mut done);
    }
    if steps.stitch {
        done.stitched += junctions::stitch(&mut soup);
    }
    if steps.split {
        done.split += split::corners(&mut soup);
    }
    if steps.orient {
        orient::turn(&mut soup, true);
    }
    // A cap may meet an edge that is there already, so that surfaces have to be parted again, which may open others.
    for _ in 0..4 {
        let capped = if steps.cap { cap::holes(&mut soup, &mut done) } else { 0 };
        let split = if steps.split && capped > 0 { split::corners(&mut soup) } else { 0 };
        done.split += split;
        if capped == 0 || split == 0 {
            break;
        }
    }
    if steps.orient && done.capped > 0 {
        orient::turn(&mut soup, false);
    }
    done.turned = soup.turned.iter().filter(|t| **t).count();
    let mut mended = apply::finish(soup, mesh, steps, done);
    mended.findings = examine::examine_mended(mesh, &mended);
    mended
}
