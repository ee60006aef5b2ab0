//! Who has a turn when, and what may happen in it; one behaviour a test.

use std::collections::HashMap;

use umbriel_fields::{Error, FieldId, Graph, Host, Mode, NoHost, NodeId};

use crate::support::{at, create, frame, graph, int, strong};

#[test]
fn only_what_changed_is_evaluated() {
    let mut graph = graph();
    let nodes: [NodeId; 100] = create(&mut graph, "Inc");
    assert_eq!(frame(&mut graph).evaluated, 100, "new nodes are evaluated once");
    assert_eq!(frame(&mut graph).evaluated, 0);
    graph.set_named(nodes[42], "in", 1i64).unwrap();
    assert_eq!(frame(&mut graph).evaluated, 1);
    assert_eq!((graph.evaluation_count(nodes[42]), graph.evaluation_count(nodes[41])), (2, 1));
}

#[test]
fn an_equal_write_is_dropped_unless_the_field_pulses() {
    for (field, evaluations) in [("x", 0), ("pulse", 1)] {
        let mut graph = graph();
        let [a] = create(&mut graph, "Plain");
        let [counter] = create(&mut graph, "Counter");
        strong(&mut graph, (a, field), (counter, "in"));
        let observed = at(&graph, a, field);
        graph.observe(observed, 5).unwrap();
        frame(&mut graph);
        let mut host = Recorder::default();
        let before = graph.revision();
        graph.set_named(a, field, 0i64).unwrap();
        graph.evaluate(0.0, &mut host);
        assert_eq!(host.told.len(), evaluations, "{field}");
        assert_eq!(graph.revision() - before, evaluations as u64);
        assert_eq!(int(&graph, counter, "count"), 1, "the counter's own field compares");
    }
}

#[test]
fn a_touch_has_the_consequences_of_a_write() {
    let mut graph = graph();
    let [counter] = create(&mut graph, "Counter");
    frame(&mut graph);
    let field = at(&graph, counter, "in");
    let before = graph.revision();
    graph.touch(field).unwrap();
    assert_eq!(graph.field_revision(field), before + 1);
    frame(&mut graph);
    assert_eq!(int(&graph, counter, "count"), 2);
}

#[test]
fn a_silent_write_has_no_consequences_even_later() {
    let mut graph = graph();
    let [a, b] = create(&mut graph, "Plain");
    strong(&mut graph, (a, "x"), (b, "x"));
    strong(&mut graph, (a, "pulse"), (b, "pulse"));
    let (x, pulse) = (at(&graph, a, "x"), at(&graph, a, "pulse"));
    graph.observe(x, 1).unwrap();
    graph.set_silent(x, 5i64).unwrap();
    graph.set(pulse, 6i64).unwrap();
    let mut host = Recorder::default();
    let before = graph.field_revision(x);
    graph.evaluate(0.0, &mut host);
    assert_eq!((int(&graph, b, "x"), int(&graph, b, "pulse"), host.told.len()), (0, 6, 0));
    assert_eq!(graph.field_revision(x), before, "readers of revisions see it");
    graph.set(x, 7i64).unwrap();
    graph.evaluate(0.0, &mut host);
    assert_eq!((int(&graph, b, "x"), host.told.len()), (7, 1));
}

#[test]
fn modes_always_and_pull() {
    let mut graph = graph();
    let [always, pulled, source] = create(&mut graph, "Counter");
    graph.set_mode(always, Mode::Always).unwrap();
    graph.set_mode(pulled, Mode::Pull).unwrap();
    graph.set_mode(source, Mode::Pull).unwrap();
    strong(&mut graph, (source, "count"), (pulled, "in"));
    for _ in 0..3 {
        frame(&mut graph);
    }
    assert_eq!((int(&graph, always, "count"), int(&graph, pulled, "count")), (3, 0));
    for _ in 0..2 {
        graph.pull(pulled, &mut NoHost).unwrap();
        assert_eq!((int(&graph, source, "count"), int(&graph, pulled, "in"), int(&graph, pulled, "count")), (1, 1, 1));
    }
    graph.depend_for_this_frame(always, pulled).unwrap();
    graph.set_named(source, "in", 1i64).unwrap();
    frame(&mut graph);
    assert_eq!((int(&graph, source, "count"), int(&graph, pulled, "count")), (2, 2));
    graph.set_mode(always, Mode::OnChange).unwrap();
    assert_eq!(frame(&mut graph).evaluated, 0);
}

