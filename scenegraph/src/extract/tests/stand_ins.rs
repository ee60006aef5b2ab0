//! Reduced casters in the scene.

use crate::Extractor;
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::Scene;

fn shape(graph: &mut Graph, segments: i32, caster: Option<NodeId>) -> NodeId {
    let sphere = graph.create("Sphere").unwrap();
    graph.set_named(sphere, "segments", segments).unwrap();
    let shape = graph.create("Shape").unwrap();
    graph.set_named(shape, "geometry", Some(sphere)).unwrap();
    graph.set_named(shape, "caster", caster).unwrap();
    shape
}

fn show(graph: &mut Graph, shapes: &[NodeId]) {
    let world = graph.find(crate::WORLD).unwrap();
    let children: std::sync::Arc<[Option<NodeId>]> = shapes.iter().copied().map(Some).collect();
    graph.set_named(world, "children", children).unwrap();
}

#[test]
fn stand_ins_cast_in_place_of_shapes() {
    let mut graph = crate::new_graph();
    let made = graph.create("ReducedCaster").unwrap();
    graph.set_named(made, "max_error", 0.05f32).unwrap();
    let given = graph.create("Box").unwrap();
    let shapes = [shape(&mut graph, 48, Some(made)), shape(&mut graph, 24, None), shape(&mut graph, 24, Some(given))];
    show(&mut graph, &shapes);
    let (mut extractor, mut scene) = (Extractor::new().with_ready_casters(), Scene::default());
    extractor.update(&graph, &mut scene);
    assert_eq!(extractor.problems(), []);
    let of: Vec<(usize, usize)> = scene.stand_ins.iter().map(|s| (s.place, s.of)).collect();
    assert_eq!(of, [(3, 0), (4, 2)]);
    let casts: Vec<bool> = scene.drawables.iter().map(|d| d.casts_shadow).collect();
    assert_eq!(casts, [false, true, false, true, true]);
    assert!(scene.stand_ins[0].error_m <= 0.05 && scene.stand_ins[1].error_m.is_nan());
    assert!(scene.drawables[3].mesh.triangle_count() < scene.drawables[0].mesh.triangle_count() / 2);
    let full: Vec<bool> = scene.with_full_casters().drawables.iter().map(|d| d.visible && d.casts_shadow).collect();
    assert_eq!(full, [true, true, true, false, false]);

    // Nothing changed: nothing is written.
    assert_eq!(extractor.update(&graph, &mut scene), Default::default());
    // A shape that casts no shadow has no stand-in; one without caster casts itself again; new shapes get their places.
    graph.set_named(shapes[0], "cast_shadow", false).unwrap();
    graph.set_named(shapes[2], "caster", None::<NodeId>).unwrap();
    extractor.update(&graph, &mut scene);
    assert_eq!((scene.stand_ins.len(), scene.drawables.len()), (0, 3));
    assert!(!scene.drawables[0].casts_shadow && scene.drawables[2].casts_shadow);
    graph.set_named(shapes[0], "cast_shadow", true).unwrap();
    let more = [shapes[0], shapes[1], shapes[2], shape(&mut graph, 12, None)];
    show(&mut graph, &more);
    extractor.update(&graph, &mut scene);
    assert_eq!(scene.stand_ins.iter().map(|s| (s.place, s.of)).collect::<Vec<_>>(), [(4, 0)]);
    assert_eq!(scene.drawables.len(), 5);
}

#[test]
fn near_shapes_cast_themselves() {
    let mut graph = crate::new_graph();
    let made = graph.create("ReducedCaster").unwrap();
    graph.set_named(made, "max_error", 0.05f32).unwrap();
    graph.set_named(made, "angle", 0.005f32).unwrap();
    let shapes = [shape(&mut graph, 48, Some(made))];
    let place = graph.create("Transform").unwrap();
    let children: std::sync::Arc<[Option<NodeId>]> = [Some(shapes[0])].into();
    graph.set_named(place, "children", children).unwrap();
    show(&mut graph, &[place]);
    let (mut extractor, mut scene) = (Extractor::new().with_ready_casters(), Scene::default());
    for (distance, expected) in [(3.0, 0), (30.0, 1), (3.0, 0)] {
        graph.set_named(place, "translation", glam::Vec3::NEG_Z * distance).unwrap();
        extractor.update(&graph, &mut scene);
        assert_eq!(scene.stand_ins.len(), expected, "at {distance} m");
        assert_eq!(scene.drawables[0].casts_shadow, expected == 0);
    }
}

#[test]
fn a_thread_makes_them_beside_the_frames() {
    let mut graph = crate::new_graph();
    let made = graph.create("ReducedCaster").unwrap();
    let shapes = [shape(&mut graph, 48, Some(made))];
    show(&mut graph, &shapes);
    let (mut extractor, mut scene) = (Extractor::new(), Scene::default());
    extractor.update(&graph, &mut scene);
    assert!(scene.drawables[0].casts_shadow, "until then the shape casts itself");
    for _ in 0..3000 {
        extractor.update(&graph, &mut scene);
        if !scene.stand_ins.is_empty() {
            assert!(!scene.drawables[0].casts_shadow);
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    panic!("no reduced caster came");
}

#[test]
fn what_cannot_be_reduced_is_told_and_casts_itself() {
    let mut graph = crate::new_graph();
    let made = graph.create("ReducedCaster").unwrap();
    graph.set_named(made, "max_error", 1e-6f32).unwrap();
    let shapes = [shape(&mut graph, 12, Some(made))];
    show(&mut graph, &shapes);
    let (mut extractor, mut scene) = (Extractor::new().with_ready_casters(), Scene::default());
    extractor.update(&graph, &mut scene);
    assert!(scene.stand_ins.is_empty() && scene.drawables[0].casts_shadow);
    let problems: Vec<String> = extractor.problems().iter().map(ToString::to_string).collect();
    assert!(problems.len() == 1 && problems[0].contains("caster") && problems[0].contains("casts itself"), "{problems:?}");
}
