//! Counts what is wrong with a surface.

use super::pairs::{Crowded, NONE, Pairs, Union, fans};
use super::soup::Soup;
use super::{Findings, Mended, drop, junctions};
use crate::adjacency::Edges;
use crate::{Mesh, Topology};
use glam::{DVec3, Vec3};
use std::collections::{HashMap, HashSet};

/// Looks at the triangles of a mesh at rest, as a shadow sees them: vertices at one place are one corner. `near_m`: how
/// close vertices are that are counted as near, metres.
pub fn examine(mesh: &Mesh, near_m: f32) -> Findings {
    let mut findings = Findings { vertices: mesh.positions.len(), ..Findings::default() };
    if mesh.topology != Topology::Triangles {
        return findings;
    }
    vertices(mesh, near_m, &mut findings);
    surface(&Soup::new(mesh, 0.0), &mut findings);
    findings
}

/// The same of what mending gave.
pub(super) fn examine_mended(mesh: &Mesh, mended: &Mended) -> Findings {
    examine(&super::apply::applied(mesh, mended), 0.0)
}

fn vertices(mesh: &Mesh, near_m: f32, findings: &mut Findings) {
    let mut used = vec![false; mesh.positions.len()];
    for v in mesh.indices.iter().filter(|v| (**v as usize) < mesh.positions.len()) {
        used[*v as usize] = true;
    }
    findings.unused_vertices = used.iter().filter(|u| !**u).count();
    findings.not_finite = mesh.positions.iter().filter(|p| !p.is_finite()).count();
    let bits = |p: &Vec3| p.to_array().map(f32::to_bits);
    let (mut places, mut patterns) = (HashSet::new(), HashSet::new());
    for p in mesh.positions.iter().filter(|p| p.is_finite()) {
        let is_known = !places.insert(bits(&(*p + 0.0)));
        let is_same = !patterns.insert(bits(p));
        findings.same_place += usize::from(is_same);
        findings.signed_zeros += usize::from(is_known && !is_same);
    }
    if near_m > 0.0 {
        let exact = Soup::new(mesh, 0.0).places.len();
        findings.near = exact - Soup::new(mesh, near_m).places.len();
    }
}

fn surface(soup: &Soup, findings: &mut Findings) {
    let edges = soup.edges();
    findings.triangles = soup.triangles.len();
    findings.zero_area = (0..soup.triangles.len()).filter(|t| drop::has_no_area(soup, *t)).count();
    findings.copies = drop::copies(soup).len();
    for edge in &edges.edges {
        let length = soup.places[edge.a as usize].distance(soup.places[edge.b as usize]);
        let signs: i32 = edges.triangles(edge).map(|(_, sign)| sign).sum();
        match edge.count {
            1 => {
                findings.open_edges += 1;
                findings.open_length_m += f64::from(length);
            }
            2 if signs != 0 => findings.clashing_edges += 1,
            2 => continue,
            _ => findings.crowded_edges += 1,
        }
        let middle = (soup.places[edge.a as usize] + soup.places[edge.b as usize]) * 0.5;
        findings.first_fault.get_or_insert(middle);
    }
    findings.holes = holes(&edges);
    hanging_together(soup, &edges, findings);
    let (found, all) = junctions::find(soup, &edges);
    findings.t_junctions = found.values().map(Vec::len).sum();
    findings.t_junctions_uncounted = !all;
    if findings.is_sound() {
        let six = (0..soup.triangles.len()).map(|t| soup.points(t)).map(|[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)));
        findings.volume_m3 = Some(six.sum::<f64>() / 6.0);
    }
}

/// Pieces of the border that hang together.
fn holes(edges: &Edges) -> usize {
    let mut known: HashMap<u32, u32> = HashMap::new();
    let open: Vec<(u32, u32)> = edges.edges.iter().filter(|e| e.count == 1).map(|e| (e.a, e.b)).collect();
    for (a, b) in &open {
        for corner in [a, b] {
            let next = known.len() as u32;
            known.entry(*corner).or_insert(next);
        }
    }
    let mut union = Union::new(known.len());
    open.iter().for_each(|(a, b)| union.unite(known[a], known[b]));
    (0..known.len() as u32).filter(|i| union.root(*i) == *i).count()
}

/// Components, Euler's number, and corners where surfaces only touch.
fn hanging_together(soup: &Soup, edges: &Edges, findings: &mut Findings) {
    let mut pieces = Union::new(soup.triangles.len());
    for edge in &edges.edges {
        let mut around = edges.triangles(edge).map(|(t, _)| t);
        if let Some(first) = around.next() {
            around.for_each(|t| pieces.unite(first, t));
        }
    }
    // Triangles without three corners have no edges.
    let mut has_edges = vec![false; soup.triangles.len()];
    edges.incidences.iter().for_each(|i| has_edges[(*i >> 1) as usize] = true);
    let whole = (0..soup.triangles.len()).filter(|t| has_edges[*t]);
    findings.components = whole.clone().filter(|t| pieces.root(*t as u32) == *t as u32).count();

    let pairs = Pairs::new(soup, edges, Crowded::Paired);
    let mut fans = fans(soup, &pairs);
    let mut corners: HashMap<u32, u32> = HashMap::new();
    let mut pinched = HashSet::new();
    for t in whole.clone() {
        for (i, corner) in soup.corners(t).into_iter().enumerate() {
            let fan = fans.root(3 * t as u32 + i as u32);
            if *corners.entry(corner).or_insert(fan) != fan {
                pinched.insert(corner);
            }
        }
    }
    // Corners of crowded edges are told as edges.
    for edge in edges.edges.iter().filter(|e| e.count > 2) {
        pinched.remove(&edge.a);
        pinched.remove(&edge.b);
    }
    debug_assert!(pairs.across.iter().flatten().all(|t| *t == NONE || (*t as usize) < soup.triangles.len()));
    findings.pinched_corners = pinched.len();
    findings.euler = corners.len() as i64 - edges.edges.len() as i64 + whole.count() as i64;
}
