//! What the functions of a script work on: the graph, lent while the script runs, and what the script has left behind.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::PathBuf;
use std::rc::Rc;

use rhai::{Dynamic, FnPtr, Position};
use umbriel_fields::{EnumValue, Error, FieldId, FieldType, Graph, Kind, NodeId, ObserverId, Value};

use crate::error::{Fault, Outcome, Problem, fail};
use crate::limits::{Limits, Meter};
use crate::source::Source;
use crate::values::{natural, to_dynamic, to_value};

/// A node as scripts hold it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Node(pub(crate) NodeId);

/// A function of the script that is called later, and where the script said so.
#[derive(Clone)]
pub(crate) struct Handler {
    pub(crate) call: FnPtr,
    pub(crate) place: Position,
}

/// A handler of a field; `me` goes first where a node type declared it.
#[derive(Clone)]
pub(crate) struct OnChange {
    pub(crate) handler: Handler,
    pub(crate) field: FieldId,
    pub(crate) observer: ObserverId,
    pub(crate) me: Option<Node>,
}

/// A node type that a script defined.
#[derive(Clone, Default)]
pub(crate) struct Definition {
    pub(crate) evaluate: Option<Handler>,
    pub(crate) changed: Vec<(String, Handler)>,
}

/// The name of an enum's value.
fn choice_name(graph: &Graph, field: FieldId, choice: u16) -> String {
    let name = graph.declaration(field).ok().and_then(|declared| declared.choice_name(EnumValue(choice)));
    name.unwrap_or_default().to_string()
}

/// Shared by all functions of one world's engine.
pub(crate) struct Stage {
    graph: RefCell<Graph>,
    pub(crate) limits: Limits,
    pub(crate) meter: Meter,
    /// Folders from which models and pictures may be read, the world's own first.
    pub(crate) folders: Vec<PathBuf>,
    pub(crate) problems: RefCell<Vec<Problem>>,
    /// The script that runs here, for the places of problems.
    pub(crate) source: RefCell<Rc<Source>>,
    /// Files that the script read, beside its own text.
    pub(crate) files: RefCell<BTreeSet<PathBuf>>,
    pub(crate) on_frame: RefCell<BTreeMap<u64, Handler>>,
    pub(crate) on_change: RefCell<BTreeMap<u64, OnChange>>,
    pub(crate) definitions: RefCell<HashMap<String, Definition>>,
    /// Nodes of script-defined types whose evaluate failed.
    pub(crate) switched_off: RefCell<HashSet<NodeId>>,
    pub(crate) time_s: Cell<f64>,
    next_handler: Cell<u64>,
    field_bytes: RefCell<HashMap<FieldId, usize>>,
    field_bytes_sum: Cell<usize>,
}

impl Stage {
    pub(crate) fn new(limits: Limits, folders: Vec<PathBuf>) -> Rc<Self> {
        Rc::new(Self {
            graph: RefCell::new(Graph::new(Vec::new())),
            meter: Meter::new(limits.memory),
            limits,
            folders,
            problems: RefCell::default(),
            source: RefCell::default(),
            files: RefCell::default(),
            on_frame: RefCell::default(),
            on_change: RefCell::default(),
            definitions: RefCell::default(),
            switched_off: RefCell::default(),
            time_s: Cell::new(0.0),
            next_handler: Cell::new(0),
            field_bytes: RefCell::default(),
            field_bytes_sum: Cell::new(0),
        })
    }

    /// Lends the graph to scripts while `work` runs. Works inside of an evaluation, where the graph is lent to a host.
    pub(crate) fn with<T>(&self, graph: &mut Graph, work: impl FnOnce() -> T) -> T {
        std::mem::swap(graph, &mut self.graph.borrow_mut());
        let result = work();
        std::mem::swap(graph, &mut self.graph.borrow_mut());
        result
    }

    pub(crate) fn read<T>(&self, work: impl FnOnce(&Graph) -> T) -> T {
        work(&self.graph.borrow())
    }

    pub(crate) fn write<T>(&self, work: impl FnOnce(&mut Graph) -> T) -> T {
        work(&mut self.graph.borrow_mut())
    }

    /// A new node, within the limit of nodes. A type that a script defined gets its handlers.
    pub(crate) fn create(&self, type_name: &str) -> Outcome<Node> {
        if self.read(Graph::node_count) >= self.limits.nodes {
            return fail(format!("the world has {} nodes already, and more are not allowed", self.limits.nodes));
        }
        let id = self.write(|graph| graph.create(type_name)).map_err(|e| Fault::new(e.to_string()))?;
        let canonical = self.read(|graph| graph.type_of(id).name.to_string());
        let changed = self.definitions.borrow().get(&canonical).map(|d| d.changed.clone()).unwrap_or_default();
        for (field, handler) in changed {
            self.observe(Node(id), &field, handler, Some(Node(id)))?;
        }
        Ok(Node(id))
    }

