//! The graph: nodes that come and go, and what they are made of.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

use slotmap::{Key, SlotMap};
use smallvec::SmallVec;

use crate::batch::Batches;
use crate::changes::ChangeLog;
use crate::column::Columns;
use crate::explain::Explain;
use crate::frame::FrameState;
use crate::naming::{canonical, hint};
use crate::observe::Observers;
use crate::program::Programs;
use crate::record::{Event, Journal};
use crate::route::Routes;
use crate::schedule::{EVALUATES, NATIVE, Schedule};
use crate::{Error, Evaluator, Field, Kind, Mode, NodeType, Revision, TypeRegistry};

slotmap::new_key_type! {
    /// A node. Ids of deleted nodes are never valid again.
    pub struct NodeId;
}

/// A field of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FieldId {
    /// The node.
    pub node: NodeId,
    /// The place in the node's list of fields: declared ones first, then dynamic ones. The place of a removed field may be used again.
    pub index: u16,
}

/// The node's place in every array that is kept by node.
#[inline]
pub(crate) fn slot_of(id: NodeId) -> u32 {
    id.data().as_ffi() as u32
}

/// One node.
#[derive(Debug)]
pub(crate) struct Node {
    pub(crate) node_type: Arc<NodeType>,
    pub(crate) name: Option<Arc<str>>,
    /// By field index: the slot in the column of the field's type, or `FREE` where a dynamic field was removed.
    pub(crate) slots: SmallVec<[u32; 6]>,
    /// Fields beyond the declared ones.
    pub(crate) dynamic: Vec<Option<Field>>,
    /// Routes to its fields and from them; each route knows its place here.
    pub(crate) incoming: Vec<crate::RouteId>,
    pub(crate) outgoing: Vec<crate::RouteId>,
    pub(crate) created: Revision,
    pub(crate) mode: Mode,
    /// Stays in this process.
    pub(crate) local: bool,
}

impl Node {
    /// A node whose fields have no places yet.
    pub(crate) fn new(node_type: Arc<NodeType>, created: Revision) -> Self {
        let (mode, local) = (node_type.mode, node_type.local);
        Self {
            node_type,
            name: None,
            slots: SmallVec::new(),
            dynamic: Vec::new(),
            incoming: Vec::new(),
            outgoing: Vec::new(),
            created,
            mode,
            local,
        }
    }

    #[inline]
    pub(crate) fn field(&self, index: u16) -> Option<&Field> {
        let declared = &self.node_type.fields;
        match declared.get(index as usize) {
            Some(field) => Some(field),
            None => self.dynamic.get(index as usize - declared.len())?.as_ref(),
        }
    }

    /// All fields with their indices.
    pub(crate) fn fields(&self) -> impl Iterator<Item = (u16, &Field)> {
        let declared = self.node_type.fields.iter().map(Some);
        let all = declared.chain(self.dynamic.iter().map(Option::as_ref));
        all.enumerate().filter_map(|(index, field)| Some((index as u16, field?)))
    }

    pub(crate) fn index_of(&self, name: &str) -> Option<u16> {
        if let Some(index) = self.node_type.field_index(name) {
            return Some(index);
        }
        if self.dynamic.is_empty() {
            return None;
        }
        let name = canonical(name);
        let place = self.dynamic.iter().position(|field| field.as_ref().is_some_and(|field| field.is_named(&name)))?;
        Some((self.node_type.fields.len() + place) as u16)
    }

    /// The flags that it has by its type.
    pub(crate) fn base_flags(&self) -> u8 {
        match (&self.node_type.evaluator, self.mode) {
            (Evaluator::None, _) | (_, Mode::Pull) => 0,
            (Evaluator::Native(_), _) => EVALUATES | NATIVE,
            (Evaluator::Host, _) => EVALUATES,
        }
    }
}

/// All nodes, their values in typed columns, and the routes between them.
pub struct Graph {
    types: TypeRegistry,
    pub(crate) nodes: SlotMap<NodeId, Node>,
    /// By node slot; null where no node is.
    pub(crate) ids: Vec<NodeId>,
    pub(crate) columns: Columns,
    pub(crate) changes: ChangeLog,
    pub(crate) schedule: Schedule,
    pub(crate) routes: Routes,
    pub(crate) programs: Programs,
    pub(crate) observers: Observers,
    pub(crate) frame: FrameState,
    pub(crate) batches: Batches,
    /// Why fields were written, while somebody wants to know.
    pub(crate) explain: Option<Box<Explain>>,
    /// What happens from outside, if somebody records.
    pub(crate) journal: Option<Journal>,
    /// The revision of fields that were last written silently.
    pub(crate) silenced: HashMap<FieldId, Revision>,
    pub(crate) names: HashMap<Arc<str>, NodeId>,
    /// What a deleted node's type is said to be.
    deleted_type: Arc<NodeType>,
}

impl fmt::Debug for Graph {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Graph({} nodes, {} routes, revision {})", self.nodes.len(), self.routes.all.len(), self.changes.last())
    }
}

