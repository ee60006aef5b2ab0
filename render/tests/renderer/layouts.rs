//! How views make pictures.

use crate::support::*;
use glam::{Mat4, Vec3, Vec4};
use umbriel_render::Renderer;
use umbriel_scene::*;

/// Two cards, red at the left and white at the right; a view of either.
fn cards() -> (Scene, [View; 2]) {
    let card = |x: f32, color: Vec4| {
        let material = Material { shading: Shading::Unlit, base_color: color, ..Default::default() };
        shape(plane(4.0), material, at(x, 0.0, 0.0))
    };
    let drawables = vec![card(-5.0, Vec4::new(0.25, 0.5, 0.75, 1.0)), card(5.0, Vec4::new(0.75, 0.25, 0.5, 1.0))];
    let over = |x: f32| look("over", Vec3::new(x, 2.0, 0.0), Vec3::new(x, 0.0, 0.0), [32, 32]);
    (Scene { drawables: drawables.into(), ..Default::default() }, [over(-5.0), over(5.0)])
}

fn picture<const N: usize>(views: [View; N], size: [u32; 2], layout: Layout) -> Picture {
    Picture { name: "layout".into(), size, views: views.into(), layout, kind: PictureKind::Colour }
}

#[test]
fn views_come_to_their_places() {
    let (scene, views) = cards();
    let (left, right) = ([0.25, 0.5, 0.75], [0.75, 0.25, 0.5]);
    let rect = |x, y| Rect { x, y, width: 32, height: 32 };
    let tiles = |a, b| Layout::Tiles(vec![a, b]);
    for (name, size, layout, points) in [
        ("side by side", [64, 32], tiles(rect(0, 0), rect(32, 0)), vec![(16, 16, left), (48, 16, right)]),
        ("top and bottom", [32, 64], tiles(rect(0, 0), rect(0, 32)), vec![(16, 16, left), (16, 48, right)]),
        ("with a gap", [80, 32], tiles(rect(48, 0), rect(0, 0)), vec![(16, 16, right), (40, 16, [0.0; 3]), (60, 16, left)]),
        ("anaglyph", [32, 32], Layout::Anaglyph, vec![(16, 16, [left[0], right[1], right[2]])]),
    ] {
        let shot = shoot(&scene, &picture(views.clone(), size, layout));
        for (x, y, colour) in points {
            assert_colour(shot.pixel(x, y), colour, name);
        }
        assert_eq!(shot.problems, Vec::<String>::new(), "{name}");
    }
    let shot = shoot(&scene, &picture(views.clone(), [32, 32], Layout::Layers));
    assert_eq!(shot.layers.len(), 2);
    assert_colour(shot.layers[0].pixel(16, 16), left, "first layer");
    assert_colour(shot.layers[1].pixel(16, 16), right, "second layer");
    let outside = picture(views, [40, 32], tiles(rect(0, 0), rect(32, 0)));
    let shot = shoot(&scene, &outside);
    assert!(shot.problems[0].contains("no place"), "{:?}", shot.problems);
    assert_colour(shot.pixel(16, 16), left, "the other one is drawn");
}

#[test]
fn pictures_of_a_frame_are_as_if_alone() {
    let (mut scene, views) = cards();
    scene.lights = vec![Light { shadows: ShadowMethod::Map, ..noon() }];
    let pictures = [
        picture(views.clone(), [32, 32], Layout::Layers),
        Picture { kind: PictureKind::LightVisibility(0), ..Picture::mono(views[0].clone()) },
        Picture::mono(look("far", Vec3::new(3.0, 20.0, 9.0), Vec3::ZERO, [50, 40])),
    ];
    let (turn, gpu) = gpu();
    let mut renderer = Renderer::new(gpu).unwrap();
    for frame in 0..3 {
        renderer.render(&scene, &pictures).unwrap();
        assert_eq!(renderer.problems(), Vec::<String>::new(), "frame {frame}");
    }
    let together: Vec<_> = (0..3).map(|i| renderer.read_back(i).unwrap()).collect();
    drop(turn);
    for (picture, layers) in pictures.iter().zip(together) {
        assert_eq!(shoot(&scene, picture).layers, layers, "{}", picture.name);
    }
}

#[test]
fn a_view_may_be_off_axis_and_anywhere() {
    // A window at the left of the axis shows what is at the left.
    let (scene, _) = cards();
    let view_from_world = glam::camera::rh::view::look_at_mat4(Vec3::new(0.0, 5.0, 0.0), Vec3::ZERO, Vec3::NEG_Z);
    let window = |left: f32, right: f32| Frustum { left, right, bottom: -0.05, top: 0.05, near: 0.1 };
    for (frustum, colour) in [(window(-0.15, -0.05), [0.25, 0.5, 0.75]), (window(0.05, 0.15), [0.75, 0.25, 0.5])] {
        let view = View { name: "window".into(), view_from_world, frustum, size: [32, 32] };
        assert_colour(shoot(&scene, &Picture::mono(view)).centre(), colour, "off axis");
    }
    let far_off = Mat4::from_translation(Vec3::new(0.0, 1e4, 0.0));
    let mut moved = scene.clone();
    moved.drawables.iter_mut().for_each(|d| *d = shape_of(&d.mesh, &d.material, far_off * d.world_from_object));
    let eye = Vec3::new(5.0, 1e4 + 3.0, 0.0);
    let view = look("far off", eye, eye - Vec3::Y, [32, 32]);
    assert_colour(shoot(&moved, &Picture::mono(view)).centre(), [0.75, 0.25, 0.5], "ten kilometres up");
}

