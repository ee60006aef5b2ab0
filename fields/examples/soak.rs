//! Random operations on a graph, as many as asked for, with its invariants checked on the way:
//!
//! `cargo run --release -p umbriel-fields --example soak -- --operations 1000000 --seed 1 [--verify-every 10]`
//!
//! A twin that explains itself now and then and evaluates on two threads has every operation too, and must hold the same. Both are saved and
//! loaded on the way, as text and as bytes in turns, and go on as what was loaded.

use std::process::ExitCode;
use std::time::Instant;

use umbriel_fields::{
    Field, FieldId, Graph, Host, Mode, NoHost, NodeId, NodeType, ObserverId, RouteId, SetRule, Strength, Value,
    save::{self, TakenNames},
};

/// splitmix64 (Steele, Lea, Flood 2014).
#[derive(Clone)]
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) % end as u64) as usize
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> Option<T> {
        if from.is_empty() { None } else { Some(from[self.below(from.len())]) }
    }
}

fn types() -> Vec<NodeType> {
    let numbers = |node_type: NodeType| {
        node_type
            .field(Field::new("in", 0i64))
            .field(Field::new("out", 0i64))
            .field(Field::new("pulse", 0i32).on_set(SetRule::Pulse))
            .field(Field::new("ranged", 0.0f64).range(-5.0, 5.0))
            .field(Field::new("on", false))
            .field(Field::new("place", glam::Vec3::ZERO))
            .field(Field::new("tint", umbriel_fields::Color::default()))
            .field(Field::many::<f32>("list"))
            .field(Field::new("text", ""))
            .field(Field::choice("mode", &["a", "b", "c"], "a"))
            .field(Field::nodes("children"))
    };
    vec![
        numbers(NodeType::new("Plain", "Holds values.")),
        numbers(NodeType::new("Script", "Evaluated by the host.")).host_evaluated(),
        numbers(NodeType::new("Inc", "Evaluated by a function.")).evaluate(|evaluation| {
            let value: i64 = evaluation.get(0);
            // So heavy that two threads pay for a few.
            for _ in 0..4000 {
                std::hint::black_box(value);
            }
            evaluation.set(1, value.wrapping_mul(3) % 1009 + 1);
            if value % 50 == 7 {
                evaluation.again();
            }
        }),
    ]
}

/// All that the operations are drawn from; two of the same seed do the same.
struct Soak {
    graph: Graph,
    random: Random,
    nodes: Vec<NodeId>,
    routes: Vec<RouteId>,
    observers: Vec<ObserverId>,
    counts: Counts,
    threads: usize,
    fault: Option<String>,
}

#[derive(Clone, Debug, Default, PartialEq)]
struct Counts {
    refused: usize,
    frames: usize,
    evaluated: usize,
    copied: usize,
    callbacks: usize,
    saves: usize,
}

/// Operations inside of callbacks are few, and of the kinds that only the graph knows of.
struct Callbacks<'a> {
    random: &'a mut Random,
    nodes: &'a [NodeId],
    routes: &'a mut Vec<RouteId>,
    callbacks: usize,
}

impl Callbacks<'_> {
    fn meddle(&mut self, graph: &mut Graph, node: NodeId) {
        self.callbacks += 1;
        let field = FieldId { node, index: self.random.below(5) as u16 };
        let value = self.random.below(9) as i64 - 4;
        let route = graph.routes_from(node).next();
        match (self.random.below(100), route) {
            (0, Some(route)) => drop(graph.disconnect(route)),
            (1, _) => drop(graph.touch(field)),
            (3, _) => {
                let Some(node) = self.random.pick(self.nodes) else { return };
                let strength = [Strength::Strong, Strength::Weak][self.random.below(2)];
                let other = FieldId { node, ..field };
                self.routes.extend(graph.connect(field, other, strength));
            }
            (2, _) if self.random.below(20) == 0 => drop(graph.delete(node)),
            _ => drop(graph.set(field, value)),
        }
    }
}

