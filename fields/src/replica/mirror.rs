//! A copy of a world that scripts may work on: follows a replica, and tells what was done to it.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::Replica;
use super::apply::put;
use super::bulk::ImageHashes;
use super::deeds::{Deed, Writer, is_list, own_number};
use crate::record::{Event, Journal};
use crate::{Changes, FieldId, Graph, NodeId, Revision, RouteId, Value};

/// What was done since the last time, in order, and images that stand in it for the first time.
#[derive(Clone, Debug, Default)]
pub struct Deeds {
    /// In order.
    pub deeds: Vec<Deed>,
    /// Hashes, with what [`super::Bulk::learn`] takes.
    pub images: Vec<(u64, Vec<u8>)>,
}

/// A field's node and name, as deeds have them.
type At = (u64, String);

/// Keeps a graph equal to a replica, but for what was done to the graph and is not confirmed yet.
#[derive(Default)]
pub struct Mirror {
    /// From the replica's nodes to ours.
    local: HashMap<NodeId, NodeId>,
    /// Our nodes by the application's numbers, and the other way round; there, nodes without one have an own number.
    by_number: HashMap<u64, NodeId>,
    numbers: HashMap<NodeId, u64>,
    keys: Vec<NodeId>,
    /// Writes to the replica up to this one were taken over.
    mark: Revision,
    /// Dynamic fields: their names, and whether the replica has them.
    dynamic: HashMap<FieldId, (Arc<str>, bool)>,
    routes: HashMap<RouteId, (At, At)>,
    mirrored: HashSet<(FieldId, FieldId)>,
    routes_seen: Option<(u64, usize)>,
    /// What waits for the application, with the number of the message that told of it.
    pending: HashMap<FieldId, u64>,
    pending_names: HashMap<NodeId, u64>,
    /// Numbers of nodes that were deleted here.
    pending_deletions: HashMap<u64, u64>,
    hashes: ImageHashes,
    sent: HashSet<u64>,
    /// Nodes of others that came or went since somebody asked.
    foreign: Vec<(NodeId, bool)>,
}

impl Mirror {
    /// Notes from now on what is done to a graph.
    pub fn of(graph: &mut Graph) -> Mirror {
        graph.journal = Some(Journal::default());
        Mirror::default()
    }

    /// The application's number of a node here, or an own one where it has none yet.
    pub fn number(&self, node: NodeId) -> Option<u64> {
        self.numbers.get(&node).copied()
    }

    /// The node here of a number of the application.
    pub fn node(&self, number: u64) -> Option<NodeId> {
        self.by_number.get(&number).copied()
    }

    /// The node that was made here as the `key`th has a number in the application now.
    pub fn made(&mut self, key: u32, number: u64) {
        if let Some(of) = self.pending_deletions.remove(&own_number(key)) {
            self.pending_deletions.insert(number, of);
        }
        let Some(node) = self.keys.get(key as usize).copied() else { return };
        self.by_number.insert(number, node);
        if let Some(known) = self.numbers.get_mut(&node) {
            *known = number;
        }
    }

    /// Nodes that were not made here, that came (true) or went since the last time.
    pub fn foreign(&mut self) -> Vec<(NodeId, bool)> {
        std::mem::take(&mut self.foreign)
    }

    /// The next replica is another one: all is compared.
    pub fn restart(&mut self) {
        self.local.clear();
        self.mark = 0;
        self.routes_seen = None;
    }

