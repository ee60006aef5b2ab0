use super::*;
use crate::MorphTarget;
use glam::Vec4;

/// A unit box with four vertices of its own per face, as files have it.
fn closed_box() -> (Vec<Vec3>, Vec<u32>) {
    let (mut positions, mut indices) = (vec![], vec![]);
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            let first = positions.len() as u32;
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let mut p = Vec3::ZERO;
                p[axis] = side;
                p[(axis + 1) % 3] = u;
                p[(axis + 2) % 3] = v;
                positions.push(p);
            }
            let order = if side == 1.0 { [0, 1, 2, 0, 2, 3] } else { [0, 2, 1, 0, 3, 2] };
            indices.extend(order.map(|i| first + i));
        }
    }
    (positions, indices)
}

/// Sums that hold for any soup: incidences are grouped without gaps, each names a triangle that has the edge.
fn verify_invariants(positions: &[Vec3], indices: &[u32], edges: &Edges) {
    let mut next = 0;
    for edge in &edges.edges {
        assert!(edge.first == next && edge.count > 0 && edge.a < edge.b);
        next += edge.count;
        for (triangle, sign) in edges.triangles(edge) {
            let corners: Vec<Vec3> = indices[triangle as usize * 3..][..3].iter().map(|&i| positions[i as usize]).collect();
            let (a, b) = (positions[edge.a as usize], positions[edge.b as usize]);
            let (from, to) = if sign > 0 { (a, b) } else { (b, a) };
            assert!((0..3).any(|i| corners[i] == from && corners[(i + 1) % 3] == to), "{edge:?} {triangle} {sign}");
        }
    }
    assert_eq!(next as usize, edges.incidences.len());
}

/// Name, positions, indices; then the number of edges, of incidences, and closed.
type Row = (&'static str, Vec<Vec3>, Vec<u32>, usize, usize, bool);

#[test]
fn edges_of_small_meshes() {
    let p = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let square = vec![p(0., 0., 0.), p(1., 0., 0.), p(1., 0., 1.), p(0., 0., 1.)];
    let fan = vec![p(0., 0., 0.), p(0., 1., 0.), p(1., 0., 0.), p(-1., 0., 0.), p(0., 0., 1.)];
    let (box_positions, box_indices) = closed_box();
    let mut flipped = box_indices.clone();
    flipped.swap(0, 1);
    let negated = |q: &Vec3| q.map(|c| if c == 0.0 { -0.0 } else { c });
    let mixed_zero = box_positions.iter().enumerate().map(|(i, q)| if i % 3 == 0 { negated(q) } else { *q }).collect();
    let mut nearly = box_positions.clone();
    nearly[0].x = f32::MIN_POSITIVE;
    let rows: Vec<Row> = vec![
        ("nothing", vec![], vec![], 0, 0, false),
        ("closed box", box_positions.clone(), box_indices.clone(), 18, 36, true),
        ("box with signed zeros", mixed_zero, box_indices.clone(), 18, 36, true),
        ("box with a face turned", box_positions.clone(), flipped, 18, 36, false),
        ("box without a triangle", box_positions.clone(), box_indices[3..].to_vec(), 18, 33, false),
        ("box with a nearly equal corner", nearly, box_indices.clone(), 20, 36, false),
        ("open plane", square.clone(), vec![0, 2, 1, 0, 3, 2], 5, 6, false),
        ("plane with a degenerate triangle", square.clone(), vec![0, 2, 1, 0, 3, 2, 1, 1, 2], 5, 6, false),
        ("sheet of two sides", square.clone(), vec![0, 2, 1, 0, 1, 2], 3, 6, true),
        ("fan of three at an edge", fan, vec![0, 1, 2, 0, 1, 3, 0, 1, 4], 7, 9, false),
        ("index out of range", square, vec![0, 2, 1, 0, 3, 9], 3, 3, false),
    ];
    for (name, positions, indices, count, incidences, closed) in rows {
        let edges = Edges::of_positions(&positions, &indices);
        assert_eq!((edges.edges.len(), edges.incidences.len(), edges.closed), (count, incidences, closed), "{name}");
        verify_invariants(&positions, &indices, &edges);
    }
}

#[test]
fn fan_carries_the_signed_sum() {
    let positions = [Vec3::ZERO, Vec3::Y, Vec3::X, Vec3::NEG_X, Vec3::Z];
    let edges = Edges::of_positions(&positions, &[0, 1, 2, 1, 0, 3, 4, 0, 1]);
    let hinge = edges.edges.iter().find(|e| (e.a, e.b) == (0, 1)).unwrap();
    assert_eq!(edges.triangles(hinge).collect::<Vec<_>>(), [(0, 1), (1, -1), (2, 1)]);
}

#[test]
fn vertices_that_may_part_are_not_welded() {
    let (positions, indices) = closed_box();
    let rigid = Mesh { positions: positions.into(), indices: indices.into(), ..Mesh::default() };
    let n = rigid.positions.len();
    let skinned = |odd: [u16; 4], weights: Vec4| Mesh {
        joints: (0..n).map(|v| if v == 5 { odd } else { [0, 7, 7, 7] }).collect(),
        weights: vec![weights; n].into(),
        ..rigid.clone()
    };
    let offsets: Vec<Vec3> = (0..n).map(|v| if v == 5 { Vec3::Y } else { Vec3::ZERO }).collect();
    let morphed =
        Mesh { morph_targets: vec![MorphTarget { positions: offsets.into(), ..MorphTarget::default() }], ..rigid.clone() };
    let half = Vec4::new(0.5, 0.5, 0.0, 0.0);
    for (name, mesh, closed) in [
        ("rigid", rigid.clone(), true),
        ("one other joint", skinned([1, 7, 7, 7], half), false),
        ("other joint without weight", skinned([0, 7, 3, 2], half), true),
        ("one other morph offset", morphed, false),
        ("lines", Mesh { topology: Topology::Lines, ..rigid.clone() }, false),
    ] {
        assert_eq!(Edges::of_mesh(&mesh).closed, closed, "{name}");
    }
}

#[test]
fn a_million_edges() {
    const SIDE: u32 = 578;
    let positions: Vec<Vec3> =
        (0..SIDE * SIDE).map(|i| Vec3::new((i % SIDE) as f32 * 0.1, 0.0, (i / SIDE) as f32 * 0.1)).collect();
    let cell = |x: u32, z: u32| {
        let i = z * SIDE + x;
        [i, i + SIDE, i + 1, i + 1, i + SIDE, i + SIDE + 1]
    };
    let indices: Vec<u32> = (0..SIDE - 1).flat_map(|z| (0..SIDE - 1).flat_map(move |x| cell(x, z))).collect();
    let start = std::time::Instant::now();
    let edges = Edges::of_positions(&positions, &indices);
    println!("{} edges in {:?}", edges.edges.len(), start.elapsed());
    let inner = SIDE - 1;
    assert_eq!(edges.edges.len() as u32, 2 * inner * SIDE + inner * inner);
    assert_eq!(edges.incidences.len(), indices.len());
    assert!(!edges.closed);
    // A hash or a sort that degrades takes minutes; this leaves room for a busy machine.
    assert!(start.elapsed().as_secs() < 20);
}
