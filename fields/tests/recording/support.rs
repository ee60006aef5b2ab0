//! Types, dice, a host that does anything at any time, and recordings in memory.

use umbriel_fields::record::{Options, Recorder, Replayer};
use umbriel_fields::{
    Field, FieldId, Graph, Host, Mode, NodeId, NodeType, ObserverId, RouteId, SetRule, Strength, builtin_types,
};

pub(crate) use crate::random::Random;

/// What only this program knows how to evaluate. `step` is what a change of the program changes.
pub(crate) fn native_types(step: i64) -> Vec<NodeType> {
    let plain = NodeType::new("Plain", "Holds values.")
        .field(Field::new("x", 0i64))
        .field(Field::new("pulse", 0i64).on_set(SetRule::Pulse))
        .field(Field::new("ranged", 0i64).range(-5.0, 5.0))
        .field(Field::new("real", 0.0f64))
        .field(Field::many::<f32>("list"))
        .field(Field::node("friend"))
        .field(Field::new("image", None::<std::sync::Arc<umbriel_fields::Image>>))
        .field(Field::choice("mood", &["good", "bad"], "good"));
    let inc =
        NodeType::new("Inc", "One more.").field(Field::new("in", 0i64)).field(Field::new("out", 0i64)).evaluate(move |it| {
            let value: i64 = it.get(0);
            it.set(1, value.wrapping_add(step) % 1009);
        });
    let counter = NodeType::new("Counter", "Counts its evaluations.")
        .field(Field::new("in", 0i64))
        .field(Field::new("count", 0i64))
        .evaluate(|it| {
            let count: i64 = it.get(1);
            it.set(1, count + 1);
        });
    let asked = NodeType::new("Asked", "Twice, when asked for.")
        .field(Field::new("in", 0i64))
        .field(Field::new("out", 0i64))
        .pull_only()
        .evaluate(|it| {
            let value: i64 = it.get(0);
            it.set(1, value.wrapping_mul(2) % 1013);
        });
    let mut types = builtin_types();
    types.extend([plain, inc, counter, asked]);
    types
}

/// With those that a script would define.
pub(crate) fn all_types() -> Vec<NodeType> {
    let mut types = native_types(1);
    let script = |name: &str| {
        NodeType::new(name, "A script evaluates it.")
            .field(Field::new("in", 0i64))
            .field(Field::new("out", 0i64))
            .field(Field::choice("mood", &["up", "down"], "down"))
            .host_evaluated()
    };
    types.push(script("Script"));
    types.push(script("Always").always_evaluate());
    types
}

/// Does anything, in callbacks too.
pub(crate) struct Chaos {
    pub(crate) random: Random,
    observers: Vec<ObserverId>,
    /// How many operations callbacks may still do in this frame.
    pub(crate) budget: usize,
    pub(crate) callbacks: usize,
}

pub(crate) fn any_field(graph: &Graph, random: &mut Random) -> Option<FieldId> {
    let nodes: Vec<NodeId> = graph.nodes().collect();
    let node = random.pick(&nodes)?;
    let fields: Vec<FieldId> = graph.field_ids(node).map(|(field, _)| field).collect();
    random.pick(&fields)
}

impl Chaos {
    pub(crate) fn new(seed: u64) -> Self {
        Self { random: Random(seed), observers: Vec::new(), budget: 0, callbacks: 0 }
    }

