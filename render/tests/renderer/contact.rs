//! Where a shadow starts: at its caster, whether that is a solid or a sheet without thickness, under every kind of light.

use crate::support::*;
use glam::{Mat4, Quat, Vec3};
use std::f32::consts::FRAC_PI_2;
use umbriel_scene::*;

/// Side of a picture, pixels.
const PICTURE: u32 = 128;
/// Side of a map, texels.
const SIZE: u32 = 512;
/// Texels of floor across a picture.
const SEEN: f32 = 12.0;
/// Half of what a map of parallel light shows, and the tangent of a spot light's half angle.
const WINDOW: f32 = 0.6;
/// Gaps below this are good enough.
const GOOD_TEXELS: f32 = 1.7;
/// From the floor to lights that stand somewhere, metres.
const DISTANCE: f32 = 3.0;

/// A caster that touches the floor at the origin, and along z where `is_edge`.
struct Touching {
    name: &'static str,
    drawable: Drawable,
    is_edge: bool,
    /// How far it leans away from the light, radians: a camera must see below it.
    lean: f32,
}

fn grey() -> Material {
    Material { double_sided: true, ..matt(0.6, 0.6, 0.6) }
}

fn casters() -> Vec<Touching> {
    let solid = |name, size: Vec3| {
        let centre = Vec3::new(-0.5 * size.x, 0.5 * size.y, 0.0);
        Touching { name, drawable: shape(cuboid(size), grey(), Mat4::from_translation(centre)), is_edge: true, lean: 0.0 }
    };
    // Its lower edge lies along z; it leans over to +x, where the shadow falls.
    let sheet = |name, lean: f32| {
        let pose = Mat4::from_rotation_z(FRAC_PI_2 - lean) * Mat4::from_translation(Vec3::X * 0.25);
        Touching { name, drawable: shape(plane(0.5), grey(), pose), is_edge: true, lean }
    };
    let ball = shape(ball(48), grey(), at(0.0, 0.25, 0.0) * Mat4::from_scale(Vec3::splat(0.25)));
    vec![
        solid("box", Vec3::splat(0.5)),
        solid("board of 1 cm", Vec3::new(0.01, 0.5, 0.5)),
        Touching { name: "ball", drawable: ball, is_edge: false, lean: 0.0 },
        sheet("sheet, upright", 0.0),
        sheet("sheet, towards the light", -0.5),
        sheet("sheet, away from the light", 0.5),
        sheet("sheet, nearly flat", 1.2),
    ]
}

/// Lights that shine to +x from so high above the horizon, turned a little out of the world's axes.
fn lights(elevation: f32) -> [(&'static str, Light); 3] {
    let towards = Quat::from_rotation_y(0.3) * Vec3::new(-elevation.cos(), elevation.sin(), 0.0);
    let map = MapSettings { size: SIZE, ..Default::default() };
    let light =
        |kind, map| Light { kind, position: towards * DISTANCE, direction: -towards, map, shadows: ShadowMethod::Map, ..noon() };
    let by_hand = MapSettings { frustum: Some([-WINDOW, WINDOW, -WINDOW, WINDOW]), ..map };
    [
        ("sun", light(LightKind::Directional, by_hand)),
        ("spot", light(LightKind::Spot { inner_rad: 0.3, outer_rad: WINDOW.atan() }, map)),
        ("point", light(LightKind::Point, map)),
    ]
}

/// Size of a texel at the origin, metres.
fn texel(light: &Light) -> f32 {
    let at_distance_1 = 2.0 / SIZE as f32;
    match light.kind {
        LightKind::Directional => WINDOW * at_distance_1,
        LightKind::Spot { .. } => WINDOW * at_distance_1 * DISTANCE,
        LightKind::Point => light.position.abs().max_element() * at_distance_1,
    }
}

/// How far light reaches behind the line where a caster touches the floor, texels.
fn gap(shooter: &mut Shooter, name: &str, caster: &Touching, light: &Light) -> f32 {
    let floor = shape(plane(20.0), grey(), Mat4::IDENTITY);
    let scene =
        Scene { drawables: vec![floor, caster.drawable.clone()].into(), lights: vec![light.clone()], ..Default::default() };
    let texel = texel(light);
    let elevation = (1.2 * (FRAC_PI_2 - caster.lean)).min(1.0) * 0.7;
    // From behind, below what leans over.
    let distance = 0.1;
    let middle = Vec3::X * 0.25 * SEEN * texel;
    let mut view = look(name, middle + Vec3::new(elevation.cos(), elevation.sin(), 0.0) * distance, middle, [PICTURE; 2]);
    view.frustum = Frustum::symmetric(2.0 * (0.5 * SEEN * texel / distance).atan(), 1.0, 0.001);
    let clip_from_world = view.frustum.clip_from_view() * view.view_from_world;
    let shot = shooter.shoot(&scene, &Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(view) });
    let mut gap = 0.0f32;
    let sides: &[f32] = if caster.is_edge { &[-4.0, -2.7, -1.3, 0.0, 1.3, 2.7, 4.0] } else { &[0.0] };
    let along = Vec3::new(light.direction.x, 0.0, light.direction.z).normalize();
    let mut seen = 0;
    for side in sides {
        for step in 1..50 {
            let texels = 0.1 * step as f32;
            let p = clip_from_world.project_point3(Vec3::Z * side * texel + along * texels * texel);
            let pixel = [(p.x * 0.5 + 0.5), (0.5 - p.y * 0.5)].map(|v| v * PICTURE as f32);
            if pixel.iter().all(|v| (0.0..PICTURE as f32).contains(v)) {
                seen += 1;
                if shot.pixel(pixel[0] as u32, pixel[1] as u32)[0] >= 128 {
                    gap = gap.max(texels);
                }
            }
        }
    }
    assert!(seen >= 40 * sides.len(), "{name}: {seen} places seen");
    gap
}

#[test]
fn shadows_touch_what_casts_them() {
    let mut shooter = Shooter::new();
    let mut failed = Vec::new();
    for caster in casters() {
        let mut line = String::new();
        for degrees in [25.0f32, 45.0, 70.0] {
            for (kind, light) in lights(degrees.to_radians()) {
                // Its shadow falls to the other side where it leans more than the light does.
                if caster.lean + FRAC_PI_2 - degrees.to_radians() < 0.1 {
                    continue;
                }
                let name = format!("contact_{}_{kind}_{degrees}", caster.name.replace([' ', ','], "_"));
                let gap = gap(&mut shooter, &name, &caster, &light);
                line += &format!(" | {kind} {degrees}: {gap:.1}");
                if gap >= GOOD_TEXELS {
                    failed.push((name, gap));
                }
            }
        }
        println!("{}{line}", caster.name);
    }
    assert!(failed.is_empty(), "{failed:?}");
}