impl Host for Callbacks<'_> {
    fn field_changed(&mut self, graph: &mut Graph, field: FieldId, _: u64) {
        self.meddle(graph, field.node);
    }

    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        self.meddle(graph, node);
    }
}

impl Soak {
    fn new(seed: u64, threads: usize) -> Self {
        let (nodes, routes, observers) = (Vec::new(), Vec::new(), Vec::new());
        let mut graph = Graph::new(types());
        graph.set_threads(threads);
        Self { graph, random: Random(seed), nodes, routes, observers, counts: Counts::default(), threads, fault: None }
    }

    fn field(&mut self) -> Option<FieldId> {
        let node = self.random.pick(&self.nodes)?;
        // Mostly numbers, which convert into each other; also fields that do not exist.
        let index = if self.random.below(5) > 0 { self.random.below(5) } else { self.random.below(13) };
        Some(FieldId { node, index: index as u16 })
    }

    fn value(&mut self) -> Value {
        let number = self.random.below(13) as i64 - 6;
        match self.random.below(8) {
            0 => Value::from(number as f64 / 2.0),
            1 => Value::from(number > 0),
            2 => Value::from(glam::Vec3::splat(number as f32)),
            3 => Value::from(vec![number as f32; number.unsigned_abs() as usize]),
            4 => Value::from(["a", "b", "c", "d"][number.unsigned_abs() as usize % 4]),
            5 => Value::from(self.nodes.iter().copied().take(number.unsigned_abs() as usize).collect::<Vec<NodeId>>()),
            _ => Value::from(number),
        }
    }

    /// One operation. Errors are fine: they must change nothing that matters.
    fn step(&mut self) {
        let kind = self.random.below(100);
        let (Some(field), Some(other)) = (self.field(), self.field()) else {
            self.nodes.extend(self.graph.create("Inc"));
            return;
        };
        let value = self.value();
        let graph = &mut self.graph;
        let done = match kind {
            0..5 if self.nodes.len() < 200 => {
                graph.create(["Plain", "Inc", "Script"][kind % 3]).map(|node| self.nodes.push(node))
            }
            5 if self.nodes.len() > 100 => graph.delete(field.node),
            6..24 => {
                let strength = if kind < 10 { Strength::Weak } else { Strength::Strong };
                graph.connect(field, other, strength).map(|route| self.routes.push(route))
            }
            24..26 => {
                let at = self.random.below(self.routes.len().max(1));
                if at < self.routes.len() {
                    graph.disconnect(self.routes.swap_remove(at));
                }
                Ok(())
            }
            26..34 => graph.touch(field),
            34..37 => graph.set_silent(field, value),
            37..39 => graph.add_field(field.node, Field::new(format!("extra{}", kind - 37), value)).map(drop),
            39..41 => graph.remove_field(field),
            41..43 if self.observers.len() < 100 => graph.observe(field, 0).map(|observer| self.observers.push(observer)),
            43 => {
                let at = self.random.below(self.observers.len().max(1));
                if at < self.observers.len() {
                    graph.unobserve(self.observers.swap_remove(at));
                }
                Ok(())
            }
            44 => graph.set_name(field.node, ["a", "b", "c", ""][kind % 4]),
            45 => graph.set_mode(field.node, [Mode::OnChange, Mode::Always, Mode::Pull][field.index as usize % 3]),
            46 => graph.depend_for_this_frame(field.node, other.node),
            47 => graph.pull(field.node, &mut NoHost),
            48 => graph.wake(field.node),
            49..53 => {
                self.frame();
                Ok(())
            }
            53 if field.index == 3 && other.index == 3 => {
                self.save_and_load();
                Ok(())
            }
            _ => graph.set(field, value),
        };
        self.counts.refused += done.is_err() as usize;
        self.nodes.retain(|node| self.graph.contains(*node));
    }

