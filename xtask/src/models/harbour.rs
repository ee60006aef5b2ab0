//! What floats and stands in the harbour.

use super::glb::Glb;
use super::paint;
use super::surface::Surface;
use glam::{Vec2, Vec3, vec2, vec3};
use serde_json::json;

/// Stations of a hull from stern to bow: place along z, half breadth at the deck, height of the deck.
type Station = (f32, f32, f32);

/// The shell of a hull, open above; `bottom` is the height of the keel, and the deck is closed at `deck_below` under the rail.
fn hull(shell: &mut Surface, deck: &mut Surface, stations: &[Station], bottom: f32, deck_below: f32) {
    let chine = |s: Station| vec2(s.1 * 0.75, bottom + 0.25 * (s.2 - bottom));
    let sections = |s: Station| {
        let c = chine(s);
        [vec2(0.0, bottom), c, vec2(s.1, s.2)].map(|p| (p, s.0))
    };
    let at = |(p, z): (Vec2, f32), side: f32| vec3(side * p.x, p.y, z);
    for pair in stations.windows(2) {
        let (back, front) = (sections(pair[0]), sections(pair[1]));
        for k in 0..2 {
            shell.quad([at(back[k], 1.0), at(back[k + 1], 1.0), at(front[k + 1], 1.0), at(front[k], 1.0)].map(|p| p), Vec2::ONE);
            shell.quad([at(front[k], -1.0), at(front[k + 1], -1.0), at(back[k + 1], -1.0), at(back[k], -1.0)], Vec2::ONE);
        }
        let plank = |s: Station, side: f32| vec3(side * s.1 * 0.98, s.2 - deck_below, s.0);
        let corners = [plank(pair[0], -1.0), plank(pair[0], 1.0), plank(pair[1], 1.0), plank(pair[1], -1.0)];
        deck.quad([corners[3], corners[2], corners[1], corners[0]], vec2(pair[0].1, (pair[1].0 - pair[0].0) / 2.0));
    }
    let stern = sections(stations[0]);
    shell.quad([at(stern[1], -1.0), at(stern[1], 1.0), at(stern[2], 1.0), at(stern[2], -1.0)].map(|p| p), Vec2::ONE);
    shell.triangle([at(stern[0], 1.0), at(stern[1], 1.0), at(stern[1], -1.0)], [Vec2::ZERO; 3]);
}

/// Posts and two rails along a path.
fn railing(s: &mut Surface, path: &[Vec3]) {
    for pair in path.windows(2) {
        let steps = (pair[0].distance(pair[1]) / 1.5).ceil().max(1.0) as usize;
        for k in 0..=steps {
            let foot = pair[0].lerp(pair[1], k as f32 / steps as f32);
            s.bar(foot, foot + Vec3::Y, 0.03, 5);
        }
        for height in [0.5, 1.0] {
            s.bar(pair[0] + Vec3::Y * height, pair[1] + Vec3::Y * height, 0.025, 5);
        }
    }
}

