//! Nodes: making, finding, reading and writing fields, putting them below each other.

use std::collections::HashSet;
use std::sync::Arc;

use rhai::{Array, Dynamic, FuncRegistration, ImmutableString, Map, NativeCallContext};
use umbriel_fields::{Graph, Kind, NodeId, Value};

use super::Words;
use crate::error::{Fault, Outcome};
use crate::expression::{self, EXPRESSION};
use crate::stage::{Node, Stage};
use crate::values::{node_or_unit, show};

pub(super) fn teach(words: &mut Words<'_>) {
    make(words);
    fields(words);
    groups(words);
    find(words);
}

fn make(words: &mut Words<'_>) {
    words.engine.register_type_with_name::<Node>("Node");
    let stage = words.stage.clone();
    words.word(
        "make(type: string) -> Node",
        "A node of a type, with the type's defaults.",
        move |context: NativeCallContext<'_>, name: &str| stage.making_at(context.call_position(), || stage.create(name)),
    );
    let stage = words.stage.clone();
    words.word(
        "make(type: string, fields: map) -> Node",
        "A node with fields set: `make(\"Box\", #{ size: vec3(1, 2, 1) })`. The entry `name` names it. An Expression \
         takes `inputs`, `code` and `value`: `make(\"Expression\", #{ inputs: #{ a: 1.0 }, code: \"a * 2\" })`.",
        move |context: NativeCallContext<'_>, name: &str, fields: Map| {
            stage.making_at(context.call_position(), || {
                if umbriel_fields::canonical(name) != umbriel_fields::canonical(EXPRESSION) {
                    return make_with(&stage, name, &fields);
                }
                let outer = context.global_runtime_state().constants.clone();
                *stage.running_constants.borrow_mut() = outer.map(|known| known.borrow().clone()).unwrap_or_default();
                expression::make(&stage, context.engine(), &fields)
            })
        },
    );
    let stage = words.stage.clone();
    words.word("delete(node: Node)", "Takes a node out of the world; routes to and from it end.", move |node: Node| {
        stage.delete(node)
    });
    let stage = words.stage.clone();
    words.form("==", |a: Node, b: Node| a == b).form("!=", |a: Node, b: Node| a != b);
    words.form("==", |_: Node, (): ()| false).form("!=", |_: Node, (): ()| true);
    words.form("==", |(): (), _: Node| false).form("!=", |(): (), _: Node| true);
    words.form("to_string", {
        let stage = stage.clone();
        move |node: &mut Node| stage.label(*node)
    });
    words.form("to_debug", move |node: &mut Node| stage.label(*node));
}

/// A node with fields set; gone again if one of them is wrong.
pub(super) fn make_with(stage: &Stage, type_name: &str, fields: &Map) -> Outcome<Node> {
    let node = stage.create(type_name)?;
    match fields.iter().try_for_each(|(field, value)| set(stage, node, field, value)) {
        Ok(()) => Ok(node),
        Err(error) => {
            stage.delete(node)?;
            Err(error)
        }
    }
}

fn fields(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    let read = move |node: &mut Node, field: ImmutableString| get(&stage, *node, &field);
    FuncRegistration::new_index_getter().with_purity(true).register_into_engine(words.engine, read);
    let stage = words.stage.clone();
    let write = move |context: NativeCallContext<'_>, node: &mut Node, field: ImmutableString, value: Dynamic| {
        stage.write(|graph| stage.set_origin(graph, context.call_position()));
        set(&stage, *node, &field, &value)
    };
    FuncRegistration::new_index_setter().with_purity(true).register_into_engine(words.engine, write);
    let stage = words.stage.clone();
    words.word("fields(node: Node) -> array", "The names of a node's fields.", move |node: &mut Node| field_names(&stage, *node));
    let stage = words.stage.clone();
    words.word(
        "has(node: Node, field: string) -> bool",
        "Whether a node has a field of this name.",
        move |node: &mut Node, field: &str| stage.read(|graph| graph.field(node.0, field).is_ok()),
    );
    let stage = words.stage.clone();
    words.word(
        "add_field(node: Node, name: string, value: any)",
        "Gives one node a field that its type does not have. The value is its first value and says its type.",
        move |node: Node, name: &str, default: Dynamic| stage.add_field(node, name, &default),
    );
    let stage = words.stage.clone();
    words.word("remove_field(node: Node, name: string)", "Takes such a field away again.", move |node: Node, name: &str| {
        stage.may_write(node, name, None)?;
        let field = stage.field(node, name)?;
        let removed = stage.write(|graph| graph.remove_field(field));
        removed.map_err(|e| stage.fault_at(node, name, e.to_string()).into()) as Outcome<()>
    });
    let stage = words.stage.clone();
    words.word(
        "touch(node: Node, field: string)",
        "Says that a field changed although its value did not.",
        move |node: Node, name: &str| {
            stage.may_write(node, name, None)?;
            let field = stage.field(node, name)?;
            let touched = stage.write(|graph| graph.touch(field));
            touched.map(drop).map_err(|e| stage.fault_at(node, name, e.to_string()).into()) as Outcome<()>
        },
    );
}

/// `node.name` and `node.type` are of every node; all else is a field.
pub(super) fn get(stage: &Stage, node: Node, field: &str) -> Outcome<Dynamic> {
    match field {
        "name" | "Name" => Ok(stage.read(|graph| graph.name(node.0).map_or(Dynamic::UNIT, |name| name.to_string().into()))),
        "type" if stage.read(|graph| graph.contains(node.0)) => Ok(stage.read(|graph| stage.type_name(graph, node.0).into())),
        _ => stage.get(node, field),
    }
}

