//! Nodes that are evaluated: in a chain, in pairs, in diamonds.

use std::hint::black_box;

use glam::Quat;
use umbriel_fields::{FieldId, Graph, NoHost, NodeId, Strength};

use crate::support::{fastest, graph, nodes, row};

fn chain(length: usize) {
    let mut graph = graph();
    let outputs = nodes(&mut graph, "Negate", length + 1, "y");
    for pair in outputs.windows(2) {
        let target = FieldId { index: 0, ..pair[1] };
        graph.connect(pair[0], target, Strength::Strong).unwrap();
    }
    let first = FieldId { index: 0, ..outputs[0] };
    let ns = fastest(|round| {
        for lap in 0..100 {
            graph.set(first, (round * 100 + lap) as f32 + 0.5).unwrap();
            black_box(graph.evaluate(0.0, &mut NoHost));
        }
    });
    row(&format!("chain of {length} evaluated nodes, per node"), ns / (100 * length) as f64, None);
}

/// One field that all interpolators follow, and an interpolator for each place; how the walk of a crowd is played.
pub(crate) fn crowd(count: usize) -> (Graph, FieldId) {
    let mut graph = graph();
    let clock = nodes(&mut graph, "Plain", 1, "x")[0];
    let keys: Vec<f32> = (0..20).map(|key| key as f32 / 19.0).collect();
    let values: Vec<Quat> = (0..20).map(|key| Quat::from_rotation_y(key as f32 * 0.3)).collect();
    for _ in 0..count {
        let interpolator = graph.create("OrientationInterpolator").unwrap();
        let placed = graph.create("Placed").unwrap();
        graph.set_named(interpolator, "key", keys.clone()).unwrap();
        graph.set_named(interpolator, "key_value", values.clone()).unwrap();
        let field = |graph: &Graph, node: NodeId, name: &str| graph.field(node, name).unwrap();
        let (fraction, value) = (field(&graph, interpolator, "set_fraction"), field(&graph, interpolator, "value_changed"));
        let rotation = field(&graph, placed, "rotation");
        graph.connect(clock, fraction, Strength::Strong).unwrap();
        graph.connect(value, rotation, Strength::Strong).unwrap();
    }
    graph.evaluate(0.0, &mut NoHost);
    (graph, clock)
}

fn pairs(count: usize) {
    let (mut graph, clock) = crowd(count);
    let ns = fastest(|round| {
        graph.set(clock, (round % 97) as f32 / 97.0 + 0.001).unwrap();
        let report = graph.evaluate(0.0, &mut NoHost);
        assert_eq!((report.evaluated, report.copied), (count, 2 * count));
    });
    row(&format!("{count} interpolators of 20 keys to transforms, per pair"), ns / count as f64, None);
}

/// Each stage splits into two nodes that join again: 2^stages paths, 3 nodes a stage.
fn ladder(stages: usize) {
    let mut graph = graph();
    let mut joint = graph.create("Sum").unwrap();
    let first = graph.field(joint, "a").unwrap();
    for _ in 0..stages {
        let next = graph.create("Sum").unwrap();
        for input in ["a", "b"] {
            let side = graph.create("Sum").unwrap();
            let connect = |graph: &mut Graph, from, to, input: &str| {
                let (from, to) = (graph.field(from, "value").unwrap(), graph.field(to, input).unwrap());
                graph.connect(from, to, Strength::Strong).unwrap();
            };
            connect(&mut graph, joint, side, "a");
            connect(&mut graph, side, next, input);
        }
        joint = next;
    }
    graph.evaluate(0.0, &mut NoHost);
    let mut evaluated = 0;
    let ns = fastest(|round| {
        for lap in 0..100 {
            graph.set(first, (100 * round + lap) as f64 + 0.5).unwrap();
            evaluated = graph.evaluate(0.0, &mut NoHost).evaluated;
        }
    });
    assert_eq!(evaluated, 3 * stages + 1, "each node once");
    row(&format!("ladder of {stages} diamonds, per node"), ns / (100 * evaluated) as f64, None);
}

pub(crate) fn all() {
    chain(1000);
    pairs(100_000);
    for stages in [10, 20, 40] {
        ladder(stages);
    }
}
