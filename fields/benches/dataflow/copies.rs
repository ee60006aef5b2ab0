//! Chains and fan-outs, beside the same copies as a plain loop over an array, through a table of places in topological order.

use std::hint::black_box;

use umbriel_fields::{FieldId, Graph, NoHost, Strength};

use crate::support::{fastest, graph, nodes, row, shuffle};

/// How the targets lie in memory, compared with the order of the table or of the routes.
#[derive(Clone, Copy, PartialEq)]
enum Order {
    Neighbours,
    Shuffled,
}

impl Order {
    fn places(self, count: usize) -> Vec<u32> {
        let mut places: Vec<u32> = (0..count as u32).collect();
        if self == Order::Shuffled {
            shuffle(&mut places);
        }
        places
    }

    fn name(self) -> &'static str {
        if self == Order::Shuffled { "shuffled" } else { "neighbours" }
    }
}

/// Nanoseconds per copy of a loop over a table.
fn loop_over(copies: &[(u32, u32)], first: usize) -> f64 {
    let mut values = vec![0f32; copies.len() + 1];
    let laps = 1_000_000_usize.div_ceil(copies.len()).min(100);
    fastest(|round| {
        for _ in 0..laps {
            values[first] = round as f32;
            for (from, to) in black_box(copies) {
                values[*to as usize] = values[*from as usize];
            }
            black_box(&mut values);
        }
    }) / (laps * copies.len()) as f64
}

fn chain_bound(length: usize, order: Order) -> f64 {
    let places = order.places(length + 1);
    let copies: Vec<(u32, u32)> = places.windows(2).map(|pair| (pair[0], pair[1])).collect();
    loop_over(&copies, places[0] as usize)
}

/// The same loop over as much memory, in the same places, as a chain whose writes somebody can ask for later: beside each value the revision of the
/// field and that of its node.
fn tracked_bound(length: usize, order: Order) -> f64 {
    let places = order.places(length + 1);
    let copies: Vec<(u32, u32)> = places.windows(2).map(|pair| (pair[0], pair[1])).collect();
    let mut values = vec![0f32; length + 1];
    let [mut fields, mut nodes] = [(); 2].map(|()| vec![0u64; length + 1]);
    let laps = 1_000_000_usize.div_ceil(length).min(100);
    let mut revision = 0;
    fastest(|round| {
        for _ in 0..laps {
            values[places[0] as usize] = round as f32;
            for (from, to) in black_box(&copies) {
                revision += 1;
                values[*to as usize] = values[*from as usize];
                fields[*to as usize] = revision;
                nodes[*to as usize] = revision;
            }
            black_box((&mut values, &mut fields, &mut nodes));
        }
    }) / (laps * length) as f64
}

/// The source in place 0, the targets behind it.
fn fan_out_bound(targets: usize, order: Order) -> f64 {
    let copies: Vec<(u32, u32)> = order.places(targets).into_iter().map(|place| (0, place + 1)).collect();
    loop_over(&copies, 0)
}

/// What could be done if it were known beforehand that all targets are one piece of memory.
fn fill_bound(targets: usize) -> f64 {
    let mut values = vec![0f32; targets];
    let laps = 100;
    let ns = fastest(|round| {
        for lap in 0..laps {
            black_box(&mut values).fill((round * laps + lap) as f32);
        }
    });
    ns / laps as f64 / targets as f64
}

fn frames(graph: &mut Graph, source: FieldId, laps: u32) -> f64 {
    let ns = fastest(|round| {
        for lap in 0..laps {
            graph.set(source, (round * laps + lap) as f32 + 0.5).unwrap();
            black_box(graph.evaluate(0.0, &mut NoHost));
        }
    });
    ns / laps as f64
}

fn chain(length: usize) {
    for order in [Order::Neighbours, Order::Shuffled] {
        let mut graph = graph();
        let fields = nodes(&mut graph, "Plain", length + 1, "x");
        let places = order.places(length + 1);
        for pair in places.windows(2) {
            graph.connect(fields[pair[0] as usize], fields[pair[1] as usize], Strength::Strong).unwrap();
        }
        let laps = 1_000_000_usize.div_ceil(length).min(100) as u32;
        let ns = frames(&mut graph, fields[places[0] as usize], laps) / length as f64;
        row(&format!("chain of {length}, {}, per hop", order.name()), ns, Some(chain_bound(length, order)));
        row("  beside arrays with revisions by field and by node", ns, Some(tracked_bound(length, order)));
    }
}

fn fan_out(targets: usize, order: Order) {
    let mut graph = graph();
    let source = nodes(&mut graph, "Plain", 1, "x")[0];
    let fields = nodes(&mut graph, "Plain", targets, "x");
    for place in order.places(targets) {
        graph.connect(source, fields[place as usize], Strength::Strong).unwrap();
    }
    let per_target = targets as f64;
    let bound = Some(fan_out_bound(targets, order));
    let ns = frames(&mut graph, source, 10) / per_target;
    row(&format!("fan-out to {targets}, {}, per target", order.name()), ns, bound);
    if order == Order::Neighbours {
        row("  beside `fill` of a slice", ns, Some(fill_bound(targets)));
    }
    let ns = fastest(|round| {
        let before = graph.revision();
        graph.set(source, -(round as f32) - 0.5).unwrap();
        graph.evaluate(0.0, &mut NoHost);
        black_box(graph.changes_since(before));
    });
    row("  the same, and asking what changed", ns / per_target, bound);
}

pub(crate) fn all() {
    chain(1000);
    chain(100_000);
    fan_out(100_000, Order::Neighbours);
    fan_out(100_000, Order::Shuffled);
}
