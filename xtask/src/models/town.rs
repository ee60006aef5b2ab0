//! What stands on the market place.

use super::glb::Glb;
use super::paint;
use super::surface::Surface;
use glam::{Vec2, Vec3, vec2, vec3};
use serde_json::json;

fn textured(glb: &mut Glb, name: &str, picture: &image::RgbaImage, double_sided: bool) -> usize {
    let texture = glb.texture(picture);
    glb.material(json!({"name": name, "doubleSided": double_sided,
        "pbrMetallicRoughness": {"baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": 0.9}}))
}

/// The two sheets of a gable roof along z, with their eaves; open below.
fn gable(roof: &mut Surface, min: Vec3, max: Vec3, ridge_y: f32, eaves: f32) {
    let middle = (min.x + max.x) / 2.0;
    let slope = (ridge_y - max.y) / (middle - min.x);
    let low = max.y - eaves * slope;
    let (z0, z1) = (min.z - eaves, max.z + eaves);
    for (x, near, far) in [(min.x - eaves, z0, z1), (max.x + eaves, z1, z0)] {
        let corners = [vec3(x, low, near), vec3(x, low, far), vec3(middle, ridge_y, far), vec3(middle, ridge_y, near)];
        roof.quad(corners, vec2((z1 - z0) / 2.0, corners[1].distance(corners[2]) / 2.0));
    }
}

/// The triangles of wall below a gable roof.
fn gable_walls(walls: &mut Surface, min: Vec3, max: Vec3, ridge_y: f32) {
    let middle = (min.x + max.x) / 2.0;
    let uvs = [vec2(0.0, 1.0), vec2(2.0, 1.0), vec2(1.0, 0.0)];
    walls.triangle([vec3(min.x, max.y, max.z), vec3(max.x, max.y, max.z), vec3(middle, ridge_y, max.z)], uvs);
    walls.triangle([vec3(max.x, max.y, min.z), vec3(min.x, max.y, min.z), vec3(middle, ridge_y, min.z)], uvs);
}

/// A house of 6 x 8 metres, three storeys: walls without floor, a roof of two sheets.
pub(crate) fn house() -> Glb {
    let mut glb = Glb::default();
    let window = textured(&mut glb, "windows", &paint::window_wall(), false);
    let timber = textured(&mut glb, "timber", &paint::timber_wall(), false);
    let tiles = textured(&mut glb, "tiles", &paint::roof_tiles(), true);
    let stone = textured(&mut glb, "stone", &paint::stones(), false);
    let wood = textured(&mut glb, "door", &paint::planks(), false);
    let (min, max) = (vec3(-3.0, 0.0, -4.0), vec3(3.0, 6.0, 4.0));
    let [mut plinth, mut storeys, mut upper, mut roof, mut door] = std::array::from_fn(|_| Surface::default());
    plinth.walls(vec3(-3.1, 0.0, -4.1), vec3(3.1, 0.6, 4.1), 1.0);
    plinth.quad([vec3(-3.1, 0.6, 4.1), vec3(3.1, 0.6, 4.1), vec3(3.1, 0.6, -4.1), vec3(-3.1, 0.6, -4.1)], vec2(6.0, 8.0));
    plinth.cuboid(vec3(1.0, 6.0, -2.0), vec3(1.8, 9.6, -1.2), 1.0);
    storeys.walls(vec3(min.x, 0.6, min.z), max, 2.0);
    upper.walls(vec3(min.x - 0.3, 4.0, min.z - 0.3), vec3(max.x + 0.3, 6.0, max.z + 0.3), 2.0);
    upper.quad([vec3(-3.3, 4.0, -4.3), vec3(3.3, 4.0, -4.3), vec3(3.3, 4.0, 4.3), vec3(-3.3, 4.0, 4.3)], vec2(3.0, 4.0));
    gable_walls(&mut upper, vec3(-3.3, 0.0, -4.3), vec3(3.3, 6.0, 4.3), 9.0);
    gable(&mut roof, vec3(-3.3, 0.0, -4.3), vec3(3.3, 6.0, 4.3), 9.0, 0.5);
    door.cuboid(vec3(-0.6, 0.0, 4.0), vec3(0.6, 2.3, 4.15), 1.2);
    let parts = [(stone, &plinth), (window, &storeys), (timber, &upper), (tiles, &roof), (wood, &door)];
    let mesh = glb.mesh("house", &parts);
    glb.node("house", None, Vec3::ZERO, Some(mesh));
    glb
}

