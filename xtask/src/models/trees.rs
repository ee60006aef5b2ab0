//! A tree with leaves cut out of open cards by alpha.

use super::glb::Glb;
use super::paint;
use super::surface::Surface;
use glam::{Quat, Vec2, Vec3, vec2, vec3};
use serde_json::json;

/// A tree of 7 metres: a trunk with branches, and 90 cards of leaves.
pub(crate) fn tree() -> Glb {
    let mut glb = Glb::default();
    let bark = glb.plain("bark", [0.16, 0.11, 0.07], 0.95);
    let texture = glb.texture(&paint::leaves());
    let leaf = glb.material(json!({"name": "leaves", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.5,
        "pbrMetallicRoughness": {"baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": 0.85}}));
    let [mut trunk, mut crown] = std::array::from_fn(|_| Surface::default());
    let profile = [(0.0, 0.0), (0.38, 0.0), (0.24, 0.6), (0.18, 2.4), (0.1, 4.4), (0.0, 5.2)];
    trunk.lathe(Vec3::ZERO, &profile.map(|(r, y)| vec2(r, y)), 10);
    let golden = 2.399_963_1_f32;
    for k in 0..7 {
        let (turn, y) = (k as f32 * golden, 2.3 + 0.35 * k as f32);
        let reach = 1.7 - 0.16 * k as f32;
        trunk.bar(vec3(0.0, y, 0.0), vec3(turn.cos() * reach, y + 0.9, turn.sin() * reach), 0.05, 5);
    }
    for k in 0..90 {
        let t = (k as f32 + 0.5) / 90.0;
        let (height, turn) = (1.0 - 2.0 * t, k as f32 * golden);
        let ring = (1.0 - height * height).sqrt();
        let out = vec3(ring * turn.cos(), height, ring * turn.sin());
        let depth = 0.55 + 0.45 * ((k * 37 % 90) as f32 / 90.0);
        let place = vec3(0.0, 4.6, 0.0) + out * vec3(2.1, 1.9, 2.1) * depth;
        card(&mut crown, place, Quat::from_rotation_arc(Vec3::Z, out) * Quat::from_rotation_z(turn), 0.85);
    }
    let mesh = glb.mesh("tree", &[(bark, &trunk), (leaf, &crown)]);
    glb.node("tree", None, Vec3::ZERO, Some(mesh));
    glb
}

fn card(crown: &mut Surface, place: Vec3, turn: Quat, half: f32) {
    let corner = |x: f32, y: f32| place + turn * (vec3(x, y, 0.0) * half);
    crown.quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], Vec2::ONE);
}
