//! The same promises, kept naively: maps, lists and searches, nothing shared with the crate. Random operations must agree.

use std::collections::{BTreeMap, BTreeSet};

use umbriel_fields::{FieldId, Graph, Host, NodeId, RouteId, Strength};

use crate::support::{Random, graph};

/// Fields of "Script" (in, out) and of "Plain" (x, pulse, ranged, real), by index.
const PLAIN: &[u16] = &[0, 1, 2, 3];
const SCRIPT: &[u16] = &[0, 1];

#[derive(Clone, Copy)]
struct Cell {
    value: i64,
    written: u64,
}

struct ModelNode {
    script: bool,
    created: u64,
    propagated: u64,
    waits: bool,
    next_frame: bool,
    had_turn: bool,
}

#[derive(Clone, Copy)]
struct ModelRoute {
    id: RouteId,
    from: FieldId,
    to: FieldId,
    weak: bool,
    ordinal: u64,
}

#[derive(Default)]
struct Model {
    revision: u64,
    made: u64,
    nodes: BTreeMap<NodeId, ModelNode>,
    cells: BTreeMap<FieldId, Cell>,
    silenced: BTreeMap<FieldId, u64>,
    routes: Vec<ModelRoute>,
    carried: Vec<(ModelRoute, i64, u64)>,
    arrivals: BTreeMap<FieldId, ((u64, u64), u64)>,
    running: bool,
}

impl Model {
    fn create(&mut self, id: NodeId, script: bool) {
        self.revision += 1;
        let created = self.revision;
        for index in if script { SCRIPT } else { PLAIN } {
            self.cells.insert(FieldId { node: id, index: *index }, Cell { value: 0, written: created });
        }
        let node = ModelNode { script, created, propagated: created, waits: false, next_frame: script, had_turn: false };
        self.nodes.insert(id, node);
    }

    fn delete(&mut self, id: NodeId) {
        for route in self.routes.clone() {
            if route.from.node == id || route.to.node == id {
                self.disconnect(route.id);
            }
        }
        self.nodes.remove(&id);
        self.cells.retain(|field, _| field.node != id);
        self.revision += 1;
    }

    fn disconnect(&mut self, id: RouteId) {
        let Some(place) = self.routes.iter().position(|route| route.id == id) else { return };
        let to = self.routes.remove(place).to;
        if self.routes.iter().filter(|route| route.to == to).count() < 2 {
            self.arrivals.remove(&to);
        }
    }

    /// Asks for a turn if somebody would hear of it.
    fn mark(&mut self, id: NodeId) {
        let routed = self.routes.iter().any(|route| route.from.node == id);
        let running = self.running;
        let node = self.nodes.get_mut(&id).unwrap();
        if (node.script || routed) && !node.waits {
            if running && !node.had_turn { node.waits = true } else { node.next_frame = true }
        }
    }

    fn fits(&self, field: FieldId, value: i64) -> i64 {
        if !self.nodes[&field.node].script && field.index == 2 { value.clamp(-5, 5) } else { value }
    }

    fn pulses(&self, field: FieldId) -> bool {
        !self.nodes[&field.node].script && field.index == 1
    }

    /// Writes with the next revision; false if nothing would change.
    fn write(&mut self, field: FieldId, value: i64, compare: bool) -> bool {
        if compare && self.cells[&field].value == value {
            return false;
        }
        self.revision += 1;
        self.cells.insert(field, Cell { value, written: self.revision });
        true
    }

    fn set(&mut self, field: FieldId, value: i64) {
        if self.write(field, value, !self.pulses(field)) {
            self.mark(field.node);
        }
    }

    fn leads(&self, from: NodeId, to: NodeId) -> bool {
        let mut seen = BTreeSet::from([from]);
        let mut open = vec![from];
        while let Some(node) = open.pop() {
            if node == to {
                return true;
            }
            open.extend(
                self.routes
                    .iter()
                    .filter(|route| !route.weak && route.from.node == node && seen.insert(route.to.node))
                    .map(|route| route.to.node),
            );
        }
        false
    }

