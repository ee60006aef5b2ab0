//! Contours and silhouettes as lines (001 section 4.3).

use crate::support::*;
use glam::Vec3;
use umbriel_scene::*;

const INK: ContourStyle = ContourStyle { color: Vec3::X, line_px: 0.0, outline_px: 4.0, crease_rad: f32::INFINITY };

fn grey(size: Vec3, x: f32, y: f32, z: f32) -> Drawable {
    shape(cuboid(size), matt(0.2, 0.2, 0.2), at(x, y, z))
}

fn scene(drawables: Vec<Drawable>, style: ContourStyle) -> Scene {
    let all = (0..drawables.len()).collect();
    Scene { drawables, ambient: Vec3::ONE, contours: vec![ContourGroup { drawables: all, style }], ..Scene::default() }
}

fn is_ink(shot: &Shot, x: u32, y: u32) -> bool {
    let [r, g, _, _] = shot.pixel(x, y);
    r > 200 && g < 60
}

/// Seen from above, a metre of what is 9.5 m away has 25.4 pixels.
#[test]
fn lines_lie_where_they_should() {
    let above = Picture::mono(look("contours_above", Vec3::Y * 10.0, Vec3::ZERO, [200, 200]));
    let corner = Picture::mono(look("contours_corner", Vec3::splat(4.0), Vec3::ZERO, [200, 200]));
    let one = || vec![grey(Vec3::new(2.0, 1.0, 2.0), 0.0, 0.0, 0.0)];
    let cube = || vec![grey(Vec3::splat(2.0), 0.0, 0.0, 0.0)];
    let two = || vec![grey(Vec3::new(4.0, 1.0, 4.0), 0.0, -1.0, 0.0), grey(Vec3::splat(1.0), -1.9, 0.0, 0.0)];
    let thin = ContourStyle { line_px: 3.0, outline_px: 0.0, ..INK };
    let creased = ContourStyle { crease_rad: 1.0, ..thin };
    let lit = |samples: Samples, scene: Scene| Scene { samples, ..scene };
    // Name, scene, picture, pixels with ink, pixels without.
    type Row<'a> = (&'a str, Scene, &'a Picture, &'a [(u32, u32)], &'a [(u32, u32)]);
    let rows: [Row<'_>; 7] = [
        (
            "a stroke around",
            scene(one(), INK),
            &above,
            &[(72, 100), (128, 100), (100, 72), (100, 128), (72, 72)],
            &[(68, 100), (77, 100), (100, 100)],
        ),
        ("at one sample", lit(Samples::One, scene(one(), INK)), &above, &[(72, 100), (128, 100)], &[(68, 100), (77, 100)]),
        ("a line on the edge", scene(one(), thin), &above, &[(74, 100), (125, 100)], &[(70, 100), (78, 100), (100, 100)]),
        // The far edge of the lower box runs below the upper one.
        ("what is in front hides strokes", scene(two(), INK), &above, &[(52, 60), (52, 140)], &[(52, 100), (56, 100)]),
        ("edges within are none", scene(cube(), thin), &corner, &[], &[(100, 100), (100, 112)]),
        ("but creases are", scene(cube(), creased), &corner, &[(100, 125)], &[(85, 125)]),
        ("nothing", Scene { contours: vec![], ..scene(one(), INK) }, &above, &[], &[(72, 100), (74, 100)]),
    ];
    let mut shooter = Shooter::new();
    for (name, scene, picture, with, without) in rows {
        let shot = shooter.shoot(&scene, picture);
        for (x, y) in with {
            assert!(is_ink(&shot, *x, *y), "{name}: ({x}, {y}) is {:?}", shot.pixel(*x, *y));
        }
        for (x, y) in without {
            assert!(!is_ink(&shot, *x, *y), "{name}: ({x}, {y}) is ink");
        }
        assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
    }
}

/// More shapes than the stencil has numbers: 0 and 255 are the same, and yet each has its stroke. A light by volume counts in
/// the same stencil before.
#[test]
fn numbers_come_again() {
    let box_of = |i: u32| grey(Vec3::new(0.2, 0.002, 0.2), (i % 18) as f32 * 0.4 - 3.4, 0.0, (i / 18) as f32 * 0.4 - 3.2);
    let mut scene = scene((0..300).map(box_of).collect(), ContourStyle { outline_px: 2.0, ..INK });
    scene.lights = vec![Light { shadows: ShadowMethod::Volume, direction: Vec3::new(-0.6, -0.7, 0.2).normalize(), ..noon() }];
    let shot = shoot(&scene, &Picture::mono(look("contours_many", Vec3::Y * 10.0, Vec3::ZERO, [400, 400])));
    let missing = (0..300u32).filter(|i| {
        let p = scene.drawables[*i as usize].world_from_object.w_axis.truncate();
        let pixels_per_m = 200.0 / (9.999 * 22.5f32.to_radians().tan());
        let pixel = |v: f32| 200.0 + v * pixels_per_m;
        let y = pixel(p.z) as u32;
        let beside = |side: f32| pixel(p.x + side * 0.1) + side * 1.0;
        !(is_ink(&shot, beside(-1.0) as u32, y) && is_ink(&shot, beside(1.0) as u32, y)) || is_ink(&shot, pixel(p.x) as u32, y)
    });
    assert_eq!(missing.collect::<Vec<_>>(), Vec::<u32>::new());
}
