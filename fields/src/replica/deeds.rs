//! What a process does to its copy of a world, as messages for the one that evaluates it.

use std::collections::HashSet;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use slotmap::KeyData;

use super::bulk::{Bulk, ImageHashes, message_of_image};
use crate::codec::{Find, Name, PlainField, Ref, from_bytes, to_bytes};
use crate::{Evaluator, Field, FieldId, Graph, Image, Kind, NodeId, NodeType, Strength, Value};

/// Numbers of nodes that have none in the application yet: this, and a key. No node of a graph has such a number.
const OWN: u64 = 0xFFFF_FFFE << 32;

/// The number of the node that a guest made as its `key`th.
pub(super) fn own_number(key: u32) -> u64 {
    OWN | u64::from(key)
}

/// The key of a node that has no number in the application yet.
pub fn own_key(number: u64) -> Option<u32> {
    (number & OWN == OWN).then_some(number as u32)
}

/// The node of a number in the application's own graph.
pub fn node_numbered(number: u64) -> NodeId {
    NodeId::from(KeyData::from_ffi(number))
}

/// The number of a node in the application's own graph.
pub fn number_of(node: NodeId) -> u64 {
    slotmap::Key::data(&node).as_ffi()
}

/// A field: the node's number, and the field's name.
type At = (u64, String);

/// One thing that was done. Nodes by the application's numbers or, where it has none yet, by own ones; fields and types by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deed(pub(super) Act);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Act {
    /// The fields of the type, where it is one of a script.
    Create {
        node: u64,
        node_type: String,
        fields: Vec<PlainField>,
    },
    Delete(u64),
    Name(u64, String),
    AddField(u64, PlainField),
    RemoveField(At),
    Write {
        to: At,
        field_type: String,
        value: Vec<u8>,
    },
    Touch(At),
    /// Puts own nodes into somebody's list of nodes, and takes them out.
    List {
        to: At,
        put: Vec<u64>,
        taken: Vec<u64>,
    },
    Route {
        from: At,
        to: At,
        weak: bool,
    },
    Unroute {
        from: At,
        to: At,
    },
}

impl Deed {
    /// The node that it changes, if it is not one that it makes.
    pub fn changes(&self) -> Option<u64> {
        match &self.0 {
            Act::Create { .. } => None,
            Act::Delete(node) | Act::Name(node, _) | Act::AddField(node, _) => Some(*node),
            Act::RemoveField(to) | Act::Write { to, .. } | Act::Touch(to) | Act::List { to, .. } => Some(to.0),
            Act::Route { to, .. } | Act::Unroute { to, .. } => Some(to.0),
        }
    }

    /// The node that it makes.
    pub fn makes(&self) -> Option<u64> {
        match &self.0 {
            Act::Create { node, .. } => Some(*node),
            _ => None,
        }
    }

    /// The node that it takes out of the world.
    pub fn deletes(&self) -> Option<u64> {
        match &self.0 {
            Act::Delete(node) => Some(*node),
            _ => None,
        }
    }

    /// Nodes that it puts into a list or takes out of it, which is open to everybody for nodes of one's own.
    pub fn lists(&self) -> Option<impl Iterator<Item = u64>> {
        match &self.0 {
            Act::List { put, taken, .. } => Some(put.iter().chain(taken).copied()),
            _ => None,
        }
    }

    /// The field that it changes.
    pub fn field(&self) -> Option<&str> {
        match &self.0 {
            Act::RemoveField(to) | Act::Write { to, .. } | Act::Touch(to) | Act::List { to, .. } => Some(&to.1),
            Act::Route { to, .. } | Act::Unroute { to, .. } => Some(&to.1),
            Act::AddField(_, field) => Some(&field.name),
            Act::Name(..) => Some("name"),
            Act::Create { .. } | Act::Delete(_) => None,
        }
    }

