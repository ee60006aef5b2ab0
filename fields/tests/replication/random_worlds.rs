//! Random operations of every kind: replicas that were there from the start, that came late and that know other types are all equal.

use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng};
use umbriel_fields::replica::{Bulk, Packet, Publisher, Replica};
use umbriel_fields::{Field, FieldId, FieldType, Graph, Kind, NoHost, NodeId, NodeType, Strength};

use crate::dice::Dice;
use crate::support::{CHOICES, described, types};

const TYPES: [&str; 6] = ["All", "Adder", "Script", "TimeSensor", "PositionInterpolator", "Secretive"];

fn application_types() -> Vec<NodeType> {
    let mut all = types();
    all.push(
        NodeType::new("Secretive", "One field stays.")
            .field(Field::new("open", 1.0f32))
            .field(Field::new("secret", 2.0f32).local()),
    );
    all.push(NodeType::new("Hidden", "All of it stays.").field(Field::new("value", 1.0f32)).local());
    all
}

/// What replicas may know.
fn without_secrets() -> Vec<NodeType> {
    let shown = |known: &NodeType| known.fields.iter().filter(|field| !field.local).cloned().collect::<Vec<_>>();
    application_types().iter().map(|known| NodeType::new(known.name.clone(), "").fields(shown(known))).collect()
}

/// The same types in another order, two of them without a field or with another default, and one not known at all.
fn other_types() -> Vec<NodeType> {
    let mut all: Vec<NodeType> = application_types().into_iter().rev().filter(|known| &*known.name != "Script").collect();
    for known in &mut all {
        if &*known.name == "Adder" {
            let mut fields = known.fields.clone();
            fields.reverse();
            fields.pop();
            fields[0].default = 17.0f64.into();
            *known = NodeType::new("Adder", "Without `a`.").field(Field::new("own", 3i32)).fields(fields);
        }
    }
    all
}

/// A graph, its publisher, and replicas of it.
struct World {
    graph: Graph,
    nodes: Vec<NodeId>,
    publisher: Publisher,
    replicas: Vec<(Replica, Bulk)>,
    frames: u64,
}

impl World {
    fn new() -> Self {
        Self {
            graph: Graph::new(application_types()),
            nodes: Vec::new(),
            publisher: Publisher::new(),
            replicas: Vec::new(),
            frames: 0,
        }
    }

    fn field(&self, dice: &mut Dice) -> Option<FieldId> {
        let node = *self.nodes.get(dice.below(self.nodes.len()))?;
        let fields: Vec<_> = self.graph.field_ids(node).map(|(field, _)| field).collect();
        Some(fields[dice.below(fields.len())])
    }

    fn act(&mut self, dice: &mut Dice) {
        let action = dice.below(20);
        let Some(field) = self.field(dice).filter(|_| action > 1) else {
            let name = if dice.below(8) == 0 { "Hidden" } else { TYPES[dice.below(TYPES.len())] };
            return self.nodes.push(self.graph.create(name).unwrap());
        };
        match action {
            2 => {
                self.nodes.retain(|node| *node != field.node);
                self.graph.delete(field.node).unwrap();
            }
            3 => drop(self.graph.set_name(field.node, ["", "a", "b", "c"][dice.below(4)])),
            4 => {
                let kind = Kind::ALL[dice.below(Kind::ALL.len())];
                let name = format!("extra {}", dice.below(4));
                let mut extra = match kind {
                    Kind::Enum => Field::choice(name, &CHOICES[dice.below(2)..], CHOICES[1]),
                    _ => Field::of_type(name, FieldType { kind, multiple: dice.below(2) == 0 }),
                };
                extra.local = dice.below(5) == 0;
                let _ = self.graph.add_field(field.node, extra);
            }
            5 => drop(self.graph.remove_field(field)),
            6 | 7 => {
                let Some(to) = self.field(dice) else { return };
                let _ = self.graph.connect(field, to, if dice.below(3) == 0 { Strength::Weak } else { Strength::Strong });
            }
            8 => {
                let routes: Vec<_> = self.graph.routes().map(|(route, _)| route).collect();
                if !routes.is_empty() {
                    self.graph.disconnect(routes[dice.below(routes.len())]);
                }
            }
            9 => self.graph.set_local(field.node, dice.below(2) == 0).unwrap(),
            10 if dice.below(4) == 0 => {
                let long: Vec<f32> = (0..2000).map(|_| dice.below(3) as f32).collect();
                let _ = self.graph.set_named(field.node, "f32_many", long);
            }
            _ => {
                let declared = self.graph.declaration(field).unwrap();
                let value = dice.value(declared.field_type, declared.choices.len(), &self.nodes);
                let _ = self.graph.set_value(field, value);
            }
        }
    }

