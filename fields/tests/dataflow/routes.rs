//! What routes deliver, when, and which of them are refused; one behaviour a test.

use umbriel_fields::{Error, Graph, NodeId, RouteId, Strength};

use crate::support::{at, create, frame, graph, int, strong, weak};

#[test]
fn a_route_delivers_in_the_frame_of_the_write_not_before() {
    let mut graph = graph();
    let [a, b] = create(&mut graph, "Plain");
    strong(&mut graph, (a, "x"), (b, "x"));
    graph.set_named(a, "x", 3i64).unwrap();
    assert_eq!(int(&graph, b, "x"), 0);
    assert_eq!(frame(&mut graph).copied, 1);
    assert_eq!(int(&graph, b, "x"), 3);
    assert_eq!(frame(&mut graph).copied, 0);
}

#[test]
fn a_new_route_delivers_what_was_written_but_no_default() {
    let mut graph = graph();
    let [a, b, c] = create(&mut graph, "Plain");
    graph.set_named(b, "x", 7i64).unwrap();
    strong(&mut graph, (a, "x"), (b, "x"));
    assert_eq!(int(&graph, b, "x"), 7, "a was never written");
    strong(&mut graph, (b, "x"), (c, "x"));
    assert_eq!(int(&graph, c, "x"), 7);
}

#[test]
fn a_long_chain_takes_one_frame_in_whatever_order_it_was_built() {
    for backwards in [false, true] {
        let mut graph = graph();
        let nodes: [NodeId; 500] = create(&mut graph, "Inc");
        let mut pairs: Vec<_> = nodes.windows(2).map(|pair| (pair[0], pair[1])).collect();
        if backwards {
            pairs.reverse();
        }
        for (from, to) in pairs {
            strong(&mut graph, (from, "out"), (to, "in"));
        }
        graph.set_named(nodes[0], "in", 10i64).unwrap();
        assert_eq!(frame(&mut graph).evaluated, 500);
        assert_eq!(int(&graph, nodes[499], "out"), 510);
    }
}

#[test]
fn a_node_that_many_ways_lead_to_is_evaluated_once() {
    let mut graph = graph();
    let [source, mut joint] = create(&mut graph, "Inc");
    strong(&mut graph, (source, "out"), (joint, "in"));
    for _ in 0..30 {
        let [left, right, next] = create(&mut graph, "Inc");
        for side in [left, right] {
            strong(&mut graph, (joint, "out"), (side, "in"));
            strong(&mut graph, (side, "out"), (next, "in"));
        }
        joint = next;
    }
    frame(&mut graph);
    graph.set_named(source, "in", 1000i64).unwrap();
    assert_eq!(frame(&mut graph).evaluated, 92);
    assert_eq!(int(&graph, joint, "out"), 1062);
}

#[test]
fn of_several_routes_the_last_write_of_the_frame_wins() {
    for order in [[0, 1], [1, 0]] {
        let mut graph = graph();
        let sources: [NodeId; 2] = create(&mut graph, "Plain");
        let [target] = create(&mut graph, "Plain");
        for source in sources {
            strong(&mut graph, (source, "x"), (target, "x"));
        }
        for frames in 0..3 {
            for index in order {
                graph.set_named(sources[index], "x", 10 * frames + index as i64 + 1).unwrap();
            }
            frame(&mut graph);
            assert_eq!(int(&graph, target, "x"), 10 * frames + order[1] as i64 + 1);
        }
    }
}

#[test]
fn of_simultaneous_writes_the_route_made_last_wins() {
    for swapped in [false, true] {
        let mut graph = graph();
        let [source, left, right, target] = create(&mut graph, "Plain");
        let mut sides = [(left, "pulse"), (right, "ranged")];
        strong(&mut graph, (source, "x"), (left, "pulse"));
        strong(&mut graph, (source, "x"), (right, "ranged"));
        if swapped {
            sides.reverse();
        }
        for side in sides {
            strong(&mut graph, side, (target, "x"));
        }
        graph.set_named(source, "x", 50i64).unwrap();
        frame(&mut graph);
        assert_eq!(int(&graph, target, "x"), if swapped { 50 } else { 5 });
    }
}

#[test]
fn a_direct_write_after_the_sources_write_wins() {
    let mut graph = graph();
    let [a, b, target] = create(&mut graph, "Plain");
    strong(&mut graph, (a, "x"), (target, "x"));
    for several in [false, true] {
        if several {
            strong(&mut graph, (b, "x"), (target, "x"));
        }
        for (first, second, expected) in [(a, target, 2), (target, a, 2)] {
            graph.set_named(first, "x", 1i64).unwrap();
            graph.set_named(second, "x", expected).unwrap();
            frame(&mut graph);
            assert_eq!(int(&graph, target, "x"), expected);
            graph.set_named(a, "x", 0i64).unwrap();
            frame(&mut graph);
            assert_eq!(int(&graph, target, "x"), 0);
        }
    }
}