/// A market stall of 3 x 2 metres with an awning of cloth: one open, curved sheet.
pub(crate) fn stall() -> Glb {
    let mut glb = Glb::default();
    let wood = textured(&mut glb, "wood", &paint::planks(), false);
    let cloth = textured(&mut glb, "cloth", &paint::stripes(), true);
    let [mut frame, mut awning, mut apples, mut pears] = std::array::from_fn(|_| Surface::default());
    for (x, z, top) in [(-1.5, -1.0, 2.7), (1.5, -1.0, 2.7), (-1.5, 1.0, 2.2), (1.5, 1.0, 2.2)] {
        frame.cuboid(vec3(x - 0.05, 0.0, z - 0.05), vec3(x + 0.05, top, z + 0.05), 1.0);
    }
    frame.cuboid(vec3(-1.45, 0.8, -0.2), vec3(1.45, 0.88, 0.9), 1.0);
    frame.walls(vec3(-1.4, 0.0, 0.75), vec3(1.4, 0.8, 0.8), 1.0);
    for (i, heap) in [&mut apples, &mut pears].into_iter().enumerate() {
        let x = -0.7 + 1.4 * i as f32;
        frame.walls(vec3(x - 0.45, 0.88, 0.0), vec3(x + 0.45, 1.0, 0.6), 1.0);
        for k in 0..12u8 {
            let place = vec3(x - 0.3 + 0.2 * f32::from(k % 4), 0.98, 0.1 + 0.18 * f32::from(k / 4));
            let profile: Vec<Vec2> =
                (0..=6).map(|r| r as f32 / 6.0 * std::f32::consts::PI).map(|a| vec2(a.sin(), -a.cos()) * 0.09).collect();
            let profile: Vec<Vec2> =
                profile.iter().enumerate().map(|(r, p)| if r == 0 || r == 6 { vec2(0.0, p.y) } else { *p }).collect();
            heap.lathe(place, &profile, 8);
        }
    }
    let strips = 8;
    let edge = |k: usize, x: f32| {
        let t = k as f32 / strips as f32;
        vec3(x, 2.75 - 0.6 * t - 0.12 * (std::f32::consts::PI * t).sin(), -1.15 + 2.5 * t)
    };
    for k in 0..strips {
        awning.quad([edge(k + 1, -1.7), edge(k + 1, 1.7), edge(k, 1.7), edge(k, -1.7)], vec2(1.0, 0.2));
    }
    let front = edge(strips, 0.0);
    awning.quad(
        [
            vec3(-1.7, front.y - 0.25, front.z),
            vec3(1.7, front.y - 0.25, front.z),
            vec3(1.7, front.y, front.z),
            vec3(-1.7, front.y, front.z),
        ],
        vec2(1.0, 0.2),
    );
    let red = glb.plain("apples", [0.55, 0.06, 0.04], 0.4);
    let green = glb.plain("pears", [0.42, 0.46, 0.08], 0.5);
    let mesh = glb.mesh("stall", &[(wood, &frame), (cloth, &awning), (red, &apples), (green, &pears)]);
    glb.node("stall", None, Vec3::ZERO, Some(mesh));
    glb
}

