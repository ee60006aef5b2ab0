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

/// Other nodes in every frame, so that none of them is in a cache only because it was set in the frame before.
fn places(count: usize, changed: usize, frame: usize) -> impl Iterator<Item = usize> {
    let stride = count / changed;
    (frame * 7919 % stride..count).step_by(stride).take(changed)
}

/// Frames of one measurement: about a thousand nodes set.
fn frames(changed: usize) -> usize {
    1000_usize.div_ceil(changed)
}

fn some_changed(count: usize, changed: usize) {
    let (mut graph, fields) = at_rest(count);
    let mut frame = 0;
    let ns = fastest(|round| {
        for _ in 0..frames(changed) {
            frame += 1;
            for place in places(count, changed, frame) {
                graph.set(fields[place], round as f32 + 0.5).unwrap();
            }
            assert_eq!(graph.evaluate(0.0, &mut NoHost).evaluated, changed);
        }
    });
    let per_change = (frames(changed) * changed) as f64;
    let what = format!("{count} nodes, {changed} set and evaluated, per changed node");
    row(&what, ns / per_change, Some(plain_changed(count, changed) / per_change));
}

/// The same values in the same places of plain arrays, with what must be known of them later: a revision for each field and each node, and who waits.
fn plain_changed(count: usize, changed: usize) -> f64 {
    let [mut x, mut y] = [(); 2].map(|()| vec![0f32; count]);
    let [mut x_revisions, mut y_revisions, mut revisions] = [(); 3].map(|()| vec![0u64; count]);
    let mut waits = vec![false; count];
    let mut waiting = Vec::new();
    let (mut frame, mut revision) = (0, 0);
    fastest(|round| {
        for _ in 0..frames(changed) {
            frame += 1;
            for place in places(count, changed, frame) {
                revision += 1;
                (x[place], x_revisions[place], revisions[place], waits[place]) = (round as f32, revision, revision, true);
                waiting.push(place);
            }
            for place in waiting.drain(..) {
                revision += 1;
                (y[place], y_revisions[place], revisions[place], waits[place]) = (-x[place], revision, revision, false);
            }
            black_box((&mut y, &mut y_revisions, &mut revisions));
        }
    })
}

pub(crate) fn all() {
    for nodes in [1000, 1_000_000] {
        nothing_changed(nodes);
        for changed in [1, 10, 100, 1000, 10_000].into_iter().filter(|changed| *changed <= nodes) {
            some_changed(nodes, changed);
        }
    }
}
