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

fn picture(views: [View; 2], size: [u32; 2], layout: Layout) -> Picture {
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
