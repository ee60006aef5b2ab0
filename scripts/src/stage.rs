//! What the functions of a script work on: the graph, lent while the script runs, and what the script has left behind.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;

use rhai::{AST, Dynamic, FnPtr, ImmutableString, Position};
use umbriel_fields::{EnumValue, Error, FieldId, FieldType, Graph, Kind, NodeId, ObserverId, Value};

use crate::definition::{Behaviour, Definition};
use crate::error::{Fault, Outcome, Problem, fail};
use crate::expression::Compiled;
use crate::limits::{Limits, Meter};
use crate::property_names::PropertyNames;
use crate::sharing::Sharing;
use crate::source::Source;
use crate::values::{to_dynamic, to_value};
use crate::words::declare::declared;

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
    /// Nodes of native types that a script's type extends.
    pub(crate) behaviours: RefCell<HashMap<NodeId, Behaviour>>,
    /// Those of them that are evaluated in every frame, in the order in which they were made.
    pub(crate) always: RefCell<Vec<NodeId>>,
    /// Whose nodes are whose, where several applications work on the world.
    pub(crate) sharing: RefCell<Option<Sharing>>,
    /// Who waits for the answer about a lock.
    pub(crate) awaited: RefCell<Vec<(Node, Handler)>>,
    /// The nodes whose `evaluate` runs, with the type that it stands in, for `evaluate_base`.
    pub(crate) evaluating: RefCell<Vec<(Node, String)>>,
    /// Texts of Expressions, compiled.
    pub(crate) compiled: RefCell<Compiled>,
    /// The functions of the world, for Expressions.
    pub(crate) functions: RefCell<AST>,
    pub(crate) property_names: PropertyNames,
    /// The constants of the main script while it runs, for Expressions that it makes.
    pub(crate) running_constants: RefCell<BTreeMap<ImmutableString, Dynamic>>,
    /// Where nodes were made, as far as it is known.
    places: RefCell<HashMap<NodeId, Position>>,
    /// Where nodes are being made.
    making_at: Cell<Position>,
    /// The text of an Expression that failed.
    pub(crate) failed_code: RefCell<HashMap<NodeId, Arc<str>>>,
    /// True while an Expression is computed: it sees its inputs only.
    alone: Cell<bool>,
    pub(crate) at_console: Cell<bool>,
    /// What all handlers may hold together; more than the limit where switching one off did not free what it had gathered.
    pub(crate) held_limit: Cell<usize>,
    /// Counts the frames.
    pub(crate) frame: Cell<u64>,
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
            folders,
            problems: RefCell::default(),
            source: RefCell::default(),
            files: RefCell::default(),
            on_frame: RefCell::default(),
            on_change: RefCell::default(),
            definitions: RefCell::default(),
            behaviours: RefCell::default(),
            always: RefCell::default(),
            sharing: RefCell::default(),
            awaited: RefCell::default(),
            evaluating: RefCell::default(),
            compiled: RefCell::default(),
            functions: RefCell::new(AST::empty()),
            property_names: PropertyNames::default(),
            running_constants: RefCell::default(),
            places: RefCell::default(),
            making_at: Cell::new(Position::NONE),
            failed_code: RefCell::default(),
            alone: Cell::new(false),
            at_console: Cell::new(false),
            held_limit: Cell::new(limits.memory),
            limits,
            frame: Cell::new(0),
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

    /// Computes an Expression, from which the world is out of reach.
    pub(crate) fn alone<T>(&self, work: impl FnOnce() -> T) -> T {
        let before = self.alone.replace(true);
        let result = work();
        self.alone.set(before);
        result
    }

    /// Is an Expression being computed?
    pub(crate) fn is_alone(&self) -> bool {
        self.alone.get()
    }

    /// Refuses what an Expression must not do.
    pub(crate) fn may_change(&self) -> Outcome<()> {
        match self.is_alone() {
            true => fail("an expression sees its inputs only: it reads no other nodes and changes nothing"),
            false => Ok(()),
        }
    }

    /// Says where in the script the next writes come from, if anybody wants to know.
    pub(crate) fn set_origin(&self, graph: &mut Graph, position: Position) {
        if graph.explains() {
            let (file, line, _) = self.source.borrow().place(position);
            graph.set_origin(&if line == 0 { file } else { format!("{file}:{line}") });
        }
    }

    /// Makes nodes of which is known where in the script they were made.
    pub(crate) fn making_at<T>(&self, position: Position, make: impl FnOnce() -> Outcome<T>) -> Outcome<T> {
        self.write(|graph| self.set_origin(graph, position));
        let before = self.making_at.replace(position);
        let made = make();
        self.making_at.set(before);
        made
    }

    /// Where a node was made.
    pub(crate) fn made_at(&self, node: NodeId) -> Option<Position> {
        self.places.borrow().get(&node).copied()
    }

    /// A new node, within the limit of nodes. A type that a script defined gets its handlers.
    pub(crate) fn create(&self, type_name: &str) -> Outcome<Node> {
        self.may_change()?;
        if self.read(Graph::node_count) >= self.limits.nodes {
            return fail(format!("the world has {} nodes already, and more are not allowed", self.limits.nodes));
        }
        let node = self.create_defined(type_name)?;
        if !self.making_at.get().is_none() {
            self.places.borrow_mut().insert(node.0, self.making_at.get());
        }
        Ok(node)
    }

    pub(crate) fn delete(&self, node: Node) -> Outcome<()> {
        self.may_change()?;
        self.may_write(node, "", None)?;
        let label = self.label(node);
        self.write(|graph| graph.delete(node.0)).map_err(|e| self.fault(e, &label, None))?;
        self.on_change.borrow_mut().retain(|_, handler| handler.field.node != node.0);
        self.behaviours.borrow_mut().remove(&node.0);
        self.places.borrow_mut().remove(&node.0);
        self.failed_code.borrow_mut().remove(&node.0);
        self.switched_off.borrow_mut().remove(&node.0);
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
        self.may_change()?;
        let found = self.read(|graph| graph.field(node.0, name));
        found.map_err(|e| self.fault(e, &self.label(node), Some(name)).into())
    }

    pub(crate) fn get(&self, node: Node, name: &str) -> Outcome<Dynamic> {
        let field = self.field(node, name)?;
        Ok(self.value(field))
    }

    /// The value of a field as scripts see it; `()` if the field is gone.
    pub(crate) fn value(&self, field: FieldId) -> Dynamic {
        self.read(|graph| self.value_in(graph, field))
    }

    /// The same from a graph that is not lent at the moment.
    pub(crate) fn value_in(&self, graph: &Graph, field: FieldId) -> Dynamic {
        let Ok(value) = graph.value(field) else { return Dynamic::UNIT };
        to_dynamic(&value, &|choice| choice_name(graph, field, choice))
    }

    pub(crate) fn set(&self, node: Node, name: &str, given: &Dynamic) -> Outcome<()> {
        let field = self.field(node, name)?;
        let wanted = self.read(|graph| graph.declaration(field).map(|declared| declared.field_type));
        let wanted = wanted.map_err(|e| self.fault(e, &self.label(node), Some(name)))?;
        let value = match (wanted, given.as_bool()) {
            (FieldType { kind: Kind::Enum, multiple: false }, Ok(on)) => self.switch(field, on),
            _ => to_value(given, wanted).map_err(|why| {
                let label = self.label(node);
                let choices = self.read(|graph| graph.declaration(field).map(|declared| declared.choices.join(", ")));
                let why = match choices {
                    Ok(choices) if wanted.kind == Kind::Enum => format!("{why}; it takes one of {choices}"),
                    _ => why,
                };
                self.fault_at(node, name, format!("field `{name}` of {label}: {why}"))
            })?,
        };
        self.may_write(node, name, Some((field, &value)))?;
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
        self.may_change()?;
        self.may_write(node, name, None)?;
        let field = declared(name, default).map_err(|why| self.fault_at(node, name, format!("field `{name}`: {why}")))?;
        let added = self.write(|graph| graph.add_field(node.0, field));
        added.map(drop).map_err(|e| self.fault(e, &self.label(node), Some(name)).into())
    }

    /// A place for one more handler.
    pub(crate) fn handler_id(&self) -> Outcome<u64> {
        self.may_change()?;
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

    /// Forgets the nodes and handlers of a run; definitions and functions stay.
    pub(crate) fn forget_run(&self) {
        self.on_frame.borrow_mut().clear();
        self.on_change.borrow_mut().clear();
        self.behaviours.borrow_mut().clear();
        self.always.borrow_mut().clear();
        self.places.borrow_mut().clear();
        self.problems.borrow_mut().clear();
        self.field_bytes.borrow_mut().clear();
        self.field_bytes_sum.set(0);
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
