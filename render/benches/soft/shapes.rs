//! The casters of 004's table 3, with as many polygons.

use glam::Vec3;
use std::f32::consts::{PI, TAU};
use umbriel_scene::Mesh;

/// Quads between rows of points, each row closed; `closed` joins the last row with the first.
fn rows(rows: u32, around: u32, closed: bool, at: impl Fn(u32, u32) -> Vec3) -> (Vec<Vec3>, Vec<u32>) {
    let positions = (0..rows).flat_map(|r| (0..around).map(move |s| (r, s))).map(|(r, s)| at(r, s)).collect();
    let mut indices = Vec::new();
    for r in 0..if closed { rows } else { rows - 1 } {
        for s in 0..around {
            let place = |r: u32, s: u32| (r % rows) * around + s % around;
            let [a, b, c, d] = [place(r, s), place(r + 1, s), place(r + 1, s + 1), place(r, s + 1)];
            indices.extend([a, b, c, a, c, d]);
        }
    }
    (positions, indices)
}

/// Closes the first and the last row with a point each.
fn capped((mut positions, mut indices): (Vec<Vec3>, Vec<u32>), around: u32, [start, end]: [Vec3; 2]) -> Mesh {
    let last = positions.len() as u32 - around;
    let tip = positions.len() as u32;
    positions.extend([start, end]);
    for s in 0..around {
        let next = (s + 1) % around;
        indices.extend([tip, s, next, tip + 1, last + next, last + s]);
    }
    mesh(positions, indices)
}

fn mesh(positions: Vec<Vec3>, indices: Vec<u32>) -> Mesh {
    let centre = positions.iter().sum::<Vec3>() / positions.len() as f32;
    let normals = positions.iter().map(|p| (*p - centre).normalize_or(Vec3::Y)).collect();
    Mesh { positions: positions.into(), indices: indices.into(), normals, ..Default::default() }.checked().expect("it is a mesh")
}

/// A pillar of 176 triangles, 3 m high.
pub(crate) fn pillar() -> Mesh {
    let around = 44;
    let ring = |r: u32, s: u32| {
        let turn = TAU * s as f32 / around as f32;
        Vec3::new(0.3 * turn.cos(), 3.0 * (1 - r) as f32, -0.3 * turn.sin())
    };
    capped(rows(2, around, false, ring), around, [Vec3::Y * 3.0, Vec3::ZERO])
}

/// A ball of 1472 triangles, 1.4 m across.
pub(crate) fn ball() -> Mesh {
    let (rings, around) = (24, 32);
    let point = |r: u32, s: u32| {
        let (lat, lon) = (PI * (r + 1) as f32 / rings as f32, TAU * s as f32 / around as f32);
        Vec3::Y * 1.6 + 0.7 * Vec3::new(lat.sin() * lon.cos(), lat.cos(), -lat.sin() * lon.sin())
    };
    capped(rows(rings - 1, around, false, point), around, [Vec3::Y * 2.3, Vec3::Y * 0.9])
}

/// In place of the dragon: a knot with two octahedra, 26 584 triangles, 2 m high.
pub(crate) fn knot() -> Mesh {
    let (along, around) = (123, 108);
    let middle = |t: f32| {
        Vec3::new((2.0 + (3.0 * t).cos()) * (2.0 * t).cos(), (3.0 * t).sin() * 1.6, (2.0 + (3.0 * t).cos()) * (2.0 * t).sin())
    };
    let point = |r: u32, s: u32| {
        let (t, turn) = (TAU * r as f32 / along as f32, TAU * s as f32 / around as f32);
        let ahead = (middle(t + 1e-3) - middle(t)).normalize();
        let side = ahead.cross(Vec3::Y).normalize();
        (middle(t) + 0.45 * (side * turn.cos() + ahead.cross(side) * turn.sin())) * 0.45 + Vec3::Y * 1.4
    };
    let (mut positions, mut indices) = rows(along, around, true, point);
    for x in [-0.3, 0.3] {
        let first = positions.len() as u32;
        let corners = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
        positions.extend(corners.map(|c| c * 0.12 + Vec3::new(x, 2.6, 0.0)));
        let faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
        indices.extend(faces.iter().flatten().map(|i| first + i));
    }
    mesh(positions, indices)
}
