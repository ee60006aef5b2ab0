//! Copies that run as blocks of memory or as chains do what single ones do.

use umbriel_fields::{Changes, FieldId, NodeId, Strength};

use crate::support::{at, create, frame, graph, int, strong};

/// More than one block, and a piece of one.
const TARGETS: usize = 2500;

#[test]
fn a_block_of_targets_is_copied_like_one_by_one() {
    for odd in ["none", "written later", "equal", "evaluated", "observed", "removed", "asked before"] {
        let mut graph = graph();
        let [source] = create(&mut graph, "Plain");
        let targets: Vec<NodeId> = (0..TARGETS).map(|_| graph.create("Plain").unwrap()).collect();
        let from = at(&graph, source, "real");
        for target in &targets {
            strong(&mut graph, (source, "real"), (*target, "real"));
        }
        let special = [3, 1024, TARGETS - 1].map(|place| targets[place]);
        frame(&mut graph);
        graph.set(from, 1.0).unwrap();
        let mut expected = TARGETS;
        let mut evaluated = 0;
        for node in special {
            let field = at(&graph, node, "real");
            match odd {
                "written later" => graph.set(field, 9.0).unwrap(),
                "equal" => graph.set_silent(field, 1.0).unwrap(),
                "evaluated" => {
                    let [next] = create(&mut graph, "Inc");
                    strong(&mut graph, (node, "real"), (next, "in"));
                    evaluated += 1;
                }
                "observed" => drop(graph.observe(field, 1).unwrap()),
                "removed" => graph.delete(node).unwrap(),
                _ => {}
            }
        }
        if ["written later", "equal", "removed"].contains(&odd) {
            expected -= special.len();
        }
        let before = graph.revision();
        if odd == "asked before" {
            graph.touch(at(&graph, targets[5], "x")).unwrap();
            graph.set(from, 2.0).unwrap();
        }
        let report = frame(&mut graph);
        assert_eq!((report.copied, report.evaluated), (expected + evaluated, evaluated), "{odd}");
        let value = if odd == "asked before" { 2.0 } else { 1.0 };
        for target in targets.iter().filter(|target| graph.contains(**target)) {
            let other = odd == "written later" && special.contains(target);
            assert_eq!(graph.get_named::<f64>(*target, "real").unwrap(), if other { 9.0 } else { value }, "{odd}");
        }
        let Changes::Nodes(mut changed) = graph.changes_since(before) else { panic!("the log is short") };
        changed.retain(|node| targets.contains(node));
        assert_eq!(changed.len(), expected, "{odd}");
    }
}

#[test]
fn a_chain_waits_for_nodes_whose_turn_comes_between() {
    let mut graph = graph();
    let chain: [NodeId; 4] = create(&mut graph, "Plain");
    let [between] = create(&mut graph, "Inc");
    let [target] = create(&mut graph, "Plain");
    let links = [(chain[0], "x", chain[1], "x"), (between, "out", target, "x"), (chain[1], "x", chain[2], "x")];
    for (from, source, to, place) in links {
        strong(&mut graph, (from, source), (to, place));
    }
    strong(&mut graph, (chain[2], "x"), (chain[3], "x"));
    strong(&mut graph, (chain[3], "x"), (target, "x"));
    for round in 1..4 {
        graph.set_named(chain[0], "x", 100 * round).unwrap();
        graph.set_named(between, "in", round).unwrap();
        frame(&mut graph);
        let order: Vec<NodeId> = graph.evaluation_order().collect();
        let place = |node| order.iter().position(|other| *other == node).unwrap();
        assert!(place(chain[1]) < place(between) && place(between) < place(chain[2]), "the test needs this order");
        assert_eq!(int(&graph, target, "x"), 100 * round, "the end of the chain is written after what came between");
    }
}

#[test]
fn a_chain_changes_its_kind_on_the_way_and_splits() {
    let mut graph = graph();
    let nodes: [NodeId; 40] = create(&mut graph, "Plain");
    let field = |index: usize| ["x", "real", "ranged", "pulse"][index / 10];
    for (index, pair) in nodes.windows(2).enumerate() {
        strong(&mut graph, (pair[0], field(index)), (pair[1], field(index + 1)));
    }
    let [side] = create(&mut graph, "Plain");
    strong(&mut graph, (nodes[7], "x"), (side, "x"));
    for (value, end) in [(3, 3), (50, 5), (-50, -5)] {
        graph.set_named(nodes[0], "x", value).unwrap();
        frame(&mut graph);
        assert_eq!((int(&graph, side, "x"), int(&graph, nodes[39], "pulse")), (value, end));
    }
}

