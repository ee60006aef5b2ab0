//! Sessions made by hand: what diverges is named, scripts are not needed, and what it costs.

use glam::{Quat, Vec3};
use umbriel_fields::record::{Options, RecordError, Recorder, Replayer, summary};
use umbriel_fields::save::{self, TakenNames};
use umbriel_fields::{Field, FieldId, Graph, Host, NoHost, NodeId, NodeType, Strength, TypeRegistry};

use crate::support::{all_types, native_types, play};

fn connect(graph: &mut Graph, from: (NodeId, &str), to: (NodeId, &str), strength: Strength) {
    let (from, to) = (graph.field(from.0, from.1).unwrap(), graph.field(to.0, to.1).unwrap());
    graph.connect(from, to, strength).unwrap();
}

fn named(graph: &mut Graph, node_type: &str, name: &str) -> NodeId {
    let node = graph.create(node_type).unwrap();
    graph.set_name(node, name).unwrap();
    node
}

/// `hand.x -> inc.in`, `inc.out -> lamp.x`, recorded for 20 frames.
fn chain_recording() -> Vec<u8> {
    let mut graph = Graph::new(all_types());
    let [hand, inc, lamp] =
        [("Plain", "hand"), ("Inc", "inc"), ("Plain", "lamp")].map(|(kind, name)| named(&mut graph, kind, name));
    connect(&mut graph, (hand, "x"), (inc, "in"), Strength::Strong);
    connect(&mut graph, (inc, "out"), (lamp, "x"), Strength::Strong);
    graph.evaluate(0.0, &mut NoHost);
    let mut recorder = Recorder::new(&mut graph, Vec::new(), Options::default()).unwrap();
    for frame in 1..=20i64 {
        if frame >= 5 {
            graph.set_named(hand, "x", 10 * frame).unwrap();
        }
        graph.evaluate(frame as f64, &mut NoHost);
        recorder.frame(&mut graph).unwrap();
    }
    recorder.finish(&mut graph).unwrap()
}

#[test]
fn a_program_that_changed_is_found_out_at_the_first_field() {
    let bytes = chain_recording();
    let (mut replayer, mut graph) = Replayer::open(&bytes[..], native_types(2)).unwrap();
    let divergence = play(&mut replayer, &mut graph);
    assert_eq!(divergence.as_deref(), Some("frame 5: `inc.out` was I64(51), is now I64(52)"));
}

#[test]
fn somebody_who_meddles_with_a_replay_is_found_out() {
    type Meddle = fn(&mut Graph);
    let rows: [(Meddle, &str); 5] = [
        (
            |graph| {
                let lamp = graph.find("lamp").unwrap();
                graph.set_named(lamp, "real", 0.5).unwrap();
            },
            "frame 8: `lamp.real` was not written, is now F64(0.5)",
        ),
        (
            |graph| {
                let route = graph.routes_from(graph.find("inc").unwrap()).next().unwrap();
                graph.disconnect(route);
            },
            "frame 8: `lamp.x` was I64(81), is now I64(71)",
        ),
        (
            |graph| {
                let lamp = graph.find("lamp").unwrap();
                graph.set_name(lamp, "torch").unwrap();
            },
            "frame 8: names, nodes or routes differ, or a field that differed before",
        ),
        (
            |graph| {
                let hand = graph.find("hand").unwrap();
                graph.delete(hand).unwrap();
            },
            "frame 8: `Wrote` cannot be done again: the node does not exist any more",
        ),
        (
            |graph| {
                let script = graph.create("Plain").unwrap();
                graph.set_named(script, "mood", "bad").unwrap();
            },
            "frame 8: `mood` of an unnamed Plain was not written, is now Enum(EnumValue(1))",
        ),
    ];
    let bytes = chain_recording();
    for (meddle, expected) in rows {
        let (mut replayer, mut graph) = Replayer::open(&bytes[..], native_types(1)).unwrap();
        for _ in 0..7 {
            assert_eq!(replayer.step(&mut graph).unwrap().unwrap().divergence, None);
        }
        meddle(&mut graph);
        let divergence = replayer.step(&mut graph).unwrap().unwrap().divergence.unwrap().to_string();
        println!("{divergence}");
        assert_eq!(divergence, expected);
    }
}

/// A script that writes other nodes, creates and deletes.
struct Spawner {
    last: Option<NodeId>,
}

impl Host for Spawner {
    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        let value: i64 = graph.get_named(node, "in").unwrap();
        graph.set_named(node, "out", value * value).unwrap();
        graph.set_named(node, "mood", if value % 2 == 0 { "up" } else { "down" }).unwrap();
        if let Some(last) = self.last.take() {
            graph.delete(last).unwrap();
        }
        let spawned = graph.create("Inc").unwrap();
        graph.set_named(spawned, "in", value).unwrap();
        self.last = Some(spawned);
    }

    fn field_changed(&mut self, graph: &mut Graph, field: FieldId, token: u64) {
        assert_eq!(token, 42);
        let note = graph.field(field.node, "pulse").unwrap();
        graph.set(note, graph.get::<i64>(field).unwrap() + 1).unwrap();
    }
}

