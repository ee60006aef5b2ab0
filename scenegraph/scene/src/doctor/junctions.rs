//! T-junctions: corners of the border that lie on the edge of a neighbour.

use super::soup::{Extra, Soup};
use crate::adjacency::Edges;
use glam::Vec3;
use std::collections::HashMap;

/// Rounds of stitching; one triangle may have junctions on several sides.
const ROUNDS: usize = 8;
/// Comparisons of corners with edges for each of them, on average, before the search gives up.
const PATIENCE: usize = 256;

/// By edge's place in the list: the corners on it in the order from `a` to `b`, with their share of the way. Also, whether
/// all edges were looked at.
pub(super) fn find(soup: &Soup, edges: &Edges) -> (HashMap<usize, Vec<(f64, u32)>>, bool) {
    let open: Vec<usize> = (0..edges.edges.len()).filter(|e| edges.edges[*e].count == 1).collect();
    let mut corners: Vec<u32> = open.iter().flat_map(|e| [edges.edges[*e].a, edges.edges[*e].b]).collect();
    corners.sort_unstable();
    corners.dedup();
    // By each axis, so that every edge looks along the one on which least lies beside it.
    let sorted: [Vec<(Vec3, u32)>; 3] = std::array::from_fn(|axis| {
        let mut list: Vec<(Vec3, u32)> = corners.iter().map(|c| (soup.places[*c as usize], *c)).collect();
        list.sort_by(|x, y| x.0[axis].total_cmp(&y.0[axis]));
        list
    });
    let slack = 1e-6 * soup.radius;
    let mut budget = PATIENCE * (corners.len() + 4096);
    let (mut found, mut all) = (HashMap::new(), true);
    for e in open {
        let edge = &edges.edges[e];
        let (a, b) = (soup.places[edge.a as usize], soup.places[edge.b as usize]);
        let (low, high) = (a.min(b) - slack, a.max(b) + slack);
        let range = |axis: usize| {
            let list = &sorted[axis];
            list.partition_point(|(p, _)| p[axis] < low[axis])..list.partition_point(|(p, _)| p[axis] <= high[axis])
        };
        let (axis, candidates) = (0..3).map(|axis| (axis, range(axis))).min_by_key(|(_, r)| r.len()).unwrap_or((0, 0..0));
        let Some(left) = budget.checked_sub(candidates.len()) else {
            all = false;
            continue;
        };
        budget = left;
        let (from, way) = (a.as_dvec3(), (b - a).as_dvec3());
        let mut on: Vec<(f64, u32)> = Vec::new();
        let beside = sorted[axis][candidates].iter().filter(|(p, _)| p.cmpge(low).all() && p.cmple(high).all());
        for (place, corner) in beside.filter(|(_, c)| *c != edge.a && *c != edge.b) {
            let offset = place.as_dvec3() - from;
            let share = offset.dot(way) / way.length_squared();
            if share > 0.0 && share < 1.0 && (offset - share * way).length() <= f64::from(slack) {
                on.push((share, *corner));
            }
        }
        if !on.is_empty() {
            on.sort_by(|x, y| x.0.total_cmp(&y.0));
            found.insert(e, on);
        }
    }
    (found, all)
}

/// Splits triangles of open edges at the corners that lie on these edges; gives the number of corners.
pub(super) fn stitch(soup: &mut Soup) -> usize {
    let mut stitched = 0;
    for _ in 0..ROUNDS {
        let edges = soup.edges();
        let (found, _) = find(soup, &edges);
        let mut by_triangle: HashMap<u32, usize> = HashMap::new();
        let mut places: Vec<&usize> = found.keys().collect();
        places.sort_unstable();
        for e in places {
            if let Some((t, _)) = edges.triangles(&edges.edges[*e]).next() {
                by_triangle.entry(t).or_insert(*e); // the other sides come in later rounds
            }
        }
        if by_triangle.is_empty() {
            break;
        }
        let mut work: Vec<(u32, usize)> = by_triangle.into_iter().collect();
        work.sort_unstable();
        for (t, e) in work {
            stitched += split(soup, t as usize, (edges.edges[e].a, edges.edges[e].b), &found[&e]);
        }
    }
    stitched
}

/// Replaces a triangle by a fan over the corners on one of its sides.
fn split(soup: &mut Soup, triangle: usize, (a, b): (u32, u32), on: &[(f64, u32)]) -> usize {
    let corners = soup.corners(triangle);
    let is_side = |i: &usize| {
        let (from, to) = (corners[*i], corners[(*i + 1) % 3]);
        (from, to) == (a, b) || (from, to) == (b, a)
    };
    let Some(side) = (0..3).find(is_side) else { return 0 };
    if on.iter().any(|(_, corner)| *corner == corners[(side + 2) % 3]) {
        return 0; // the triangle is flat
    }
    let mut vertices = soup.triangles[triangle];
    vertices.rotate_left(side);
    let [from, to, apex] = vertices;
    let is_forward = corners[side] == a;
    let mut line = vec![from];
    let along: Vec<(f64, u32)> =
        if is_forward { on.to_vec() } else { on.iter().rev().map(|(share, corner)| (1.0 - share, *corner)).collect() };
    for (share, corner) in &along {
        let (x, y) = (soup.original(from), soup.original(to));
        let extra = Extra { from: x, to: y, share: *share as f32, normal: None };
        line.push(soup.add(extra, *corner));
    }
    line.push(to);
    let was_turned = soup.turned[triangle];
    soup.triangles[triangle] = [line[0], line[1], apex];
    for pair in line[1..].windows(2) {
        soup.triangles.push([pair[0], pair[1], apex]);
        soup.turned.push(was_turned);
    }
    on.len()
}