    /// Does it to the application's graph. `node` finds nodes by the numbers that stand in it. Gives the node that was made.
    ///
    /// # Errors
    /// In words: a node, a type or a field that is not there, a value that does not fit, a name that is taken, a loop.
    pub fn apply(&self, graph: &mut Graph, bulk: &Bulk, node: &dyn Fn(u64) -> Option<NodeId>) -> Result<Option<NodeId>, String> {
        let found = |number: u64| node(number).filter(|id| graph.contains(*id)).ok_or("the node is gone".to_string());
        let field = |at: &At| found(at.0).and_then(|id| graph.field(id, &at.1).map_err(in_words));
        let mut find = Lookup { node, bulk, is_missing: false };
        match &self.0 {
            Act::Create { node_type, fields, .. } => {
                let known = graph.types().get(node_type);
                let node_type = match known {
                    Ok(known) => known,
                    Err(error) if fields.is_empty() => return Err(in_words(error)),
                    Err(_) => {
                        let fields: Vec<Field> = fields.iter().map(|field| field.field(&mut find)).collect::<Result<_, _>>()?;
                        Arc::new(NodeType::new(node_type.as_str(), "Declared by a guest.").fields(fields))
                    }
                };
                return Ok(Some(graph.create_of(node_type)));
            }
            Act::Delete(number) => graph.delete(found(*number)?).map_err(in_words)?,
            Act::Name(number, name) => graph.set_name(found(*number)?, name).map_err(in_words)?,
            Act::AddField(number, plain) => {
                let (id, field) = (found(*number)?, plain.field(&mut find)?);
                graph.add_field(id, field).map_err(in_words)?;
            }
            Act::RemoveField(at) => graph.remove_field(field(at)?).map_err(in_words)?,
            Act::Touch(at) => graph.touch(field(at)?).map_err(in_words)?,
            Act::Write { to, field_type, value } => {
                let to = field(to)?;
                let declared = graph.declaration(to).map_err(in_words)?;
                if declared.field_type.to_string() != *field_type {
                    return Err(format!("{} is a {}, not a {field_type}", graph.describe_field(to), declared.field_type));
                }
                let value = from_bytes(value, declared.field_type, declared, &mut find)?;
                if find.is_missing {
                    return Err("an image of the value did not come along".into());
                }
                graph.set_value(to, value).map_err(in_words)?;
            }
            Act::List { to, put, taken } => {
                let to = field(to)?;
                let Value::Nodes(before) = graph.value(to).map_err(in_words)? else {
                    return Err(format!("{} is no list of nodes", graph.describe_field(to)));
                };
                let [put, taken]: [HashSet<NodeId>; 2] =
                    [put, taken].map(|numbers| numbers.iter().filter_map(|number| node(*number)).collect());
                let stays = |id: &NodeId| !taken.contains(id) && graph.contains(*id);
                let mut after: Vec<Option<NodeId>> =
                    before.iter().copied().filter(|id| id.is_some_and(|id| stays(&id))).collect();
                let mut new: Vec<NodeId> = put.into_iter().filter(|id| !after.contains(&Some(*id))).collect();
                new.sort_unstable();
                after.extend(new.into_iter().map(Some));
                graph.set_value(to, Value::Nodes(after.into())).map_err(in_words)?;
            }
            Act::Route { from, to, weak } => {
                let strength = if *weak { Strength::Weak } else { Strength::Strong };
                let (from, to) = (field(from)?, field(to)?);
                graph.connect(from, to, strength).map_err(in_words)?;
            }
            Act::Unroute { from, to } => {
                let route = graph.route_between(field(from)?, field(to)?).ok_or("the route is gone")?;
                graph.disconnect(route);
            }
        }
        Ok(None)
    }
}

fn in_words(error: crate::Error) -> String {
    error.to_string()
}

/// Finds what stands in values of deeds.
struct Lookup<'a> {
    node: &'a dyn Fn(u64) -> Option<NodeId>,
    bulk: &'a Bulk,
    is_missing: bool,
}

impl Find for Lookup<'_> {
    fn node(&mut self, name: &Ref) -> Option<NodeId> {
        match name {
            Ref::Number(number) => (self.node)(*number),
            Ref::Name(_) => None,
        }
    }

    fn image(&mut self, name: &Ref) -> Option<Arc<Image>> {
        let Ref::Number(hash) = name else { return None };
        let image = if *hash == 0 { None } else { self.bulk.image(*hash) };
        self.is_missing |= *hash != 0 && image.is_none();
        image
    }
}

