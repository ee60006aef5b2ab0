//! The number of threads changes nothing: the same values and revisions after every frame.

use umbriel_fields::{Evaluation, Field, FieldId, Graph, Host, NoHost, NodeId, NodeType, SetRule, Strength, Value};

use crate::support::{Random, frame};

/// Mixes what it is given so that any difference spreads; at least so heavy that threads pay for a few of them.
fn mix(evaluation: &mut Evaluation<'_>) {
    let [a, b, state] = [0, 1, 2].map(|index| evaluation.get::<i64>(index));
    let mut mixed = a.wrapping_mul(31).wrapping_add(b).wrapping_add(state.rotate_left(7));
    for _ in 0..4000 {
        mixed = std::hint::black_box(mixed ^ (mixed << 13) ^ ((mixed as u64) >> 7) as i64);
    }
    mixed =
        mixed.wrapping_add(evaluation.changed(0) as i64 + 2 * evaluation.changed(1) as i64 + (evaluation.time() * 60.0) as i64);
    evaluation.set(2, mixed);
    let own: i64 = evaluation.get(2);
    evaluation.set(3, own % 3);
    evaluation.set(3, own % 5);
    evaluation.set(4, (own % 1000) as f64);
    let few: i64 = evaluation.get(3);
    evaluation.set(5, evaluation.changed(3) && few % 2 == 0);
    if own % 7 == 0 {
        evaluation.again();
    }
    if own % 11 == 0 {
        evaluation.report(format!("{own}"));
    }
}

fn mixers() -> Vec<NodeType> {
    let fields = |node_type: NodeType| {
        node_type
            .field(Field::new("a", 0i64))
            .field(Field::new("b", 0i64).on_set(SetRule::Pulse))
            .field(Field::new("state", 1i64))
            .field(Field::new("few", 0i64))
            .field(Field::new("ranged", 0.0f64).range(-100.0, 100.0))
            .field(Field::new("flag", false))
    };
    vec![
        fields(NodeType::new("Mix", "Evaluated by a function.")).evaluate(mix),
        fields(NodeType::new("Script", "Evaluated by the host.")).host_evaluated(),
        fields(NodeType::new("Plain", "Not evaluated.")),
    ]
}

/// Writes into other nodes too, so that what was evaluated ahead is void.
struct Meddler {
    random: Random,
    nodes: Vec<NodeId>,
}

impl Host for Meddler {
    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        let value: i64 = graph.get(FieldId { node, index: 0 }).unwrap();
        graph.set(FieldId { node, index: 3 }, value % 100).unwrap();
        let other = self.random.pick(&self.nodes).unwrap();
        match self.random.below(4) {
            0 => graph.set(FieldId { node: other, index: 0 }, value).unwrap(),
            1 => graph.touch(FieldId { node: other, index: 1 }).unwrap(),
            2 => graph.set_silent(FieldId { node: other, index: 0 }, value).unwrap(),
            _ => graph
                .set_mode(other, self.random.pick(&[umbriel_fields::Mode::OnChange, umbriel_fields::Mode::Pull]).unwrap())
                .unwrap(),
        }
    }
}

/// One number for all values and revisions of a graph (FNV-1a).
fn hash(graph: &Graph) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    let mut add = |bits: u64| hash = (hash ^ bits).wrapping_mul(0x0000_0100_0000_01b3);
    for node in graph.nodes() {
        for (field, _) in graph.field_ids(node) {
            add(graph.field_revision(field));
            match graph.value(field).unwrap() {
                Value::I64(value) => add(value as u64),
                Value::F64(value) => add(value.to_bits()),
                Value::Bool(value) => add(value as u64),
                other => panic!("{other:?}"),
            }
        }
    }
    hash
}

