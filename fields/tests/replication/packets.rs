//! Packets: what they cost, what travels once, and what bad ones are answered with.

use std::sync::Arc;

use glam::Vec3;
use slotmap::Key;
use umbriel_fields::record::{Options, Recorder, Replayer};
use umbriel_fields::replica::{Bulk, Packet, Publisher, Replica, ReplicaError, seal};
use umbriel_fields::{Changes, Field, Graph, Image, NoHost, NodeId, NodeType, TypeRegistry, Value};

use crate::support::types;

fn replica_of(publisher: &mut Publisher, graph: &Graph, bulk: &mut Bulk) -> Replica {
    let bytes = publisher.snapshot(graph).unwrap();
    let packet = Packet::read(&bytes).unwrap();
    for hash in packet.missing(bulk) {
        bulk.learn(hash, &publisher.bulk(hash).unwrap()).unwrap();
    }
    Replica::new(&packet, types(), bulk).unwrap()
}

fn world() -> (Graph, NodeId) {
    let mut graph = Graph::new(types());
    let node = graph.create("All").unwrap();
    graph.set_name(node, "mesh").unwrap();
    (graph, node)
}

#[test]
fn a_frame_costs_what_was_written() {
    let mut graph = Graph::new(types());
    let nodes: Vec<NodeId> = (0..1000).map(|_| graph.create("All").unwrap()).collect();
    let mut publisher = Publisher::new();
    publisher.frame(&graph);
    let idle = publisher.frame(&graph).len();
    assert!(idle < 64, "an idle frame has {idle} bytes");
    for node in &nodes {
        graph.set_named(*node, "vec3_one", Vec3::ONE).unwrap();
    }
    let bytes = publisher.frame(&graph).len();
    assert!(bytes < idle + 1000 * 12 + 32, "12 bytes of a vector, and one run of all nodes: {bytes}");
    for node in nodes.iter().step_by(3) {
        graph.set_named(*node, "vec3_one", Vec3::ZERO).unwrap();
    }
    let bytes = publisher.frame(&graph).len();
    assert!(bytes < idle + 334 * 12 + 32, "a run has steps: {bytes}");
}

/// Nodes that were made in a row and then some of them not any more, written by patterns: all, few, with holes, of one field or of two.
fn values_of_nodes_in_a_row_arrive(others_between: usize) {
    let mut graph = Graph::new(types());
    let mut nodes: Vec<NodeId> = Vec::new();
    for _ in 0..60 {
        nodes.push(graph.create("All").unwrap());
        for _ in 0..others_between {
            graph.create("Adder").unwrap();
        }
    }
    let (mut publisher, mut bulk) = (Publisher::new(), Bulk::new());
    publisher.frame(&graph);
    let mut replica = replica_of(&mut publisher, &graph, &mut bulk);
    type Pattern = fn(usize) -> bool;
    let patterns: [Pattern; 7] = [
        |_| true,
        |place| place != 1,
        |place| [0, 2, 57].contains(&place),
        |place| place < 7,
        |place| (10..50).contains(&place),
        |place| place % 3 == 0,
        |place| place > 30 && place != 40,
    ];
    for round in 0..8 {
        for (number, pattern) in patterns.iter().enumerate() {
            for (place, node) in nodes.iter().enumerate().filter(|(place, _)| pattern(*place)) {
                let value = (round * 1000 + number * 100 + place) as f32;
                graph.set_named(*node, "vec3_one", Vec3::new(value, -value, 0.5)).unwrap();
                if place % 2 == 0 || number == 0 {
                    graph.set_named(*node, "f32_one", value).unwrap();
                }
            }
            let bytes = publisher.frame(&graph);
            let mark = replica.graph().revision();
            replica.apply(&Packet::read(&bytes).unwrap(), &bulk).unwrap();
            let Changes::Nodes(mut changed) = replica.graph().changes_since(mark) else { panic!("that is known") };
            let there = |node: &NodeId| replica.node(node.data().as_ffi()).unwrap();
            let written = nodes.iter().enumerate().filter(|(place, _)| pattern(*place)).map(|(_, node)| there(node));
            let mut expected: Vec<NodeId> = written.collect();
            if number == 0 {
                // What came and went in this frame.
                changed.retain(|node| nodes.iter().any(|known| there(known) == *node));
            }
            changed.sort();
            expected.sort();
            assert_eq!(changed, expected, "round {round}, pattern {number}");
            let fresh = replica_of(&mut publisher, &graph, &mut bulk);
            assert!(replica.agrees() && fresh.agrees(), "round {round}, pattern {number}");
            assert_eq!(replica.difference(&fresh), None);
            for node in &nodes {
                let there = there(node);
                for field in ["vec3_one", "f32_one"] {
                    let values = [graph.value_named(*node, field), replica.graph().value_named(there, field)];
                    assert_eq!(values[0], values[1], "round {round}, pattern {number}, {field}");
                }
            }
        }
        // The row has a hole, and then a node out of the row in it; the last stands in another place.
        let gone = nodes.remove([50, 3, 20, 0, 30, 54, 10, 10][round]);
        graph.delete(gone).unwrap();
        if round % 2 == 0 {
            nodes.push(graph.create("All").unwrap());
        }
    }
}

