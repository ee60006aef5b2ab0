//! Building a graph from nothing.

use std::hint::black_box;
use std::time::Instant;

use umbriel_fields::{Graph, NoHost, NodeType, Strength};

use crate::support::{graph, nodes, row};

/// The best of a few runs, each in a new graph.
fn best(mut run: impl FnMut(&mut Graph) -> f64) -> f64 {
    (0..7).map(|_| run(&mut graph())).fold(f64::INFINITY, f64::min)
}

fn create(count: usize) {
    for node_type in ["Plain", "Negate", "Placed"] {
        let ns = best(|graph| {
            let start = Instant::now();
            for _ in 0..count {
                black_box(graph.create(node_type).unwrap());
            }
            start.elapsed().as_nanos() as f64
        });
        let fields = graph().types().get(node_type).map(|found: std::sync::Arc<NodeType>| found.fields.len()).unwrap();
        row(&format!("creating one of {count} nodes of {fields} fields by name"), ns / count as f64, None);
    }
}

fn connect(count: usize) {
    for backwards in [false, true] {
        let mut order = 0.0;
        let ns = best(|graph| {
            let fields = nodes(graph, "Plain", count + 1, "x");
            let start = Instant::now();
            for at in 0..count {
                let at = if backwards { count - 1 - at } else { at };
                graph.connect(fields[at], fields[at + 1], Strength::Strong).unwrap();
            }
            let connected = start.elapsed().as_nanos() as f64;
            graph.set(fields[0], 1.0f32).unwrap();
            let start = Instant::now();
            assert_eq!(graph.evaluate(0.0, &mut NoHost).copied, count);
            order = start.elapsed().as_nanos() as f64;
            connected
        });
        let way = if backwards { "last to first" } else { "first to last" };
        row(&format!("connecting a chain of {count}, {way}, per route"), ns / count as f64, None);
        row("  its first frame: order, copy lists and copies, per route", order / count as f64, None);
    }
}

pub(crate) fn all() {
    create(100_000);
    connect(100_000);
}