    fn may_connect(&self, from: FieldId, to: FieldId, weak: bool) -> bool {
        (weak || !self.leads(to.node, from.node)) && !self.routes.iter().any(|route| route.from == from && route.to == to)
    }

    fn connect(&mut self, id: RouteId, from: FieldId, to: FieldId, weak: bool) {
        self.made += 1;
        if !self.routes.iter().any(|route| route.from.node == from.node) {
            self.nodes.get_mut(&from.node).unwrap().propagated = self.revision;
        }
        self.routes.push(ModelRoute { id, from, to, weak, ordinal: self.made });
        if self.routes.iter().filter(|route| route.to == to).count() == 2 {
            self.arrivals.remove(&to);
        }
        if self.cells[&from].written > self.nodes[&from.node].created {
            let value = self.fits(to, self.cells[&from].value);
            if self.write(to, value, true) {
                self.mark(to.node);
            }
        }
    }

    fn deliver(&mut self, route: ModelRoute, value: i64, written: u64, revision: u64) -> bool {
        if !self.routes.iter().any(|other| other.id == route.id) {
            return false;
        }
        let target = self.cells[&route.to];
        let fan_in = self.routes.iter().filter(|other| other.to == route.to).count() > 1;
        let arrival = self.arrivals.get(&route.to).filter(|(_, delivered)| fan_in && *delivered == target.written);
        let late = match arrival {
            Some((won, _)) => (written, route.ordinal) <= *won,
            None => written <= target.written,
        };
        if late {
            return false;
        }
        let value = self.fits(route.to, value);
        let copied = self.pulses(route.to) || value != target.value;
        if copied {
            self.cells.insert(route.to, Cell { value, written: revision });
            self.mark(route.to.node);
        }
        if fan_in {
            self.arrivals.insert(route.to, ((written, route.ordinal), if copied { revision } else { target.written }));
        }
        copied
    }

    fn start(&mut self) {
        let revision = self.revision + 1;
        let mut copied = false;
        for (route, value, written) in std::mem::take(&mut self.carried) {
            copied |= self.deliver(route, value, written, revision);
        }
        self.revision += copied as u64;
        self.running = true;
        for node in self.nodes.values_mut() {
            (node.waits, node.next_frame, node.had_turn) = (std::mem::take(&mut node.next_frame), false, false);
        }
    }

    /// Whose turn it is, if only one node can be next; script nodes come when the graph says so.
    fn turn(&mut self, id: NodeId) {
        let node = self.nodes.get_mut(&id).unwrap();
        assert!(node.waits, "a turn that nobody asked for");
        (node.waits, node.had_turn) = (false, true);
        if node.script {
            let value = self.cells[&FieldId { node: id, index: 0 }].value;
            self.write(FieldId { node: id, index: 1 }, (value * 3 + 1) % 101, true);
        }
        let before = std::mem::replace(&mut self.nodes.get_mut(&id).unwrap().propagated, self.revision);
        let fields: Vec<FieldId> = self.cells.keys().filter(|field| field.node == id).copied().collect();
        for from in fields {
            let Cell { value, written } = self.cells[&from];
            if written <= before || self.silenced.get(&from) == Some(&written) {
                continue;
            }
            let revision = self.revision + 1;
            let mut copied = false;
            let routes: Vec<ModelRoute> = self.routes.iter().filter(|route| route.from == from).copied().collect();
            for route in routes.iter().filter(|route| !route.weak) {
                copied |= self.deliver(*route, value, written, revision);
            }
            self.revision += copied as u64;
            if routes.iter().any(|route| route.weak) {
                self.revision += 1;
                let written = self.revision;
                self.carried.extend(routes.iter().filter(|route| route.weak).map(|route| (*route, value, written)));
            }
        }
    }
}

/// Evaluates the script nodes and notes their order.
#[derive(Default)]
struct Follower {
    turns: Vec<NodeId>,
}

impl Host for Follower {
    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        self.turns.push(node);
        let value: i64 = graph.get(FieldId { node, index: 0 }).unwrap();
        graph.set(FieldId { node, index: 1 }, (value * 3 + 1) % 101).unwrap();
    }
}

