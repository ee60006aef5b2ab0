//! Saves of graphs that were made by hand: what they look like, and that a loaded world goes on as the saved one would have.

use std::sync::Arc;

use glam::Vec3;
use umbriel_fields::save::{self, TakenNames};
use umbriel_fields::{Field, Graph, Host, Image, Mode, NoHost, NodeId, SetRule, Strength, Value};

use crate::support::{described, types};

fn connect(graph: &mut Graph, from: (NodeId, &str), to: (NodeId, &str), strength: Strength) {
    let (from, to) = (graph.field(from.0, from.1).unwrap(), graph.field(to.0, to.1).unwrap());
    graph.connect(from, to, strength).unwrap();
}

/// A shared node, a dynamic field, both strengths, a shared image, a name that needs care.
fn small_world() -> (Graph, Vec<NodeId>) {
    let mut graph = Graph::new(types());
    let names = ["world", "path", "#4 \"quoted\".x\0", "sum"];
    let [world, path, odd, sum] = [("All", names[0]), ("PositionInterpolator", names[1]), ("All", names[2]), ("Adder", names[3])]
        .map(|(node_type, name)| {
            let node = graph.create(node_type).unwrap();
            graph.set_name(node, name).unwrap();
            node
        });
    let shared = graph.create("All").unwrap();
    graph.set_named(world, "children", [odd, shared]).unwrap();
    graph.set_named(odd, "children", [shared, world]).unwrap();
    graph.set_named(path, "key", [0.0f32, 0.5, 1.0]).unwrap();
    graph.set_named(path, "key_value", [Vec3::ZERO, Vec3::new(0.1, -0.0, f32::NAN), Vec3::INFINITY]).unwrap();
    let image = Arc::new(Image { width: 2, height: 1, rgba: (0..8).collect() });
    graph.set_named(odd, "image_one", image.clone()).unwrap();
    graph.set_named(shared, "image_many", vec![Some(image), None]).unwrap();
    graph.set_named(shared, "enum_one", "volume").unwrap();
    graph.set_mode(path, Mode::Always).unwrap();
    let speed = Field::new("speed", 1.5f32).unit("m/s").range(0.0, 9.0).alias("v").doc("How fast.").on_set(SetRule::Pulse);
    let speed = graph.add_field(sum, speed).unwrap();
    graph.set(speed, 0.1f32).unwrap();
    graph.add_field(sum, Field::choice("mood", &["good", "bad"], "bad")).unwrap();
    connect(&mut graph, (sum, "speed"), (path, "set_fraction"), Strength::Strong);
    connect(&mut graph, (path, "value_changed"), (world, "vec3_one"), Strength::Strong);
    connect(&mut graph, (sum, "sum"), (sum, "a"), Strength::Weak);
    connect(&mut graph, (shared, "f64_one"), (sum, "b"), Strength::Strong);
    connect(&mut graph, (odd, "f64_one"), (sum, "b"), Strength::Strong);
    (graph, vec![world, path, odd, sum, shared])
}

#[test]
fn a_world_survives_in_both_forms_and_twice_is_the_same() {
    let (graph, order) = small_world();
    let text = save::to_text(&graph);
    println!("{text}");
    for bytes in [text.clone().into_bytes(), save::to_binary(&graph)] {
        let (mut other, reports) = save::load(&bytes, types()).unwrap();
        assert_eq!(reports, []);
        let loaded = save::load_into(&mut other, &bytes, TakenNames::Number).unwrap();
        assert_eq!(loaded.nodes.len(), order.len());
        let (other, _) = save::load(&bytes, types()).unwrap();
        let mut again: Vec<NodeId> = other.nodes().collect();
        again.sort_by_key(|node| slot(*node));
        assert_eq!(described(&other, &again), described(&graph, &order));
        other.verify_invariants().unwrap();
        assert_eq!(save::to_text(&other), text, "what was loaded is saved as it was");
        assert_eq!(save::to_binary(&other), save::to_binary(&graph));
    }
}

/// Nodes of a fresh graph get ascending places.
fn slot(node: NodeId) -> u64 {
    use slotmap::Key;
    node.data().as_ffi() as u32 as u64
}

#[test]
fn shared_images_stay_shared() {
    let (graph, _) = small_world();
    for bytes in [save::to_text(&graph).into_bytes(), save::to_binary(&graph)] {
        let (graph, _) = save::load(bytes, types()).unwrap();
        let mut images = Vec::new();
        for node in graph.nodes() {
            for (field, _) in graph.field_ids(node) {
                match graph.value(field).unwrap() {
                    Value::Image(Some(image)) => images.push(image),
                    Value::Images(many) => images.extend(many.iter().flatten().cloned()),
                    _ => {}
                }
            }
        }
        assert_eq!(images.len(), 2);
        assert!(Arc::ptr_eq(&images[0], &images[1]));
    }
}

/// `out = 2 in + 1`, as a script would.
struct Doubler;

impl Host for Doubler {
    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        let value: f64 = graph.get_named(node, "in").unwrap();
        graph.set_named(node, "out", (2.0 * value + 1.0) % 1000.0).unwrap();
    }
}