#[test]
fn a_replay_needs_no_scripts() {
    let mut graph = Graph::new(all_types());
    let (script, plain) = (named(&mut graph, "Script", "script"), named(&mut graph, "Plain", "plain"));
    let spin = graph.add_field(plain, Field::new("spin", Quat::IDENTITY)).unwrap();
    connect(&mut graph, (script, "out"), (plain, "x"), Strength::Strong);
    let mut recorder = Recorder::new(&mut graph, Vec::new(), Options { keyframe_every: 10 }).unwrap();
    let observed = graph.field(plain, "x").unwrap();
    graph.observe(observed, 42).unwrap();
    let mut host = Spawner { last: None };
    for frame in 0..50i64 {
        graph.set_named(script, "in", frame / 2).unwrap();
        graph.set(spin, Quat::from_rotation_y(frame as f32)).unwrap();
        graph.evaluate(frame as f64, &mut host);
        recorder.frame(&mut graph).unwrap();
    }
    let bytes = recorder.finish(&mut graph).unwrap();
    let (mut replayer, mut replayed) = Replayer::open(&bytes[..], native_types(1)).unwrap();
    assert!(replayed.types().get("Script").is_err(), "nobody knows the script here");
    assert_eq!(play(&mut replayer, &mut replayed), None);
    let plain = replayed.find("plain").unwrap();
    assert_eq!(replayed.get_named::<i64>(plain, "pulse"), Ok(24 * 24 + 1));
    let text = summary(&bytes[..]).unwrap().to_string();
    println!("{text}");
    assert!(text.contains("50 frames, 0.000 s to 49.000 s"), "{text}");
    assert!(text.contains("script.out") && text.contains("plain.spin") && text.contains("plain.pulse"), "{text}");
    assert!(text.contains("2 nodes at the start, 25 created, 24 deleted"), "{text}");
}

#[test]
fn types_that_are_missing_or_changed_are_named() {
    let bytes = chain_recording();
    let known = |types: Vec<NodeType>| Replayer::open(&bytes[..], TypeRegistry::from(types)).err().unwrap().to_string();
    let without = native_types(1).into_iter().filter(|node_type| &*node_type.name != "Inc").collect();
    let changed = native_types(1).into_iter().map(|node_type| match &*node_type.name {
        "Inc" => NodeType::new("Inc", "Other.").field(Field::new("in", 0i64)).field(Field::new("out", 0i32)).evaluate(|_| {}),
        _ => node_type,
    });
    assert_eq!(known(without), "the recording has nodes of type `Inc`, which is not known");
    assert_eq!(
        known(changed.collect()),
        "the type `Inc` is not what it was when this was recorded: field `out` (i64) is now `out` (i32), or has another default, range or \
         choices"
    );
}

#[test]
fn loading_a_file_is_part_of_a_session() {
    let mut world = Graph::new(all_types());
    let (sum, back) = (named(&mut world, "Inc", "inc"), named(&mut world, "Plain", "back"));
    connect(&mut world, (sum, "out"), (back, "x"), Strength::Strong);
    connect(&mut world, (back, "x"), (sum, "in"), Strength::Weak);
    (0..5).for_each(|frame| drop(world.evaluate(frame as f64, &mut NoHost)));
    let file = save::to_text(&world);
    let mut graph = Graph::new(all_types());
    let mut recorder = Recorder::new(&mut graph, Vec::new(), Options::default()).unwrap();
    for frame in 0..12 {
        if frame % 3 == 2 {
            save::load_into(&mut graph, &file, TakenNames::Number).unwrap();
        }
        graph.evaluate(frame as f64, &mut NoHost);
        recorder.frame(&mut graph).unwrap();
    }
    let bytes = recorder.finish(&mut graph).unwrap();
    let (mut replayer, mut replayed) = Replayer::open(&bytes[..], native_types(1)).unwrap();
    assert_eq!(play(&mut replayer, &mut replayed), None);
    let value = |graph: &Graph, name| graph.get_named::<i64>(graph.find(name).unwrap(), "out").unwrap();
    assert_eq!(value(&replayed, "inc"), value(&graph, "inc"));
    assert!(value(&graph, "inc") > value(&world, "inc") + 5, "what was on its way in the file goes on");
    assert_eq!((replayed.node_count(), replayed.revision()), (8, graph.revision()));
}