    /// Takes over what is new in the replica. What was done here and told with a message beyond number `applied` stays as it is.
    pub fn follow(&mut self, replica: &Replica, graph: &mut Graph, applied: u64) {
        // What comes from the application is not told to it.
        let journal = graph.journal.take();
        let theirs = replica.graph();
        let is_refused = |(number, of): (&u64, &u64)| *of <= applied && replica.node(*number).is_some();
        if self.pending_deletions.iter().any(is_refused) {
            self.restart(); // the application keeps a node that was deleted here, and what refers to it
        }
        self.pending_deletions.retain(|_, of| *of > applied);
        let is_restart = self.mark == 0;
        let nodes = match theirs.changes_since(self.mark) {
            Changes::Nodes(nodes) if !is_restart => nodes,
            _ => self.local.keys().copied().filter(|id| !theirs.contains(*id)).chain(theirs.nodes()).collect(),
        };
        for id in nodes.iter().filter(|id| !theirs.contains(**id)) {
            if let Some(gone) = self.local.remove(id) {
                self.forget(gone, graph);
            }
        }
        let alive = || nodes.iter().copied().filter(|id| theirs.contains(*id));
        let new: HashSet<NodeId> = alive().filter(|id| self.create(replica, *id, graph)).collect();
        if is_restart {
            let known: HashSet<NodeId> = self.local.values().copied().collect();
            let gone: Vec<NodeId> = self.by_number.values().copied().filter(|id| !known.contains(id)).collect();
            gone.into_iter().for_each(|id| self.forget(id, graph));
        }
        self.names(theirs, alive(), graph, applied);
        for id in alive() {
            self.fields(theirs, id, graph);
        }
        let confirmed: HashSet<FieldId> =
            self.pending.iter().filter(|(_, of)| **of <= applied).map(|(field, _)| *field).collect();
        self.pending.retain(|_, of| *of > applied);
        for id in alive() {
            self.values(theirs, id, graph, new.contains(&id), &confirmed);
        }
        for field in confirmed {
            self.confirm(replica, field, graph);
        }
        self.connect(theirs, graph);
        self.mark = theirs.revision();
        graph.journal = journal;
    }

    fn forget(&mut self, node: NodeId, graph: &mut Graph) {
        if let Some(number) = self.numbers.remove(&node) {
            self.by_number.remove(&number);
        }
        self.foreign.push((node, false));
        let _ = graph.delete(node); // it may have been deleted here before
    }

    /// True if the node is new here.
    fn create(&mut self, replica: &Replica, id: NodeId, graph: &mut Graph) -> bool {
        if self.local.contains_key(&id) {
            return false;
        }
        let number = replica.number(id).filter(|number| !self.pending_deletions.contains_key(number));
        let Some(number) = number else { return false };
        let theirs = replica.graph();
        let known = self.by_number.get(&number).copied().filter(|node| graph.contains(*node));
        // A new graph has its root already.
        let same_name = || theirs.name(id).and_then(|name| graph.find(name)).filter(|node| !self.numbers.contains_key(node));
        let node = known.or_else(same_name).unwrap_or_else(|| graph.create_of(theirs.type_of(id).clone()));
        if known.is_none() {
            self.foreign.push((node, true));
        }
        self.local.insert(id, node);
        self.by_number.insert(number, node);
        self.numbers.insert(node, number);
        true
    }

    fn names(&mut self, theirs: &Graph, nodes: impl Iterator<Item = NodeId>, graph: &mut Graph, applied: u64) {
        self.pending_names.retain(|_, of| *of > applied);
        let mut wanted = Vec::new();
        for id in nodes {
            let Some(node) = self.local.get(&id).copied().filter(|node| !self.pending_names.contains_key(node)) else { continue };
            if graph.name(node) != theirs.name(id) {
                let _ = graph.set_name(node, ""); // no name is always free
                wanted.push((node, theirs.name(id).unwrap_or_default().to_string()));
            }
        }
        for (node, name) in wanted {
            if let Some(other) = graph.find(&name) {
                let _ = graph.set_name(other, ""); // an own one of that name, which the application will not have
            }
            let _ = graph.set_name(node, &name); // it is free now
        }
    }

    /// Dynamic fields come and go.
    fn fields(&mut self, theirs: &Graph, id: NodeId, graph: &mut Graph) {
        let Some(node) = self.local.get(&id).copied() else { return };
        let declared = theirs.type_of(id).fields.len();
        let there: Vec<&crate::Field> =
            theirs.field_ids(id).filter(|(field, _)| field.index as usize >= declared).map(|(_, field)| field).collect();
        let here: Vec<FieldId> = graph.field_ids(node).map(|(field, _)| field).filter(|f| self.dynamic.contains_key(f)).collect();
        if there.is_empty() && here.is_empty() {
            return;
        }
        for field in here {
            let is_gone = self.dynamic.get(&field).is_some_and(|(name, known)| *known && !there.iter().any(|f| f.name == *name));
            if is_gone {
                let _ = graph.remove_field(field); // it was found a moment ago
                self.dynamic.remove(&field);
            }
        }
        for field in there {
            let found = graph.field(node, &field.name).or_else(|_| graph.add_field(node, field.clone()));
            if let Ok(found) = found {
                self.dynamic.insert(found, (field.name.clone(), true));
            }
        }
    }

