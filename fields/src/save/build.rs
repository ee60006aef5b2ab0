//! From what a file says to nodes in a graph.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::parsed::{Data, Parsed, ParsedField, ParsedNode, ParsedRoute};
use super::{Loaded, Report, SaveError, TakenNames};
use crate::codec::{Find, Ref};
use crate::graph::slot_of;
use crate::naming::hint;
use crate::propagate::Carried;
use crate::record::Event;
use crate::schedule::DIRTY;
use crate::{Field, FieldId, Graph, Image, Mode, NodeId, RouteId, Strength, Value};

/// Finds what the file names.
struct Found {
    nodes: Vec<Option<NodeId>>,
    places: HashMap<String, usize>,
    images: Vec<(String, Option<Arc<Image>>)>,
    image_places: HashMap<String, usize>,
    /// What values referred to in vain since this was last emptied.
    missed: Vec<String>,
}

impl Found {
    fn place(&self, name: &Ref) -> Option<usize> {
        match name {
            Ref::Number(number) => (*number as usize).checked_sub(1).filter(|place| *place < self.nodes.len()),
            Ref::Name(name) => self.places.get(name).copied(),
        }
    }

    fn why_missing(&self, name: &Ref) -> String {
        let id = match name {
            Ref::Number(number) => format!("#{number}"),
            Ref::Name(name) => name.clone(),
        };
        match self.place(name) {
            Some(_) => format!("node `{id}` was kept out"),
            None => format!("there is no node `{id}` in the file{}", hint(&id, self.places.keys().map(String::as_str))),
        }
    }
}

fn is_nothing(name: &Ref) -> bool {
    matches!(name, Ref::Number(0)) || matches!(name, Ref::Name(name) if name.is_empty())
}

impl Find for Found {
    fn node(&mut self, name: &Ref) -> Option<NodeId> {
        if is_nothing(name) {
            return None;
        }
        let found = self.place(name).and_then(|place| self.nodes[place]);
        if found.is_none() {
            self.missed.push(self.why_missing(name));
        }
        found
    }

    fn image(&mut self, name: &Ref) -> Option<Arc<Image>> {
        if is_nothing(name) {
            return None;
        }
        let place = match name {
            Ref::Number(number) => (*number as usize).checked_sub(1),
            Ref::Name(name) => self.image_places.get(name).copied(),
        };
        let found = place.and_then(|place| self.images.get(place)?.1.clone());
        if found.is_none() {
            let id = match name {
                Ref::Number(number) => format!("image{number}"),
                Ref::Name(name) => name.clone(),
            };
            self.missed.push(format!("the file holds no usable picture `{id}`"));
        }
        found
    }
}

struct Build<'a> {
    graph: &'a mut Graph,
    found: Found,
    reports: Vec<Report>,
}

/// Makes what the file says; only names can be a reason to make nothing.
pub(super) fn build(graph: &mut Graph, parsed: &Parsed<'_>, taken: TakenNames) -> Result<Loaded, SaveError> {
    if taken == TakenNames::Refuse {
        refuse_taken(graph, parsed)?;
    }
    let mut places = HashMap::new();
    for (place, node) in parsed.nodes.iter().enumerate() {
        places.entry(node.id.clone()).or_insert(place);
    }
    let image_places = parsed.images.iter().enumerate().map(|(place, (name, _))| (name.clone(), place)).collect();
    let found = Found { nodes: Vec::new(), places, images: parsed.images.clone(), image_places, missed: Vec::new() };
    let mut build = Build { graph, found, reports: parsed.reports.clone() };
    for (place, node) in parsed.nodes.iter().enumerate() {
        let made = build.node(node, place, taken);
        build.found.nodes.push(made);
    }
    for (place, node) in parsed.nodes.iter().enumerate() {
        if let Some(id) = build.found.nodes[place] {
            node.dynamic.iter().for_each(|field| build.add_field(id, node, field));
        }
    }
    let routes: Vec<_> = parsed.routes.iter().map(|route| build.route(route)).collect();
    for (place, node) in parsed.nodes.iter().enumerate() {
        if let Some(id) = build.found.nodes[place] {
            build.values(id, node);
        }
    }
    let nodes: Vec<NodeId> = build.found.nodes.iter().copied().flatten().collect();
    if parsed.waiting.is_some() {
        build.graph.rest(&nodes);
    }
    for (route, id) in parsed.routes.iter().zip(routes) {
        if let (Some(data), Some(id)) = (&route.carries, id) {
            build.carry(route, data, id);
        }
    }
    build.wait(parsed);
    Ok(Loaded { nodes, reports: build.reports })
}

