//! Everything at any time, inside of callbacks too: whatever happens, the invariants hold.

use umbriel_fields::{Changes, Field, FieldId, Graph, Host, Mode, NoHost, NodeId, ObserverId, RouteId, Strength};

use crate::support::{Random, graph};

struct Chaos {
    random: Random,
    observers: Vec<ObserverId>,
    /// How many operations callbacks may still do in this frame.
    budget: usize,
    callbacks: usize,
    refused: usize,
}

fn any_field(graph: &Graph, random: &mut Random) -> Option<FieldId> {
    let nodes: Vec<NodeId> = graph.nodes().collect();
    let node = random.pick(&nodes)?;
    let fields: Vec<FieldId> = graph.field_ids(node).map(|(field, _)| field).collect();
    random.pick(&fields)
}

impl Chaos {
    /// One operation. Errors are fine: they must change nothing that matters.
    fn act(&mut self, graph: &mut Graph) {
        let random = &mut self.random;
        let (Some(field), Some(other)) = (any_field(graph, random), any_field(graph, random)) else {
            graph.create("Script").unwrap();
            return;
        };
        let number = random.below(7) as i64;
        let done = match random.below(20) {
            0 | 1 if graph.node_count() < 20 => {
                graph.create(random.pick(&["Inc", "Plain", "Counter", "Script"]).unwrap()).map(drop)
            }
            2 => graph.delete(field.node),
            3..=6 => graph.connect(field, other, if number < 2 { Strength::Weak } else { Strength::Strong }).map(drop),
            7 => {
                let routes: Vec<RouteId> = graph.routes().map(|(id, _)| id).collect();
                random.pick(&routes).map(|route| graph.disconnect(route));
                Ok(())
            }
            8 => graph.touch(field),
            9 => graph.set_silent(field, number),
            10 => graph.add_field(field.node, Field::new(format!("extra{number}"), number)).map(drop),
            11 => graph.remove_field(field),
            12 | 13 => graph.observe(field, number as u64).map(|observer| self.observers.push(observer)),
            14 => {
                random.pick(&self.observers).map(|observer| graph.unobserve(observer));
                Ok(())
            }
            15 => graph.set_name(field.node, &format!("n{number}")),
            16 => graph.set_mode(field.node, random.pick(&[Mode::OnChange, Mode::Always, Mode::Pull, Mode::OnChange]).unwrap()),
            17 => graph.depend_for_this_frame(field.node, other.node),
            18 => graph.pull(field.node, &mut NoHost),
            _ => graph.set(field, number),
        };
        self.refused += done.is_err() as usize;
    }

    fn act_in_callback(&mut self, graph: &mut Graph) {
        self.callbacks += 1;
        for _ in 0..self.random.below(4) {
            if self.budget > 0 {
                self.budget -= 1;
                self.act(graph);
            }
        }
        graph.verify_invariants().unwrap();
    }
}

impl Host for Chaos {
    fn field_changed(&mut self, graph: &mut Graph, field: FieldId, _: u64) {
        assert!(graph.declaration(field).is_ok(), "told of a field that is gone");
        self.act_in_callback(graph);
    }

    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        assert!(graph.contains(node));
        self.act_in_callback(graph);
    }
}

#[test]
fn whatever_happens_the_invariants_hold() {
    let (mut callbacks, mut refused) = (0, 0);
    for seed in 0..30 {
        let mut graph = graph();
        let mut chaos = Chaos { random: Random(1000 + seed), observers: Vec::new(), budget: 0, callbacks: 0, refused: 0 };
        let mut alive_before: Vec<NodeId> = Vec::new();
        let mut mark = graph.revision();
        for number in 0..800 {
            if chaos.random.below(6) == 0 {
                chaos.budget = 6;
                graph.evaluate(number as f64, &mut chaos);
            } else {
                chaos.act(&mut graph);
            }
            graph.verify_invariants().unwrap_or_else(|fault| panic!("seed {seed}, step {number}: {fault}"));
            if number % 7 == 0 {
                check_changes(&graph, mark, &alive_before);
                mark = graph.revision();
                alive_before = graph.nodes().collect();
            }
        }
        (callbacks, refused) = (callbacks + chaos.callbacks, refused + chaos.refused);
    }
    assert!(callbacks > 2000 && refused > 2000, "{callbacks} callbacks, {refused} refusals: the test tests too little");
}

/// What changed is exactly who was written, created, or deleted since.
fn check_changes(graph: &Graph, mark: u64, alive_before: &[NodeId]) {
    let Changes::Nodes(mut found) = graph.changes_since(mark) else { panic!("the log is short") };
    found.sort();
    let count = found.len();
    found.dedup();
    assert_eq!(found.len(), count, "each node once");
    for node in graph.nodes() {
        assert_eq!(found.binary_search(&node).is_ok(), graph.node_revision(node) > mark, "{}", graph.describe(node));
        assert!(alive_before.contains(&node) || graph.node_revision(node) > mark, "a new node is a change");
    }
    for node in alive_before {
        assert!(graph.contains(*node) || found.binary_search(node).is_ok(), "a deleted node is a change");
    }
}