    fn field_here(&self, theirs: &Graph, field: FieldId, graph: &Graph) -> Option<FieldId> {
        let node = self.local.get(&field.node).copied()?;
        let declared = graph.type_of(node);
        let is_same = Arc::ptr_eq(declared, theirs.type_of(field.node)) && (field.index as usize) < declared.fields.len();
        if is_same {
            return Some(FieldId { node, index: field.index });
        }
        graph.field(node, &theirs.declaration(field).ok()?.name).ok()
    }

    fn values(&self, theirs: &Graph, id: NodeId, graph: &mut Graph, is_new: bool, confirmed: &HashSet<FieldId>) {
        let fields: Vec<FieldId> = theirs.field_ids(id).map(|(field, _)| field).collect();
        for field in fields {
            if !is_new && theirs.field_revision(field) <= self.mark {
                continue;
            }
            let Some(here) = self.field_here(theirs, field, graph) else { continue };
            if self.pending.contains_key(&here) || confirmed.contains(&here) {
                continue;
            }
            let Some(value) = self.value(theirs, field) else { continue };
            // A new node has its defaults already, and nobody needs to hear of them.
            if !is_new || graph.value(here).is_ok_and(|ours| ours != value) {
                let _ = put(graph, here, value); // a field of another type stays as it is
            }
        }
    }

    /// What the application made of something that was done here: mostly the same.
    fn confirm(&self, replica: &Replica, here: FieldId, graph: &mut Graph) {
        let theirs = replica.graph();
        let found = || {
            let node = replica.node(*self.numbers.get(&here.node)?)?;
            let field = theirs.field(node, &graph.declaration(here).ok()?.name).ok()?;
            self.value(theirs, field).filter(|value| graph.value(here).is_ok_and(|ours| ours != *value))
        };
        if let Some(value) = found() {
            let _ = put(graph, here, value); // a field of another type stays as it is
        }
    }

    /// A value of the replica, with our nodes in it.
    fn value(&self, theirs: &Graph, field: FieldId) -> Option<Value> {
        let local = |node: Option<NodeId>| node.and_then(|node| self.local.get(&node).copied());
        Some(match theirs.value(field).ok()? {
            Value::Node(node) => Value::Node(local(node)),
            Value::Nodes(nodes) => Value::Nodes(nodes.iter().map(|node| local(*node)).collect()),
            other => other,
        })
    }

    fn connect(&mut self, theirs: &Graph, graph: &mut Graph) {
        let seen = (theirs.routes.made, theirs.routes.all.len());
        if self.routes_seen.replace(seen) == Some(seen) {
            return;
        }
        let mut wanted = HashMap::new();
        for (_, route) in theirs.routes() {
            if let (Some(from), Some(to)) = (self.field_here(theirs, route.from, graph), self.field_here(theirs, route.to, graph))
            {
                wanted.insert((from, to), route.strength);
            }
        }
        for (from, to) in std::mem::take(&mut self.mirrored) {
            if let Some(route) = graph.route_between(from, to).filter(|_| !wanted.contains_key(&(from, to))) {
                graph.disconnect(route);
                self.routes.remove(&route);
            }
        }
        for ((from, to), strength) in wanted {
            let made = graph.route_between(from, to).map_or_else(|| graph.link(from, to, strength), Ok);
            // One that loops with what was made here meanwhile is left out: nothing is evaluated here.
            if let Ok(route) = made {
                self.note_route(graph, route, from, to);
                self.mirrored.insert((from, to));
            }
        }
    }

    fn note_route(&mut self, graph: &Graph, route: RouteId, from: FieldId, to: FieldId) {
        let at = |field: FieldId| Some((self.number(field.node)?, graph.declaration(field).ok()?.name.to_string()));
        if let (Some(from), Some(to)) = (at(from), at(to)) {
            self.routes.insert(route, (from, to));
        }
    }