#[test]
fn a_weak_route_takes_one_frame_a_lap() {
    let mut graph = graph();
    let [node] = create(&mut graph, "Inc");
    weak(&mut graph, (node, "out"), (node, "in"));
    for lap in 1..10 {
        frame(&mut graph);
        assert_eq!(int(&graph, node, "out"), lap);
    }
}

#[test]
fn a_weak_route_carries_the_value_of_the_last_frame() {
    let mut graph = graph();
    let [a, b] = create(&mut graph, "Plain");
    weak(&mut graph, (a, "x"), (b, "x"));
    for number in 1..5i64 {
        graph.set_named(a, "x", number).unwrap();
        frame(&mut graph);
        assert_eq!(int(&graph, b, "x"), number - 1);
    }
}

#[test]
fn a_loop_of_strong_routes_is_named_and_refused() {
    let mut graph = graph();
    let nodes: [NodeId; 3] = create(&mut graph, "Inc");
    for (node, name) in nodes.into_iter().zip(["a", "b", "c"]) {
        graph.set_name(node, name).unwrap();
    }
    strong(&mut graph, (nodes[0], "out"), (nodes[1], "in"));
    strong(&mut graph, (nodes[1], "out"), (nodes[2], "in"));
    let (from, to) = (at(&graph, nodes[2], "out"), at(&graph, nodes[0], "in"));
    let error = graph.connect(from, to, Strength::Strong).unwrap_err();
    assert_eq!(
        error.to_string(),
        "strong routes would form a loop: `c.out` -> `a.in`, `a.out` -> `b.in`, `b.out` -> `c.in`; make one of them weak, such as `c.out` -> `a.in`"
    );
    assert_eq!(graph.routes().count(), 2, "the refused route is not there");
    graph.connect(from, to, Strength::Weak).unwrap();
    for round in 1..4 {
        frame(&mut graph);
        assert_eq!(int(&graph, nodes[2], "out"), 3 * round);
    }
    let (from, to) = (at(&graph, nodes[0], "out"), at(&graph, nodes[0], "in"));
    assert!(matches!(graph.connect(from, to, Strength::Strong), Err(Error::Loop { .. })), "to itself");
}

#[test]
fn a_long_loop_is_named_in_short() {
    let mut graph = graph();
    let nodes: [NodeId; 5000] = create(&mut graph, "Inc");
    for pair in nodes.windows(2).rev() {
        strong(&mut graph, (pair[0], "out"), (pair[1], "in"));
    }
    let (from, to) = (at(&graph, nodes[4999], "out"), at(&graph, nodes[0], "in"));
    let error = graph.connect(from, to, Strength::Strong).unwrap_err().to_string();
    assert!(error.contains("... 4993 more ...") && error.len() < 1000, "{error}");
}

#[test]
fn two_routes_between_the_same_fields_are_refused() {
    let mut graph = graph();
    let [a, b] = create(&mut graph, "Plain");
    strong(&mut graph, (a, "x"), (b, "x"));
    let (from, to) = (at(&graph, a, "x"), at(&graph, b, "x"));
    assert!(matches!(graph.connect(from, to, Strength::Weak), Err(Error::DuplicateRoute { .. })));
}

#[test]
fn routes_are_listed_by_field_and_node_and_end_with_either_node() {
    let mut graph = graph();
    let [a, b, c] = create(&mut graph, "Plain");
    let ab = strong(&mut graph, (a, "x"), (b, "x"));
    let ac = strong(&mut graph, (a, "x"), (c, "x"));
    let bc = strong(&mut graph, (b, "real"), (c, "real"));
    let from = |graph: &Graph, node| graph.routes_from(node).collect::<Vec<RouteId>>();
    assert_eq!((from(&graph, a), from(&graph, b)), (vec![ab, ac], vec![bc]));
    assert_eq!(graph.routes_to(at(&graph, c, "x")).collect::<Vec<_>>(), [ac]);
    graph.delete(c).unwrap();
    assert_eq!((from(&graph, a), from(&graph, b)), (vec![ab], vec![]));
    assert!(graph.disconnect(ab) && !graph.disconnect(ab) && !graph.disconnect(bc));
    frame(&mut graph);
}
