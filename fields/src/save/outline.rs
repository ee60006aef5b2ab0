//! What of a graph goes into a save, and in which order.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use crate::codec::{Name, Ref};
use crate::graph::slot_of;
use crate::schedule::{DIRTY, EVALUATES, ROUTED};
use crate::{Evaluator, Field, FieldId, Graph, Image, Mode, NodeId, Route, RouteId, Same, Value};

/// Nodes, images and their numbers, from one.
pub(super) struct Outline {
    pub(super) nodes: Vec<NodeId>,
    pub(super) images: Vec<Arc<Image>>,
    numbers: HashMap<NodeId, usize>,
    image_numbers: HashMap<*const Image, usize>,
    /// The names of nodes in a text file, by number; none for bytes.
    names: Option<Vec<String>>,
}

impl Outline {
    pub(super) fn new(graph: &Graph, with_names: bool) -> Self {
        let mut nodes: Vec<NodeId> = graph.nodes().collect();
        nodes.sort_by_key(|id| graph.nodes[*id].created);
        let numbers = nodes.iter().enumerate().map(|(place, id)| (*id, place + 1)).collect();
        let name = |(place, id): (usize, &NodeId)| match graph.name(*id) {
            Some(name) if !name.starts_with('#') => name.to_string(),
            _ => format!("#{}", place + 1),
        };
        let names = with_names.then(|| nodes.iter().enumerate().map(name).collect());
        Self { nodes, images: Vec::new(), numbers, image_numbers: HashMap::new(), names }
    }

    /// The node's name in a text file.
    pub(super) fn id(&self, node: NodeId) -> &str {
        self.names.as_ref().map_or("", |names| &names[self.numbers[&node] - 1])
    }

    /// The node's number, from one.
    pub(super) fn number(&self, node: NodeId) -> u64 {
        self.numbers.get(&node).map_or(0, |number| *number as u64)
    }
}

impl Name for Outline {
    fn node(&mut self, node: Option<NodeId>) -> Ref {
        let number = node.and_then(|node| self.numbers.get(&node).copied());
        match (&self.names, number) {
            (None, number) => Ref::Number(number.unwrap_or(0) as u64),
            (Some(names), Some(number)) => Ref::Name(names[number - 1].clone()),
            (Some(_), None) => Ref::Name(String::new()),
        }
    }

    fn image(&mut self, image: Option<&Arc<Image>>) -> Ref {
        let number = image.map_or(0, |image| {
            *self.image_numbers.entry(Arc::as_ptr(image)).or_insert_with(|| {
                self.images.push(image.clone());
                self.images.len()
            })
        });
        match (&self.names, number) {
            (None, number) => Ref::Number(number as u64),
            (Some(_), 0) => Ref::Name(String::new()),
            (Some(_), number) => Ref::Name(format!("image{number}")),
        }
    }
}

/// The declared fields of a node that do not hold their defaults.
pub(super) fn written_fields(graph: &Graph, id: NodeId) -> Vec<(&Field, Value)> {
    let count = graph.type_of(id).fields.len();
    let values = graph.field_ids(id).take(count).filter_map(|(field, declared)| Some((declared, graph.value(field).ok()?)));
    // A node that does not exist any more loads as none, so it is none.
    let alive = |value| match value {
        Value::Node(Some(node)) if !graph.contains(node) => Value::Node(None),
        value => value,
    };
    let values = values.map(|(declared, value)| (declared, alive(value)));
    values.filter(|(declared, value)| !value.same(&declared.default)).collect()
}

/// The dynamic fields of a node.
pub(super) fn dynamic_fields(graph: &Graph, id: NodeId) -> Vec<(&Field, Value)> {
    let count = graph.type_of(id).fields.len();
    graph.field_ids(id).skip(count).filter_map(|(field, declared)| Some((declared, graph.value(field).ok()?))).collect()
}

/// The routes in the order in which they were made, with what is on its way along weak ones.
pub(super) fn routes(graph: &Graph) -> Vec<(Route, Option<&Value>)> {
    let mut routes: Vec<_> = graph.routes().map(|(id, route)| (id, *route)).collect();
    routes.sort_by_key(|(_, route)| route.ordinal);
    let on_its_way: HashMap<RouteId, &Value> =
        graph.frame.carried.iter().map(|carried| (carried.route, &carried.value)).collect();
    routes.into_iter().map(|(id, route)| (route, on_its_way.get(&id).copied())).collect()
}

/// The name of a mode that is not the type's own.
pub(super) fn own_mode(graph: &Graph, id: NodeId) -> Option<&'static str> {
    let node = &graph.nodes[id];
    (node.mode != node.node_type.mode).then(|| mode_name(node.mode))
}

pub(super) fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::OnChange => "on_change",
        Mode::Always => "always",
        Mode::Pull => "pull",
    }
}

/// What the next frame will hear of: fields in the order in which they were written, then nodes that wait without one.
pub(super) fn waiting(graph: &Graph) -> Vec<(NodeId, Option<&Field>)> {
    let mut news: Vec<(u64, FieldId)> = Vec::new();
    for (id, node) in &graph.nodes {
        let evaluates = !matches!(node.node_type.evaluator, Evaluator::None);
        if !evaluates && node.outgoing.is_empty() {
            continue;
        }
        let turn = &graph.schedule.turns[slot_of(id) as usize];
        let left: Vec<u16> = node.outgoing.iter().map(|route| graph.routes.all[*route].from.index).collect();
        for (index, _) in node.fields() {
            let field = FieldId { node: id, index };
            let written = graph.field_revision(field);
            let unseen = evaluates && written > turn.evaluated || written > turn.propagated && left.contains(&index);
            if unseen && graph.silenced.get(&field) != Some(&written) {
                news.push((written, field));
            }
        }
    }
    news.sort_unstable();
    let mut listed: HashSet<NodeId> = news.iter().map(|(_, field)| field.node).collect();
    let mut waiting: Vec<_> =
        news.into_iter().map(|(_, field)| (field.node, graph.nodes[field.node].field(field.index))).collect();
    for slot in &graph.schedule.pending {
        let id = graph.ids[*slot as usize];
        let flags = graph.schedule.flags[*slot as usize];
        // Whoever waited only for an observer, or for routes that are gone, has nothing to do.
        let waits = flags & DIRTY != 0 && flags & (EVALUATES | ROUTED) != 0;
        if waits && listed.insert(id) {
            waiting.push((id, None));
        }
    }
    waiting
}
