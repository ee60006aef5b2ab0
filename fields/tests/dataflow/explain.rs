//! Why a field holds what it holds, what nodes cost, and how the graph looks.

use umbriel_fields::{By, FieldId, Graph, Host, Mode, NodeId, Strength};

use crate::support::{at, create, frame, graph, strong, weak};

fn named<const N: usize>(graph: &mut Graph, node_type: &str, names: [&str; N]) -> [NodeId; N] {
    let nodes = create(graph, node_type);
    for (node, name) in std::iter::zip(nodes, names) {
        graph.set_name(node, name).unwrap();
    }
    nodes
}

fn why(graph: &Graph, node: NodeId, field: &str) -> String {
    graph.why(at(graph, node, field)).iter().map(|cause| format!("{cause}\n")).collect()
}

#[test]
fn a_value_is_traced_through_routes_and_evaluations_to_who_wrote_it() {
    let mut graph = graph();
    let [clock] = named(&mut graph, "Plain", ["clock"]);
    let [inc] = named(&mut graph, "Inc", ["inc"]);
    let [foot] = named(&mut graph, "Plain", ["foot"]);
    strong(&mut graph, (clock, "x"), (inc, "in"));
    strong(&mut graph, (inc, "out"), (foot, "real"));
    graph.explain(true);
    graph.set_origin("market.rhai:12");
    graph.set_named(clock, "x", 41i64).unwrap();
    graph.evaluate(0.5, &mut umbriel_fields::NoHost);
    let expected = "\
        `foot.real` = 42.0, in frame 1 (0.500 s) by the route from `inc.out`\n  \
          `inc.out` = 42, in frame 1 (0.500 s) by the evaluation of `inc` (Inc)\n    \
            `inc.in` = 41, in frame 1 (0.500 s) by the route from `clock.x`\n      \
              `clock.x` = 41, in frame 1 (0.500 s) from outside at market.rhai:12\n";
    assert_eq!(why(&graph, foot, "real"), expected);
    let causes = graph.why(at(&graph, foot, "real"));
    assert_eq!(causes[3].by, By::Outside { origin: Some("market.rhai:12".into()) });
    assert_eq!(causes[0].by, By::Route { from: at(&graph, inc, "out"), strength: Strength::Strong });
    // The explanation is that of the write, even when its sources were written since.
    graph.set_origin("");
    graph.set_silent(at(&graph, clock, "x"), 7i64).unwrap();
    assert_eq!(why(&graph, foot, "real"), expected);
    assert_eq!(why(&graph, clock, "x"), "`clock.x` = 7, in frame 2 (0.500 s) from outside\n");
}

#[test]
fn feedback_is_traced_lap_by_lap_over_weak_routes() {
    let mut graph = graph();
    let [node] = named(&mut graph, "Inc", ["loop"]);
    weak(&mut graph, (node, "out"), (node, "in"));
    graph.explain(true);
    for _ in 0..3 {
        frame(&mut graph);
    }
    let values: Vec<String> =
        graph.why(at(&graph, node, "out")).iter().map(|cause| format!("{} {}", cause.frame, cause.by_text)).collect();
    assert_eq!(
        values,
        [
            "3 by the evaluation of `loop` (Inc)",
            "3 by the weak route from `loop.out`",
            "2 by the evaluation of `loop` (Inc)",
            "2 by the weak route from `loop.out`",
            "1 by the evaluation of `loop` (Inc)",
        ]
    );
}

#[test]
fn of_several_routes_the_one_that_won_is_named() {
    let mut graph = graph();
    let [a, b, target] = named(&mut graph, "Plain", ["a", "b", "target"]);
    for source in [a, b] {
        strong(&mut graph, (source, "x"), (target, "x"));
    }
    graph.explain(true);
    for (first, last, name) in [(a, b, "b"), (b, a, "a")] {
        graph.touch(at(&graph, first, "x")).unwrap();
        let value: i64 = graph.get_named(target, "x").unwrap();
        graph.set_named(first, "x", value + 5).unwrap();
        graph.set_named(last, "x", value + 10).unwrap();
        frame(&mut graph);
        assert_eq!(graph.why(at(&graph, target, "x"))[0].by_text, format!("by the route from `{name}.x`"));
    }
}

