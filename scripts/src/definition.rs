//! Node types that scripts defined: what they add to the type that they extend, and how their nodes come to be.
//!
//! A type on top of a native one, such as a Transform, makes nodes of that native type, with fields of their own and observers that
//! call the script. So everybody who knows Transforms knows these: extraction, files, displays.

use std::sync::Arc;

use umbriel_fields::{Field, Graph, NodeId, NodeType, Time, Value};

use crate::error::{Fault, Outcome};
use crate::stage::{Handler, Node, Stage};

/// What the observers of nodes of native types carry, whose `evaluate` a script wrote.
pub(crate) const BEHAVIOUR: u64 = u64::MAX;
/// Written in every frame for nodes of native types that are always evaluated, so that they have their turn in order.
pub(crate) const FRAME_TIME: &str = "frame_time";
/// Names the script's type, for those who save and open.
pub(crate) const SCRIPT_TYPE: &str = "script_type";

/// A node type that a script defined.
#[derive(Clone, Default)]
pub(crate) struct Definition {
    /// The type that it extends.
    pub(crate) base: Option<String>,
    /// The native type at the end of the chain, if there is one: what its nodes are made of.
    pub(crate) native: Option<String>,
    /// The fields that scripts declared, those of script-defined bases first.
    pub(crate) own_fields: Vec<Field>,
    /// First values of fields of the native type.
    pub(crate) defaults: Vec<(Arc<str>, Value)>,
    /// Its own; that of a base goes on to count without one.
    pub(crate) evaluate: Option<Handler>,
    pub(crate) changed: Vec<(String, Handler)>,
    pub(crate) always: bool,
    /// Its nodes stay in this application.
    pub(crate) local: bool,
}

/// A node of a native type that behaves as a script says.
#[derive(Clone)]
pub(crate) struct Behaviour {
    pub(crate) type_name: String,
    /// The last frame in which it was evaluated: once is enough, however many of its fields were written.
    pub(crate) frame: u64,
}

impl Definition {
    /// Begins with all that the base has.
    pub(crate) fn on(stage: &Stage, base: &NodeType) -> Self {
        let of_a_script = stage.definitions.borrow().get(&*base.name).cloned();
        let native = of_a_script.is_none().then(|| base.name.to_string());
        let inherited = of_a_script.unwrap_or_else(|| Self { native, ..Self::default() });
        Self { base: Some(base.name.to_string()), evaluate: None, ..inherited }
    }

    /// Whether it, or a type that it extends, has an `evaluate` in a script.
    pub(crate) fn is_evaluated(&self, stage: &Stage) -> bool {
        self.evaluate.is_some() || self.base.as_ref().is_some_and(|base| stage.evaluate_from(base).is_some())
    }
}

impl Stage {
    /// The `evaluate` of a type, its own or the nearest one that it inherits, with the type that it stands in.
    pub(crate) fn evaluate_from(&self, type_name: &str) -> Option<(String, Handler)> {
        let definitions = self.definitions.borrow();
        let mut name = type_name;
        loop {
            let definition = definitions.get(name)?;
            if let Some(handler) = &definition.evaluate {
                return Some((name.to_string(), handler.clone()));
            }
            name = definition.base.as_deref()?;
        }
    }

    /// The next `evaluate` above that of a type.
    pub(crate) fn evaluate_above(&self, type_name: &str) -> Option<(String, Handler)> {
        let base = self.definitions.borrow().get(type_name)?.base.clone()?;
        self.evaluate_from(&base)
    }

    /// The type of a node as the script knows it.
    pub(crate) fn type_name(&self, graph: &Graph, node: NodeId) -> String {
        let behaviour = self.behaviours.borrow().get(&node).map(|behaviour| behaviour.type_name.clone());
        behaviour.unwrap_or_else(|| graph.type_of(node).name.to_string())
    }

    /// Whether a node is of a type, or of one that extends it.
    pub(crate) fn is_a(&self, graph: &Graph, node: NodeId, wanted: &str) -> bool {
        let definitions = self.definitions.borrow();
        let mut name = self.type_name(graph, node);
        while name != wanted {
            match definitions.get(&name).and_then(|definition| definition.base.clone()) {
                Some(base) => name = base,
                None => return false,
            }
        }
        true
    }

    /// A node of a type, with all that the script's definition adds to it.
    pub(crate) fn create_defined(&self, type_name: &str) -> Outcome<Node> {
        let fault = |e: umbriel_fields::Error| Fault::new(e.to_string());
        let known = self.read(|graph| graph.types().get(type_name)).map_err(fault)?;
        let Some(definition) = self.definitions.borrow().get(&*known.name).cloned() else {
            return Ok(Node(self.write(|graph| graph.create(type_name)).map_err(fault)?));
        };
        let made_of = definition.native.as_deref().unwrap_or(&known.name);
        let node = Node(self.write(|graph| graph.create(made_of)).map_err(fault)?);
        if definition.local {
            self.write(|graph| graph.set_local(node.0, true)).map_err(fault)?;
        }
        if definition.native.is_some() {
            self.write(|graph| dress(graph, node.0, &known.name, &definition, definition.is_evaluated(self))).map_err(fault)?;
            self.behaviours.borrow_mut().insert(node.0, Behaviour { type_name: known.name.to_string(), frame: 0 });
            if definition.always && definition.is_evaluated(self) {
                self.always.borrow_mut().push(node.0);
            }
        }
        for (field, handler) in definition.changed {
            self.observe(node, &field, handler, Some(node))?;
        }
        Ok(node)
    }

    /// Writes the time into nodes of native types that a script evaluates in every frame.
    pub(crate) fn wake_always(&self, graph: &mut Graph, time_s: f64) {
        // What was deleted, or lost the field, is forgotten.
        self.always.borrow_mut().retain(|id| graph.set_named(*id, FRAME_TIME, Time(time_s)).is_ok());
    }
}

/// Gives a node of a native type the fields of the script, first values, and observers that call its `evaluate`.
fn dress(
    graph: &mut Graph,
    id: NodeId,
    name: &str,
    definition: &Definition,
    evaluated: bool,
) -> Result<(), umbriel_fields::Error> {
    graph.add_field(id, Field::new(SCRIPT_TYPE, name).output().doc("The type of the script that it is of."))?;
    for field in &definition.own_fields {
        graph.add_field(id, field.clone())?;
    }
    for (field, value) in &definition.defaults {
        graph.set_named(id, field, value.clone())?;
    }
    if !evaluated {
        return Ok(());
    }
    if definition.always {
        graph.add_field(id, Field::new(FRAME_TIME, Time(0.0)).on_set(umbriel_fields::SetRule::Pulse))?;
    }
    let fields: Vec<_> = graph.field_ids(id).map(|(field, _)| field).collect();
    for field in &fields {
        graph.observe(*field, BEHAVIOUR)?;
    }
    // A new node is evaluated once, whether it is written or not.
    fields.first().map_or(Ok(()), |field| graph.touch(*field))
}