fn refuse_taken(graph: &Graph, parsed: &Parsed<'_>) -> Result<(), SaveError> {
    const SHOWN: usize = 5;
    let taken: Vec<&str> = parsed.nodes.iter().map(|node| node.name.as_str()).filter(|name| graph.find(name).is_some()).collect();
    if taken.is_empty() {
        return Ok(());
    }
    let mut names = taken.iter().take(SHOWN).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if taken.len() > SHOWN {
        names += &format!(" and {} more", taken.len() - SHOWN);
    }
    Err(SaveError::NamesTaken { names })
}

impl Build<'_> {
    fn report(&mut self, line: Option<usize>, node: &str, field: Option<&str>, message: impl Into<String>) {
        self.reports.push(Report { line, node: node.into(), field: field.map(String::from), message: message.into() });
    }

    fn node(&mut self, node: &ParsedNode<'_>, place: usize, taken: TakenNames) -> Option<NodeId> {
        let id = match self.graph.create(&node.type_name) {
            Ok(id) => id,
            Err(error) => {
                self.report(node.line, &node.id, None, format!("{error}; the node is kept out"));
                return None;
            }
        };
        if self.found.places.get(&node.id) != Some(&place) {
            self.report(
                node.line,
                &node.id,
                None,
                "a node above has this name; this one loads without, and nothing refers to it",
            );
        } else if !node.name.is_empty() {
            self.name(id, node, taken);
        }
        if let Some(mode) = &node.mode {
            match mode.as_str() {
                "on_change" => drop(self.graph.set_mode(id, Mode::OnChange)),
                "always" => drop(self.graph.set_mode(id, Mode::Always)),
                "pull" => drop(self.graph.set_mode(id, Mode::Pull)),
                other => {
                    let nearest = hint(other, ["on_change", "always", "pull"]);
                    self.report(node.line, &node.id, None, format!("mode is on_change, always or pull, not `{other}`{nearest}"));
                }
            }
        }
        Some(id)
    }

    fn name(&mut self, id: NodeId, node: &ParsedNode<'_>, taken: TakenNames) {
        let Err(error) = self.graph.set_name(id, &node.name) else { return };
        if taken == TakenNames::Refuse {
            return self.report(node.line, &node.id, None, error.to_string());
        }
        let free = (2..).map(|number| format!("{}_{number}", node.name)).find(|name| self.graph.find(name).is_none());
        if let Some(name) = free
            && self.graph.set_name(id, &name).is_ok()
        {
            self.report(node.line, &node.id, None, format!("the name is taken; it is called `{name}` here"));
        }
    }

    fn add_field(&mut self, id: NodeId, node: &ParsedNode<'_>, parsed: &ParsedField<'_>) {
        let name = parsed.declaration.name.as_str();
        let mut field = match parsed.declaration.field_without_default() {
            Ok(field) => field,
            Err(fault) => return self.report(parsed.line, &node.id, Some(name), format!("{fault}; the field is kept out")),
        };
        if let Some(default) = &parsed.default {
            match self.value(node, &field, default) {
                Some(value) => field.default = value,
                None => return,
            }
        }
        if let Err(error) = self.graph.add_field(id, field) {
            self.report(parsed.line, &node.id, Some(name), error.to_string());
        }
    }

    fn values(&mut self, id: NodeId, node: &ParsedNode<'_>) {
        for (name, data) in &node.fields {
            self.set(id, node, name, data);
        }
        for parsed in &node.dynamic {
            // A field that could not be added was reported.
            if let Some(data) = &parsed.value
                && self.graph.field(id, &parsed.declaration.name).is_ok()
            {
                self.set(id, node, &parsed.declaration.name, data);
            }
        }
    }

    fn set(&mut self, id: NodeId, node: &ParsedNode<'_>, name: &str, data: &Data<'_>) {
        let field = match self.graph.field(id, name) {
            Ok(field) => field,
            Err(error) => return self.report(data.line(), &node.id, Some(name), format!("{error}; the value is kept out")),
        };
        let Ok(declared) = self.graph.declaration(field).cloned() else { return };
        if let Some(value) = self.value(node, &declared, data)
            && let Err(error) = self.graph.set_value(field, value)
        {
            self.report(data.line(), &node.id, Some(name), error.to_string());
        }
    }

    /// A value, unless it is reported.
    fn value(&mut self, node: &ParsedNode<'_>, field: &Field, data: &Data<'_>) -> Option<Value> {
        let value = data.value(field, &mut self.found);
        for missed in std::mem::take(&mut self.found.missed) {
            self.report(data.line(), &node.id, Some(&field.name), format!("{missed}; nothing takes its place"));
        }
        match value {
            Ok(value) => Some(value),
            Err((line, message)) => {
                self.report(line, &node.id, Some(&field.name), message);
                None
            }
        }
    }

    fn endpoint(&mut self, line: Option<usize>, (node, field): &(Ref, String)) -> Option<FieldId> {
        let Some(id) = self.found.place(node).and_then(|place| self.found.nodes[place]) else {
            let why = self.found.why_missing(node);
            self.report(line, "", Some(field), format!("{why}; the route is kept out"));
            return None;
        };
        match self.graph.field(id, field) {
            Ok(field) => Some(field),
            Err(error) => {
                self.report(line, "", Some(field), format!("{error}; the route is kept out"));
                None
            }
        }
    }

    fn route(&mut self, route: &ParsedRoute<'_>) -> Option<RouteId> {
        let (from, to) = (self.endpoint(route.line, &route.from), self.endpoint(route.line, &route.to));
        let (from, to) = (from?, to?);
        let strength = if route.weak { Strength::Weak } else { Strength::Strong };
        match self.graph.link(from, to, strength) {
            Ok(made) => {
                self.graph.note(|| Event::Linked { route: made, from, to, strength });
                Some(made)
            }
            Err(error) => {
                self.report(route.line, "", None, format!("{error}; the route is kept out"));
                None
            }
        }
    }

    fn carry(&mut self, route: &ParsedRoute<'_>, data: &Data<'_>, id: RouteId) {
        let Some(declared) = self.graph.route(id).and_then(|made| self.graph.declaration(made.from).ok()).cloned() else {
            return;
        };
        match data.value(&declared, &mut self.found) {
            Ok(value) => self.graph.carry(id, value),
            Err((line, message)) => self.report(line.or(route.line), "", Some(&route.from.1), message),
        }
    }

    fn wait(&mut self, parsed: &Parsed<'_>) {
        for waiting in parsed.waiting.iter().flatten() {
            let Some(id) = self.found.place(&waiting.node).and_then(|place| self.found.nodes[place]) else {
                let why = self.found.why_missing(&waiting.node);
                self.report(waiting.line, "", None, format!("{why}; nothing waits"));
                continue;
            };
            let done = match &waiting.field {
                None => self.graph.wake(id),
                Some(name) => self.graph.field(id, name).and_then(|field| self.graph.touch(field)),
            };
            if let Err(error) = done {
                self.report(waiting.line, "", waiting.field.as_deref(), format!("{error}; nothing waits"));
            }
        }
    }
}

impl Graph {
    /// Nothing that happened to these nodes is news any more: no evaluation, no call and no route follows from it.
    pub(crate) fn rest(&mut self, nodes: &[NodeId]) {
        let last = self.changes.last();
        let slots: HashSet<u32> = nodes.iter().filter(|id| self.nodes.contains_key(**id)).map(|id| slot_of(*id)).collect();
        for slot in &slots {
            self.schedule.flags[*slot as usize] &= !DIRTY;
            let turn = &mut self.schedule.turns[*slot as usize];
            (turn.propagated, turn.evaluated) = (last, last);
        }
        // The order in which they will wait is that in which they ask from now on.
        self.schedule.pending.retain(|slot| !slots.contains(slot));
        self.note(|| Event::Rested(nodes.to_vec()));
    }

    /// Puts a value on its way along a weak route, as if its source had just had its turn.
    pub(crate) fn carry(&mut self, route: RouteId, value: Value) {
        let written = self.changes.next();
        self.note(|| Event::Carries(route, value.clone()));
        self.frame.carried.push(Carried { route, value, written });
    }
}