/// A church of 9 x 18 metres with a tower of 24.
pub(crate) fn church() -> Glb {
    let mut glb = Glb::default();
    let stone = textured(&mut glb, "stone", &paint::stones(), false);
    let tiles = textured(&mut glb, "tiles", &paint::roof_tiles(), true);
    let glass = glb.plain("glass", [0.05, 0.07, 0.12], 0.2);
    let gold = glb.material(json!({"name": "gold",
        "pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.77, 0.34, 1.0], "metallicFactor": 1.0, "roughnessFactor": 0.35}}));
    let [mut walls, mut roof, mut windows, mut cross] = std::array::from_fn(|_| Surface::default());
    let (min, max) = (vec3(-4.5, 0.0, -14.0), vec3(4.5, 7.0, 4.0));
    walls.walls(min, max, 2.0);
    gable_walls(&mut walls, min, max, 12.0);
    gable(&mut roof, min, max, 12.0, 0.5);
    walls.cuboid(vec3(-2.5, 0.0, 2.0), vec3(2.5, 16.0, 7.0), 2.0);
    let (tip, y) = (vec3(0.0, 24.0, 4.5), 15.9);
    let corner = |x: f32, z: f32| vec3(x * 2.8, y, 4.5 + z * 2.8);
    for [a, b] in [[(-1.0, 1.0), (1.0, 1.0)], [(1.0, 1.0), (1.0, -1.0)], [(1.0, -1.0), (-1.0, -1.0)], [(-1.0, -1.0), (-1.0, 1.0)]]
    {
        roof.triangle([corner(a.0, a.1), corner(b.0, b.1), tip], [vec2(0.0, 4.0), vec2(3.0, 4.0), vec2(1.5, 0.0)]);
    }
    for z in [-12.0, -9.0, -6.0, -3.0, 0.0] {
        for side in [-1.0, 1.0] {
            windows.cuboid(vec3(side * 4.5 - 0.05, 2.0, z - 0.5), vec3(side * 4.5 + 0.05, 5.5, z + 0.5), 1.0);
            walls.cuboid(vec3(side * 4.9 - 0.4, 0.0, z + 1.1), vec3(side * 4.9 + 0.4, 5.0, z + 1.9), 2.0);
        }
    }
    windows.cuboid(vec3(-0.9, 0.0, 6.95), vec3(0.9, 3.2, 7.05), 1.0);
    windows.cuboid(vec3(-0.6, 12.0, 6.95), vec3(0.6, 14.5, 7.05), 1.0);
    cross.cuboid(tip + vec3(-0.08, -0.2, -0.08), tip + vec3(0.08, 1.8, 0.08), 1.0);
    cross.cuboid(tip + vec3(-0.5, 1.0, -0.08), tip + vec3(0.5, 1.2, 0.08), 1.0);
    let mesh = glb.mesh("church", &[(stone, &walls), (tiles, &roof), (glass, &windows), (gold, &cross)]);
    glb.node("church", None, Vec3::ZERO, Some(mesh));
    glb
}

/// A fountain of 5 metres across: basin, column, bowl, and water that is seen through.
pub(crate) fn fountain() -> Glb {
    let mut glb = Glb::default();
    let stone = textured(&mut glb, "stone", &paint::stones(), false);
    let water = glb.material(json!({"name": "water", "alphaMode": "BLEND",
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.28, 0.36, 0.7], "metallicFactor": 0.0, "roughnessFactor": 0.08}}));
    let [mut basin, mut surface] = std::array::from_fn(|_| Surface::default());
    let rim = [(0.0, 0.0), (2.5, 0.0), (2.5, 0.7), (2.2, 0.7), (2.2, 0.2), (0.0, 0.2)].map(|(r, y)| vec2(r, y));
    basin.lathe(Vec3::ZERO, &rim, 32);
    let column = [
        (0.0, 0.2),
        (0.35, 0.2),
        (0.2, 0.6),
        (0.18, 1.6),
        (0.9, 1.9),
        (0.95, 2.0),
        (0.8, 2.0),
        (0.15, 1.85),
        (0.1, 2.5),
        (0.0, 2.6),
    ];
    basin.lathe(Vec3::ZERO, &column.map(|(r, y)| vec2(r, y)), 24);
    surface.lathe(Vec3::Y * 0.55, &[vec2(2.2, 0.0), vec2(0.0, 0.0)], 32);
    surface.lathe(Vec3::Y * 1.97, &[vec2(0.8, 0.0), vec2(0.0, 0.0)], 24);
    let mesh = glb.mesh("fountain", &[(stone, &basin), (water, &surface)]);
    glb.node("fountain", None, Vec3::ZERO, Some(mesh));
    glb
}

/// A street lamp of 3.6 metres; the place of its light is the node `flame`.
pub(crate) fn lamp() -> Glb {
    let mut glb = Glb::default();
    let iron = glb.material(json!({"name": "iron",
        "pbrMetallicRoughness": {"baseColorFactor": [0.05, 0.06, 0.06, 1.0], "metallicFactor": 0.6, "roughnessFactor": 0.5}}));
    let glow = glb.material(json!({"name": "glow", "emissiveFactor": [1.0, 0.75, 0.4],
        "pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.9, 0.7, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}}));
    let [mut post, mut globe] = std::array::from_fn(|_| Surface::default());
    let profile = [(0.0, 0.0), (0.18, 0.0), (0.16, 0.3), (0.06, 0.5), (0.05, 3.0), (0.14, 3.1), (0.0, 3.12)];
    post.lathe(Vec3::ZERO, &profile.map(|(r, y)| vec2(r, y)), 12);
    post.lathe(Vec3::Y * 3.5, &[vec2(0.0, 0.0), vec2(0.24, 0.0), vec2(0.0, 0.2)], 6);
    for k in 0..4u8 {
        let (sin, cos) = (f32::from(k) * std::f32::consts::FRAC_PI_2).sin_cos();
        post.bar(vec3(sin * 0.12, 3.1, cos * 0.12), vec3(sin * 0.2, 3.5, cos * 0.2), 0.012, 5);
    }
    globe.lathe(Vec3::Y * 3.3, &[vec2(0.0, -0.1), vec2(0.07, -0.07), vec2(0.1, 0.0), vec2(0.07, 0.07), vec2(0.0, 0.1)], 12);
    let post = glb.mesh("post", &[(iron, &post)]);
    let globe = glb.mesh("globe", &[(glow, &globe)]);
    let root = glb.node("lamp", None, Vec3::ZERO, Some(post));
    glb.node("globe", Some(root), Vec3::ZERO, Some(globe));
    glb.node("flame", Some(root), Vec3::Y * 3.3, None);
    glb
}

/// The paved square, 80 metres wide, with a field around it.
pub(crate) fn square() -> Glb {
    let mut glb = Glb::default();
    let cobbles = textured(&mut glb, "cobbles", &paint::cobbles(), false);
    let grass = glb.plain("grass", [0.11, 0.17, 0.05], 1.0);
    let [mut paving, mut field] = std::array::from_fn(|_| Surface::default());
    let flat = |s: &mut Surface, half: f32, y: f32, repeats: f32| {
        let at = |x: f32, z: f32| vec3(x * half, y, z * half);
        s.quad([at(-1.0, 1.0), at(1.0, 1.0), at(1.0, -1.0), at(-1.0, -1.0)], Vec2::splat(repeats));
    };
    flat(&mut paving, 40.0, 0.0, 40.0);
    flat(&mut field, 400.0, -0.05, 1.0);
    let mesh = glb.mesh("square", &[(cobbles, &paving), (grass, &field)]);
    glb.node("square", None, Vec3::ZERO, Some(mesh));
    glb
}