struct Script;

impl Host for Script {
    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        graph.set_origin("door.rhai:3");
        graph.set(FieldId { node, index: 1 }, 5i64).unwrap();
    }

    fn field_changed(&mut self, graph: &mut Graph, field: FieldId, _: u64) {
        graph.set_origin("door.rhai:9");
        let other = graph.find("other").unwrap();
        let value: i64 = graph.get(field).unwrap();
        graph.set_named(other, "x", value).unwrap();
    }
}

#[test]
fn what_scripts_write_comes_from_what_they_were_told() {
    let mut graph = graph();
    let [script] = named(&mut graph, "Script", ["script"]);
    let [other] = named(&mut graph, "Plain", ["other"]);
    graph.observe(at(&graph, script, "out"), 1).unwrap();
    graph.explain(true);
    graph.set_named(script, "in", 1i64).unwrap();
    graph.evaluate(0.0, &mut Script);
    assert_eq!(
        why(&graph, other, "x"),
        "`other.x` = 5, in frame 1 (0.000 s) by the callback of `script.out` at door.rhai:9\n  \
           `script.out` = 5, in frame 1 (0.000 s) by the evaluation of `script` (Script) at door.rhai:3\n    \
             `script.in` = 1, in frame 1 (0.000 s) from outside\n"
    );
}

#[test]
fn explaining_changes_no_result_and_can_be_switched_off() {
    let mut graph = graph();
    let [a, b] = named(&mut graph, "Plain", ["a", "b"]);
    strong(&mut graph, (a, "x"), (b, "x"));
    graph.set_named(a, "x", 1i64).unwrap();
    let unknown = "`b.x` = 0, its default, or written before anybody asked\n";
    assert_eq!(why(&graph, b, "x"), unknown);
    let mut copied = Vec::new();
    for on in [false, true] {
        graph.explain(on);
        assert_eq!(graph.explains(), on);
        graph.touch(at(&graph, a, "x")).unwrap();
        let value: i64 = graph.get_named(a, "x").unwrap();
        graph.set_named(a, "x", value + 1).unwrap();
        let before = graph.revision();
        copied.push((frame(&mut graph), graph.revision() - before));
    }
    assert_eq!(copied[0], copied[1]);
    assert!(why(&graph, b, "x").contains("by the route from `a.x`"));
    graph.explain(false);
    assert!(why(&graph, b, "x").contains("before anybody asked"));
}

#[test]
fn costs_count_and_time_evaluations() {
    let mut graph = graph();
    let [busy] = named(&mut graph, "Counter", ["busy"]);
    let [once, _plain] = [named(&mut graph, "Inc", ["once"])[0], named(&mut graph, "Plain", ["plain"])[0]];
    graph.set_mode(busy, Mode::Always).unwrap();
    graph.explain(true);
    for _ in 0..5 {
        frame(&mut graph);
    }
    let costs = graph.costs();
    let mut counts: Vec<(NodeId, u32)> = costs.iter().map(|cost| (cost.node, cost.evaluations)).collect();
    counts.sort();
    assert_eq!(counts, [(busy, 5), (once, 1)]);
    assert!(costs.iter().all(|cost| !cost.time.is_zero()) && costs[0].time >= costs[1].time);
    assert_eq!(costs.iter().find(|cost| cost.node == busy).unwrap().name, "`busy` (Counter)");
}

#[test]
fn the_graph_can_be_drawn() {
    let mut graph = graph();
    let [a] = named(&mut graph, "Plain", ["say \"a\""]);
    let [b] = create(&mut graph, "Inc");
    strong(&mut graph, (a, "x"), (b, "in"));
    weak(&mut graph, (b, "out"), (a, "real"));
    let dot = graph.dot();
    for line in [
        "digraph umbriel {",
        "[label = \"say \\\"a\\\" (Plain)\"];",
        "[label = \"an unnamed Inc\", style = rounded];",
        "[label = \"x to in\"];",
        "[label = \"out to real\", style = dashed];",
    ] {
        assert_eq!(dot.matches(line).count(), 1, "{line}\n{dot}");
    }
}
