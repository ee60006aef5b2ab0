//! Surfaces with known faults, and random damage to whole ones.

use super::{Findings, Mended, Steps, examine, mend, natural_weld_m};
use crate::Mesh;
use glam::Vec3;
use proptest::prelude::*;
use proptest::test_runner::Config;

fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
    let positions: Vec<Vec3> = positions.iter().map(|p| Vec3::from_array(*p)).collect();
    Mesh { positions: positions.into(), indices: triangles.as_flattened().into(), ..Mesh::default() }.checked().unwrap()
}

/// A box between two corners; faces have vertices of their own, as their normals differ.
fn cuboid(min: [f32; 3], max: [f32; 3]) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let corner = |i: usize| std::array::from_fn(|axis| if i >> axis & 1 == 0 { min[axis] } else { max[axis] });
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for face in faces {
        let first = positions.len() as u32;
        positions.extend(face.map(corner));
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    (positions, triangles)
}

fn cube() -> Mesh {
    let (positions, triangles) = cuboid([0.0; 3], [1.0; 3]);
    mesh(&positions, &triangles)
}

fn both(a: (Vec<[f32; 3]>, Vec<[u32; 3]>), b: (Vec<[f32; 3]>, Vec<[u32; 3]>)) -> Mesh {
    let shift = a.0.len() as u32;
    let triangles: Vec<[u32; 3]> = a.1.into_iter().chain(b.1.into_iter().map(|t| t.map(|v| v + shift))).collect();
    mesh(&[a.0, b.0].concat(), &triangles)
}

