//! Speed and memory of the dataflow beside plain arrays, which nothing can beat: `cargo bench -p umbriel-fields --bench dataflow`.

mod building;
mod copies;
mod evaluations;
mod idle;
mod memory;
mod support;
mod threads;

fn main() {
    // `-- threads` measures those alone.
    if std::env::args().any(|arg| arg == "threads") {
        return threads::all();
    }
    println!("{:<66} {:>10} {:>9} {:>6}", "nanoseconds", "umbriel", "arrays", "ratio");
    copies::chain(1000);
    copies::chain(100_000);
    copies::fan_out(100_000, copies::Order::Neighbours);
    copies::fan_out(100_000, copies::Order::Shuffled);
    evaluations::chain(1000);
    evaluations::pairs(100_000);
    for stages in [10, 20, 40] {
        evaluations::ladder(stages);
    }
    for nodes in [1000, 1_000_000] {
        idle::nothing_changed(nodes);
        for changed in [1, 100, 1000] {
            idle::some_changed(nodes, changed);
        }
    }
    building::create(100_000);
    building::connect(100_000);
    println!("\n{:<66} {:>10}", "bytes", "umbriel");
    memory::nodes(100_000);
    memory::routes(100_000);
    println!();
    threads::all();
}