/// The hashes of the frames of a random session, and what the frames reported. `churned` mixes where values lie before it starts.
fn session(seed: u64, threads: usize, churned: bool) -> Vec<(u64, umbriel_fields::FrameReport)> {
    let mut random = Random(seed);
    let mut graph = Graph::new(mixers());
    graph.set_threads(threads);
    let kinds = ["Mix", "Mix", "Mix", "Mix", "Mix", "Mix", "Plain", "Script"];
    let mut nodes: Vec<NodeId> = (0..300).map(|_| graph.create(random.pick(&kinds).unwrap()).unwrap()).collect();
    for _ in 0..if churned { 200 } else { 0 } {
        let gone = nodes.swap_remove(random.below(nodes.len()));
        graph.delete(gone).unwrap();
        if random.below(2) == 0 {
            nodes.push(graph.create(random.pick(&kinds).unwrap()).unwrap());
        }
    }
    for _ in 0..150 {
        let [from, to] = [(); 2].map(|()| FieldId { node: random.pick(&nodes).unwrap(), index: random.below(4) as u16 });
        let strength = if random.below(5) == 0 { Strength::Weak } else { Strength::Strong };
        // Loops and doubles are refused, which is as good.
        let _ = graph.connect(from, to, strength);
    }
    let mut host = Meddler { random: Random(seed + 1), nodes: nodes.clone() };
    (0..12)
        .map(|number| {
            if number % 5 == 4 {
                let node = random.pick(&nodes).unwrap();
                let _ = graph.add_field(node, Field::new(format!("more{number}"), 0i64));
            }
            for _ in 0..random.below(400) {
                let field = FieldId { node: random.pick(&nodes).unwrap(), index: random.below(4) as u16 };
                graph.set(field, random.below(1000) as i64).unwrap();
            }
            let report = graph.evaluate(number as f64 / 60.0, &mut host);
            graph.verify_invariants().unwrap();
            (hash(&graph), report)
        })
        .collect()
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mut different = std::collections::HashSet::new();
    for seed in 0..6 {
        let churned = seed % 3 == 2;
        let serial = session(seed, 1, churned);
        for threads in [2, 3, 8] {
            assert_eq!(session(seed, threads, churned), serial, "seed {seed}, {threads} threads");
        }
        different.extend(serial.into_iter().map(|(hash, _)| hash));
    }
    assert!(different.len() > 60, "the sessions are alike: {} frames", different.len());
}

#[test]
fn independent_nodes_are_evaluated_on_several_threads() {
    use std::collections::HashSet;
    use std::sync::{Arc, Mutex};
    let seen: Arc<Mutex<HashSet<std::thread::ThreadId>>> = Arc::default();
    let noted = seen.clone();
    let node_type = NodeType::new("Slow", "Takes its time.").field(Field::new("x", 0i64)).evaluate(move |_| {
        noted.lock().unwrap().insert(std::thread::current().id());
        std::thread::sleep(std::time::Duration::from_micros(300));
    });
    for threads in [1, 4] {
        let mut graph = Graph::new(vec![node_type.clone()]);
        graph.set_threads(threads);
        let nodes: Vec<NodeId> = (0..600).map(|_| graph.create("Slow").unwrap()).collect();
        for round in 1..3 {
            seen.lock().unwrap().clear();
            for node in &nodes {
                graph.set_named(*node, "x", round).unwrap();
            }
            assert_eq!(graph.evaluate(0.0, &mut NoHost).evaluated, 600);
        }
        // The first frame measures, the second knows.
        assert_eq!(seen.lock().unwrap().len(), threads, "of {threads}");
        assert_eq!(frame(&mut graph).evaluated, 0, "idle frames stay idle");
    }
}

/// Writes into a node of the same level.
struct Neighbour(NodeId);

impl Host for Neighbour {
    fn evaluate(&mut self, graph: &mut Graph, _: NodeId) {
        graph.set_named(self.0, "in", 9i64).unwrap();
    }
}

#[test]
fn many_nodes_of_a_level_have_their_turns_together_before_the_host() {
    for threads in [1, 2] {
        let mut graph = Graph::new(crate::support::types());
        graph.set_threads(threads);
        // The script is made first, but what needs no host goes before it.
        let script = graph.create("Script").unwrap();
        let counters: Vec<NodeId> = (0..100).map(|_| graph.create("Counter").unwrap()).collect();
        let plain = graph.create("Plain").unwrap();
        let (from, count) = (graph.field(counters[3], "count").unwrap(), graph.field(plain, "x").unwrap());
        graph.connect(from, count, Strength::Strong).unwrap();
        // A dependency numbers all anew, so that they are of one level.
        graph.depend_for_this_frame(script, plain).unwrap();
        graph.evaluate(0.0, &mut NoHost);
        for node in counters.iter().chain([&script]) {
            graph.set_named(*node, "in", 1i64).unwrap();
        }
        let mut host = Neighbour(counters[3]);
        let counts = |graph: &Graph| [0, 3].map(|place| graph.get_named::<i64>(counters[place], "count").unwrap());
        assert_eq!(graph.evaluate(0.0, &mut host).evaluated, 101);
        assert_eq!((counts(&graph), graph.get::<i64>(count).unwrap()), ([2, 2], 2), "{threads} threads");
        assert_eq!(graph.evaluate(0.0, &mut host).evaluated, 1, "the write came after the turn");
        assert_eq!((counts(&graph), graph.get::<i64>(count).unwrap()), ([2, 3], 3), "{threads} threads");
    }
}

