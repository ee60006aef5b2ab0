//! Triangles under treatment: vertices with their looks, corners with their places.

use crate::Mesh;
use crate::adjacency::{Edges, part_by_motion, welded};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// An added vertex before its place is final.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extra {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) share: f32,
    pub(super) normal: Option<Vec3>,
}

/// The surface of a mesh. A *corner* is what vertices at one place have in common.
pub(super) struct Soup {
    /// Vertices of the mesh; those behind are extras.
    pub(super) originals: usize,
    pub(super) extras: Vec<Extra>,
    /// The corner of each vertex.
    pub(super) corner_of: Vec<u32>,
    /// The place of each corner.
    pub(super) places: Vec<Vec3>,
    /// Vertex numbers. Only triangles whose corners are finite and three are among them, unless they await being dropped.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Was the triangle turned?
    pub(super) turned: Vec<bool>,
    /// Vertices that were moved to another one's place.
    pub(super) welded: usize,
    /// Half of the diagonal of the mesh, metres.
    pub(super) radius: f32,
}

impl Soup {
    /// Corners are what is at one place, or at most `weld_m` apart.
    pub(super) fn new(mesh: &Mesh, weld_m: f32) -> Soup {
        let exact = welded(mesh);
        let classes = if weld_m > 0.0 { nearby(mesh, &exact, weld_m) } else { exact };
        let mut places = Vec::new();
        let mut corner_of = vec![u32::MAX; classes.len()];
        let mut moved = 0;
        for (v, lowest) in classes.iter().enumerate() {
            if *lowest as usize == v {
                corner_of[v] = places.len() as u32;
                places.push(mesh.positions[v]);
            } else {
                corner_of[v] = corner_of[*lowest as usize];
                let (here, there) = (mesh.positions[v], mesh.positions[*lowest as usize]);
                moved += usize::from(here.to_array().map(f32::to_bits) != there.to_array().map(f32::to_bits));
            }
        }
        let count = corner_of.len();
        let triangles: Vec<[u32; 3]> = mesh
            .indices
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .filter(|t| t.iter().all(|v| (*v as usize) < count && mesh.positions[*v as usize].is_finite()))
            .collect();
        let radius = crate::Aabb::from_points(mesh.positions.iter().copied()).radius();
        let turned = vec![false; triangles.len()];
        Soup { originals: count, extras: Vec::new(), corner_of, places, triangles, turned, welded: moved, radius }
    }

    /// The corners of a triangle.
    pub(super) fn corners(&self, triangle: usize) -> [u32; 3] {
        self.triangles[triangle].map(|v| self.corner_of[v as usize])
    }

    /// The places of a triangle.
    pub(super) fn points(&self, triangle: usize) -> [DVec3; 3] {
        self.corners(triangle).map(|c| self.places[c as usize].as_dvec3())
    }

    /// The normal of a triangle, as long as twice its area.
    pub(super) fn scaled_normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.points(triangle);
        (b - a).cross(c - a)
    }

    /// Edges between corners. Triangles two of whose corners are one are left out.
    pub(super) fn edges(&self) -> Edges {
        let indices: Vec<u32> = self.triangles.as_flattened().iter().map(|v| self.corner_of[*v as usize]).collect();
        let every: Vec<u32> = (0..self.places.len() as u32).collect();
        Edges::of_welded(&every, &indices)
    }

    /// Adds a vertex at a corner.
    pub(super) fn add(&mut self, extra: Extra, corner: u32) -> u32 {
        self.extras.push(extra);
        self.corner_of.push(corner);
        self.corner_of.len() as u32 - 1
    }

    /// Adds a vertex that looks like another one.
    pub(super) fn copy(&mut self, vertex: u32, normal: Option<Vec3>, corner: u32) -> u32 {
        let like = match (vertex as usize).checked_sub(self.originals) {
            Some(extra) => self.extras[extra],
            None => Extra { from: vertex, to: vertex, share: 0.0, normal: None },
        };
        self.add(Extra { normal: normal.or(like.normal), ..like }, corner)
    }

    /// The normal of an added vertex that has one of its own.
    pub(super) fn own_normal(&self, vertex: u32) -> Option<Vec3> {
        self.extras.get((vertex as usize).checked_sub(self.originals)?)?.normal
    }

    /// The vertex of the mesh that a vertex looks most like.
    pub(super) fn original(&self, vertex: u32) -> u32 {
        match (vertex as usize).checked_sub(self.originals) {
            Some(extra) if self.extras[extra].share > 0.5 => self.extras[extra].to,
            Some(extra) => self.extras[extra].from,
            None => vertex,
        }
    }

    /// Turns a triangle round.
    pub(super) fn turn(&mut self, triangle: usize) {
        self.triangles[triangle].swap(1, 2);
        self.turned[triangle] = !self.turned[triangle];
    }

    /// Keeps the triangles that `keep` names.
    pub(super) fn retain(&mut self, mut keep: impl FnMut(usize) -> bool) {
        let kept: Vec<usize> = (0..self.triangles.len()).filter(|t| keep(*t)).collect();
        self.triangles = kept.iter().map(|t| self.triangles[*t]).collect();
        self.turned = kept.iter().map(|t| self.turned[*t]).collect();
    }
}

/// Joins classes whose places are at most `reach` apart: each joins the lowest one that it can, and only one that is not
/// itself joined to another, so that nothing is drawn along. Vertices that move differently are not joined.
fn nearby(mesh: &Mesh, exact: &[u32], reach: f32) -> Vec<u32> {
    let cell_of = |p: Vec3| (p.as_dvec3() / f64::from(reach)).floor().to_array().map(|x| x as i64);
    // A class of motion per vertex: what may be joined at all.
    let mut motion = vec![0; exact.len()];
    part_by_motion(&mut motion, mesh);
    let mut heads: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut joined = exact.to_vec();
    for (v, lowest) in exact.iter().enumerate() {
        let p = mesh.positions[v];
        if *lowest as usize != v {
            joined[v] = joined[*lowest as usize];
            continue;
        }
        if !p.is_finite() {
            continue;
        }
        let cell = cell_of(p);
        let around = (0..27).map(|i| [cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1]);
        let near = |h: &u32| mesh.positions[*h as usize].distance(p) <= reach && motion[*h as usize] == motion[v];
        let head = around.filter_map(|c| heads.get(&c)).flatten().copied().filter(near).min();
        match head {
            Some(head) => joined[v] = head,
            None => heads.entry(cell).or_default().push(v as u32),
        }
    }
    joined
}