/// A ring of tubes, of genus 1, with one vertex per corner.
fn torus(around: u32, across: u32) -> Mesh {
    let turn = std::f32::consts::TAU;
    let mut positions = Vec::new();
    for i in 0..around {
        let (s, c) = (turn * i as f32 / around as f32).sin_cos();
        for j in 0..across {
            let (t, d) = (turn * j as f32 / across as f32).sin_cos();
            positions.push([c * (2.0 + d), t, -s * (2.0 + d)]);
        }
    }
    let at = |i: u32, j: u32| i % around * across + j % across;
    let quad = |(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    let triangles: Vec<[u32; 3]> = (0..around).flat_map(|i| (0..across).map(move |j| (i, j))).flat_map(quad).collect();
    mesh(&positions, &triangles)
}

fn without(mesh: &Mesh, triangles: &[usize]) -> Mesh {
    let kept = mesh.indices.chunks_exact(3).enumerate().filter(|(i, _)| !triangles.contains(i)).flat_map(|(_, t)| t);
    Mesh { indices: kept.copied().collect(), ..mesh.clone() }
}

fn flipped(mesh: &Mesh, which: impl Fn(usize) -> bool) -> Mesh {
    let turn = |(i, t): (usize, &[u32])| if which(i) { [t[0], t[2], t[1]] } else { [t[0], t[1], t[2]] };
    Mesh { indices: mesh.indices.chunks_exact(3).enumerate().flat_map(turn).collect(), ..mesh.clone() }
}

fn all(mesh: &Mesh) -> Mended {
    mend(mesh, &Steps::all(natural_weld_m(mesh)))
}

/// Open, crowded, clashing edges; pinched corners, T-junctions, triangles without area, copies.
fn counts(f: &Findings) -> [usize; 7] {
    [f.open_edges, f.crowded_edges, f.clashing_edges, f.pinched_corners, f.t_junctions, f.zero_area, f.copies]
}

#[test]
fn faults_are_counted_and_mended() {
    let unit = cuboid([0.0; 3], [1.0; 3]);
    let sheet = mesh(&[[0., 0., 0.], [1., 0., 0.], [1., 0., 1.], [0., 0., 1.]], &[[0, 2, 1], [0, 3, 2]]);
    let mut jittered = cube();
    jittered.positions = jittered.positions.iter().enumerate().map(|(i, p)| *p + 1e-7 * (i % 3) as f32).collect();
    let mut t_junction = unit.clone();
    // The top's diagonal gets a corner in its middle on one side only.
    t_junction.0.push([0.5, 0.5, 1.0]);
    let [a, b, c] = t_junction.1.remove(2);
    t_junction.1.extend([[a, b, 24], [b, c, 24]]);
    let mut flat = unit.clone();
    flat.1.push([0, 1, 1]);
    let copied = [unit.1.clone(), vec![unit.1[3]]].concat();
    // The three triangles of a wing: two of a wall, and one that stands on their common edge.
    let wing = mesh(&[[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [-1., 0., 0.], [0., 0., 1.]], &[[0, 2, 1], [0, 1, 3], [0, 1, 4]]);
    let rows: Vec<(&str, Mesh, [usize; 7], bool)> = vec![
        ("cube", cube(), [0; 7], true),
        ("torus", torus(8, 6), [0; 7], true),
        ("one triangle gone", without(&cube(), &[0]), [3, 0, 0, 0, 0, 0, 0], true),
        ("one side gone", without(&cube(), &[4, 5]), [4, 0, 0, 0, 0, 0, 0], true),
        ("two sides gone", without(&cube(), &[0, 1, 4, 5]), [6, 0, 0, 0, 0, 0, 0], true),
        ("a triangle turned", flipped(&cube(), |i| i == 3), [0, 0, 3, 0, 0, 0, 0], true),
        ("inside out", flipped(&cube(), |_| true), [0; 7], true),
        ("a sheet", sheet, [4, 0, 0, 0, 0, 0, 0], true),
        ("boxes with a common edge", both(unit.clone(), cuboid([1., 1., 0.], [2., 2., 1.])), [0, 1, 0, 0, 0, 0, 0], true),
        ("boxes with a common corner", both(unit.clone(), cuboid([1.; 3], [2.; 3])), [0, 0, 0, 1, 0, 0, 0], true),
        ("boxes with a common side", both(unit.clone(), cuboid([1., 0., 0.], [2., 1., 1.])), [0, 5, 0, 0, 0, 0, 0], true),
        ("a T-junction", mesh(&t_junction.0, &t_junction.1), [3, 0, 0, 0, 1, 0, 0], true),
        ("a triangle of two corners", mesh(&flat.0, &flat.1), [0, 0, 0, 0, 0, 1, 0], true),
        ("a triangle twice", mesh(&unit.0, &copied), [0, 3, 0, 0, 0, 0, 1], true),
        ("a wing", wing, [6, 1, 0, 0, 0, 0, 0], true),
        ("nothing", mesh(&[[0.; 3]], &[]), [0; 7], false),
    ];
    for (name, mesh, expected, sound) in rows {
        let before = examine(&mesh, 0.0);
        assert_eq!(counts(&before), expected, "{name}: {before}");
        let mended = all(&mesh);
        assert_eq!(mended.findings.is_sound(), sound, "{name}: {}\ndone: {}", mended.findings, mended.done);
        assert_eq!(counts(&mended.findings), [0; 7], "{name}: {}", mended.findings);
        let volume = mended.findings.volume_m3.unwrap_or(0.0);
        assert!(volume >= -1e-4, "{name}: {volume} m3 inside out");
        let again = all(&mended.apply(&mesh));
        assert!(again.is_unchanged(), "{name}: mended twice: {}", again.done);
    }
    assert!(!examine(&jittered, 0.0).is_closed());
    let mended = all(&jittered);
    assert!(mended.findings.is_sound() && mended.done.welded > 0 && mended.added.is_empty(), "{}", mended.findings);
}

#[test]
fn nothing_is_done_unasked() {
    let torn = without(&flipped(&cube(), |i| i == 3), &[0]);
    let mended = mend(&torn, &Steps::default());
    assert!(mended.is_unchanged());
    assert_eq!(mended.apply(&torn), torn);
    // Each step alone.
    let only = |steps: Steps| mend(&torn, &steps).done;
    assert_eq!(only(Steps { orient: true, ..Steps::default() }).turned, 1);
    let capped = only(Steps { cap: true, ..Steps::default() });
    assert_eq!((capped.capped > 0, capped.turned), (true, 0));
}

#[test]
fn genus_volume_and_cavities() {
    let ring = examine(&torus(32, 16), 0.0);
    assert_eq!((ring.genus(), ring.components, ring.euler), (Some(1), 1, 0));
    let hollow = {
        let (inner, t) = cuboid([0.25; 3], [0.75; 3]);
        both(cuboid([0.0; 3], [1.0; 3]), (inner, t.into_iter().map(|[a, b, c]| [a, c, b]).collect()))
    };
    let mended = all(&hollow);
    assert!(mended.is_unchanged(), "{}", mended.done);
    assert_eq!(mended.findings.volume_m3.map(|v| (v * 1e3).round()), Some(875.0));
}

#[test]
fn looks_survive() {
    let mut torn = without(&flipped(&cube(), |i| i == 6 || i == 7), &[0]);
    torn.uv0 = torn.positions.iter().map(|p| p.truncate()).collect();
    let mended = all(&torn);
    let after = mended.apply(&torn);
    assert!(after.clone().checked().is_ok());
    assert_eq!(after.uv0[..torn.uv0.len()], torn.uv0[..], "old vertices keep their texture coordinates");
    for t in after.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| after.positions[i as usize]);
        let face = (b - a).cross(c - a);
        assert!(t.iter().all(|v| after.normals[*v as usize].dot(face) > 0.0), "a normal points away from its triangle");
    }
}

#[test]
fn vertices_that_move_differently_are_not_welded() {
    let mut torn = cube();
    torn.joints = (0..24).map(|v| [u16::from(v >= 4), 0, 0, 0]).collect();
    torn.weights = vec![glam::Vec4::X; 24].into();
    let mended = mend(&torn, &Steps { weld_m: Some(0.01), ..Steps::default() });
    assert_eq!(mended.findings.open_edges, 8, "the first side comes off when its joint turns");
}