type Act = Box<dyn FnMut(&mut Graph)>;

/// Writes down what it is told, and does what it was asked to do by token or node.
#[derive(Default)]
struct Recorder {
    told: Vec<(FieldId, u64)>,
    evaluated: Vec<NodeId>,
    on_change: HashMap<u64, Act>,
    on_evaluate: HashMap<NodeId, Act>,
}

impl Host for Recorder {
    fn field_changed(&mut self, graph: &mut Graph, field: FieldId, token: u64) {
        self.told.push((field, token));
        if let Some(act) = self.on_change.get_mut(&token) {
            act(graph);
        }
        graph.verify_invariants().unwrap();
    }

    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        self.evaluated.push(node);
        if let Some(act) = self.on_evaluate.get_mut(&node) {
            act(graph);
        }
        graph.verify_invariants().unwrap();
    }
}

#[test]
fn observers_are_told_once_a_frame_at_the_turn_of_the_node() {
    let mut graph = graph();
    let [a, b] = create(&mut graph, "Inc");
    strong(&mut graph, (a, "out"), (b, "in"));
    frame(&mut graph);
    let fields = [at(&graph, b, "out"), at(&graph, b, "in"), at(&graph, a, "in")];
    let observers = [(fields[0], 0), (fields[1], 1), (fields[2], 2)].map(|(field, token)| graph.observe(field, token).unwrap());
    let mut host = Recorder::default();
    graph.set(fields[2], 5i64).unwrap();
    graph.set(fields[2], 6i64).unwrap();
    graph.evaluate(0.0, &mut host);
    assert_eq!(host.told, [(fields[2], 2), (fields[1], 1), (fields[0], 0)], "inputs before the evaluation, outputs after it");
    graph.evaluate(0.0, &mut host);
    assert_eq!(host.told.len(), 3);
    assert!(graph.unobserve(observers[1]) && !graph.unobserve(observers[1]));
    graph.set(fields[2], 7i64).unwrap();
    graph.evaluate(0.0, &mut host);
    assert_eq!(host.told[3..], [(fields[2], 2), (fields[0], 0)]);
}

#[test]
fn a_write_to_a_node_that_had_its_turn_waits_for_the_next_frame() {
    let mut graph = graph();
    let [early, late] = create(&mut graph, "Inc");
    let [script] = create(&mut graph, "Script");
    strong(&mut graph, (early, "out"), (script, "in"));
    strong(&mut graph, (script, "out"), (late, "in"));
    let (first, last) = (at(&graph, early, "in"), at(&graph, late, "in"));
    let mut host = Recorder::default();
    let mut times = 0;
    let act = move |graph: &mut Graph| {
        times += 1;
        if times == 1 {
            graph.set(first, 100i64).unwrap();
            graph.set(last, 100i64).unwrap();
        }
    };
    host.on_evaluate.insert(script, Box::new(act));
    graph.evaluate(0.0, &mut host);
    assert_eq!((int(&graph, early, "out"), int(&graph, late, "out")), (1, 101));
    assert_eq!(graph.evaluate(0.0, &mut host).evaluated, 2, "early and the script after it");
    assert_eq!((int(&graph, early, "out"), int(&graph, script, "in")), (101, 101));
}