    pub(crate) fn delete(&self, node: Node) -> Outcome<()> {
        let label = self.label(node);
        self.write(|graph| graph.delete(node.0)).map_err(|e| self.fault(e, &label, None))?;
        self.on_change.borrow_mut().retain(|_, handler| handler.field.node != node.0);
        let mut bytes = self.field_bytes.borrow_mut();
        bytes.retain(|field, size| {
            let keep = field.node != node.0;
            self.field_bytes_sum.set(self.field_bytes_sum.get() - if keep { 0 } else { *size });
            keep
        });
        Ok(())
    }

    /// The node in words, for messages.
    pub(crate) fn label(&self, node: Node) -> String {
        self.read(|graph| graph.describe(node.0))
    }

    fn fault(&self, error: Error, label: &str, field: Option<&str>) -> Fault {
        Fault { message: error.to_string(), node: Some(label.into()), field: field.map(str::to_string) }
    }

    pub(crate) fn fault_at(&self, node: Node, field: &str, message: impl Into<String>) -> Fault {
        Fault { message: message.into(), node: Some(self.label(node)), field: Some(field.into()) }
    }

    pub(crate) fn field(&self, node: Node, name: &str) -> Outcome<FieldId> {
        let found = self.read(|graph| graph.field(node.0, name));
        found.map_err(|e| self.fault(e, &self.label(node), Some(name)).into())
    }

    pub(crate) fn get(&self, node: Node, name: &str) -> Outcome<Dynamic> {
        let field = self.field(node, name)?;
        Ok(self.value(field))
    }

    /// The value of a field as scripts see it; `()` if the field is gone.
    pub(crate) fn value(&self, field: FieldId) -> Dynamic {
        self.read(|graph| {
            let Ok(value) = graph.value(field) else { return Dynamic::UNIT };
            to_dynamic(&value, &|choice| choice_name(graph, field, choice))
        })
    }

    pub(crate) fn set(&self, node: Node, name: &str, given: &Dynamic) -> Outcome<()> {
        let field = self.field(node, name)?;
        let wanted = self.read(|graph| graph.declaration(field).map(|declared| declared.field_type));
        let wanted = wanted.map_err(|e| self.fault(e, &self.label(node), Some(name)))?;
        let value = match (wanted, given.as_bool()) {
            (FieldType { kind: Kind::Enum, multiple: false }, Ok(on)) => self.switch(field, on),
            _ => to_value(given, wanted).map_err(|why| {
                let label = self.label(node);
                self.fault_at(node, name, format!("field `{name}` of {label}: {why}"))
            })?,
        };
        self.reserve(field, &value)?;
        let written = self.write(|graph| graph.set_value(field, value));
        written.map_err(|e| self.fault(e, &self.label(node), Some(name)).into())
    }

    /// On and off for a field that names its choices: the second and the first of them, as in `shadows = true`.
    fn switch(&self, field: FieldId, on: bool) -> Value {
        Value::from(self.read(|graph| choice_name(graph, field, u16::from(on))))
    }

    /// Counts what arrays in fields hold, about.
    fn reserve(&self, field: FieldId, value: &Value) -> Outcome<()> {
        const BYTES_PER_ELEMENT: usize = 16;
        let new = if value.len() > 64 { value.len() * BYTES_PER_ELEMENT } else { 0 };
        let mut bytes = self.field_bytes.borrow_mut();
        let old = bytes.get(&field).copied().unwrap_or(0);
        let sum = self.field_bytes_sum.get() - old + new;
        if sum > self.limits.field_memory {
            return fail(format!("the arrays in the fields need more than {} MB", self.limits.field_memory >> 20));
        }
        self.field_bytes_sum.set(sum);
        match new {
            0 => drop(bytes.remove(&field)),
            _ => drop(bytes.insert(field, new)),
        }
        Ok(())
    }

    pub(crate) fn add_field(&self, node: Node, name: &str, default: &Dynamic) -> Outcome<()> {
        let value = natural(default).map_err(|why| self.fault_at(node, name, format!("field `{name}`: {why}")))?;
        let added = self.write(|graph| graph.add_field(node.0, umbriel_fields::Field::new(name, value)));
        added.map(drop).map_err(|e| self.fault(e, &self.label(node), Some(name)).into())
    }

    /// A place for one more handler.
    pub(crate) fn handler_id(&self) -> Outcome<u64> {
        if self.on_frame.borrow().len() + self.on_change.borrow().len() >= self.limits.handlers {
            return fail(format!("the world has {} handlers already, and more are not allowed", self.limits.handlers));
        }
        self.next_handler.set(self.next_handler.get() + 1);
        Ok(self.next_handler.get())
    }

    pub(crate) fn observe(&self, node: Node, field: &str, handler: Handler, me: Option<Node>) -> Outcome<u64> {
        let field = self.field(node, field)?;
        let id = self.handler_id()?;
        let observer = self.write(|graph| graph.observe(field, id)).map_err(|e| self.fault(e, &self.label(node), None))?;
        self.on_change.borrow_mut().insert(id, OnChange { handler, field, observer, me });
        Ok(id)
    }

    /// Stops a handler, even from within itself.
    pub(crate) fn stop(&self, id: u64) {
        self.on_frame.borrow_mut().remove(&id);
        let removed = self.on_change.borrow_mut().remove(&id);
        if let Some(handler) = removed {
            self.write(|graph| graph.unobserve(handler.observer));
        }
    }
}
