//! Umbriel's fields.

use std::hint::black_box;

use umbriel_fields::{Field, FieldId, Graph, NoHost, NodeType, Strength, builtin_types};

use crate::fastest;

fn graph() -> Graph {
    let mut types = builtin_types();
    types.push(NodeType::new("Plain", "Holds a number.").field(Field::new("x", 0.0f32)));
    Graph::new(types)
}

fn plain(graph: &mut Graph) -> FieldId {
    FieldId { node: graph.create("Plain").expect("the type is registered"), index: 0 }
}

fn frames(graph: &mut Graph, source: FieldId, laps: u32) -> f64 {
    let ns = fastest(|round| {
        for lap in 0..laps {
            graph.set(source, (round * laps + lap) as f32 + 0.5).expect("the field exists");
            black_box(graph.evaluate(0.0, &mut NoHost));
        }
    });
    ns / laps as f64
}

pub(crate) fn chain(length: usize) -> f64 {
    let mut graph = graph();
    let fields: Vec<FieldId> = (0..=length).map(|_| plain(&mut graph)).collect();
    for pair in fields.windows(2) {
        graph.connect(pair[0], pair[1], Strength::Strong).expect("a chain has no loop");
    }
    frames(&mut graph, fields[0], 100) / length as f64
}

pub(crate) fn fan_out(targets: usize) -> f64 {
    let mut graph = graph();
    let source = plain(&mut graph);
    for _ in 0..targets {
        let target = plain(&mut graph);
        graph.connect(source, target, Strength::Strong).expect("a fan has no loop");
    }
    frames(&mut graph, source, 10) / targets as f64
}

/// Each stage splits into two sums that join again.
pub(crate) fn diamonds(stages: usize) -> f64 {
    let mut graph = graph();
    let sum = |graph: &mut Graph| graph.create("Sum").expect("a type of this crate");
    let mut joint = sum(&mut graph);
    let first = graph.field(joint, "a").expect("a field of sums");
    for _ in 0..stages {
        let next = sum(&mut graph);
        for input in ["a", "b"] {
            let side = sum(&mut graph);
            for (from, to, input) in [(joint, side, "a"), (side, next, input)] {
                let (from, to) = (graph.field(from, "value"), graph.field(to, input));
                let (from, to) = (from.expect("a field of sums"), to.expect("a field of sums"));
                graph.connect(from, to, Strength::Strong).expect("diamonds have no loop");
            }
        }
        joint = next;
    }
    graph.evaluate(0.0, &mut NoHost);
    let ns = fastest(|round| {
        for lap in 0..100 {
            graph.set(first, (100 * round + lap) as f64 + 0.5).expect("the field exists");
            black_box(graph.evaluate(0.0, &mut NoHost));
        }
    });
    ns / (100 * (3 * stages + 1)) as f64
}
