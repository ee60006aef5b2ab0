//! Evaluation of independent nodes on one thread and on two.

use umbriel_fields::{FieldId, Graph, NoHost, Strength};

use crate::evaluations::crowd;
use crate::support::{graph, nodes};

/// Nanoseconds of the fastest of many frames on one thread and on two, taken in turns, so that whatever else the machine does meets both.
fn in_turns(graph: &mut Graph, clock: FieldId) -> [f64; 2] {
    let start = std::time::Instant::now();
    let mut best = [f64::INFINITY; 2];
    let mut round = 0;
    while start.elapsed().as_secs_f64() < 2.0 || round < 20 {
        for threads in [1, 2] {
            graph.set_threads(threads);
            round += 1;
            graph.set(clock, (round % 97) as f32 / 97.0 + 0.001).unwrap();
            let before = std::time::Instant::now();
            graph.evaluate(0.0, &mut NoHost);
            best[threads - 1] = best[threads - 1].min(before.elapsed().as_nanos() as f64);
        }
    }
    best
}

/// As many interpolators of the vertices of a small mesh, or of a rope.
fn ropes(count: usize, vertices: usize) -> (Graph, FieldId) {
    let mut graph = graph();
    let clock = nodes(&mut graph, "Plain", 1, "x")[0];
    let values: Vec<glam::Vec3> = (0..4 * vertices).map(|at| glam::Vec3::splat(at as f32)).collect();
    for fraction in nodes(&mut graph, "CoordinateInterpolator", count, "set_fraction") {
        graph.set_named(fraction.node, "key", [0.0f32, 0.3, 0.6, 1.0]).unwrap();
        graph.set_named(fraction.node, "key_value", values.clone()).unwrap();
        graph.connect(clock, fraction, Strength::Strong).unwrap();
    }
    graph.evaluate(0.0, &mut NoHost);
    (graph, clock)
}

fn compare(what: &str, count: usize, (mut graph, clock): (Graph, FieldId)) {
    let [one, two] = in_turns(&mut graph, clock).map(|ns| ns / count as f64);
    println!("{:<66} {one:>10.2} {two:>9.2} {:>6.2}", format!("{count} {what}"), one / two);
}

pub(crate) fn all() {
    println!();
    println!("{:<66} {:>10} {:>9} {:>6}", "nanoseconds per evaluation", "1 thread", "2 threads", "ratio");
    for count in [300, 1000, 3000, 10_000, 100_000] {
        compare("orientation interpolators of 20 keys", count, crowd(count));
    }
    for count in [100, 1000, 10_000] {
        compare("coordinate interpolators of 64 vertices", count, ropes(count, 64));
    }
}
