//! Parts surfaces that meet at crowded edges or touch at corners.

use super::pairs::{Crowded, Pairs, fans, paired, side};
use super::soup::{Extra, Soup};
use crate::adjacency::Edge;
use glam::DVec3;
use std::collections::{BTreeMap, HashMap, HashSet};

/// Rounds of [`bend`]; one triangle may have three crowded edges.
const ROUNDS: usize = 8;

/// How far corners are moved apart, as share of the size of the mesh: twice what is welded where nobody says how much.
const GAP: f64 = 2e-6;
/// The same as share of the distance from the origin: some steps of a 32-bit number.
const STEPS: f64 = 5e-7;

/// Parts surfaces at crowded edges and at corners where they touch; gives the number of new corners.
pub(super) fn corners(soup: &mut Soup) -> usize {
    let made = part(soup);
    made + (0..ROUNDS).map(|_| bend(soup)).take_while(|made| *made > 0).sum::<usize>()
}

/// The fans around a corner, and where each uses it: triangle, and place in it.
type Fans = BTreeMap<u32, Vec<(usize, usize)>>;

/// Gives every fan of triangles around a corner a corner of its own, moved a little into the surface's inside.
fn part(soup: &mut Soup) -> usize {
    let edges = soup.edges();
    let pairs = Pairs::new(soup, &edges, Crowded::Paired);
    let mut union = fans(soup, &pairs);
    let mut by_corner: HashMap<u32, Fans> = HashMap::new();
    for t in 0..soup.triangles.len() {
        for (i, corner) in soup.corners(t).into_iter().enumerate() {
            let fan = union.root(3 * t as u32 + i as u32);
            by_corner.entry(corner).or_default().entry(fan).or_default().push((t, i));
        }
    }
    let mut crowded: Vec<(u32, Fans)> = by_corner.into_iter().filter(|(_, f)| f.len() > 1).collect();
    crowded.sort_by_key(|(corner, _)| *corner);
    let mut made = 0;
    for (corner, fans) in crowded {
        let place = soup.places[corner as usize].as_dvec3();
        let gap = (2.0 * GAP * f64::from(soup.radius)).max(STEPS * place.abs().max_element()).max(1e-30);
        // The largest keeps the corner.
        let keeps = fans.iter().max_by_key(|(fan, uses)| (uses.len(), std::cmp::Reverse(**fan))).map(|(fan, _)| *fan);
        let mut taken = vec![soup.places[corner as usize]];
        for (_, uses) in fans.iter().filter(|(fan, _)| Some(**fan) != keeps) {
            let inward = -uses.iter().map(|(t, _)| soup.scaled_normal(*t)).sum::<DVec3>().normalize_or(DVec3::Y);
            let mut moved = place + gap * inward;
            while taken.contains(&moved.as_vec3()) {
                moved += gap * (inward + 0.5 * inward.any_orthonormal_vector());
            }
            taken.push(moved.as_vec3());
            give(soup, uses, moved);
            made += 1;
        }
    }
    made
}

/// A new corner for these places in triangles; vertices that others use too are copied.
fn give(soup: &mut Soup, uses: &[(usize, usize)], place: DVec3) {
    soup.places.push(place.as_vec3());
    let corner = soup.places.len() as u32 - 1;
    let mut copies: HashMap<u32, u32> = HashMap::new();
    for (t, i) in uses {
        let vertex = soup.triangles[*t][*i];
        let copy = *copies.entry(vertex).or_insert_with(|| soup.copy(vertex, None, corner));
        soup.triangles[*t][*i] = copy;
    }
}

/// Where one surface passes an edge twice, its ends cannot be parted. All but one of the passing pairs of triangles get a
/// corner of their own in the middle of the edge instead.
fn bend(soup: &mut Soup) -> usize {
    let edges = soup.edges();
    let mut touched: HashSet<u32> = HashSet::new();
    let mut work: Vec<(Edge, Vec<u32>)> = Vec::new();
    for edge in edges.edges.iter().filter(|e| e.count > 2) {
        let all: Vec<u32> = edges.triangles(edge).map(|(t, _)| t).collect();
        if all.iter().any(|t| touched.contains(t)) {
            continue;
        }
        touched.extend(&all);
        let pairs = paired(soup, &edges, edge);
        let in_pairs: Vec<u32> = pairs.iter().flat_map(|(s, t)| [*s, *t]).collect();
        work.extend(pairs.iter().skip(1).map(|(s, t)| (*edge, vec![*s, *t])));
        work.extend(all.iter().filter(|t| !in_pairs.contains(t)).map(|t| (*edge, vec![*t])));
    }
    for (edge, triangles) in &work {
        // No two at the same place.
        let share = 0.35 + 0.3 * (soup.places.len() as f32 * 0.618_034).fract();
        soup.places.push(soup.places[edge.a as usize].lerp(soup.places[edge.b as usize], share));
        let middle = soup.places.len() as u32 - 1;
        for t in triangles {
            let i = side(soup, *t, edge);
            let [p, q, apex] = [0, 1, 2].map(|k| soup.triangles[*t as usize][(i + k) % 3]);
            let share = if soup.corner_of[p as usize] == edge.a { share } else { 1.0 - share };
            let (from, to) = (soup.original(p), soup.original(q));
            let normal = soup.own_normal(p);
            let m = soup.add(Extra { from, to, share, normal }, middle);
            soup.triangles[*t as usize] = [p, m, apex];
            soup.triangles.push([m, q, apex]);
            soup.turned.push(soup.turned[*t as usize]);
        }
    }
    work.len()
}
