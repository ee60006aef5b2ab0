//! What the measurements share: a clock, a table, a graph.

use std::time::Instant;

use umbriel_fields::{Field, FieldId, Graph, NodeType, builtin_types};

/// Nanoseconds of the fastest of many runs.
pub(crate) fn fastest(mut run: impl FnMut(u32)) -> f64 {
    let start = Instant::now();
    let mut best = f64::INFINITY;
    let mut round = 0;
    while start.elapsed().as_secs_f64() < 0.4 || round < 5 {
        let before = Instant::now();
        run(round);
        best = best.min(before.elapsed().as_nanos() as f64);
        round += 1;
    }
    best
}

/// `Plain` holds a number, `Negate` is evaluated, `Placed` is what an interpolator moves.
pub(crate) fn graph() -> Graph {
    let mut types = builtin_types();
    types.push(NodeType::new("Plain", "Holds a number.").field(Field::new("x", 0.0f32)));
    types.push(NodeType::new("Negate", "Evaluated.").field(Field::new("x", 0.0f32)).field(Field::new("y", 0.0f32)).evaluate(
        |evaluation| {
            let x: f32 = evaluation.get(0);
            evaluation.set(1, -x);
        },
    ));
    types.push(
        NodeType::new("Placed", "A place.")
            .field(Field::new("translation", glam::Vec3::ZERO))
            .field(Field::new("rotation", glam::Quat::IDENTITY))
            .field(Field::nodes("children")),
    );
    Graph::new(types)
}

pub(crate) fn nodes(graph: &mut Graph, node_type: &str, count: usize, field: &str) -> Vec<FieldId> {
    let node_type = graph.types().get(node_type).unwrap();
    let index = node_type.field_index(field).unwrap();
    (0..count).map(|_| FieldId { node: graph.create_of(node_type.clone()), index }).collect()
}

pub(crate) fn row(what: &str, ns: f64, bound: Option<f64>) {
    match bound {
        Some(bound) => println!("{what:<66} {ns:>10.2} {bound:>9.2} {:>6.1}", ns / bound),
        None => println!("{what:<66} {ns:>10.2}"),
    }
}

/// Mixes an order, always the same (Fisher, Yates 1938, with splitmix64).
pub(crate) fn shuffle<T>(items: &mut [T]) {
    let mut state = 1u64;
    for last in (1..items.len()).rev() {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        items.swap(last, ((z ^ (z >> 31)) % (last as u64 + 1)) as usize);
    }
}
