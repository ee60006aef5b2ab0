//! The same chain, fan-out and diamonds in Umbriel's fields and in bevy_ecs. Prints a line per figure: case, who, nanoseconds, separated by
//! tabs; `cargo xtask peers fields` makes one table of these and of Coin's.

mod bevy;
mod ours;

use std::time::Instant;

const CHAIN: usize = 1000;
const TARGETS: [usize; 3] = [1000, 10_000, 100_000];
const STAGES: [usize; 4] = [4, 8, 12, 20];

/// Nanoseconds of the fastest of many runs.
fn fastest(mut run: impl FnMut(u32)) -> f64 {
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

fn row(case: &str, who: &str, ns: f64) {
    println!("{case}\t{who}\t{ns:.3}");
}

fn main() {
    let chain = format!("chain of {CHAIN}, per hop");
    row(&chain, "umbriel", ours::chain(CHAIN));
    row(&chain, "bevy_ecs, system", bevy::chain_by_system(CHAIN));
    row(&chain, "bevy_ecs, observers", bevy::chain_by_observers(CHAIN));
    for targets in TARGETS {
        let fan_out = format!("fan-out to {targets}, per target");
        row(&fan_out, "umbriel", ours::fan_out(targets));
        row(&fan_out, "bevy_ecs, system", bevy::fan_out_by_system(targets));
        row(&fan_out, "bevy_ecs, observers", bevy::fan_out_by_observers(targets));
    }
    for stages in STAGES {
        row(&format!("{stages} diamonds, per node"), "umbriel", ours::diamonds(stages));
    }
}
