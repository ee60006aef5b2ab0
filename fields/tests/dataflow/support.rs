//! Node types and helpers that the tests share.

use umbriel_fields::{Field, FieldId, Graph, NoHost, NodeId, NodeType, SetRule, Strength};

pub(crate) use crate::random::Random;

/// `out = in + 1`, a number that only holds a value, one that pulses, one with a range.
pub(crate) fn types() -> Vec<NodeType> {
    vec![
        NodeType::new("Inc", "One more.").field(Field::new("in", 0i64)).field(Field::new("out", 0i64)).evaluate(|evaluation| {
            let value: i64 = evaluation.get(0);
            evaluation.set(1, value + 1);
        }),
        NodeType::new("Plain", "Holds numbers.")
            .field(Field::new("x", 0i64))
            .field(Field::new("pulse", 0i64).on_set(SetRule::Pulse))
            .field(Field::new("ranged", 0i64).range(-5.0, 5.0))
            .field(Field::new("real", 0.0f64))
            .field(Field::nodes("children")),
        NodeType::new("Counter", "Counts its evaluations.")
            .field(Field::new("in", 0i64))
            .field(Field::new("count", 0i64))
            .evaluate(|evaluation| {
                let count: i64 = evaluation.get(1);
                evaluation.set(1, count + 1);
            }),
        NodeType::new("Script", "The host evaluates it.")
            .field(Field::new("in", 0i64))
            .field(Field::new("out", 0i64))
            .host_evaluated(),
    ]
}

pub(crate) fn graph() -> Graph {
    Graph::new(types())
}

pub(crate) fn create<const N: usize>(graph: &mut Graph, node_type: &str) -> [NodeId; N] {
    std::array::from_fn(|_| graph.create(node_type).unwrap())
}

pub(crate) fn at(graph: &Graph, node: NodeId, field: &str) -> FieldId {
    graph.field(node, field).unwrap()
}

pub(crate) fn strong(graph: &mut Graph, from: (NodeId, &str), to: (NodeId, &str)) -> umbriel_fields::RouteId {
    let (from, to) = (at(graph, from.0, from.1), at(graph, to.0, to.1));
    graph.connect(from, to, Strength::Strong).unwrap()
}

pub(crate) fn weak(graph: &mut Graph, from: (NodeId, &str), to: (NodeId, &str)) -> umbriel_fields::RouteId {
    let (from, to) = (at(graph, from.0, from.1), at(graph, to.0, to.1));
    graph.connect(from, to, Strength::Weak).unwrap()
}

pub(crate) fn int(graph: &Graph, node: NodeId, field: &str) -> i64 {
    graph.get_named(node, field).unwrap()
}

pub(crate) fn frame(graph: &mut Graph) -> umbriel_fields::FrameReport {
    let report = graph.evaluate(0.0, &mut NoHost);
    graph.verify_invariants().unwrap();
    report
}