fn check_order(model: &Model, turns: &[NodeId]) {
    for (place, later) in turns.iter().enumerate() {
        for earlier in &turns[..place] {
            assert!(!model.leads(*later, *earlier), "a source had its turn after its target");
        }
    }
}

fn step(random: &mut Random, graph: &mut Graph, model: &mut Model) {
    let nodes: Vec<NodeId> = model.nodes.keys().copied().collect();
    let fields: Vec<FieldId> = model.cells.keys().copied().collect();
    let (field, other) = (random.pick(&fields), random.pick(&fields));
    let value = random.below(9) as i64 - 4;
    match (random.below(100), field, other) {
        (0..8, ..) if nodes.len() < 14 => {
            let script = random.below(2) == 0;
            let id = graph.create(if script { "Script" } else { "Plain" }).unwrap();
            model.create(id, script);
        }
        (8..12, Some(field), _) => {
            graph.delete(field.node).unwrap();
            model.delete(field.node);
        }
        (12..40, Some(from), Some(to)) => {
            let weak = random.below(3) == 0;
            let strength = if weak { Strength::Weak } else { Strength::Strong };
            let expected = model.may_connect(from, to, weak);
            match graph.connect(from, to, strength) {
                Ok(id) => {
                    assert!(expected, "a route that must not be");
                    model.connect(id, from, to, weak);
                }
                Err(error) => assert!(!expected, "{error}"),
            }
        }
        (40..48, ..) => {
            let routes: Vec<RouteId> = model.routes.iter().map(|route| route.id).collect();
            if let Some(route) = random.pick(&routes) {
                assert!(graph.disconnect(route));
                model.disconnect(route);
            }
        }
        (48..52, Some(field), _) => {
            graph.touch(field).unwrap();
            model.revision += 1;
            model.cells.get_mut(&field).unwrap().written = model.revision;
            model.mark(field.node);
        }
        (52..56, Some(field), _) => {
            graph.set_silent(field, value).unwrap();
            if model.write(field, value, !model.pulses(field)) {
                model.silenced.insert(field, model.revision);
            }
        }
        (56..82, Some(field), _) => {
            graph.set(field, value).unwrap();
            model.set(field, value);
        }
        (82.., ..) => evaluate(graph, model),
        _ => {}
    }
}

fn evaluate(graph: &mut Graph, model: &mut Model) {
    model.start();
    let mut follower = Follower::default();
    graph.evaluate(0.0, &mut follower);
    // The order among nodes that do not depend on each other is the graph's choice; that it respects the routes is checked.
    let order: Vec<NodeId> = graph.evaluation_order().collect();
    let place = |id: NodeId| order.iter().position(|other| *other == id).unwrap();
    let mut turns = Vec::new();
    while let Some(next) = model.nodes.iter().filter(|(_, node)| node.waits).map(|(id, _)| *id).min_by_key(|id| place(*id)) {
        model.turn(next);
        turns.push(next);
    }
    check_order(model, &turns);
    turns.retain(|id| model.nodes[id].script);
    assert_eq!(turns, follower.turns);
    model.running = false;
    model.nodes.values_mut().for_each(|node| node.had_turn = false);
}

fn compare(graph: &Graph, model: &Model) {
    assert_eq!(graph.node_count(), model.nodes.len());
    assert_eq!(graph.routes().count(), model.routes.len());
    for (field, cell) in &model.cells {
        assert_eq!(graph.get::<i64>(*field).unwrap(), cell.value, "{}", graph.describe_field(*field));
    }
}

#[test]
fn random_operations_agree_with_the_model() {
    for seed in 0..40 {
        let mut random = Random(seed);
        let (mut graph, mut model) = (graph(), Model::default());
        for number in 0..600 {
            step(&mut random, &mut graph, &mut model);
            graph.verify_invariants().unwrap_or_else(|fault| panic!("seed {seed}, step {number}: {fault}"));
            compare(&graph, &model);
        }
    }
}