impl Graph {
    /// A graph without nodes. Takes a registry or a list of types.
    pub fn new(types: impl Into<TypeRegistry>) -> Self {
        Self {
            types: types.into(),
            nodes: SlotMap::with_key(),
            ids: Vec::new(),
            columns: Columns::default(),
            changes: ChangeLog::default(),
            schedule: Schedule::default(),
            routes: Routes::default(),
            programs: Programs::default(),
            observers: Observers::default(),
            frame: FrameState::default(),
            batches: Batches::default(),
            explain: None,
            silenced: HashMap::new(),
            names: HashMap::new(),
            journal: None,
            deleted_type: Arc::new(NodeType::new("(deleted)", "A node that does not exist any more.")),
        }
    }

    /// The types that can be created; more can be registered at any time.
    pub fn types(&self) -> &TypeRegistry {
        &self.types
    }

    /// Creates a node of a type by the type's name or alias.
    pub fn create(&mut self, type_name: &str) -> Result<NodeId, Error> {
        let node_type = self.types.get(type_name)?;
        Ok(self.create_of(node_type))
    }

    /// Creates a node of a type that the registry or another node gave.
    pub fn create_of(&mut self, node_type: Arc<NodeType>) -> NodeId {
        let created = self.changes.next();
        let type_of_new = node_type.clone();
        let mode = node_type.mode;
        let id = self.nodes.insert(Node::new(node_type, created));
        let slot = slot_of(id);
        if self.ids.len() <= slot as usize {
            self.ids.resize(slot as usize + 1, NodeId::default());
            self.changes.grow(self.ids.len());
            self.schedule.grow(self.ids.len());
            self.programs.grow(self.ids.len());
        }
        self.ids[slot as usize] = id;
        let node = &mut self.nodes[id];
        for (index, field) in node.node_type.fields.iter().enumerate() {
            node.slots.push(self.columns.insert(field.default.clone(), (slot, index as u16), created));
        }
        let flags = node.base_flags();
        self.schedule.created(slot, flags, created);
        self.changes.reshaped(slot, created);
        self.schedule.mark(slot);
        if mode == Mode::Always {
            self.frame.always.insert(slot);
        }
        self.note(|| Event::Created(id, type_of_new));
        id
    }

    /// Deletes a node with its routes, observers and name. References to it in fields stay and are dead ([`Graph::contains`]).
    pub fn delete(&mut self, id: NodeId) -> Result<(), Error> {
        let node = self.nodes.get(id).ok_or(Error::DeadNode)?;
        for route in node.incoming.iter().chain(&node.outgoing).copied().collect::<Vec<_>>() {
            self.disconnect(route);
        }
        let Some(node) = self.nodes.remove(id) else { return Err(Error::DeadNode) };
        let slot = slot_of(id);
        for (index, field) in node.fields() {
            self.columns.remove(field.field_type, node.slots[index as usize]);
            self.silenced.remove(&FieldId { node: id, index });
        }
        if let Some(name) = &node.name {
            self.names.remove(name);
        }
        self.observers.forget_node(slot);
        self.programs.forget(slot);
        self.schedule.deleted(slot);
        self.frame.forget(slot);
        self.forget_explained(id);
        self.ids[slot as usize] = NodeId::default();
        let revision = self.changes.next();
        self.changes.deleted(id, revision);
        self.note(|| Event::Deleted(id));
        Ok(())
    }

    /// True if the node exists.
    pub fn contains(&self, id: NodeId) -> bool {
        self.nodes.contains_key(id)
    }

    /// All nodes, in no particular but always the same order.
    pub fn nodes(&self) -> impl Iterator<Item = NodeId> {
        self.nodes.keys()
    }

    /// How many nodes there are.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// The node's type; for a deleted node a type called `(deleted)` without fields.
    pub fn type_of(&self, id: NodeId) -> &Arc<NodeType> {
        self.nodes.get(id).map_or(&self.deleted_type, |node| &node.node_type)
    }

    pub(crate) fn node(&self, id: NodeId) -> Result<&Node, Error> {
        self.nodes.get(id).ok_or(Error::DeadNode)
    }

    /// The field of a name or alias, in any spelling; the error names the nearest one.
    pub fn field(&self, id: NodeId, name: &str) -> Result<FieldId, Error> {
        let node = self.node(id)?;
        match node.index_of(name) {
            Some(index) => Ok(FieldId { node: id, index }),
            None => {
                let names =
                    node.fields().flat_map(|(_, field)| std::iter::once(&*field.name).chain(field.aliases.iter().map(|a| &**a)));
                Err(Error::UnknownField { node: self.describe(id), name: name.into(), hint: hint(name, names) })
            }
        }
    }

    /// The declaration of a field.
    pub fn declaration(&self, field: FieldId) -> Result<&Field, Error> {
        self.node(field.node)?.field(field.index).ok_or_else(|| self.dead_field(field))
    }

    /// The declarations of a node's fields: declared ones, then dynamic ones.
    pub fn fields_of(&self, id: NodeId) -> impl Iterator<Item = &Field> {
        self.nodes.get(id).into_iter().flat_map(Node::fields).map(|(_, field)| field)
    }

    /// The ids of a node's fields with their declarations.
    pub fn field_ids(&self, id: NodeId) -> impl Iterator<Item = (FieldId, &Field)> {
        self.nodes.get(id).into_iter().flat_map(Node::fields).map(move |(index, field)| (FieldId { node: id, index }, field))
    }

    /// True if the field holds node references.
    pub fn holds_nodes(&self, field: FieldId) -> bool {
        self.declaration(field).is_ok_and(|field| field.field_type.kind == Kind::Node)
    }
}
