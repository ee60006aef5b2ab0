//! A walking figure: skinned, animated, 1.75 metres tall, looking along +z.

use super::glb::{Glb, Track, about_x};
use super::surface::{Ring, Surface};
use glam::{Vec2, Vec3, vec3};
use std::f32::consts::TAU;

/// Seconds of one cycle of two steps.
const CYCLE_S: f32 = 1.15;
const KEYS: usize = 25;

/// Name, parent, and place at rest of each joint.
const JOINTS: [(&str, Option<usize>, Vec3); 14] = [
    ("hips", None, vec3(0.0, 0.95, 0.0)),
    ("spine", Some(0), vec3(0.0, 1.15, 0.0)),
    ("head", Some(1), vec3(0.0, 1.50, 0.0)),
    ("upper_arm.L", Some(1), vec3(0.21, 1.42, 0.0)),
    ("forearm.L", Some(3), vec3(0.23, 1.14, 0.0)),
    ("upper_arm.R", Some(1), vec3(-0.21, 1.42, 0.0)),
    ("forearm.R", Some(5), vec3(-0.23, 1.14, 0.0)),
    ("thigh.L", Some(0), vec3(0.10, 0.90, 0.0)),
    ("shin.L", Some(7), vec3(0.10, 0.48, 0.0)),
    ("foot.L", Some(8), vec3(0.10, 0.08, 0.0)),
    ("thigh.R", Some(0), vec3(-0.10, 0.90, 0.0)),
    ("shin.R", Some(10), vec3(-0.10, 0.48, 0.0)),
    ("foot.R", Some(11), vec3(-0.10, 0.08, 0.0)),
    ("hat", Some(2), vec3(0.0, 1.70, 0.0)),
];

/// The figure with its animation `walk`; at rest it stands, at 1.45 m/s its feet do not slide.
pub(crate) fn figure() -> Glb {
    let mut glb = Glb::default();
    let coat = glb.plain("coat", [0.10, 0.16, 0.34], 0.8);
    let trousers = glb.plain("trousers", [0.14, 0.12, 0.11], 0.9);
    let skin = glb.plain("skin", [0.72, 0.46, 0.34], 0.6);
    let leather = glb.plain("leather", [0.07, 0.045, 0.03], 0.5);
    let surfaces = [(coat, coat_surface()), (trousers, trouser_surface()), (skin, skin_surface()), (leather, leather_surface())];
    let mesh = glb.mesh("figure", &surfaces.each_ref().map(|(m, s)| (*m, s)));
    let root = glb.node("figure", None, Vec3::ZERO, None);
    let body = glb.node("body", Some(root), Vec3::ZERO, Some(mesh));
    let mut joints: Vec<usize> = Vec::new();
    for (name, parent, place) in JOINTS {
        let above = parent.map_or(Vec3::ZERO, |p| JOINTS[p].2);
        joints.push(glb.node(name, Some(parent.map_or(root, |p| joints[p])), place - above, None));
    }
    glb.skin(body, &joints, &JOINTS.map(|j| j.2));
    let times: Vec<f32> = (0..KEYS).map(|k| CYCLE_S * k as f32 / (KEYS - 1) as f32).collect();
    glb.animation("walk", &times, &walk(&joints));
    glb
}

/// Centre of a ring, its radii along x and z, and its joints.
type Section = (Vec3, f32, f32, [(u8, f32); 2]);

fn tube(surface: &mut Surface, rings: &[Section]) {
    let rings: Vec<Ring> =
        rings.iter().map(|(centre, x, z, joints)| Ring { centre: *centre, radius: Vec2::new(*x, *z), joints: *joints }).collect();
    surface.loft(&rings, 12);
}

fn only(joint: u8) -> [(u8, f32); 2] {
    [(joint, 1.0), (0, 0.0)]
}

fn half(a: u8, b: u8) -> [(u8, f32); 2] {
    [(a, 0.5), (b, 0.5)]
}

fn coat_surface() -> Surface {
    let mut s = Surface::default();
    let at = |y: f32| vec3(0.0, y, 0.0);
    tube(
        &mut s,
        &[
            (at(0.78), 0.19, 0.14, only(0)),
            (at(0.95), 0.17, 0.12, only(0)),
            (at(1.08), 0.15, 0.11, half(0, 1)),
            (at(1.25), 0.18, 0.12, only(1)),
            (at(1.42), 0.20, 0.11, only(1)),
            (at(1.48), 0.09, 0.08, only(1)),
        ],
    );
    for (side, upper, fore) in [(1.0, 3, 4), (-1.0, 5, 6)] {
        let arm = |y: f32, x: f32| vec3(side * x, y, 0.0);
        tube(
            &mut s,
            &[
                (arm(0.90, 0.24), 0.042, 0.042, only(fore)),
                (arm(1.08, 0.235), 0.05, 0.05, only(fore)),
                (arm(1.14, 0.23), 0.052, 0.052, half(upper, fore)),
                (arm(1.22, 0.225), 0.055, 0.055, only(upper)),
                (arm(1.40, 0.20), 0.065, 0.065, only(upper)),
                (arm(1.46, 0.17), 0.04, 0.05, only(1)),
            ],
        );
    }
    s
}

