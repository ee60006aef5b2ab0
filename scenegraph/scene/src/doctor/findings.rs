//! What an examination found.

use std::fmt;

/// The state of the triangles of one mesh. Counts of edges and corners are those of the surface: vertices at one place are
/// one corner.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// Triangles.
    pub triangles: usize,
    /// Vertices, used or not.
    pub vertices: usize,
    /// Pieces that hang together by edges.
    pub components: usize,
    /// Corners minus edges plus triangles; 2 for every sphere.
    pub euler: i64,
    /// Enclosed volume, cubic metres, where the surface is whole; negative where it is inside out.
    pub volume_m3: Option<f64>,
    /// Edges of one triangle.
    pub open_edges: usize,
    /// Their length, metres.
    pub open_length_m: f64,
    /// Closed runs that they form.
    pub holes: usize,
    /// Edges of more than two triangles.
    pub crowded_edges: usize,
    /// Edges whose two triangles wind against each other.
    pub clashing_edges: usize,
    /// Corners at which surfaces meet that share no edge there.
    pub pinched_corners: usize,
    /// Triangles without area.
    pub zero_area: usize,
    /// Triangles whose three corners another one has already, wound the same way.
    pub copies: usize,
    /// Vertices at the place of an earlier one, bit by bit.
    pub same_place: usize,
    /// Vertices at the place of an earlier one, but for the sign of a zero.
    pub signed_zeros: usize,
    /// Vertices that welding would move to an earlier one.
    pub near: usize,
    /// Corners that lie on an open edge without being its end (T-junctions).
    pub t_junctions: usize,
    /// There were too many open edges to look for all T-junctions.
    pub t_junctions_uncounted: bool,
    /// Vertices that no triangle uses.
    pub unused_vertices: usize,
    /// Vertices whose place is NaN or infinite; their triangles are left out of everything else.
    pub not_finite: usize,
    /// Where the first open, crowded or clashing edge is, metres.
    pub first_fault: Option<glam::Vec3>,
}

impl Findings {
    /// Every edge has at least two triangles.
    pub fn is_closed(&self) -> bool {
        self.triangles > 0 && self.open_edges == 0
    }

    /// No edge has more than two triangles, and no corner joins what shares no edge.
    pub fn is_two_manifold(&self) -> bool {
        self.triangles > 0 && self.crowded_edges == 0 && self.pinched_corners == 0
    }

    /// Triangles with a common edge wind alike.
    pub fn is_oriented(&self) -> bool {
        self.triangles > 0 && self.clashing_edges == 0
    }

    /// Closed, two-manifold and consistently oriented: the surface of something solid.
    pub fn is_sound(&self) -> bool {
        self.is_closed() && self.is_two_manifold() && self.is_oriented()
    }

    /// Holes through the solid, as through a ring; where the surface is sound.
    pub fn genus(&self) -> Option<i64> {
        self.is_sound().then(|| (2 * self.components as i64 - self.euler) / 2)
    }

    /// What stands in the way of a sound surface; empty where nothing does.
    pub fn faults(&self) -> Vec<String> {
        let (open, length) = (self.open_edges, self.open_length_m);
        let at_least = if self.t_junctions_uncounted { "at least " } else { "" };
        let rows = [
            (self.triangles == 0, "no triangles".to_owned()),
            (open > 0, format!("{open} open edges, {length:.4} m, around {} holes", self.holes)),
            (self.crowded_edges > 0, format!("{} edges of more than two triangles", self.crowded_edges)),
            (self.pinched_corners > 0, format!("{} corners where surfaces only touch", self.pinched_corners)),
            (self.clashing_edges > 0, format!("{} edges whose triangles wind against each other", self.clashing_edges)),
            (self.t_junctions > 0, format!("{at_least}{} T-junctions", self.t_junctions)),
            (self.not_finite > 0, format!("{} vertices that are not finite", self.not_finite)),
        ];
        rows.into_iter().filter(|(is, _)| *is).map(|(_, text)| text).collect()
    }

    /// What is untidy, but harmless.
    pub fn remarks(&self) -> Vec<String> {
        let rows = [
            (self.zero_area, "triangles without area"),
            (self.copies, "copies of triangles"),
            (self.signed_zeros, "vertices that differ in the sign of a zero"),
            (self.near, "vertices close to another"),
            (self.unused_vertices, "vertices without triangle"),
        ];
        rows.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect()
    }
}

impl fmt::Display for Findings {
    /// Two lines and more: the numbers, the verdict, then one for each fault, then the remarks.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let yes = |is: bool| if is { "yes" } else { "NO" };
        write!(f, "{} triangles, {} vertices ({} at a place of another)", self.triangles, self.vertices, self.same_place)?;
        write!(f, ", {} components, Euler {}", self.components, self.euler)?;
        if let Some(genus) = self.genus() {
            write!(f, ", genus {genus}")?;
        }
        if let Some(volume) = self.volume_m3 {
            let inside_out = if volume < 0.0 { ", inside out" } else { "" };
            match volume.abs() {
                0.0 | 1e-3..1e9 => write!(f, ", {volume:.6} m3{inside_out}")?,
                _ => write!(f, ", {volume:.6e} m3{inside_out}")?,
            }
        }
        write!(f, "\nclosed {}, ", yes(self.is_closed()))?;
        write!(f, "two-manifold {}, oriented {}", yes(self.is_two_manifold()), yes(self.is_oriented()))?;
        for fault in self.faults() {
            write!(f, "\n- {fault}")?;
        }
        if let Some(p) = self.first_fault {
            write!(f, "\n  the first near ({:.4}, {:.4}, {:.4})", p.x, p.y, p.z)?;
        }
        let remarks = self.remarks();
        if remarks.is_empty() { Ok(()) } else { write!(f, "\n  also {}", remarks.join(", ")) }
    }
}