#[test]
fn callbacks_may_disconnect_and_delete_anything() {
    for what in ["disconnect", "delete the source", "delete the target", "delete itself", "unobserve", "evaluate"] {
        let mut graph = graph();
        let [a, b, c] = create(&mut graph, "Inc");
        let route = strong(&mut graph, (a, "out"), (b, "in"));
        strong(&mut graph, (b, "out"), (c, "in"));
        let observed = at(&graph, b, "in");
        let observer = graph.observe(observed, 1).unwrap();
        graph.observe(observed, 2).unwrap();
        let mut host = Recorder::default();
        let act = move |graph: &mut Graph| match what {
            "disconnect" => drop(graph.disconnect(route)),
            "delete the source" => graph.delete(a).unwrap_or_default(),
            "delete the target" => graph.delete(c).unwrap_or_default(),
            "delete itself" => graph.delete(b).unwrap_or_default(),
            "unobserve" => drop(graph.unobserve(observer)),
            _ => assert_eq!(graph.evaluate(0.0, &mut NoHost).problems.len(), 1),
        };
        host.on_change.insert(1, Box::new(act));
        graph.evaluate(0.0, &mut host);
        frame(&mut graph);
        assert_eq!(host.told.len(), if what == "delete itself" { 1 } else { 2 }, "{what}");
        let alive = graph.routes().count();
        let expected = match what {
            "disconnect" | "delete the source" | "delete the target" => 1,
            "delete itself" => 0,
            _ => 2,
        };
        assert_eq!(alive, expected, "{what}");
    }
}

#[test]
fn what_a_callback_creates_takes_part_in_the_next_frame() {
    let mut graph = graph();
    let [a] = create(&mut graph, "Inc");
    let out = at(&graph, a, "out");
    graph.observe(out, 1).unwrap();
    let mut host = Recorder::default();
    let act = move |graph: &mut Graph| {
        let [new] = create(graph, "Inc");
        graph.set_name(new, "new").unwrap();
        strong(graph, (a, "out"), (new, "in"));
    };
    host.on_change.insert(1, Box::new(act));
    assert_eq!(graph.evaluate(0.0, &mut host).evaluated, 1);
    let new = graph.find("new").unwrap();
    assert_eq!((int(&graph, new, "in"), int(&graph, new, "out")), (1, 0));
    frame(&mut graph);
    assert_eq!(int(&graph, new, "out"), 2);
}

#[test]
fn a_dependency_for_one_frame_changes_the_order_of_that_frame() {
    let mut graph = graph();
    let [first, second] = create(&mut graph, "Script");
    for (dependent, expected) in
        [(None, [first, second]), (Some((first, second)), [second, first]), (Some((second, first)), [first, second])]
    {
        let mut host = Recorder::default();
        for node in [first, second] {
            let field = at(&graph, node, "in");
            graph.touch(field).unwrap();
        }
        if let Some((node, on)) = dependent {
            graph.depend_for_this_frame(node, on).unwrap();
        }
        graph.evaluate(0.0, &mut host);
        assert_eq!(host.evaluated, expected);
    }
    strong(&mut graph, (first, "out"), (second, "in"));
    let error = graph.depend_for_this_frame(first, second).unwrap_err();
    assert!(matches!(error, Error::Dependency { .. }), "{error}");
    frame(&mut graph);
}

#[test]
fn a_dependency_asked_for_in_the_frame_moves_what_follows_too() {
    let mut graph = graph();
    let nodes: [NodeId; 4] = create(&mut graph, "Script");
    let [asks, dependent, follows, on] = nodes;
    strong(&mut graph, (asks, "out"), (dependent, "in"));
    strong(&mut graph, (dependent, "out"), (follows, "in"));
    let mut host = Recorder::default();
    host.on_evaluate.insert(asks, Box::new(move |graph: &mut Graph| graph.depend_for_this_frame(dependent, on).unwrap()));
    graph.evaluate(0.0, &mut host);
    assert_eq!(host.evaluated, [asks, on, dependent, follows]);
}

#[test]
fn reports_name_the_node_and_come_once() {
    let mut graph = graph();
    let [script] = create(&mut graph, "Script");
    let mut host = Recorder::default();
    host.on_evaluate.insert(script, Box::new(move |graph: &mut Graph| graph.report(script, None, "line 3: no such thing")));
    let report = graph.evaluate(0.0, &mut host);
    assert_eq!((report.problems.len(), report.problems[0].node), (1, script));
    assert_eq!(graph.evaluate(0.0, &mut host).problems, []);
}