    fn learn(publisher: &Publisher, packet: &Packet<'_>, bulk: &mut Bulk) {
        for hash in packet.missing(bulk) {
            bulk.learn(hash, &publisher.bulk(hash).expect("what a packet refers to is offered")).unwrap();
        }
    }

    fn join(&mut self, types: Vec<NodeType>) {
        let bytes = self.publisher.snapshot(&self.graph).expect("nothing was written since the frame");
        let packet = Packet::read(&bytes).unwrap();
        let mut bulk = Bulk::new();
        Self::learn(&self.publisher, &packet, &mut bulk);
        self.replicas.push((Replica::new(&packet, types, &bulk).unwrap(), bulk));
    }

    fn frame(&mut self) {
        self.frames += 1;
        self.graph.evaluate(self.frames as f64 / 60.0, &mut NoHost);
        let bytes = self.publisher.frame(&self.graph);
        for (replica, bulk) in &mut self.replicas {
            let packet = Packet::read(&bytes).unwrap();
            Self::learn(&self.publisher, &packet, bulk);
            replica.apply(&packet, bulk).unwrap();
        }
    }

    /// What the application shows, and what a replica holds, in words.
    fn check(&mut self) -> Result<(), TestCaseError> {
        let truth = self.shown();
        for (place, (replica, _)) in self.replicas.iter().enumerate() {
            prop_assert!(replica.agrees(), "replica {place}, frame {}", self.frames);
            prop_assert_eq!(replica.hash(), self.publisher.hash());
            replica.graph().verify_invariants().map_err(TestCaseError::fail)?;
            let shown = shown_by(replica, self.nodes.iter().map(|node| number(*node)), |node| self.replica_shows(node));
            let different = shown.iter().zip(&truth).find(|(shown, truth)| shown != truth);
            prop_assert_eq!((different, shown.len()), (None, truth.len()), "replica {}, frame {}", place, self.frames);
        }
        Ok(())
    }

    fn replica_shows(&self, number: u64) -> bool {
        self.nodes.iter().any(|node| crate::random_worlds::number(*node) == number && !self.graph.is_local(*node))
    }

    fn shown(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for node in self.nodes.iter().filter(|node| !self.graph.is_local(**node)) {
            lines.push(format!("{} {:?}", self.graph.type_of(*node).name, self.graph.name(*node)));
            let shown = self.graph.field_ids(*node).filter(|(_, declared)| !declared.local);
            lines.extend(fields_in_words(&self.graph, shown, |node| Some(number(node))));
        }
        lines
    }
}

fn number(node: NodeId) -> u64 {
    use slotmap::Key;
    node.data().as_ffi()
}

fn in_words(value: &umbriel_fields::Value, number: impl Fn(NodeId) -> Option<u64>) -> String {
    use umbriel_fields::Value;
    match value {
        Value::Node(node) => format!("{:?}", node.and_then(&number)),
        Value::Nodes(nodes) => format!("{:?}", nodes.iter().map(|node| node.and_then(&number)).collect::<Vec<_>>()),
        Value::Image(Some(image)) => format!("{image:?} {:?}", image.rgba),
        Value::Images(images) => format!("{:?}", images.iter().flatten().map(|image| image.rgba.clone()).collect::<Vec<_>>()),
        other => format!("{other:?}"),
    }
}