fn trouser_surface() -> Surface {
    let mut s = Surface::default();
    for (side, thigh, shin) in [(1.0, 7, 8), (-1.0, 10, 11)] {
        let leg = |y: f32| vec3(side * 0.10, y, 0.0);
        tube(
            &mut s,
            &[
                (leg(0.10), 0.055, 0.06, only(shin)),
                (leg(0.30), 0.065, 0.07, only(shin)),
                (leg(0.44), 0.065, 0.065, only(shin)),
                (leg(0.48), 0.067, 0.067, half(thigh, shin)),
                (leg(0.54), 0.07, 0.07, only(thigh)),
                (leg(0.78), 0.085, 0.09, only(thigh)),
                (leg(0.90), 0.08, 0.09, half(0, thigh)),
            ],
        );
    }
    s
}

fn skin_surface() -> Surface {
    let mut s = Surface::default();
    let head = |y: f32| vec3(0.0, y, 0.01);
    tube(
        &mut s,
        &[
            (head(1.44), 0.05, 0.05, only(2)),
            (head(1.53), 0.055, 0.06, only(2)),
            (head(1.57), 0.075, 0.09, only(2)),
            (head(1.65), 0.08, 0.10, only(2)),
            (head(1.72), 0.07, 0.085, only(2)),
            (head(1.76), 0.03, 0.04, only(2)),
        ],
    );
    for (side, fore) in [(1.0, 4), (-1.0, 6)] {
        let hand = |y: f32| vec3(side * 0.243, y, 0.0);
        tube(
            &mut s,
            &[
                (hand(0.78), 0.02, 0.035, only(fore)),
                (hand(0.85), 0.028, 0.045, only(fore)),
                (hand(0.92), 0.03, 0.03, only(fore)),
            ],
        );
    }
    s
}

fn leather_surface() -> Surface {
    let mut s = Surface::default();
    for (side, foot) in [(1.0, 9), (-1.0, 12)] {
        let shoe = |y: f32| vec3(side * 0.10, y, 0.06);
        tube(
            &mut s,
            &[(shoe(0.0), 0.05, 0.14, only(foot)), (shoe(0.05), 0.05, 0.14, only(foot)), (shoe(0.13), 0.045, 0.07, only(foot))],
        );
    }
    let hat = |y: f32| vec3(0.0, y, 0.01);
    tube(
        &mut s,
        &[
            (hat(1.71), 0.15, 0.17, only(13)),
            (hat(1.725), 0.15, 0.17, only(13)),
            (hat(1.726), 0.09, 0.105, only(13)),
            (hat(1.82), 0.08, 0.095, only(13)),
        ],
    );
    s
}

/// Hips bob twice a cycle; legs swing in opposite phase, each knee bends while its leg comes forward; arms swing against
/// the legs. A turn about +x by a positive angle swings a hanging limb backwards.
fn walk(joints: &[usize]) -> Vec<Track> {
    let phase = |k: usize| TAU * k as f32 / (KEYS - 1) as f32;
    let turns = |joint: usize, angle: &dyn Fn(f32) -> f32| Track {
        node: joints[joint],
        path: "rotation",
        values: (0..KEYS).flat_map(|k| about_x(angle(phase(k)))).collect(),
    };
    let hips = (0..KEYS).flat_map(|k| (JOINTS[0].2 + Vec3::Y * (0.018 * (2.0 * phase(k)).cos() - 0.03)).to_array()).collect();
    let mut tracks = vec![Track { node: joints[0], path: "translation", values: hips }];
    for (offset, thigh, upper) in [(0.0, 7, 5), (TAU / 2.0, 10, 3)] {
        tracks.push(turns(thigh, &|p| -0.47 * (p + offset).sin() - 0.06));
        tracks.push(turns(thigh + 1, &|p| 0.12 + 0.85 * (p + offset + 0.35).cos().max(0.0).powi(2)));
        tracks.push(turns(thigh + 2, &|p| 0.22 * (p + offset + 2.4).sin()));
        tracks.push(turns(upper, &|p| -0.42 * (p + offset).sin()));
        tracks.push(turns(upper + 1, &|p| -0.25 - 0.2 * (p + offset).sin().max(0.0)));
    }
    tracks
}