#[test]
fn values_of_nodes_in_a_row_arrive_however_they_are_written() {
    (0..3).for_each(values_of_nodes_in_a_row_arrive);
}

/// A recording that is played from a later frame on: values of the nodes lie elsewhere then.
#[test]
fn a_graph_that_was_restored_is_followed() {
    // Of a type that is evaluated here, a restored node is still the same.
    let of = |name: &str| NodeType::new(name, "").field(Field::new("place", Vec3::ZERO)).evaluate(|_| {});
    let registry = TypeRegistry::from(vec![of("Thing"), of("Other")]);
    let mut recorded = Graph::new(registry.clone());
    let both = (0..40).map(|_| ["Thing", "Other"].map(|name| recorded.create(name).unwrap()));
    let (nodes, others): (Vec<NodeId>, Vec<NodeId>) = both.map(|[thing, other]| (thing, other)).unzip();
    let mut recorder = Recorder::new(&mut recorded, Vec::new(), Options { keyframe_every: 1 }).unwrap();
    for frame in 1..=8 {
        if frame == 4 {
            recorded.delete(nodes[3]).unwrap();
            // Values of things that stand in a row do not lie in a row any more.
            recorded.delete(others[20]).unwrap();
        }
        for (place, node) in nodes.iter().enumerate().filter(|(place, _)| *place != 3 || frame < 4) {
            recorded.set_named(*node, "place", Vec3::new(frame as f32, place as f32, 1.0)).unwrap();
        }
        for other in others.iter().filter(|other| frame < 4 || **other != others[20]) {
            recorded.set_named(*other, "place", Vec3::splat(-frame as f32)).unwrap();
        }
        recorded.evaluate(frame as f64, &mut NoHost);
        recorder.frame(&mut recorded).unwrap();
    }
    let bytes = recorder.finish(&mut recorded).unwrap();
    let (mut replayer, mut graph) = Replayer::open(&bytes[..], registry.clone()).unwrap();
    let (mut publisher, bulk) = (Publisher::new(), Bulk::new());
    publisher.frame(&graph);
    let copy = |publisher: &mut Publisher, graph: &Graph, bulk: &Bulk| {
        Replica::new(&Packet::read(publisher.snapshot(graph).unwrap()).unwrap(), registry.clone(), bulk).unwrap()
    };
    let mut replica = copy(&mut publisher, &graph, &bulk);
    for frame in [1, 2, 6, 7, 8] {
        replayer.seek(&mut graph, frame).unwrap();
        replica.apply(&Packet::read(publisher.frame(&graph)).unwrap(), &bulk).unwrap();
        let fresh = copy(&mut publisher, &graph, &bulk);
        assert!(replica.agrees() && fresh.agrees(), "frame {frame}");
        assert_eq!(replica.difference(&fresh), None, "frame {frame}");
        for node in graph.nodes().filter(|node| &*graph.type_of(*node).name == "Thing") {
            let there = replica.node(node.data().as_ffi()).unwrap();
            let values = [graph.value_named(node, "place"), replica.graph().value_named(there, "place")];
            assert_eq!(values[0], values[1], "frame {frame}");
            assert!(matches!(values[0], Ok(Value::Vec3(found)) if found.x == frame as f32), "frame {frame}: {values:?}");
        }
    }
}