/// Sorted: the places of dynamic fields are nobody's business.
fn fields_in_words<'a>(
    graph: &'a Graph,
    fields: impl Iterator<Item = (FieldId, &'a Field)>,
    number: impl Fn(NodeId) -> Option<u64>,
) -> Vec<String> {
    let word =
        |(field, declared): (FieldId, &Field)| format!("{} {}", declared.name, in_words(&graph.value(field).unwrap(), &number));
    let mut words: Vec<String> = fields.map(word).collect();
    words.sort();
    words
}

fn shown_by(replica: &Replica, numbers: impl Iterator<Item = u64>, is_shown: impl Fn(u64) -> bool) -> Vec<String> {
    let graph = replica.graph();
    let mut lines = Vec::new();
    for number in numbers.filter(|number| is_shown(*number)) {
        let node = replica.node(number).expect("the replica has the node");
        lines.push(format!("{} {:?}", graph.type_of(node).name, graph.name(node)));
        lines.extend(fields_in_words(graph, graph.field_ids(node), |node| replica.number(node)));
    }
    lines
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn replicas_are_equal_after_each_frame(seed in any::<[u8; 32]>()) {
        let mut dice = Dice(TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
        let mut world = World::new();
        for frame in 0..30 {
            for _ in 0..dice.below(12) {
                world.act(&mut dice);
            }
            world.frame();
            if frame % 9 == 0 {
                world.join(without_secrets());
            }
            world.check()?;
        }
        prop_assert_eq!(world.replicas.len(), 4);
    }

    #[test]
    fn replicas_with_other_types_agree(seed in any::<[u8; 32]>()) {
        let mut dice = Dice(TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
        let mut world = World::new();
        for frame in 0..20 {
            for _ in 0..dice.below(12) {
                world.act(&mut dice);
            }
            world.frame();
            if frame % 7 == 0 {
                world.join(other_types());
            }
            for (replica, _) in &world.replicas {
                prop_assert!(replica.agrees());
                replica.graph().verify_invariants().map_err(TestCaseError::fail)?;
            }
        }
    }

    #[test]
    fn any_corruption_is_named(seed in any::<[u8; 32]>()) {
        let mut dice = Dice(TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
        let mut world = World::new();
        (0..60).for_each(|_| world.act(&mut dice));
        world.frame();
        world.join(application_types());
        world.join(application_types());
        let Some(node) = world.nodes.iter().copied().find(|node| !world.graph.is_local(*node)) else { return Ok(()) };
        let (victim, _) = &mut world.replicas[0];
        let id = victim.node(number(node)).unwrap();
        let fields: Vec<_> = victim.graph().field_ids(id).map(|(field, declared)| (field, declared.clone())).collect();
        let (field, declared) = fields[dice.below(fields.len())].clone();
        let value = dice.value(declared.field_type, declared.choices.len(), &[]);
        if declared.local || victim.graph_mut().set_value(field, value).is_err() {
            return Ok(());
        }
        world.frame();
        let [(victim, _), (truth, _)] = &world.replicas[..] else { unreachable!() };
        prop_assert!(truth.agrees());
        let difference = victim.difference(truth);
        if victim.agrees() {
            // The frame may have mended it.
            let here = in_words(&victim.graph().value(field).unwrap(), |node| victim.number(node));
            let truth_field = truth.graph().field(truth.node(number(node)).unwrap(), &declared.name).unwrap();
            let there = in_words(&truth.graph().value(truth_field).unwrap(), |node| truth.number(node));
            prop_assert!(here == there, "the hash misses a change of {}", declared.name);
            prop_assert_eq!(difference, None);
        } else {
            let difference = difference.expect("what has another hash differs somewhere");
            prop_assert_eq!(difference.field.as_deref(), Some(&*declared.name));
            prop_assert_eq!(difference.node, world.graph.describe(node));
            prop_assert_eq!(difference.frame, 2);
        }
    }
}

#[test]
fn descriptions_hold_for_the_same_graph() {
    // `described` is the words of saves; here it proves that publishing changes nothing.
    let mut world = World::new();
    let mut dice = Dice(TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    (0..50).for_each(|_| world.act(&mut dice));
    let before = described(&world.graph, &world.nodes);
    world.publisher.frame(&world.graph);
    world.publisher.snapshot(&world.graph).unwrap();
    assert_eq!(described(&world.graph, &world.nodes), before);
}
