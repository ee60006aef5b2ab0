//! Random operations in the world of another process: what was done there comes to be in the world, and the copy is the world again.

use std::collections::HashMap;

use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng};
use umbriel_fields::replica::{Bulk, Deed, Mirror, Packet, Publisher, Replica, node_numbered, number_of, own_key};
use umbriel_fields::{Changes, Field, FieldId, FieldType, Graph, Kind, NodeId, Same, Strength, Value};

use crate::dice::Dice;
use crate::support::{CHOICES, types};

const TYPES: [&str; 5] = ["All", "Adder", "Script", "TimeSensor", "PositionInterpolator"];

/// The world, and a guest's copy of it.
struct Shared {
    world: Graph,
    publisher: Publisher,
    bulk: Bulk,
    made: HashMap<u32, NodeId>,
    copy: Graph,
    mirror: Mirror,
    replica: Replica,
    guest_bulk: Bulk,
    messages: u64,
    /// Messages on their way.
    line: Vec<(u64, Vec<Deed>)>,
    refused: usize,
}

fn act(graph: &mut Graph, dice: &mut Dice) {
    let nodes: Vec<NodeId> = graph.nodes().collect();
    let any = |dice: &mut Dice, graph: &Graph| {
        let node = *nodes.get(dice.below(nodes.len()))?;
        let fields: Vec<FieldId> = graph.field_ids(node).map(|(field, _)| field).collect();
        fields.get(dice.below(fields.len())).copied()
    };
    let action = dice.below(16);
    let Some(field) = any(dice, graph).filter(|_| action > 2) else {
        return drop(graph.create(TYPES[dice.below(TYPES.len())]));
    };
    match action {
        3 => drop(graph.delete(field.node)),
        4 => drop(graph.set_name(field.node, ["", "a", "b", "c", "d", "e"][dice.below(6)])),
        5 => {
            let kind = Kind::ALL[dice.below(Kind::ALL.len())];
            let name = format!("extra {}", dice.below(4));
            let extra = match kind {
                Kind::Enum => Field::choice(name, &CHOICES[dice.below(2)..], CHOICES[1]),
                _ => Field::of_type(name, FieldType { kind, multiple: dice.below(2) == 0 }),
            };
            let _ = graph.add_field(field.node, extra); // there may be one of that name
        }
        6 => drop(graph.remove_field(field)),
        7 | 8 => {
            let Some(to) = any(dice, graph) else { return };
            let _ = graph.connect(field, to, if dice.below(3) == 0 { Strength::Weak } else { Strength::Strong });
        }
        9 => {
            let routes: Vec<_> = graph.routes().map(|(route, _)| route).collect();
            if !routes.is_empty() {
                graph.disconnect(routes[dice.below(routes.len())]);
            }
        }
        _ => {
            let declared = graph.declaration(field).unwrap();
            let value = dice.value(declared.field_type, declared.choices.len(), &nodes);
            let _ = graph.set_value(field, value); // some are out of range
        }
    }
}

impl Shared {
    fn new() -> Shared {
        let mut world = Graph::new(types());
        world.create("All").unwrap();
        let mut publisher = Publisher::new();
        publisher.frame(&world);
        let bytes = publisher.snapshot(&world).unwrap();
        let mut copy = Graph::new(types());
        let replica = Replica::new(&Packet::read(&bytes).unwrap(), copy.types().clone(), &Bulk::new()).unwrap();
        let mut mirror = Mirror::of(&mut copy);
        mirror.follow(&replica, &mut copy, 0);
        let (bulk, guest_bulk) = (Bulk::new(), Bulk::new());
        Shared {
            world,
            publisher,
            bulk,
            made: HashMap::new(),
            copy,
            mirror,
            replica,
            guest_bulk,
            messages: 0,
            line: Vec::new(),
            refused: 0,
        }
    }

    /// The guest tells, and after some frames the world hears of it.
    fn tell(&mut self) {
        self.messages += 1;
        let told = self.mirror.deeds(&mut self.copy, &self.replica, self.messages, &|_| true);
        told.images.iter().for_each(|(hash, image)| self.bulk.learn(*hash, image).unwrap());
        self.line.push((self.messages, told.deeds));
    }