#[test]
fn a_chain_of_100_000_takes_one_frame_and_no_deep_stack() {
    let run = || {
        let mut graph = graph();
        let nodes: Vec<NodeId> = (0..100_000).map(|_| graph.create("Inc").unwrap()).collect();
        for pair in nodes.windows(2).rev() {
            let [from, to] = [FieldId { node: pair[0], index: 1 }, FieldId { node: pair[1], index: 0 }];
            graph.connect(from, to, Strength::Strong).unwrap();
        }
        assert_eq!(graph.evaluate(0.0, &mut umbriel_fields::NoHost).evaluated, 100_000);
        int(&graph, nodes[99_999], "out")
    };
    let thread = std::thread::Builder::new().stack_size(128 * 1024).spawn(run).unwrap();
    assert_eq!(thread.join().unwrap(), 100_000);
}

/// Longer than the longest piece of a chain that is kept together.
const CHAIN: usize = 2600;

#[test]
fn a_long_chain_may_be_cut_and_watched_anywhere() {
    for odd in ["none", "observed", "in each frame", "equal", "silent", "written", "cut and mended", "two sources"] {
        let mut graph = graph();
        let nodes: Vec<NodeId> = (0..CHAIN).map(|_| graph.create("Plain").unwrap()).collect();
        let fields: Vec<FieldId> = nodes.iter().map(|node| at(&graph, *node, "real")).collect();
        // Pieces that were in use before they became one chain.
        for place in (0..CHAIN - 1).rev() {
            graph.connect(fields[place], fields[place + 1], Strength::Strong).unwrap();
            if place % 500 == 0 {
                graph.set(fields[place], place as f64 + 1.0).unwrap();
                frame(&mut graph);
            }
        }
        let special = [1, 700, 1025, CHAIN - 2];
        let (mut copied, mut ends) = (CHAIN - 1, CHAIN);
        for place in special {
            let field = fields[place];
            match odd {
                "observed" => drop(graph.observe(field, 1).unwrap()),
                "in each frame" => graph.set_mode(field.node, umbriel_fields::Mode::Always).unwrap(),
                "cut and mended" => {
                    let route = graph.routes_to(field).next().unwrap();
                    graph.disconnect(route);
                    graph.connect(fields[place - 1], field, Strength::Strong).unwrap();
                }
                "two sources" => {
                    let [other] = create(&mut graph, "Plain");
                    graph.connect(FieldId { node: other, ..field }, field, Strength::Strong).unwrap();
                }
                _ => {}
            }
            graph.verify_invariants().unwrap();
        }
        frame(&mut graph);
        let before = graph.revision();
        graph.set(fields[0], 5.5).unwrap();
        match odd {
            // What holds the value already ends the wave; what follows is as it was.
            "equal" => {
                graph.set_silent(fields[700], 5.5).unwrap();
                (copied, ends) = (699, 701);
            }
            // A copy is a write of its frame, later than both.
            "silent" => graph.set_silent(fields[700], 9.0).unwrap(),
            "written" => graph.set(fields[700], 9.0).unwrap(),
            _ => {}
        }
        assert_eq!(frame(&mut graph).copied, copied, "{odd}");
        let first: f64 = graph.get(fields[0]).unwrap();
        for (place, field) in fields.iter().enumerate() {
            let expected = if place < ends { first } else { 1.0 };
            assert_eq!(graph.get::<f64>(*field).unwrap(), expected, "{odd}, place {place}");
        }
        let revisions: Vec<_> = fields[..ends.min(700)].iter().map(|field| graph.field_revision(*field)).collect();
        assert!(revisions.windows(2).all(|pair| pair[0] < pair[1]), "{odd}: each copy is a write of its own");
        let Changes::Nodes(changed) = graph.changes_since(before) else { panic!("the log is short") };
        assert!(changed.len() >= copied, "{odd}");
        graph.verify_invariants().unwrap();
        assert_eq!(frame(&mut graph).copied, 0, "{odd}: nothing is left over");
    }
}