    /// One operation. Errors are fine.
    pub(crate) fn act(&mut self, graph: &mut Graph) {
        const TYPES: [&str; 8] = ["Inc", "Plain", "Counter", "Script", "Always", "Asked", "TimeSensor", "ScalarDamper"];
        let random = &mut self.random;
        let (Some(field), Some(other)) = (any_field(graph, random), any_field(graph, random)) else {
            graph.create("Script").unwrap();
            return;
        };
        let number = random.below(7) as i64;
        let _ = match random.below(26) {
            0..=2 if graph.node_count() < 24 => graph.create(random.pick(&TYPES).unwrap()).map(drop),
            3 => graph.delete(field.node),
            4..=7 => graph.connect(field, other, if number < 2 { Strength::Weak } else { Strength::Strong }).map(drop),
            8 => {
                let routes: Vec<RouteId> = graph.routes().map(|(id, _)| id).collect();
                random.pick(&routes).map(|route| graph.disconnect(route));
                Ok(())
            }
            9 => graph.touch(field),
            10 => graph.set_silent(field, number),
            11 => graph.add_field(field.node, Field::new(format!("extra{number}"), number)).map(drop),
            12 => graph.remove_field(field),
            13 | 14 => graph.observe(field, number as u64).map(|observer| self.observers.push(observer)),
            15 => {
                random.pick(&self.observers).map(|observer| graph.unobserve(observer));
                Ok(())
            }
            16 => graph.set_name(field.node, &format!("n{number}")),
            17 => graph.set_mode(field.node, random.pick(&[Mode::OnChange, Mode::Always, Mode::Pull, Mode::OnChange]).unwrap()),
            18 => graph.depend_for_this_frame(field.node, other.node),
            19 => graph.pull(field.node, self),
            20 => graph.wake(field.node),
            21 => self.set_odd(graph, field, other.node),
            _ => graph.set(field, number),
        };
    }

    /// Lists, images, references.
    fn set_odd(&mut self, graph: &mut Graph, field: FieldId, other: NodeId) -> Result<(), umbriel_fields::Error> {
        let random = &mut self.random;
        match graph.declaration(field)?.name.as_ref() {
            "list" => {
                let count = random.below(600);
                graph.set(field, (0..count).map(|place| place as f32 * 0.1).collect::<Vec<f32>>())
            }
            "friend" => graph.set(field, other),
            "image" => {
                let rgba = (0..16).map(|_| random.below(3) as u8).collect();
                graph.set(field, umbriel_fields::Image { width: 2, height: 2, rgba })
            }
            "mood" => graph.set(field, umbriel_fields::EnumValue(random.below(2) as u16)),
            _ => graph.set(field, random.next() as i64),
        }
    }

    fn act_in_callback(&mut self, graph: &mut Graph) {
        self.callbacks += 1;
        for _ in 0..self.random.below(3) {
            if self.budget > 0 {
                self.budget -= 1;
                self.act(graph);
            }
        }
    }
}

impl Host for Chaos {
    fn field_changed(&mut self, graph: &mut Graph, _: FieldId, _: u64) {
        self.act_in_callback(graph);
    }

    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        if let Ok(value) = graph.get_named::<i64>(node, "in") {
            let _ = graph.set_named(node, "out", value.wrapping_mul(3) % 101);
        }
        self.act_in_callback(graph);
    }
}

/// Records so many random frames after so many that are not recorded.
pub(crate) fn random_recording(seed: u64, before: usize, frames: usize, keyframe_every: u64) -> (Vec<u8>, Graph, usize) {
    let mut graph = Graph::new(all_types());
    let mut chaos = Chaos::new(seed);
    let frame = |graph: &mut Graph, number: usize, chaos: &mut Chaos| {
        for _ in 0..chaos.random.below(9) {
            chaos.act(graph);
        }
        chaos.budget = 4;
        graph.evaluate(number as f64 / 60.0, chaos);
    };
    for number in 0..before {
        frame(&mut graph, number, &mut chaos);
    }
    for _ in 0..chaos.random.below(4) {
        chaos.act(&mut graph);
    }
    let mut recorder = Recorder::new(&mut graph, Vec::new(), Options { keyframe_every }).unwrap();
    for number in before..before + frames {
        frame(&mut graph, number, &mut chaos);
        recorder.frame(&mut graph).unwrap();
    }
    let bytes = recorder.finish(&mut graph).unwrap();
    (bytes, graph, chaos.callbacks)
}

/// Plays to the end; the first divergence, if there is one.
pub(crate) fn play(replayer: &mut Replayer, graph: &mut Graph) -> Option<String> {
    while let Some(replayed) = replayer.step(graph).unwrap() {
        if let Some(divergence) = replayed.divergence {
            return Some(divergence.to_string());
        }
    }
    None
}