/// What is drawn straight in its picture, and what for this or that reason is not, looks the same to the last bit but one.
#[test]
fn pictures_drawn_in_themselves_are_as_if_composed() {
    let box_at = |x: f32| shape(cuboid(Vec3::ONE), matt(0.8, 0.5, 0.3), at(x, 0.5, 0.0));
    let drawables = vec![shape(plane(40.0), matt(0.6, 0.6, 0.6), at(0.0, 0.0, 0.0)), box_at(-1.5), box_at(1.5)];
    let sun = |shadows| Light { direction: Vec3::new(-0.5, -1.0, -0.4).normalize(), shadows, ..noon() };
    let lamp = |shadows| Light { kind: LightKind::Point, position: Vec3::new(0.0, 3.0, 1.0), shadows, ..noon() };
    let scene = |lights: &[Light]| Scene {
        drawables: drawables.clone().into(),
        lights: lights.to_vec(),
        samples: Samples::One,
        exposure: 1.7,
        background: Background { horizon: Vec3::new(0.4, 0.5, 0.6), ..Default::default() },
        ..Default::default()
    };
    let (volume, map) = (ShadowMethod::Volume, ShadowMethod::Map);
    let view = |x: f32, width| look("row", Vec3::new(x, 2.0, 6.0), Vec3::new(x, 0.5, 0.0), [width, 48]);
    let rect = |x, width| Rect { x, y: 0, width, height: 48 };
    let row = |rects: [Rect; 2]| {
        let views = [view(-1.0, rects[0].width), view(1.0, rects[1].width)];
        picture(views, [112, 48], Layout::Tiles(rects.into()))
    };
    let in_order = row([rect(0, 64), rect(64, 48)]);
    let behind_the_eye = shape(plane(1.0), Material { alpha: AlphaMode::Blend, ..matt(1.0, 1.0, 1.0) }, at(0.0, 1.0, 30.0));
    let rows = [
        ("no light", vec![], &in_order, 0),
        ("a sun by volume", vec![sun(volume)], &in_order, 0),
        ("a sun by map, a lamp by volume", vec![sun(map), lamp(volume)], &in_order, 0),
        ("two lights by volume add up", vec![sun(volume), lamp(volume)], &in_order, 2),
        ("views that do not lie in a row", vec![sun(volume)], &row([rect(48, 64), rect(0, 48)]), 2),
        ("views with a gap", vec![sun(volume)], &row([rect(0, 32), rect(64, 48)]), 2),
    ];
    for (name, lights, picture, composed) in rows {
        let mut scene = scene(&lights);
        let shot = shoot(&scene, picture);
        assert_eq!((shot.stats.composed, shot.problems), (composed, Vec::new()), "{name}");
        scene.drawables = scene.drawables.iter().cloned().chain([behind_the_eye.clone()]).collect::<Vec<_>>().into();
        let with_glass = shoot(&scene, picture);
        assert_eq!(with_glass.stats.composed, 2, "{name}, with something half-transparent");
        let worst = shot.layers[0].rgba.iter().zip(&with_glass.layers[0].rgba).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(1), "{name}: {worst:?}");
        assert!(shot.layers[0].rgba.iter().any(|v| *v > 100), "{name}: black");
    }
    let (scene, four) = (scene(&[sun(volume)]), Samples::Four);
    assert_eq!(
        shoot(&Scene { samples: four, ..scene }, &in_order).stats.composed,
        2,
        "samples are mixed before they are exposed"
    );
}

/// Views that share a target do not touch each other's samples, however wide they are.
#[test]
fn neighbours_are_as_if_alone() {
    let box_at = |x: f32| shape(cuboid(Vec3::ONE), matt(0.8, 0.5, 0.3), at(x, 0.5, 0.0));
    let sun = Light { direction: Vec3::new(-0.5, -1.0, -0.4).normalize(), shadows: ShadowMethod::Volume, ..noon() };
    let scene = Scene {
        drawables: vec![shape(plane(40.0), matt(0.6, 0.6, 0.6), at(0.0, 0.0, 0.0)), box_at(-1.5), box_at(1.5)].into(),
        lights: vec![sun],
        samples: Samples::Four,
        ..Scene::default()
    };
    let view = |i: usize| look("one", Vec3::new(3.0 * i as f32 - 3.0, 2.0, 6.0), Vec3::new(0.0, 0.5, 0.0), [75, 48]);
    let rects = [0, 1, 2].map(|i| Rect { x: 75 * i, y: 0, width: 75, height: 48 });
    let all = shoot(&scene, &picture([view(0), view(1), view(2)], [225, 48], Layout::Tiles(rects.into())));
    for i in 0..3 {
        let alone = shoot(&scene, &picture([view(i)], [75, 48], Layout::Tiles([rects[0]].into())));
        let row = |pixels: &[u8], left: usize, width: usize, y: usize| pixels[4 * (y * width + left)..][..4 * 75].to_vec();
        for y in 0..48 {
            let (one, among) = (row(&alone.layers[0].rgba, 0, 75, y), row(&all.layers[0].rgba, 75 * i, 225, y));
            let differs = one.iter().zip(&among).position(|(a, b)| a.abs_diff(*b) > 1).map(|k| k / 4);
            assert_eq!(differs, None, "column of view {i}, row {y}");
        }
    }
}
