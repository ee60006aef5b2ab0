//! Triangles that are nothing, or are there twice.

use super::soup::Soup;
use super::{Done, junctions};
use std::collections::HashMap;

/// Height over longest side below which a triangle counts as having no area.
const FLAT: f64 = 1e-7;

/// Two corners are one, or all three lie on a line.
pub(super) fn has_no_area(soup: &Soup, triangle: usize) -> bool {
    let [a, b, c] = soup.corners(triangle);
    a == b || b == c || c == a || lies_on_a_line(soup, triangle)
}

fn lies_on_a_line(soup: &Soup, triangle: usize) -> bool {
    let [a, b, c] = soup.points(triangle);
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    soup.scaled_normal(triangle).length() <= FLAT * longest
}

/// Triangles that another one before them equals, corner for corner and turn for turn.
pub(super) fn copies(soup: &Soup) -> Vec<usize> {
    let mut seen: HashMap<[u32; 3], ()> = HashMap::new();
    let is_copy = |t: &usize| {
        let mut corners = soup.corners(*t);
        let least = (0..3).min_by_key(|i| corners[*i]).unwrap_or(0);
        corners.rotate_left(least);
        seen.insert(corners, ()).is_some()
    };
    (0..soup.triangles.len()).filter(is_copy).collect()
}

/// Leaves them out. Where one whose corners lie on a line closed a T-junction, its neighbour across the long side is split
/// instead, so that a closed surface stays closed.
pub(super) fn triangles(soup: &mut Soup, done: &mut Done) {
    let nothing: Vec<bool> = (0..soup.triangles.len()).map(|t| has_no_area(soup, t)).collect();
    let on_a_line = (0..soup.triangles.len()).filter(|t| nothing[*t]).any(|t| {
        let [a, b, c] = soup.corners(t);
        a != b && b != c && c != a
    });
    done.dropped = nothing.iter().filter(|n| **n).count();
    soup.retain(|t| !nothing[t]);
    if on_a_line {
        done.stitched += junctions::stitch(soup);
    }
    let copies = copies(soup);
    done.dropped_copies = copies.len();
    let mut is_copy = vec![false; soup.triangles.len()];
    copies.into_iter().for_each(|t| is_copy[t] = true);
    soup.retain(|t| !is_copy[t]);
}