#[test]
fn a_route_within_a_level_is_followed_in_the_next_frame_at_once() {
    for threads in [1, 2] {
        let mut graph = Graph::new(crate::support::types());
        graph.set_threads(threads);
        let nodes: Vec<NodeId> = (0..100).map(|_| graph.create("Inc").unwrap()).collect();
        frame(&mut graph);
        // All are of one level until these come, which agree with the order that there is.
        for pair in nodes[..4].windows(2) {
            let (from, to) = (graph.field(pair[0], "out").unwrap(), graph.field(pair[1], "in").unwrap());
            graph.connect(from, to, Strength::Strong).unwrap();
        }
        for (number, node) in nodes.iter().enumerate() {
            let own = if (1..4).contains(&number) { continue } else { 10 };
            graph.set_named(*node, "in", own as i64).unwrap();
        }
        assert_eq!(frame(&mut graph).evaluated, 100);
        assert_eq!([0, 1, 2, 3, 4].map(|at| graph.get_named::<i64>(nodes[at], "out").unwrap()), [11, 12, 13, 14, 11]);
    }
}

/// Interpolator-like pairs: what is evaluated, and a place that each copies its number to; made in turns, all of one before all of the other, or mixed.
#[test]
fn copies_of_a_batch_are_the_same_for_any_number_of_threads_and_wherever_targets_lie() {
    for order in ["in turns", "apart", "mixed"] {
        let run = |threads: usize| {
            let mut graph = Graph::new(mixers());
            graph.set_threads(threads);
            let mut random = Random(7);
            let (mut mixers, mut places) = (Vec::new(), Vec::new());
            for _ in 0..200 {
                mixers.push(graph.create("Mix").unwrap());
                if order == "in turns" {
                    places.push(graph.create("Plain").unwrap());
                }
            }
            while places.len() < 200 {
                places.push(graph.create("Plain").unwrap());
            }
            if order == "mixed" {
                (1..200).rev().for_each(|last| places.swap(last, random.below(last + 1)));
            }
            // Some take two numbers from two mixers, some tell another mixer, and some of the targets are watched.
            for (at, mixer) in mixers.iter().enumerate() {
                let from = FieldId { node: *mixer, index: 2 };
                graph.connect(from, FieldId { node: places[at / 2], index: (at % 2) as u16 }, Strength::Strong).unwrap();
                if at % 10 == 0 {
                    graph.connect(from, FieldId { node: places[199 - at / 10], index: 0 }, Strength::Strong).unwrap();
                }
            }
            for watched in &places[..20] {
                let to = graph.create("Mix").unwrap();
                graph.connect(FieldId { node: *watched, index: 0 }, FieldId { node: to, index: 0 }, Strength::Strong).unwrap();
            }
            (0..4i64)
                .map(|round| {
                    let seen = graph.revision();
                    for mixer in mixers.iter().step_by(1 + round as usize) {
                        graph.set(FieldId { node: *mixer, index: 0 }, round * 77).unwrap();
                    }
                    let report = graph.evaluate(round as f64, &mut NoHost);
                    graph.verify_invariants().unwrap();
                    (hash(&graph), report, graph.changes_since(seen))
                })
                .collect::<Vec<_>>()
        };
        let serial = run(1);
        assert!(serial.iter().all(|(_, report, _)| report.copied > 50));
        for threads in [2, 5] {
            assert_eq!(run(threads), serial, "{order}, {threads} threads");
        }
    }
}

#[test]
fn an_evaluation_is_one_write() {
    let mut graph = Graph::new(mixers());
    for count in [1, 100] {
        let nodes: Vec<NodeId> = (0..count).map(|_| graph.create("Mix").unwrap()).collect();
        for node in &nodes {
            graph.set_named(*node, "a", 5i64).unwrap();
        }
        frame(&mut graph);
        let written: Vec<_> = nodes
            .iter()
            .map(|node| ["state", "ranged"].map(|name| graph.field_revision(graph.field(*node, name).unwrap())))
            .collect();
        assert!(written.iter().all(|[state, ranged]| state == ranged), "{written:?}");
        assert!(written.windows(2).all(|pair| pair[0][0] < pair[1][0]), "each node's is its own: {written:?}");
    }
}