    /// What was done to the graph since the last time, to be told with message `number`. `is_ours` says whether a node may be written;
    /// of lists of other nodes only own nodes come and go.
    pub fn deeds(&mut self, graph: &mut Graph, replica: &Replica, number: u64, is_ours: &dyn Fn(NodeId) -> bool) -> Deeds {
        let events = graph.journal.as_mut().map(|journal| std::mem::take(&mut journal.events)).unwrap_or_default();
        let mut told = Deeds::default();
        for event in events {
            self.before(graph, &event, number);
            let gone = self.routes_gone(&event);
            let before = match &event {
                Event::Wrote { field, .. } if !is_ours(field.node) && is_list(graph, *field) => {
                    self.there(replica, graph, *field)
                }
                _ => None,
            };
            let numbers = &self.numbers;
            let number_of = |node: NodeId| numbers.get(&node).copied().unwrap_or(0);
            let mut writer = Writer { number: &number_of, hashes: &mut self.hashes, sent: &mut self.sent, images: Vec::new() };
            let deed = match &event {
                Event::Created(node, node_type) => Some(writer.create(*node, node_type)),
                Event::Deleted(node) => numbers.get(node).map(|number| writer.delete(*number)),
                Event::Named(node, name) => Some(writer.name(*node, name.as_deref().unwrap_or_default())),
                Event::FieldAdded(field, added) => Some(writer.add_field(field.node, added)),
                Event::FieldRemoved(field) => self.dynamic.get(field).map(|(name, _)| writer.remove_field(field.node, name)),
                Event::Wrote { field, value, .. } => match before {
                    Some(before) => writer.list(graph, *field, &before, value),
                    None => writer.write(graph, *field, value),
                },
                Event::Touched(field) => writer.touch(graph, *field),
                // A route whose source is gone again has left its value behind.
                Event::Connected { from, to, strength, held, .. } => {
                    writer.route(graph, *from, *to, *strength).or_else(|| writer.write(graph, *to, held))
                }
                Event::Linked { from, to, strength, .. } => writer.route(graph, *from, *to, *strength),
                Event::Disconnected(_) => gone.map(|(from, to)| writer.unroute(from, to)),
                _ => None,
            };
            told.images.append(&mut writer.images);
            told.deeds.extend(deed);
            self.after(&event, number);
        }
        told
    }

    fn before(&mut self, graph: &Graph, event: &Event, number: u64) {
        match event {
            Event::Created(node, _) => {
                self.numbers.insert(*node, own_number(self.keys.len() as u32));
                self.keys.push(*node);
            }
            Event::Wrote { field, .. } => drop(self.pending.insert(*field, number)),
            Event::Named(node, _) => drop(self.pending_names.insert(*node, number)),
            Event::FieldAdded(field, added) => drop(self.dynamic.insert(*field, (added.name.clone(), false))),
            Event::Connected { route, from, to, .. } | Event::Linked { route, from, to, .. } => {
                self.note_route(graph, *route, *from, *to);
            }
            _ => {}
        }
    }

    fn routes_gone(&mut self, event: &Event) -> Option<(At, At)> {
        match event {
            Event::Disconnected(route) => self.routes.remove(route),
            _ => None,
        }
    }

    fn after(&mut self, event: &Event, message: u64) {
        match event {
            Event::Deleted(node) => {
                if let Some(number) = self.numbers.remove(node) {
                    self.by_number.remove(&number);
                    self.pending_deletions.insert(number, message);
                }
                self.pending.retain(|field, _| field.node != *node);
                self.pending_names.remove(node);
            }
            Event::FieldRemoved(field) => drop(self.dynamic.remove(field)),
            _ => {}
        }
    }

    /// A list of nodes as the replica has it, with our nodes in it.
    fn there(&self, replica: &Replica, graph: &Graph, here: FieldId) -> Option<Arc<[Option<NodeId>]>> {
        let node = replica.node(*self.numbers.get(&here.node)?)?;
        let field = replica.graph().field(node, &graph.declaration(here).ok()?.name).ok()?;
        match self.value(replica.graph(), field)? {
            Value::Nodes(nodes) => Some(nodes),
            _ => None,
        }
    }
}