    fn hear(&mut self, until: u64) {
        let (due, later): (Vec<_>, Vec<_>) = std::mem::take(&mut self.line).into_iter().partition(|(number, _)| *number <= until);
        self.line = later;
        for deed in due.iter().flat_map(|(_, deeds)| deeds) {
            let made = &self.made;
            let find = |number: u64| match own_key(number) {
                Some(key) => made.get(&key).copied(),
                None => Some(number).filter(|number| *number != 0).map(node_numbered),
            };
            match deed.apply(&mut self.world, &self.bulk, &find) {
                Ok(Some(node)) => {
                    let key = own_key(deed.makes().unwrap()).unwrap();
                    self.made.insert(key, node);
                    self.mirror.made(key, number_of(node));
                }
                Ok(None) => {}
                Err(_) => self.refused += 1,
            }
        }
    }

    fn frame(&mut self, dice: &mut Dice, applied: u64) {
        self.publish();
        if dice.below(10) == 0 {
            self.restart();
        }
        self.mirror.follow(&self.replica, &mut self.copy, applied);
    }

    fn frame_after(&mut self, applied: u64) {
        self.publish();
        self.mirror.follow(&self.replica, &mut self.copy, applied);
    }

    /// The guest tells, the world hears, and the guest sees what came of it.
    fn exchange(&mut self) {
        self.tell();
        self.hear(u64::MAX);
        self.frame_after(self.messages);
    }

    fn publish(&mut self) {
        let bytes = self.publisher.frame(&self.world);
        let packet = Packet::read(&bytes).unwrap();
        for hash in packet.missing(&self.guest_bulk) {
            self.guest_bulk.learn(hash, &self.publisher.bulk(hash).unwrap()).unwrap();
        }
        self.replica.apply(&packet, &self.guest_bulk).unwrap();
        assert!(self.replica.agrees());
    }

    /// As after a gap.
    fn restart(&mut self) {
        let bytes = self.publisher.snapshot(&self.world).unwrap();
        let packet = Packet::read(&bytes).unwrap();
        self.replica = Replica::new(&packet, self.copy.types().clone(), &self.guest_bulk).unwrap();
        self.mirror.restart();
    }

    fn check(&self) -> Result<(), TestCaseError> {
        let here = |node: Option<NodeId>| {
            let known = node.filter(|node| self.world.contains(*node)).and_then(|node| self.mirror.node(number_of(node)));
            known.filter(|node| self.copy.contains(*node))
        };
        prop_assert!(self.refused > 0 || self.copy.node_count() == self.world.node_count());
        for node in self.world.nodes() {
            let Some(ours) = here(Some(node)) else { return Err(TestCaseError::fail("a node is missing")) };
            prop_assert_eq!(self.copy.name(ours), self.world.name(node));
            prop_assert_eq!(self.copy.fields_of(ours).count(), self.world.fields_of(node).count());
            for (field, declared) in self.world.field_ids(node) {
                let expected = match self.world.value(field).unwrap() {
                    Value::Node(node) => Value::Node(here(node)),
                    Value::Nodes(nodes) => Value::Nodes(nodes.iter().map(|node| here(*node)).collect()),
                    other => other,
                };
                let found = match self.copy.value_named(ours, &declared.name).unwrap() {
                    Value::Node(node) => Value::Node(node.filter(|node| self.copy.contains(*node))),
                    Value::Nodes(nodes) => {
                        Value::Nodes(nodes.iter().map(|node| node.filter(|n| self.copy.contains(*n))).collect())
                    }
                    other => other,
                };
                // Images are told apart by where they lie.
                let is_same = match declared.field_type.kind {
                    Kind::Image => format!("{found:?}") == format!("{expected:?}"),
                    _ => found.same(&expected),
                };
                prop_assert!(is_same, "{}: {found:?} is not {expected:?}", self.world.describe_field(field));
            }
        }
        for (_, route) in self.world.routes() {
            let place = |field: FieldId| {
                let node = here(Some(field.node))?;
                self.copy.field(node, &self.world.declaration(field).ok()?.name).ok()
            };
            let (Some(from), Some(to)) = (place(route.from), place(route.to)) else { continue };
            // A loop with what was made here and refused there is left out.
            prop_assert!(self.refused > 0 || self.copy.route_between(from, to).is_some());
        }
        Ok(())
    }
}

