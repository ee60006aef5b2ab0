//! Which triangles continue each other across an edge.

use super::soup::Soup;
use crate::adjacency::Edge;
use crate::adjacency::Edges;
use glam::DVec3;
use std::f64::consts::TAU;

/// Triangles whose angles around an edge are the same in such steps lie on each other.
const STEPS_PER_RAD: f64 = 1e5;

/// No triangle.
pub(super) const NONE: u32 = u32::MAX;

/// Across each side of each triangle (from its first corner to its second, and so on), the triangle that goes on there.
pub(super) struct Pairs {
    pub(super) across: Vec<[u32; 3]>,
}

/// How edges of more than two triangles are looked at.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Crowded {
    /// Surfaces end there.
    Open,
    /// Neighbours around the edge continue each other, best so that there is something solid between them.
    Paired,
}

impl Pairs {
    pub(super) fn new(soup: &Soup, edges: &Edges, crowded: Crowded) -> Pairs {
        let mut across = vec![[NONE; 3]; soup.triangles.len()];
        for edge in &edges.edges {
            let pairs = match edge.count {
                0 | 1 => continue,
                2 => {
                    let mut both = edges.triangles(edge).map(|(t, _)| t);
                    both.next().zip(both.next()).into_iter().collect()
                }
                _ if crowded == Crowded::Open => continue,
                _ => paired(soup, edges, edge),
            };
            for (s, t) in pairs {
                across[s as usize][side(soup, s, edge)] = t;
                across[t as usize][side(soup, t, edge)] = s;
            }
        }
        Pairs { across }
    }
}

/// Which side of a triangle lies on the edge.
pub(super) fn side(soup: &Soup, triangle: u32, edge: &Edge) -> usize {
    let corners = soup.corners(triangle as usize);
    let on = |i: &usize| {
        let (from, to) = (corners[*i], corners[(*i + 1) % 3]);
        (from.min(to), from.max(to)) == (edge.a, edge.b)
    };
    (0..3).find(on).unwrap_or(0)
}

/// The triangles at a crowded edge in pairs, by their angle around the edge. Of all ways to pair neighbours the one with
/// most pairs that have their inner sides towards each other; then the one with the least angle between.
pub(super) fn paired(soup: &Soup, edges: &Edges, edge: &Edge) -> Vec<(u32, u32)> {
    let [a, b] = [edge.a, edge.b].map(|c| soup.places[c as usize].as_dvec3());
    let axis = (b - a).normalize_or_zero();
    let (right, up) = axis.any_orthonormal_pair();
    let angle = |t: u32| {
        let corners = soup.corners(t as usize);
        let apex = corners.iter().find(|c| **c != edge.a && **c != edge.b).map_or(a, |c| soup.places[*c as usize].as_dvec3());
        let out: DVec3 = apex - a;
        out.dot(up).atan2(out.dot(right)).rem_euclid(TAU)
    };
    let mut around: Vec<(f64, u32, i32)> = edges.triangles(edge).map(|(t, sign)| (angle(t), t, sign)).collect();
    // Of triangles that lie on each other, those that end something solid come before those that begin it.
    let step = |angle: f64| (angle * STEPS_PER_RAD).round() as i64 % (TAU * STEPS_PER_RAD).round() as i64;
    around.sort_by_key(|(angle, t, sign)| (step(*angle), -sign, *t));
    let count = around.len();
    let starts = if count.is_multiple_of(2) { 2 } else { count };
    let pairs_from = |start: usize| {
        (0..count / 2).map(move |i| ((start + 2 * i) % count, (start + 2 * i + 1) % count)).collect::<Vec<(usize, usize)>>()
    };
    // A triangle that winds with the edge (from a to b) has its front towards larger angles, and the inside at its back.
    let score = |start: &usize| {
        let mut solid = 0;
        let mut angles = 0.0;
        for (i, j) in pairs_from(*start) {
            solid += usize::from(around[i].2 < 0 && around[j].2 > 0);
            angles += (around[j].0 - around[i].0).rem_euclid(TAU);
        }
        (solid, angles)
    };
    let better = |x: &usize, y: &usize| {
        let ((s, a), (t, b)) = (score(x), score(y));
        s.cmp(&t).then(b.total_cmp(&a)).then(y.cmp(x))
    };
    // More triangles at one edge than this are pairs of neighbours, however they lie.
    let start = (0..starts.min(64)).max_by(better).unwrap_or(0);
    pairs_from(start).into_iter().map(|(i, j)| (around[i].1, around[j].1)).collect()
}

/// Which corners of triangles hang together: sets of `3 * triangle + place`, united across sides that go on.
pub(super) fn fans(soup: &Soup, pairs: &Pairs) -> Union {
    let mut fans = Union::new(3 * soup.triangles.len());
    for (s, across) in pairs.across.iter().enumerate() {
        let corners = soup.corners(s);
        for (k, t) in across.iter().enumerate().filter(|(_, t)| **t != NONE) {
            let others = soup.corners(*t as usize);
            for i in [k, (k + 1) % 3] {
                if let Some(j) = others.iter().position(|c| *c == corners[i]) {
                    fans.unite(3 * s as u32 + i as u32, 3 * t + j as u32);
                }
            }
        }
    }
    fans
}

/// Sets of numbers that were united.
pub(super) struct Union(Vec<u32>);

impl Union {
    pub(super) fn new(count: usize) -> Union {
        Union((0..count as u32).collect())
    }

    pub(super) fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    pub(super) fn unite(&mut self, i: u32, j: u32) {
        let (i, j) = (self.root(i), self.root(j));
        self.0[i.max(j) as usize] = i.min(j);
    }
}