#[test]
fn bad_input() {
    let mut broken = cube();
    broken.positions = broken.positions.iter().enumerate().map(|(i, p)| if i == 5 { Vec3::NAN } else { *p }).collect();
    let findings = examine(&broken, 1e-3);
    assert_eq!(findings.not_finite, 1);
    assert!(!findings.is_closed() && findings.faults().len() == 2, "{findings}");
    let mended = all(&broken);
    assert!(mended.indices.iter().all(|v| *v != 5), "the broken vertex is not used any more");
    assert_eq!(examine(&Mesh::default(), 1.0).faults(), ["no triangles"]);
}

/// A million open edges in a fraction of a minute, also where they all lie on one line.
#[test]
fn many_open_edges_are_bounded() {
    let soup = |place: fn(u32) -> [f32; 3]| {
        let positions: Vec<[f32; 3]> = (0..60_000).map(place).collect();
        let triangles: Vec<[u32; 3]> = (0..20_000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        mesh(&positions, &triangles)
    };
    let scattered = examine(&soup(|i| [(i * 7919 % 60_013) as f32, (i % 977) as f32, (i % 3) as f32]), 0.0);
    assert_eq!(scattered.open_edges, 60_000);
    let on_a_line = examine(&soup(|i| [if i % 3 == 2 { i as f32 } else { -(i as f32) }, 0.0, (i % 3 / 2) as f32]), 0.0);
    assert!(on_a_line.open_edges > 0 && on_a_line.t_junctions_uncounted, "{on_a_line}");
}

#[derive(Clone, Copy, Debug)]
enum Damage {
    Delete(usize),
    Flip(usize),
    /// Gives a triangle vertices of its own, moved by less than what is welded.
    Tear(usize, i8),
    Flat(usize),
    Copy(usize),
    /// Splits a side of a triangle, but not of its neighbour.
    Junction(usize, u8),
}

fn damage() -> impl Strategy<Value = Damage> {
    let t = 0..10_000usize;
    prop_oneof![
        t.clone().prop_map(Damage::Delete),
        t.clone().prop_map(Damage::Flip),
        (t.clone(), -1..=1i8).prop_map(|(t, d)| Damage::Tear(t, d)),
        t.clone().prop_map(Damage::Flat),
        t.clone().prop_map(Damage::Copy),
        (t, 1..255u8).prop_map(|(t, s)| Damage::Junction(t, s)),
    ]
}

fn damaged(mesh: &Mesh, damages: &[Damage]) -> Mesh {
    let mut positions = mesh.positions.to_vec();
    let mut triangles: Vec<[u32; 3]> = mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    for damage in damages {
        let count = triangles.len();
        match *damage {
            Damage::Delete(t) if count > 4 => drop(triangles.remove(t % count)),
            Damage::Delete(_) => {}
            Damage::Flip(t) => triangles[t % count].swap(0, 1),
            Damage::Tear(t, by) => {
                triangles[t % count] = triangles[t % count].map(|v| {
                    positions.push(positions[v as usize] + 2e-7 * f32::from(by));
                    positions.len() as u32 - 1
                });
            }
            Damage::Flat(t) => {
                let [a, b, _] = triangles[t % count];
                triangles.push([a, b, a]);
            }
            Damage::Copy(t) => triangles.push(triangles[t % count]),
            Damage::Junction(t, share) => {
                let [a, b, c] = triangles[t % count];
                positions.push(positions[a as usize].lerp(positions[b as usize], f32::from(share) / 255.0));
                let middle = positions.len() as u32 - 1;
                triangles[t % count] = [a, middle, c];
                triangles.push([middle, b, c]);
            }
        }
    }
    Mesh { positions: positions.into(), normals: [].into(), indices: triangles.into_flattened().into(), ..Mesh::default() }
        .checked()
        .unwrap()
}

proptest! {
    #![proptest_config(Config { cases: 160, failure_persistence: None, ..Config::default() })]

    #[test]
    fn random_damage_is_mended(kind in 0..2usize, damages in proptest::collection::vec(damage(), 1..12)) {
        let whole = if kind == 0 { cube() } else { torus(9, 7) };
        let broken = damaged(&whole, &damages);
        let mended = all(&broken);
        prop_assert!(mended.findings.is_sound() || !mended.findings.faults().is_empty());
        // Nothing the doctor has a step for is left over.
        prop_assert!(mended.findings.is_sound(), "{}\ndone: {}", mended.findings, mended.done);
        prop_assert!(mended.apply(&broken).checked().is_ok());
        // What only tears and turns does not change the body. (Of a triangle and its turned copy nobody knows which is right.)
        if !damages.iter().any(|d| matches!(d, Damage::Delete(_) | Damage::Copy(_))) {
            let (before, after) = (examine(&whole, 0.0).volume_m3, mended.findings.volume_m3);
            let (before, after) = (before.unwrap_or(0.0), after.unwrap_or(0.0));
            prop_assert!((before - after).abs() < 1e-3 * before, "{} m3 became {} m3", before, after);
        }
    }
}