pub(crate) fn set(stage: &Stage, node: Node, field: &str, value: &Dynamic) -> Outcome<()> {
    match field {
        "name" | "Name" => {
            let Some(name) = value.read_lock::<ImmutableString>() else {
                return stage.fault_at(node, "name", format!("a name is a string, not {}", show(value))).throw();
            };
            stage.may_write(node, "name", None)?;
            let named = stage.write(|graph| graph.set_name(node.0, &name));
            named.map_err(|e| stage.fault_at(node, "name", e.to_string()).into())
        }
        _ => stage.set(node, field, value),
    }
}

fn field_names(stage: &Stage, node: Node) -> Array {
    stage.read(|graph| {
        if !graph.contains(node.0) {
            return Array::new();
        }
        graph.fields_of(node.0).map(|field| field.name.to_string().into()).collect()
    })
}

fn groups(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "add(group: Node, node: Node)",
        "Puts a node below a group: `world.add(lamp)`.",
        move |group: &mut Node, node: Node| add(&stage, *group, &[node.into()]),
    );
    let stage = words.stage.clone();
    words.word("add(group: Node, nodes: array)", "Puts several nodes below a group.", move |group: &mut Node, nodes: Array| {
        add(&stage, *group, &nodes)
    });
    let stage = words.stage.clone();
    words.word(
        "remove(group: Node, node: Node)",
        "Takes a node out of a group; it lives on.",
        move |group: &mut Node, node: Node| {
            let mut children = children(&stage, *group)?;
            children.retain(|child| child.read_lock::<Node>().is_none_or(|child| *child != node));
            stage.set(*group, "children", &children.into())
        },
    );
}

fn children(stage: &Stage, group: Node) -> Outcome<Array> {
    Ok(stage.get(group, "children")?.into_array().unwrap_or_default())
}

/// Adds what is not below the group already.
pub(super) fn add(stage: &Stage, group: Node, nodes: &[Dynamic]) -> Outcome<()> {
    let mut all = children(stage, group)?;
    for node in nodes {
        let Some(new) = node.read_lock::<Node>().map(|node| *node) else {
            return stage.fault_at(group, "children", format!("only nodes can be added to a group, not {}", show(node))).throw();
        };
        if new == group {
            return stage.fault_at(group, "children", "a group cannot be below itself").throw();
        }
        if !all.iter().any(|child| child.read_lock::<Node>().is_some_and(|child| *child == new)) {
            all.push(Dynamic::from(new));
        }
    }
    stage.set(group, "children", &all.into())
}

impl From<Node> for Dynamic {
    fn from(node: Node) -> Self {
        Dynamic::from(node)
    }
}

fn find(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "find(name: string) -> Node",
        "The node of this name, or `()`. A path such as `/world/house/door` goes down from group to group.",
        move |name: &str| -> Dynamic {
            stage.read(|graph| node_or_unit(if name.starts_with('/') { graph.find_path(name) } else { graph.find(name) }))
        },
    );
    let stage = words.stage.clone();
    words.word(
        "find(below: Node, name: string) -> Node",
        "The node of this name below another one, or `()`. Finds it in a model that was loaded more than once, too.",
        move |top: &mut Node, name: &str| -> Dynamic {
            let is_it = |own: &str| {
                own == name || own.rsplit_once('.').is_some_and(|(own, copy)| own == name && copy.parse::<u32>().is_ok())
            };
            stage.read(|graph| {
                let found = below(graph, top.0).into_iter().find(|id| graph.name(*id).is_some_and(is_it));
                node_or_unit(found)
            })
        },
    );
    let stage = words.stage.clone();
    words.word(
        "descendants(below: Node, type: string) -> array",
        "All nodes of a type that hang below a node, by children and by all other fields.",
        move |top: &mut Node, name: &str| -> Outcome<Array> {
            stage.read(|graph| {
                let wanted = graph.types().get(name).map_err(|e| Fault::new(e.to_string()))?;
                let mut found = below(graph, top.0);
                found.retain(|id| stage.is_a(graph, *id, &wanted.name));
                Ok(found.into_iter().map(|id| Dynamic::from(Node(id))).collect())
            })
        },
    );
    let stage = words.stage.clone();
    words.word(
        "find_all(type: string) -> array",
        "All nodes of a type, and of types of the world that extend it.",
        move |name: &str| -> Outcome<Array> {
            let wanted = stage.read(|graph| graph.types().get(name)).map_err(|e| Fault::new(e.to_string()))?;
            Ok(stage.read(|graph| {
                let of_type = |id: &NodeId| stage.is_a(graph, *id, &wanted.name);
                graph.nodes().filter(of_type).map(|id| Dynamic::from(Node(id))).collect()
            }))
        },
    );
    let stage = words.stage.clone();
    words.word("types() -> array", "The names of all node types.", move || -> Array {
        stage.read(|graph| graph.types().iter().map(|node_type| node_type.name.to_string().into()).collect())
    });
}

/// A node and all that hangs below it, each once, parents before what is below them.
fn below(graph: &Graph, top: NodeId) -> Vec<NodeId> {
    let mut found = vec![top];
    let mut seen = HashSet::from([top]);
    let mut next = 0;
    while let Some(id) = found.get(next).copied() {
        next += 1;
        for (field, _) in graph.field_ids(id).filter(|(_, declared)| declared.field_type.kind == Kind::Node) {
            let nodes = match graph.value(field) {
                Ok(Value::Node(one)) => Arc::from([one]),
                Ok(Value::Nodes(many)) => many,
                _ => continue,
            };
            found.extend(nodes.iter().flatten().copied().filter(|id| graph.contains(*id) && seen.insert(*id)));
        }
    }
    found
}
