//! Speed and memory of the dataflow beside plain arrays, which nothing can beat: `cargo bench -p umbriel-fields --bench dataflow`.

mod building;
mod copies;
mod evaluations;
mod idle;
mod memory;
mod support;
mod threads;

/// The parts that can be measured alone: `-- idle threads`.
const PARTS: [(&str, fn()); 6] = [
    ("copies", copies::all),
    ("evaluations", evaluations::all),
    ("idle", idle::all),
    ("building", building::all),
    ("memory", memory::all),
    ("threads", threads::all),
];

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    let wants = |part: &str| wanted.is_empty() || wanted.iter().any(|wanted| wanted == part);
    println!("{:<66} {:>10} {:>9} {:>6}", "nanoseconds", "umbriel", "arrays", "ratio");
    PARTS.iter().filter(|(part, _)| wants(part)).for_each(|(_, measure)| measure());
}