#[test]
fn long_values_and_images_travel_once() {
    let (mut graph, node) = world();
    let image = Arc::new(Image { width: 64, height: 64, rgba: vec![7; 64 * 64 * 4].into() });
    let points: Vec<Vec3> = (0..10_000).map(|n| Vec3::splat(n as f32)).collect();
    graph.set_named(node, "vec3_many", points.clone()).unwrap();
    graph.set_named(node, "image_one", image.clone()).unwrap();
    let mut publisher = Publisher::new();
    let first = publisher.frame(&graph);
    let mut bulk = Bulk::new();
    assert_eq!(Packet::read(&first).unwrap().missing(&bulk).len(), 2);
    assert!(first.len() < 8000, "the values themselves are elsewhere: {}", first.len());
    let replica = replica_of(&mut publisher, &graph, &mut bulk);
    // Another node with the same content, and who comes back: nothing is missing.
    let twin = graph.create("All").unwrap();
    graph.set_named(twin, "vec3_many", points).unwrap();
    graph.set_named(twin, "image_one", Arc::new(Image::clone(&image))).unwrap();
    let second = publisher.frame(&graph);
    assert_eq!(Packet::read(&second).unwrap().missing(&bulk), []);
    let again = replica_of(&mut publisher, &graph, &mut bulk);
    let picture = |replica: &Replica| {
        let node = replica.graph().find("mesh").unwrap();
        replica.graph().get_named::<Option<Arc<Image>>>(node, "image_one").unwrap().unwrap()
    };
    assert!(Arc::ptr_eq(&picture(&replica), &picture(&again)), "caches of a GPU go by identity: it stays");
    // What changes every frame goes as it is.
    for frame in 0..3 {
        graph.set_named(node, "vec3_many", vec![Vec3::splat(frame as f32); 5000]).unwrap();
        let bytes = publisher.frame(&graph);
        assert_eq!(Packet::read(&bytes).unwrap().missing(&bulk), []);
    }
    // Nobody holds the first list any more but the twin; both are offered still, for who was slow.
    graph.delete(node).unwrap();
    graph.delete(twin).unwrap();
    publisher.frame(&graph);
    assert!(Packet::read(&first).unwrap().missing(&Bulk::new()).iter().all(|hash| publisher.bulk(*hash).is_some()));
}

#[test]
fn a_node_that_comes_after_its_reference_is_found() {
    let (mut graph, node) = world();
    let child = graph.create("All").unwrap();
    graph.set_local(child, true).unwrap();
    graph.set_named(node, "children", [child]).unwrap();
    let mut publisher = Publisher::new();
    publisher.frame(&graph);
    let mut bulk = Bulk::new();
    let mut replica = replica_of(&mut publisher, &graph, &mut bulk);
    let children = |replica: &Replica| {
        let graph = replica.graph();
        let children = graph.get_named::<Arc<[Option<NodeId>]>>(graph.find("mesh").unwrap(), "children").unwrap();
        children[0].is_some_and(|child| graph.contains(child))
    };
    assert!(!children(&replica));
    graph.set_local(child, false).unwrap();
    replica.apply(&Packet::read(publisher.frame(&graph)).unwrap(), &bulk).unwrap();
    assert!(children(&replica) && replica.agrees());
    graph.set_local(child, true).unwrap();
    replica.apply(&Packet::read(publisher.frame(&graph)).unwrap(), &bulk).unwrap();
    assert!(!children(&replica) && replica.agrees());
}

#[test]
fn the_dead_are_forgotten_once_nothing_refers_to_them() {
    let (mut graph, node) = world();
    let mut publisher = Publisher::new();
    publisher.frame(&graph);
    let mut bulk = Bulk::new();
    let mut replica = replica_of(&mut publisher, &graph, &mut bulk);
    for frame in 0..60 {
        let made: Vec<NodeId> = (0..200).map(|_| graph.create("Adder").unwrap()).collect();
        graph.set_named(node, "node_one", made[0]).unwrap();
        replica.apply(&Packet::read(publisher.frame(&graph)).unwrap(), &bulk).unwrap();
        made.iter().for_each(|node| graph.delete(*node).unwrap());
        replica.apply(&Packet::read(publisher.frame(&graph)).unwrap(), &bulk).unwrap();
        assert!(replica.agrees(), "frame {frame}");
        let late = replica_of(&mut publisher, &graph, &mut bulk);
        assert!(late.agrees() && late.difference(&replica).is_none(), "frame {frame}");
    }
}