fn steel(glb: &mut Glb, name: &str, color: [f32; 3], double_sided: bool) -> usize {
    let [r, g, b] = color;
    glb.material(json!({"name": name, "doubleSided": double_sided,
        "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.45}}))
}

fn planking(glb: &mut Glb) -> usize {
    let texture = glb.texture(&paint::planks());
    glb.material(json!({"name": "planks", "doubleSided": true,
        "pbrMetallicRoughness": {"baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": 0.9}}))
}

/// A ferry of 48 metres: an open hull, three decks, bridge, funnel and railings. The water line is at y = 0, the bow along +z.
pub(crate) fn ferry() -> Glb {
    let mut glb = Glb::default();
    let blue = steel(&mut glb, "hull", [0.03, 0.09, 0.22], true);
    let wood = planking(&mut glb);
    let white = steel(&mut glb, "house", [0.85, 0.86, 0.84], false);
    let glass = glb.plain("glass", [0.04, 0.06, 0.09], 0.15);
    let red = steel(&mut glb, "funnel", [0.6, 0.05, 0.04], true);
    let [mut shell, mut deck, mut house, mut panes, mut funnel, mut rails] = std::array::from_fn(|_| Surface::default());
    let stations = [
        (-24.0, 5.5, 4.2),
        (-18.0, 6.2, 4.0),
        (-6.0, 6.5, 4.0),
        (6.0, 6.5, 4.0),
        (14.0, 5.6, 4.4),
        (20.0, 3.0, 5.2),
        (24.0, 0.05, 6.0),
    ];
    hull(&mut shell, &mut deck, &stations, -2.0, 0.9);
    for (min, max) in [
        (vec3(-5.2, 3.1, -20.0), vec3(5.2, 6.0, 9.0)),
        (vec3(-4.6, 6.0, -17.0), vec3(4.6, 8.6, 7.0)),
        (vec3(-4.2, 8.6, 1.0), vec3(4.2, 11.0, 6.0)),
    ] {
        house.cuboid(min, max, 2.0);
        let (y0, y1) = (min.y + 1.1, max.y - 0.6);
        for side in [-1.0, 1.0] {
            let count = ((max.z - min.z) / 2.4) as usize;
            for k in 0..count {
                let z = min.z + 1.0 + 2.4 * k as f32;
                panes.cuboid(vec3(side * max.x - 0.03, y0, z), vec3(side * max.x + 0.03, y1, z + 1.2), 1.0);
            }
        }
    }
    panes.cuboid(vec3(-3.9, 9.6, 5.97), vec3(3.9, 10.5, 6.04), 1.0);
    railing(
        &mut rails,
        &[vec3(5.0, 6.0, 8.8), vec3(5.0, 6.0, -19.8), vec3(-5.0, 6.0, -19.8), vec3(-5.0, 6.0, 8.8), vec3(5.0, 6.0, 8.8)],
    );
    railing(&mut rails, &[vec3(4.4, 8.6, 0.9), vec3(4.4, 8.6, -16.8), vec3(-4.4, 8.6, -16.8), vec3(-4.4, 8.6, 0.9)]);
    funnel.lathe(vec3(0.0, 8.6, -9.0), &[vec2(1.4, 0.0), vec2(1.2, 3.6), vec2(1.0, 3.6), vec2(1.0, 3.0)], 20);
    rails.bar(vec3(0.0, 11.0, 3.0), vec3(0.0, 17.0, 3.0), 0.12, 8);
    rails.bar(vec3(-2.0, 14.5, 3.0), vec3(2.0, 14.5, 3.0), 0.08, 6);
    let mesh =
        glb.mesh("ferry", &[(blue, &shell), (wood, &deck), (white, &house), (glass, &panes), (red, &funnel), (white, &rails)]);
    glb.node("ferry", None, Vec3::ZERO, Some(mesh));
    glb
}

/// A barge of 30 metres with an open hold and its load of crates.
pub(crate) fn barge() -> Glb {
    let mut glb = Glb::default();
    let rust = steel(&mut glb, "hull", [0.28, 0.10, 0.06], true);
    let wood = planking(&mut glb);
    let grey = steel(&mut glb, "coaming", [0.35, 0.37, 0.38], true);
    let [mut shell, mut deck, mut hold, mut load] = std::array::from_fn(|_| Surface::default());
    let stations = [(-15.0, 3.6, 1.8), (-12.0, 4.0, 1.6), (11.0, 4.0, 1.6), (14.0, 3.2, 1.9), (15.0, 2.6, 2.1)];
    hull(&mut shell, &mut deck, &stations, -1.2, 0.4);
    hold.walls(vec3(-3.0, 1.2, -7.0), vec3(3.0, 2.4, 10.0), 2.0);
    hold.cuboid(vec3(-2.4, 1.2, -13.0), vec3(2.4, 4.0, -9.0), 2.0);
    for (k, x) in [-1.6f32, 0.1, 1.5].into_iter().enumerate() {
        for row in 0..5u8 {
            let z = -5.6 + 3.0 * f32::from(row) + 0.3 * k as f32;
            load.cuboid(vec3(x - 0.7, 1.2, z - 0.7), vec3(x + 0.7, 2.5 + 0.3 * ((k + row as usize) % 3) as f32, z + 0.7), 1.4);
        }
    }
    let mesh = glb.mesh("barge", &[(rust, &shell), (wood, &deck), (grey, &hold), (wood, &load)]);
    glb.node("barge", None, Vec3::ZERO, Some(mesh));
    glb
}

/// A harbour crane of 26 metres; the nodes `slewing` and `hook` are there to be moved.
pub(crate) fn crane() -> Glb {
    let mut glb = Glb::default();
    let yellow = steel(&mut glb, "paint", [0.75, 0.48, 0.03], false);
    let dark = steel(&mut glb, "machine", [0.12, 0.13, 0.14], false);
    let [mut portal, mut house, mut jib, mut cable, mut hook] = std::array::from_fn(|_| Surface::default());
    for (x, z) in [(-3.0, -3.0), (3.0, -3.0), (-3.0, 3.0), (3.0, 3.0)] {
        portal.bar(vec3(x, 0.0, z), vec3(x * 0.5, 9.0, z * 0.5), 0.35, 8);
        portal.cuboid(vec3(x - 0.6, 0.0, z - 0.9), vec3(x + 0.6, 0.6, z + 0.9), 1.0);
    }
    for (a, b) in [((-1.0, -1.0), (1.0, -1.0)), ((1.0, -1.0), (1.0, 1.0)), ((1.0, 1.0), (-1.0, 1.0)), ((-1.0, 1.0), (-1.0, -1.0))]
    {
        portal.bar(vec3(a.0 * 2.25, 4.5, a.1 * 2.25), vec3(b.0 * 2.25, 4.5, b.1 * 2.25), 0.2, 6);
    }
    portal.lathe(Vec3::Y * 9.0, &[vec2(0.0, 0.0), vec2(2.2, 0.0), vec2(2.2, 0.8), vec2(0.0, 0.8)], 20);
    house.cuboid(vec3(-1.8, 0.0, -4.0), vec3(1.8, 3.2, 1.2), 1.5);
    house.cuboid(vec3(0.6, 0.6, 1.2), vec3(1.8, 2.8, 2.8), 1.5);
    lattice(&mut jib, vec3(0.0, 1.2, 1.0), vec3(0.0, 15.0, 17.0), 0.8, 12);
    cable.bar(vec3(0.0, 15.0, 17.0), vec3(0.0, 4.0, 17.0), 0.05, 5);
    cable.bar(vec3(0.0, 3.2, -3.6), vec3(0.0, 15.0, 17.0), 0.05, 5);
    hook.cuboid(vec3(-0.4, -0.8, -0.4), vec3(0.4, 0.0, 0.4), 1.0);
    hook.cuboid(vec3(-1.2, -3.2, -1.2), vec3(1.2, -0.8, 1.2), 1.2);
    let base = glb.mesh("portal", &[(yellow, &portal)]);
    let top = glb.mesh("slewing", &[(dark, &house), (yellow, &jib), (dark, &cable)]);
    let load = glb.mesh("hook", &[(dark, &hook)]);
    let root = glb.node("crane", None, Vec3::ZERO, Some(base));
    let slewing = glb.node("slewing", Some(root), Vec3::Y * 9.8, Some(top));
    glb.node("hook", Some(slewing), vec3(0.0, 4.0, 17.0), Some(load));
    glb
}

/// A lattice girder of square section that tapers to a point: four chords with diagonals.
fn lattice(s: &mut Surface, from: Vec3, to: Vec3, half: f32, bays: usize) {
    let axis = (to - from).normalize();
    let side = axis.cross(Vec3::Y).normalize();
    let up = side.cross(axis);
    let corner = |bay: usize, k: usize| {
        let t = bay as f32 / bays as f32;
        let width = half * (1.0 - 0.85 * t);
        let (a, b) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][k % 4];
        from.lerp(to, t) + (side * a + up * b) * width
    };
    for bay in 0..bays {
        for k in 0..4 {
            s.bar(corner(bay, k), corner(bay + 1, k), 0.08, 5);
            s.bar(corner(bay, k), corner(bay + 1, k + 1), 0.05, 4);
            s.bar(corner(bay, k), corner(bay, k + 1), 0.05, 4);
        }
    }
}
