//! Evaluation of independent nodes on one thread and on two.

use umbriel_fields::{FieldId, Graph, NoHost};

use crate::evaluations::crowd;

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

pub(crate) fn interpolators() {
    for count in [300, 1000, 3000, 10_000, 100_000] {
        let (mut graph, clock) = crowd(count);
        let [one, two] = in_turns(&mut graph, clock).map(|ns| ns / count as f64);
        println!("{:<66} {one:>10.2} {two:>9.2} {:>6.2}", format!("{count} orientation interpolators of 20 keys"), one / two);
    }
}
