//! What did not change costs nothing, however much of it there is.

use std::hint::black_box;

use umbriel_fields::{FieldId, Graph, NoHost};

use crate::support::{fastest, graph, nodes, row};

fn at_rest(count: usize) -> (Graph, Vec<FieldId>) {
    let mut graph = graph();
    let fields = nodes(&mut graph, "Negate", count, "x");
    graph.evaluate(0.0, &mut NoHost);
    (graph, fields)
}

fn nothing_changed(count: usize) {
    let (mut graph, _) = at_rest(count);
    let ns = fastest(|_| (0..1000).for_each(|_| drop(black_box(graph.evaluate(0.0, &mut NoHost)))));
    row(&format!("{count} nodes, none changed, per frame"), ns / 1000.0, None);
}

fn some_changed(count: usize, changed: usize) {
    let (mut graph, fields) = at_rest(count);
    let changed: Vec<FieldId> = fields.iter().step_by(count / changed).copied().collect();
    let ns = fastest(|round| {
        for field in &changed {
            graph.set(*field, round as f32 + 0.5).unwrap();
        }
        assert_eq!(graph.evaluate(0.0, &mut NoHost).evaluated, changed.len());
    });
    row(&format!("{count} nodes, {} set and evaluated, per changed node", changed.len()), ns / changed.len() as f64, None);
}

pub(crate) fn all() {
    for nodes in [1000, 1_000_000] {
        nothing_changed(nodes);
        for changed in [1, 10, 100, 1000, 10_000].into_iter().filter(|changed| *changed <= nodes) {
            some_changed(nodes, changed);
        }
    }
}