#[test]
fn bad_packets_are_told_and_do_no_harm() {
    let (mut graph, node) = world();
    let mut publisher = Publisher::new();
    publisher.frame(&graph);
    let mut bulk = Bulk::new();
    let mut replica = replica_of(&mut publisher, &graph, &mut bulk);
    graph.set_named(node, "vec3_one", Vec3::ONE).unwrap();
    let good = publisher.frame(&graph);
    let error = |bytes: &[u8]| Packet::read(bytes).err();
    let changed = |place: usize, value: u8| {
        let mut bytes = good.clone();
        bytes[place] ^= value;
        bytes
    };
    assert_eq!(error(b"hello"), Some(ReplicaError::NotAPacket));
    assert_eq!(error(&changed(0, 1)), Some(ReplicaError::NotAPacket));
    assert_eq!(error(&changed(4, 2)), Some(ReplicaError::WrongVersion { found: 1, ours: 3 }));
    for place in 6..good.len() {
        let found = error(&changed(place, 64));
        assert!(matches!(found, Some(ReplicaError::Damaged { .. })), "byte {place}: {found:?}");
    }
    for end in 0..good.len() {
        assert!(error(&good[..end]).is_some(), "{end} bytes");
    }
    // With a checksum that fits, the records are all that protects.
    for place in 14..good.len() {
        let mut bytes = changed(place, 255);
        seal(&mut bytes);
        if let Ok(packet) = Packet::read(&bytes) {
            let mut victim = replica_of(&mut publisher, &graph, &mut bulk);
            let _ = victim.apply(&packet, &bulk);
            victim.graph().verify_invariants().unwrap();
        }
    }
    let mut next = publisher.unsealed_frame(&graph);
    let unsealed = next.clone();
    seal(&mut next);
    assert!(error(&unsealed).is_none() && error(&next).is_none() && unsealed[6..14] == [0; 8] && next[14..] == unsealed[14..]);
    let gap = replica.apply(&Packet::read(&next).unwrap(), &bulk);
    assert_eq!(gap, Err(ReplicaError::Gap { last: 1, found: 3 }));
    replica.apply(&Packet::read(&good).unwrap(), &bulk).unwrap();
    replica.apply(&Packet::read(&next).unwrap(), &bulk).unwrap();
    assert!(replica.agrees());
    let snapshot = publisher.snapshot(&graph).unwrap();
    let kind = replica.apply(&Packet::read(&snapshot).unwrap(), &bulk);
    assert_eq!(kind, Err(ReplicaError::OtherKind { expected: "frame" }));
    assert_eq!(
        bulk.learn(5, &[0, 1, 2]).unwrap_err().to_string(),
        "the packet is damaged: a long value is not what its hash 0000000000000005 says"
    );
}

#[test]
fn a_type_that_means_something_else_is_refused() {
    let mut graph = Graph::new(vec![NodeType::new("Lamp", "").field(Field::new("power", 1.0f32))]);
    graph.create("Lamp").unwrap();
    let mut publisher = Publisher::new();
    publisher.frame(&graph);
    let bytes = publisher.snapshot(&graph).unwrap();
    let packet = Packet::read(&bytes).unwrap();
    let other = vec![NodeType::new("Lamp", "").field(Field::new("power", 1i32))];
    let error = Replica::new(&packet, other, &Bulk::new()).err().unwrap().to_string();
    assert_eq!(
        error,
        "field `power` of node type `Lamp` is a f32 in the application and a i32 here: both ends must be of one release"
    );
    let mut replica = Replica::new(&packet, vec![NodeType::new("Other", "")], &Bulk::new()).unwrap();
    assert_eq!(replica.unknown_types(), ["Lamp"]);
    assert!(replica.agrees());
}