/// Writes values for deeds: nodes by numbers, images by hashes, those that are new beside them.
pub(super) struct Writer<'a> {
    pub(super) number: &'a dyn Fn(NodeId) -> u64,
    pub(super) hashes: &'a mut ImageHashes,
    pub(super) sent: &'a mut HashSet<u64>,
    pub(super) images: Vec<(u64, Vec<u8>)>,
}

impl Name for Writer<'_> {
    fn node(&mut self, node: Option<NodeId>) -> Ref {
        Ref::Number(node.map_or(0, self.number))
    }

    fn image(&mut self, image: Option<&Arc<Image>>) -> Ref {
        let Some(image) = image else { return Ref::Number(0) };
        let hash = self.hashes.of(image);
        if self.sent.insert(hash) {
            self.images.push((hash, message_of_image(image).to_vec()));
        }
        Ref::Number(hash)
    }
}

impl Writer<'_> {
    fn at(&self, graph: &Graph, field: FieldId) -> Option<At> {
        Some(((self.number)(field.node), graph.declaration(field).ok()?.name.to_string()))
    }

    pub(super) fn create(&mut self, node: NodeId, node_type: &NodeType) -> Deed {
        let is_of_a_script = matches!(node_type.evaluator, Evaluator::Host);
        let fields = node_type.fields.iter().filter(|_| is_of_a_script).map(|field| PlainField::of(field, self)).collect();
        Deed(Act::Create { node: (self.number)(node), node_type: node_type.name.to_string(), fields })
    }

    pub(super) fn delete(&self, number: u64) -> Deed {
        Deed(Act::Delete(number))
    }

    pub(super) fn name(&self, node: NodeId, name: &str) -> Deed {
        Deed(Act::Name((self.number)(node), name.into()))
    }

    pub(super) fn add_field(&mut self, node: NodeId, field: &Field) -> Deed {
        Deed(Act::AddField((self.number)(node), PlainField::of(field, self)))
    }

    pub(super) fn remove_field(&self, node: NodeId, field: &str) -> Deed {
        Deed(Act::RemoveField(((self.number)(node), field.into())))
    }

    pub(super) fn write(&mut self, graph: &Graph, field: FieldId, value: &Value) -> Option<Deed> {
        let to = self.at(graph, field)?;
        let declared = graph.declaration(field).ok()?;
        if declared.field_type != value.field_type() {
            return None;
        }
        let value = to_bytes(value, declared, self, Vec::new());
        Some(Deed(Act::Write { to, field_type: declared.field_type.to_string(), value }))
    }

    pub(super) fn touch(&self, graph: &Graph, field: FieldId) -> Option<Deed> {
        Some(Deed(Act::Touch(self.at(graph, field)?)))
    }

    /// What of a list of nodes is new, and what is not there any more.
    pub(super) fn list(&self, graph: &Graph, field: FieldId, before: &[Option<NodeId>], now: &Value) -> Option<Deed> {
        let Value::Nodes(now) = now else { return None };
        let missing_in = |list: &[Option<NodeId>], node: &NodeId| !list.contains(&Some(*node));
        let put = now.iter().flatten().filter(|node| missing_in(before, node)).map(|node| (self.number)(*node)).collect();
        let taken = before.iter().flatten().filter(|node| missing_in(now, node)).map(|node| (self.number)(*node)).collect();
        Some(Deed(Act::List { to: self.at(graph, field)?, put, taken }))
    }

    pub(super) fn route(&self, graph: &Graph, from: FieldId, to: FieldId, strength: Strength) -> Option<Deed> {
        Some(Deed(Act::Route { from: self.at(graph, from)?, to: self.at(graph, to)?, weak: strength == Strength::Weak }))
    }

    pub(super) fn unroute(&self, from: At, to: At) -> Deed {
        Deed(Act::Unroute { from, to })
    }
}

/// True if a field is a list of nodes.
pub(super) fn is_list(graph: &Graph, field: FieldId) -> bool {
    graph.declaration(field).is_ok_and(|field| field.field_type.kind == Kind::Node && field.field_type.multiple)
}