/// The guest's nodes `from` and `to`, which the world has.
fn two_adders(shared: &mut Shared) -> [NodeId; 2] {
    let pair = ["from", "to"].map(|name| {
        let node = shared.copy.create("Adder").unwrap();
        shared.copy.set_name(node, name).unwrap();
        node
    });
    shared.exchange();
    pair
}

#[test]
fn what_a_route_brought_stays_when_its_source_is_gone() {
    let mut shared = Shared::new();
    let [from, to] = two_adders(&mut shared);
    let field = |graph: &Graph, node: NodeId, name: &str| graph.field(node, name).unwrap();
    let source = field(&shared.copy, from, "a");
    shared.copy.set_value(source, Value::F64(3.0)).unwrap();
    let target = field(&shared.copy, to, "b");
    shared.copy.connect(source, target, Strength::Strong).unwrap();
    shared.copy.delete(from).unwrap();
    shared.exchange();
    let theirs = shared.world.find("to").unwrap();
    assert_eq!(shared.world.value_named(theirs, "b").unwrap(), Value::F64(3.0));
    shared.check().unwrap();
}

#[test]
fn what_was_deleted_here_does_not_come_back_before_the_world_hears_of_it() {
    let mut shared = Shared::new();
    let [from, _] = two_adders(&mut shared);
    shared.copy.delete(from).unwrap();
    shared.tell();
    shared.restart();
    shared.frame_after(shared.messages - 1);
    assert_eq!(shared.copy.find("from"), None);
    shared.exchange();
    assert_eq!((shared.copy.find("from"), shared.world.find("from")), (None, None));
    shared.check().unwrap();
}

#[test]
fn what_the_world_keeps_comes_back() {
    let mut shared = Shared::new();
    let [from, to] = two_adders(&mut shared);
    let ends = |graph: &Graph, from, to| (graph.field(from, "a").unwrap(), graph.field(to, "b").unwrap());
    let (source, target) = ends(&shared.copy, from, to);
    shared.copy.connect(source, target, Strength::Strong).unwrap();
    shared.exchange();
    shared.copy.delete(from).unwrap();
    shared.tell();
    shared.line.clear(); // refused
    shared.frame_after(shared.messages);
    let [from, to] = ["from", "to"].map(|name| shared.copy.find(name).unwrap());
    let (source, target) = ends(&shared.copy, from, to);
    assert!(shared.copy.route_between(source, target).is_some());
    shared.check().unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_a_guest_does_comes_to_be(seed in any::<[u8; 32]>(), hosts in any::<bool>()) {
        let mut dice = Dice(TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
        let mut shared = Shared::new();
        for _ in 0..25 {
            (0..dice.below(8)).for_each(|_| act(&mut shared.copy, &mut dice));
            shared.tell();
            let until = shared.messages - dice.below(3).min(shared.messages as usize) as u64;
            shared.hear(until);
            if hosts {
                // The world goes on as well; only writes, so that what it does never forbids what was done here.
                (0..dice.below(3)).for_each(|_| drop(shared.world.create("Adder")));
            }
            let heard = shared.line.first().map_or(shared.messages, |(number, _)| number - 1);
            shared.frame(&mut dice, heard);
        }
        shared.hear(u64::MAX);
        let last = shared.messages;
        shared.frame(&mut dice, last);
        shared.frame(&mut dice, last);
        shared.check()?;
        shared.copy.verify_invariants().map_err(TestCaseError::fail)?;
        prop_assert!(!matches!(shared.copy.changes_since(0), Changes::Nodes(nodes) if nodes.is_empty()));
    }
}
