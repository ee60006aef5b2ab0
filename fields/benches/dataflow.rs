//! Speed of the dataflow beside plain arrays, which nothing can beat: `cargo bench -p umbriel-fields`.

use std::hint::black_box;
use std::time::Instant;

use umbriel_fields::{Field, FieldId, Graph, NoHost, NodeType, Strength, builtin_types};

/// Nanoseconds of the fastest of many runs.
fn fastest(mut run: impl FnMut(u32)) -> f64 {
    let start = Instant::now();
    let mut best = f64::INFINITY;
    let mut round = 0;
    while start.elapsed().as_secs_f64() < 0.5 || round < 5 {
        let before = Instant::now();
        run(round);
        best = best.min(before.elapsed().as_nanos() as f64);
        round += 1;
    }
    best
}

fn graph() -> Graph {
    let mut types = builtin_types();
    types.push(NodeType::new("Plain", "Holds a number.").field(Field::new("x", 0.0f32)));
    types.push(NodeType::new("Negate", "Evaluated.").field(Field::new("x", 0.0f32)).field(Field::new("y", 0.0f32)).evaluate(
        |evaluation| {
            let x: f32 = evaluation.get(0);
            evaluation.set(1, -x);
        },
    ));
    Graph::new(types)
}

fn nodes(graph: &mut Graph, node_type: &str, count: usize, field: &str) -> Vec<FieldId> {
    (0..count)
        .map(|_| {
            let node = graph.create(node_type).unwrap();
            graph.field(node, field).unwrap()
        })
        .collect()
}

fn row(what: &str, ns: f64, bound: Option<f64>) {
    match bound {
        Some(bound) => println!("{what:<58} {ns:>12.2} {bound:>10.2} {:>7.1}", ns / bound),
        None => println!("{what:<58} {ns:>12.2}"),
    }
}

/// Copies from place to place in order, as the graph does in the chain.
fn bound_of_chain(length: usize) -> f64 {
    let mut values = vec![0f32; length + 1];
    let copies: Vec<(u32, u32)> = (0..length as u32).map(|at| (at, at + 1)).collect();
    fastest(|round| {
        for _ in 0..100 {
            values[0] = round as f32;
            for (from, to) in black_box(&copies) {
                values[*to as usize] = values[*from as usize];
            }
            black_box(&mut values);
        }
    }) / (100 * length) as f64
}

fn chain(length: usize) {
    let mut graph = graph();
    let fields = nodes(&mut graph, "Plain", length + 1, "x");
    for pair in fields.windows(2) {
        graph.connect(pair[0], pair[1], Strength::Strong).unwrap();
    }
    let ns = fastest(|round| {
        for lap in 0..100 {
            graph.set(fields[0], (round * 100 + lap) as f32 + 0.5).unwrap();
            black_box(graph.evaluate(0.0, &mut NoHost));
        }
    });
    row(&format!("chain of {length}, per hop"), ns / (100 * length) as f64, Some(bound_of_chain(length)));
}

fn evaluated_chain(length: usize) {
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

fn fan_out(targets: usize) {
    let mut values = vec![0f32; targets + 1];
    let copies: Vec<(u32, u32)> = (0..targets as u32).map(|at| (0, at + 1)).collect();
    let bound = fastest(|round| {
        values[0] = round as f32;
        for (from, to) in black_box(&copies) {
            values[*to as usize] = values[*from as usize];
        }
        black_box(&mut values);
    });
    let mut graph = graph();
    let source = nodes(&mut graph, "Plain", 1, "x")[0];
    for target in nodes(&mut graph, "Plain", targets, "x") {
        graph.connect(source, target, Strength::Strong).unwrap();
    }
    let ns = fastest(|round| {
        graph.set(source, round as f32 + 0.5).unwrap();
        black_box(graph.evaluate(0.0, &mut NoHost));
    });
    row(&format!("fan-out to {targets}, per target"), ns / targets as f64, Some(bound / targets as f64));
    let ns = fastest(|round| {
        let before = graph.revision();
        graph.set(source, -(round as f32) - 0.5).unwrap();
        graph.evaluate(0.0, &mut NoHost);
        black_box(graph.changes_since(before));
    });
    row("  the same, and asking what changed", ns / targets as f64, Some(bound / targets as f64));
}

fn idle(count: usize) {
    let mut graph = graph();
    let start = Instant::now();
    let fields = nodes(&mut graph, "Negate", count, "x");
    row(&format!("creating one of {count} nodes"), start.elapsed().as_nanos() as f64 / count as f64, None);
    graph.evaluate(0.0, &mut NoHost);
    let ns = fastest(|_| (0..1000).for_each(|_| drop(black_box(graph.evaluate(0.0, &mut NoHost)))));
    row(&format!("{count} nodes, none changed, per frame"), ns / 1000.0, None);
    let changed: Vec<FieldId> = fields.iter().step_by(count / 100).copied().collect();
    let ns = fastest(|round| {
        for field in &changed {
            graph.set(*field, round as f32 + 0.5).unwrap();
        }
        black_box(graph.evaluate(0.0, &mut NoHost));
    });
    row(&format!("{count} nodes, {} changed, per changed node", changed.len()), ns / changed.len() as f64, None);
    let ns = fastest(|round| {
        let before = graph.revision();
        for field in &changed {
            graph.set(*field, -(round as f32) - 0.5).unwrap();
        }
        graph.evaluate(0.0, &mut NoHost);
        black_box(graph.changes_since(before));
    });
    row("  the same, and asking what changed", ns / changed.len() as f64, None);
    let ns = fastest(|_| {
        let mut sum = 0.0f32;
        for field in &changed {
            sum += graph.get::<f32>(*field).unwrap();
        }
        black_box(sum);
    });
    row("get", ns / changed.len() as f64, None);
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
        graph.set(first, round as f64 + 0.5).unwrap();
        evaluated = graph.evaluate(0.0, &mut NoHost).evaluated;
    });
    assert_eq!(evaluated, 3 * stages + 1, "each node once");
    row(&format!("ladder of {stages} diamonds, per node"), ns / evaluated as f64, None);
}

fn main() {
    println!("{:<58} {:>12} {:>10} {:>7}", "nanoseconds", "umbriel", "arrays", "ratio");
    chain(1000);
    evaluated_chain(1000);
    fan_out(100_000);
    ladder(20);
    idle(1_000_000);
}