    /// What was loaded must say of itself what was saved, and goes on in place of the graph.
    fn save_and_load(&mut self) {
        self.counts.saves += 1;
        let text = save::to_text(&self.graph);
        let data = if self.counts.saves.is_multiple_of(2) { text.clone().into_bytes() } else { save::to_binary(&self.graph) };
        let mut graph = Graph::new(types());
        let loaded = match save::load_into(&mut graph, data, TakenNames::Refuse) {
            Ok(loaded) => loaded,
            Err(error) => return self.fault = Some(format!("what was saved does not load: {error}")),
        };
        if let Some(report) = loaded.reports.first() {
            self.fault = Some(format!("what was saved does not load whole: {report}"));
        } else if save::to_text(&graph) != text {
            self.fault = Some("what was loaded is not what was saved".into());
        }
        graph.set_threads(self.threads);
        graph.explain(self.graph.explains());
        (self.graph, self.nodes) = (graph, loaded.nodes);
        self.routes = self.graph.routes().map(|(route, _)| route).collect();
        // Who observes is not saved.
        self.observers.clear();
    }

    fn frame(&mut self) {
        let (random, nodes, routes) = (&mut self.random, &self.nodes[..], &mut self.routes);
        let mut host = Callbacks { random, nodes, routes, callbacks: 0 };
        let report = self.graph.evaluate(self.counts.frames as f64 / 60.0, &mut host);
        self.counts.callbacks += host.callbacks;
        self.counts.frames += 1;
        self.counts.evaluated += report.evaluated;
        self.counts.copied += report.copied;
    }

    /// One number for all values and revisions (FNV-1a).
    fn hash(&self) -> u64 {
        let mut hash = 0xcbf2_9ce4_8422_2325u64;
        let mut add =
            |bytes: &[u8]| bytes.iter().for_each(|byte| hash = (hash ^ *byte as u64).wrapping_mul(0x0000_0100_0000_01b3));
        for node in self.graph.nodes() {
            for (field, _) in self.graph.field_ids(node) {
                add(&self.graph.field_revision(field).to_le_bytes());
                add(format!("{:?}", self.graph.value(field)).as_bytes());
            }
        }
        hash
    }
}

fn number(name: &str, default: usize) -> usize {
    let args: Vec<String> = std::env::args().collect();
    let place = args.iter().position(|arg| arg == name);
    place.and_then(|place| args.get(place + 1)?.parse().ok()).unwrap_or(default)
}

fn main() -> ExitCode {
    let (operations, seed) = (number("--operations", 1_000_000), number("--seed", 1));
    let verify_every = number("--verify-every", 10).max(1);
    println!(
        "{operations} operations, seed {seed}, invariants checked after every {verify_every}, hashes after every {}",
        20 * verify_every
    );
    let start = Instant::now();
    let [mut soak, mut twin] = [1, 2].map(|threads| Soak::new(seed as u64, threads));
    let mut largest = (0, 0);
    for done in 1..=operations {
        soak.step();
        // What the twin explains is forgotten now and then, so that both ways are taken.
        if done % 5000 == 0 {
            twin.graph.explain(!twin.graph.explains());
        }
        twin.step();
        largest = largest.max((soak.graph.node_count(), soak.graph.routes().count()));
        let broken = if done % verify_every == 0 { soak.graph.verify_invariants().err() } else { None };
        let fault = broken.or(soak.fault.take()).or(twin.fault.take());
        let differs = done % (20 * verify_every) == 0 && (soak.hash() != twin.hash() || soak.counts != twin.counts);
        if let Some(fault) = fault.or(differs.then(|| "the twin on two threads holds other values".into())) {
            println!("operation {done}: {fault}");
            return ExitCode::FAILURE;
        }
    }
    println!("{:?}, at most {} nodes and {} routes", soak.counts, largest.0, largest.1);
    println!(
        "no fault in {:.1} s; last revision {}, hash {:016x}",
        start.elapsed().as_secs_f64(),
        soak.graph.revision(),
        soak.hash()
    );
    ExitCode::SUCCESS
}
