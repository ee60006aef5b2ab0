//! Random graphs over every type and every class of value survive; damaged files never do harm.

use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng};
use umbriel_fields::save::{self, TakenNames};
use umbriel_fields::{Field, FieldType, Graph, Kind, NodeId, SetRule, Strength};

use crate::dice::Dice;
use crate::support::{CHOICES, described, types};

fn any_field(dice: &mut Dice, graph: &Graph, nodes: &[NodeId]) -> umbriel_fields::FieldId {
    let node = nodes[dice.below(nodes.len())];
    let fields: Vec<_> = graph.field_ids(node).map(|(field, _)| field).collect();
    fields[dice.below(fields.len())]
}

fn add_field(dice: &mut Dice, graph: &mut Graph, nodes: &[NodeId]) {
    let kind = Kind::ALL[dice.below(Kind::ALL.len())];
    let field_type = FieldType { kind, multiple: dice.below(2) == 0 };
    let name = format!("extra {}", dice.below(6));
    let mut field = match kind {
        Kind::Enum => Field::choice(name, &CHOICES, CHOICES[0]),
        _ => Field::of_type(name, field_type),
    };
    (field.field_type, field.default) = (field_type, dice.value(field_type, CHOICES.len(), nodes));
    field = field.doc(dice.text()).unit(dice.text());
    if dice.below(4) == 0 {
        field = field.alias(format!("other {}", dice.below(100)));
    }
    if dice.below(3) == 0 {
        field = field.on_set(SetRule::Pulse).output();
    }
    if dice.below(3) == 0 {
        field = field.range(-0.0, [1.0, f64::INFINITY, 1e300][dice.below(3)]);
    }
    let node = nodes[dice.below(nodes.len())];
    let _ = graph.add_field(node, field);
}

fn random_graph(dice: &mut Dice) -> (Graph, Vec<NodeId>) {
    const TYPES: [&str; 6] = ["All", "Adder", "Script", "TimeSensor", "PositionInterpolator", "ScalarDamper"];
    let mut graph = Graph::new(types());
    let doomed = graph.create("All").unwrap();
    let mut nodes: Vec<NodeId> =
        (0..1 + dice.below(7)).map(|_| graph.create(TYPES[dice.below(TYPES.len()).min(dice.below(9))]).unwrap()).collect();
    for number in 0..nodes.len() * 12 {
        let field = any_field(dice, &graph, &nodes);
        match dice.below(12) {
            0 => {
                let name = format!("{}{}", ["", "#", "a.", "#3"][dice.below(4)], dice.text());
                let _ = graph.set_name(field.node, &name);
            }
            1 => add_field(dice, &mut graph, &nodes),
            2..=4 => {
                let to = any_field(dice, &graph, &nodes);
                let _ = graph.connect(field, to, if dice.below(3) == 0 { Strength::Weak } else { Strength::Strong });
            }
            5 if dice.below(3) == 0 => drop(graph.evaluate(number as f64 * 0.25, &mut umbriel_fields::NoHost)),
            6 if dice.below(4) == 0 => drop(graph.remove_field(field)),
            _ => {
                let declared = graph.declaration(field).unwrap();
                let value = dice.value(declared.field_type, declared.choices.len(), &nodes);
                let _ = graph.set_value(field, value);
            }
        }
    }
    // References to it stay, and are saved as nothing.
    graph.delete(doomed).unwrap();
    if nodes.len() > 2 && dice.below(3) == 0 {
        let gone = nodes.remove(1);
        graph.delete(gone).unwrap();
    }
    (graph, nodes)
}

/// The first line of the descriptions that differs.
fn unlike(a: (&Graph, &[NodeId]), b: (&Graph, &[NodeId])) -> Option<String> {
    first_difference(&described(a.0, a.1).join("\n"), &described(b.0, b.1).join("\n"))
}

/// The first lines that differ.
fn first_difference(a: &str, b: &str) -> Option<String> {
    let (a, b): (Vec<_>, Vec<_>) = (a.lines().collect(), b.lines().collect());
    let place = (0..a.len().max(b.len())).find(|place| a.get(*place) != b.get(*place))?;
    Some(format!("line {}: {:?} is not {:?}", place + 1, a.get(place), b.get(place)))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_graphs_survive(seed in any::<[u8; 32]>()) {
        let mut dice = Dice(TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
        let (mut graph, order) = random_graph(&mut dice);
        let text = save::to_text(&graph);
        prop_assert_eq!(&text, &save::to_text(&graph));
        let bytes = save::to_binary(&graph);
        let mut loaded = Vec::new();
        for data in [text.as_bytes(), &bytes] {
            let mut other = Graph::new(types());
            let report = save::load_into(&mut other, data, TakenNames::Refuse).unwrap();
            prop_assert_eq!(&report.reports, &[], "{}", text);
            prop_assert_eq!(unlike((&other, &report.nodes), (&graph, &order)), None, "{}", text);
            prop_assert_eq!(first_difference(&save::to_text(&other), &text), None);
            prop_assert_eq!(&save::to_binary(&other), &bytes);
            other.verify_invariants().unwrap();
            loaded.push((other, report.nodes));
        }
        // Both go on alike.
        let [(one, nodes), (two, other_nodes)] = &mut loaded[..] else { unreachable!() };
        for frame in 0..3 {
            one.evaluate(frame as f64, &mut umbriel_fields::NoHost);
            two.evaluate(frame as f64, &mut umbriel_fields::NoHost);
            prop_assert_eq!(unlike((one, nodes), (two, other_nodes)), None);
        }
        graph.evaluate(0.0, &mut umbriel_fields::NoHost);
    }

    #[test]
    fn damage_is_noticed_or_harmless(seed in any::<[u8; 32]>()) {
        let mut dice = Dice(TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
        let (graph, _) = random_graph(&mut dice);
        let mut bytes = save::to_binary(&graph);
        for _ in 0..1 + dice.below(3) {
            let place = dice.below(bytes.len());
            bytes[place] ^= 1 << dice.below(8);
        }
        if bytes != save::to_binary(&graph) {
            prop_assert!(save::load(&bytes, types()).is_err());
        }
        // With a checksum that fits, the records themselves are all that protects.
        bytes[8..12].copy_from_slice(&[1, 0, 0, 0]);
        let checksum = xxhash_rust::xxh3::xxh3_64_with_seed(&bytes[20..], 1 << 16).to_le_bytes();
        bytes[12..20].copy_from_slice(&checksum);
        if let Ok((graph, _)) = save::load(&bytes, types()) {
            graph.verify_invariants().unwrap();
        }
        let mut text = save::to_text(&graph).into_bytes();
        for _ in 0..1 + dice.below(5) {
            let place = dice.below(text.len());
            text[place] = b"()[]{}\",:09.-#\\a\n"[dice.below(17)];
        }
        if let Ok((graph, _)) = save::load(&text, types()) {
            graph.verify_invariants().unwrap();
        }
    }
}

#[test]
fn every_truncation_is_an_error() {
    let mut dice = Dice(TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let (graph, _) = random_graph(&mut dice);
    let (bytes, text) = (save::to_binary(&graph), save::to_text(&graph));
    for end in 0..bytes.len() {
        assert!(save::load(&bytes[..end], types()).is_err(), "{end} bytes");
    }
    let text = text.trim_end();
    for end in (0..text.len()).filter(|end| text.is_char_boundary(*end)) {
        assert!(save::load(&text[..end], types()).is_err(), "{end} bytes of text");
    }
    assert!(bytes.len() > 500 && text.len() > 500);
}