/// A clock, a feedback loop over a weak route, a node that counts its evaluations, a script node.
fn running_world() -> (Graph, Vec<NodeId>) {
    let mut graph = Graph::new(types());
    let [clock, sum, script, idle] = ["TimeSensor", "Adder", "Script", "Adder"].map(|node_type| graph.create(node_type).unwrap());
    graph.set_named(clock, "loop", true).unwrap();
    connect(&mut graph, (clock, "fraction_changed"), (sum, "a"), Strength::Strong);
    connect(&mut graph, (script, "out"), (sum, "b"), Strength::Strong);
    connect(&mut graph, (sum, "sum"), (script, "in"), Strength::Weak);
    (graph, vec![clock, sum, script, idle])
}

#[test]
fn a_loaded_world_goes_on_as_the_saved_one() {
    for saved_after in [0, 1, 2, 7] {
        for binary in [false, true] {
            let (mut graph, order) = running_world();
            for number in 0..saved_after {
                graph.evaluate(number as f64 * 0.1, &mut Doubler);
            }
            let bytes = if binary { save::to_binary(&graph) } else { save::to_text(&graph).into_bytes() };
            let mut loaded = Graph::new(types());
            let nodes = save::load_into(&mut loaded, bytes, TakenNames::Refuse).unwrap().nodes;
            for number in saved_after..saved_after + 12 {
                assert_eq!(described(&loaded, &nodes), described(&graph, &order), "saved after {saved_after}, frame {number}");
                let time_s = number as f64 * 0.1;
                let (a, b) = (loaded.evaluate(time_s, &mut Doubler), graph.evaluate(time_s, &mut Doubler));
                assert_eq!((a.evaluated, a.problems), (b.evaluated, b.problems), "saved after {saved_after}, frame {number}");
            }
        }
    }
}

/// Each node costs its name and what differs from its type.
#[test]
fn a_large_world_is_saved_in_few_bytes() {
    let mut graph = Graph::new(types());
    let mut last = graph.create("All").unwrap();
    for number in 0..10_000 {
        let node = graph.create(if number % 2 == 0 { "Adder" } else { "All" }).unwrap();
        graph.set_name(node, &format!("node {number}")).unwrap();
        match number % 2 {
            0 => connect(&mut graph, (last, "f64_one"), (node, "a"), Strength::Strong),
            _ => {
                graph.set_named(node, "vec3_one", Vec3::splat(number as f32 * 0.1)).unwrap();
                connect(
                    &mut graph,
                    (last, "sum"),
                    (node, "f64_one"),
                    if number % 3 == 0 { Strength::Weak } else { Strength::Strong },
                );
            }
        }
        last = node;
    }
    let (text, binary) = (save::to_text(&graph), save::to_binary(&graph));
    for (bytes, per_node) in [(text.as_bytes(), 200), (&binary, 80)] {
        assert!(bytes.len() < per_node * 10_001, "{} bytes a node", bytes.len() / 10_001);
        let (loaded, reports) = save::load(bytes, types()).unwrap();
        assert_eq!((loaded.node_count(), reports.len()), (10_001, 0));
    }
}

#[test]
fn names_that_are_taken_are_refused_or_numbered() {
    let (mut graph, order) = small_world();
    let bytes = save::to_binary(&graph);
    let before = described(&graph, &order);
    let revision = graph.revision();
    let error = save::load_into(&mut graph, &bytes, TakenNames::Refuse).unwrap_err();
    assert_eq!(error.to_string(), "the names `world`, `path`, `#4 \"quoted\".x\0`, `sum` are taken");
    assert_eq!((graph.revision(), described(&graph, &order)), (revision, before), "nothing happened");
    let loaded = save::load_into(&mut graph, &bytes, TakenNames::Number).unwrap();
    assert_eq!(graph.name(loaded.nodes[0]), Some("world_2"));
    assert_eq!(loaded.reports[0].to_string(), "`world`: the name is taken; it is called `world_2` here");
    assert_eq!(loaded.reports.len(), 4);
    let children = graph.value_named(loaded.nodes[0], "children").unwrap();
    assert_eq!(children, Value::from([loaded.nodes[2], loaded.nodes[4]]), "references stay within what was loaded");
    graph.verify_invariants().unwrap();
}

#[test]
fn a_file_written_by_hand_is_as_new() {
    let text = r#"(format: "umbriel-world", version: (1, 0), // By hand.
        nodes: [
            (id: "sum", type: "adder", fields: {"A": 2, "b": 0.5}), // Spellings are free, and 2 is a number.
            (id: "to", type: "All"),
        ],
        routes: [(from: "sum.sum", to: "to.f64_one")])"#;
    let (mut graph, reports) = save::load(text, types()).unwrap();
    assert_eq!(reports, []);
    graph.evaluate(0.0, &mut NoHost);
    assert_eq!(graph.get_named::<f64>(graph.find("to").unwrap(), "f64_one"), Ok(2.5));
}