/// A weak route's value that left before a strong one arrived, but was written later, wins in the next frame: who won is in keyframes.
#[test]
fn who_wrote_last_is_known_after_seeking() {
    let mut graph = Graph::new(all_types());
    let [early, strong, weak, to] = ["other", "strong", "weak", "to"].map(|name| named(&mut graph, "Plain", name));
    connect(&mut graph, (weak, "x"), (early, "x"), Strength::Strong);
    connect(&mut graph, (strong, "x"), (to, "x"), Strength::Strong);
    connect(&mut graph, (weak, "x"), (to, "x"), Strength::Weak);
    let mut recorder = Recorder::new(&mut graph, Vec::new(), Options { keyframe_every: 1 }).unwrap();
    graph.set_named(strong, "x", 7).unwrap();
    graph.set_named(weak, "x", 8).unwrap();
    for (frame, expected) in [(1, 7), (2, 8), (3, 8)] {
        graph.evaluate(frame as f64, &mut NoHost);
        recorder.frame(&mut graph).unwrap();
        assert_eq!(graph.get_named::<i64>(to, "x"), Ok(expected));
    }
    let bytes = recorder.finish(&mut graph).unwrap();
    let (mut replayer, mut replayed) = Replayer::open(&bytes[..], native_types(1)).unwrap();
    replayer.seek(&mut replayed, 3).unwrap();
    replayer.seek(&mut replayed, 1).unwrap();
    assert_eq!(play(&mut replayer, &mut replayed), None);
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let mut graph = Graph::new(all_types());
    graph.set_threads(3);
    let [hand, all] = [("Plain", "hand"), ("Plain", "all")].map(|(kind, name)| named(&mut graph, kind, name));
    for _ in 0..3000 {
        let inc = graph.create("Inc").unwrap();
        connect(&mut graph, (hand, "x"), (inc, "in"), Strength::Strong);
        connect(&mut graph, (inc, "out"), (all, "x"), Strength::Strong);
    }
    let mut recorder = Recorder::new(&mut graph, Vec::new(), Options::default()).unwrap();
    for frame in 0..20i64 {
        graph.set_named(hand, "x", frame).unwrap();
        graph.evaluate(frame as f64, &mut NoHost);
        recorder.frame(&mut graph).unwrap();
    }
    let bytes = recorder.finish(&mut graph).unwrap();
    for threads in [1, 2, 5] {
        let (mut replayer, mut replayed) = Replayer::open(&bytes[..], native_types(1)).unwrap();
        replayed.set_threads(threads);
        assert_eq!(play(&mut replayer, &mut replayed), None);
        assert_eq!(replayed.revision(), graph.revision(), "{threads} threads");
    }
}

#[test]
fn only_one_records_a_graph() {
    let mut graph = Graph::new(all_types());
    let recorder = Recorder::new(&mut graph, Vec::new(), Options::default()).unwrap();
    assert!(matches!(Recorder::new(&mut graph, Vec::new(), Options::default()), Err(RecordError::Recording)));
    recorder.finish(&mut graph).unwrap();
    assert!(Recorder::new(&mut graph, Vec::new(), Options::default()).is_ok());
}

/// A head that moves, a clock, a thousand interpolators, ten thousand nodes that rest: what a frame costs.
#[test]
fn a_frame_costs_what_changed() {
    // Only the clock moves; a head and some paths do; a head and many.
    let rows = [(0, 10_000), (100, 10_000), (1000, 10_000)];
    let mut sizes = Vec::new();
    for (paths, resting) in rows {
        let mut graph = Graph::new(all_types());
        for number in 0..resting {
            let node = graph.create("Plain").unwrap();
            graph.set_named(node, "x", number as i64).unwrap();
        }
        let clock = graph.create("TimeSensor").unwrap();
        graph.set_named(clock, "loop", true).unwrap();
        let head = graph.create("Plain").unwrap();
        let position = graph.add_field(head, Field::new("position", Vec3::ZERO)).unwrap();
        for _ in 0..paths {
            let path = graph.create("PositionInterpolator").unwrap();
            graph.set_named(path, "key", [0.0f32, 1.0]).unwrap();
            graph.set_named(path, "key_value", [Vec3::ZERO, Vec3::ONE]).unwrap();
            connect(&mut graph, (clock, "fraction_changed"), (path, "set_fraction"), Strength::Strong);
        }
        let run = |graph: &mut Graph, frame: i32| {
            if paths > 0 {
                graph.set(position, Vec3::splat(frame as f32 * 0.37)).unwrap();
            }
            graph.evaluate(frame as f64 / 60.0 + 0.001, &mut NoHost);
        };
        run(&mut graph, 0);
        let mut recorder = Recorder::new(&mut graph, Vec::new(), Options { keyframe_every: 0 }).unwrap();
        let keyframe = recorder.bytes();
        for frame in 1..101 {
            run(&mut graph, frame);
            recorder.frame(&mut graph).unwrap();
        }
        let per_frame = (recorder.bytes() - keyframe) as f64 / 100.0;
        let bytes = recorder.finish(&mut graph).unwrap();
        let written = summary(&bytes[..]).unwrap().fields_written as f64 / 100.0;
        sizes.push((per_frame, written));
        let (mut replayer, mut graph) = Replayer::open(&bytes[..], native_types(1)).unwrap();
        assert_eq!(play(&mut replayer, &mut graph), None);
    }
    assert!(sizes[0].0 < 150.0, "ten thousand nodes that rest cost nothing");
    for (bytes, written) in &sizes[1..] {
        assert!(*bytes < 60.0 + 20.0 * written, "{bytes} bytes for {written} fields");
    }
}
