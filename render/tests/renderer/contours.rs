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
    Scene {
        drawables: drawables.into(),
        ambient: Vec3::ONE,
        contours: vec![ContourGroup { drawables: all, style }],
        ..Scene::default()
    }
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

/// How much of a pixel is ink, 0 to 1: everything else in these pictures is as green as red.
fn ink(shot: &Shot, x: u32, y: u32) -> f32 {
    let linear = |byte: u8| (f32::from(byte) / 255.0 + 0.055).powf(2.4) / 1.055f32.powf(2.4);
    let [red, green, _, _] = shot.pixel(x, y);
    linear(red) - linear(green)
}

/// Runs of ink along a row or a column of pixels: the middle and the width of each, pixels.
fn strokes(along: impl Iterator<Item = f32>) -> Vec<(f32, f32)> {
    let inked: Vec<(f32, f32)> = along.enumerate().map(|(i, ink)| (i as f32 + 0.5, ink)).filter(|(_, ink)| *ink > 0.05).collect();
    let width = |run: &[(f32, f32)]| run.iter().map(|(_, ink)| ink).sum::<f32>();
    let middle = |run: &[(f32, f32)]| run.iter().map(|(at, ink)| at * ink).sum::<f32>() / width(run);
    inked.chunk_by(|a, b| b.0 - a.0 < 1.5).map(|run| (middle(run), width(run))).collect()
}

/// Pixels from the left and the top at which `view` sees a point.
fn seen_at(view: &View, point: Vec3) -> (f32, f32) {
    let seen = view.frustum.clip_from_view() * view.view_from_world * point.extend(1.0);
    let half = |side: u32| 0.5 * side as f32;
    (half(view.size[0]) * (1.0 + seen.x / seen.w), half(view.size[1]) * (1.0 - seen.y / seen.w))
}

/// Where strokes and lines lie, to a third of a pixel, and how wide they are: a box whose foot stands on the ground, seen as
/// a visitor sees it and from above.
#[test]
fn lines_are_as_wide_as_they_should_be() {
    let walked = look("contours_walked", Vec3::new(0.0, 4.0, 9.0), Vec3::Y, [200, 200]);
    let above = look("contours_straight", Vec3::Y * 10.0, Vec3::ZERO, [200, 200]);
    let standing =
        || vec![grey(Vec3::new(4.0, 1.0, 2.0), 0.0, 0.5, 0.0), shape(plane(60.0), matt(0.1, 0.1, 0.1), at(0.0, 0.0, 0.0))];
    let scene_of = |style, samples| {
        let mut scene = Scene { samples, ..scene(standing(), style) };
        scene.contours[0].drawables.truncate(1);
        scene
    };
    let line = ContourStyle { line_px: 3.0, outline_px: 0.0, ..INK };
    // Name, style, view, across (true: along the row of the middle), points whose pixels bound strokes, and by how many
    // pixels the middle of the stroke is farther right or down, and its width.
    type Row<'a> = (&'a str, ContourStyle, &'a View, bool, &'a [(Vec3, f32, f32)]);
    let (far_top, foot) = (Vec3::new(0.0, 1.0, -1.0), Vec3::new(0.0, 0.0, 1.0));
    let (left, right) = (Vec3::new(-2.0, 1.0, 0.0), Vec3::new(2.0, 1.0, 0.0));
    let rows: [Row<'_>; 4] = [
        ("strokes above and along the foot", INK, &walked, false, &[(far_top, -2.0, 4.0), (foot, 2.0, 4.0)]),
        ("strokes at both sides", INK, &above, true, &[(left, -2.0, 4.0), (right, 2.0, 4.0)]),
        ("lines on both sides", line, &above, true, &[(left, 0.0, 3.0), (right, 0.0, 3.0)]),
        ("narrow strokes", ContourStyle { outline_px: 1.0, ..INK }, &walked, false, &[(far_top, -0.5, 1.0), (foot, 0.5, 1.0)]),
    ];
    let mut shooter = Shooter::new();
    for (name, style, view, across, expected) in rows {
        for (samples, tolerance) in [(Samples::Four, 0.34), (Samples::One, 0.76)] {
            let shot = shooter.shoot(&scene_of(style, samples), &Picture::mono(view.clone()));
            let found = strokes((0..200).map(|i| if across { ink(&shot, i, 100) } else { ink(&shot, 100, i) }));
            println!("{name}: {found:?}");
            assert_eq!(found.len(), expected.len(), "{name}, {samples:?}: {found:?}");
            for ((point, beside, wide), (middle, width)) in expected.iter().zip(found) {
                let (x, y) = seen_at(view, *point);
                let off = middle - if across { x } else { y } - beside;
                assert!(off.abs() <= tolerance, "{name}, {samples:?}: the middle at {middle} is {off} pixels off");
                assert!((width - wide).abs() <= tolerance, "{name}, {samples:?}: {width} pixels wide instead of {wide}");
            }
        }
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
