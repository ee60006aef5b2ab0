//! How the application's numbers are understood here: nodes, types, images.

use std::collections::HashMap;
use std::sync::Arc;

use slotmap::KeyData;

use super::bulk::Bulk;
use super::herd::Herds;
use super::packet::TypeRecord;
use super::{ReplicaError, damaged};
use crate::codec::{Find, Name, Ref};
use crate::{Graph, Image, NodeId, NodeType, Value};

/// No such field.
pub(super) const NONE: u16 = u16::MAX;

/// A type of the application, as it is here.
pub(super) struct LocalType {
    pub(super) node_type: Arc<NodeType>,
    /// Its number among the herds.
    pub(super) herd: u32,
    /// By the application's index.
    pub(super) to_local: Vec<u16>,
    /// Fields that only the application's type has; nodes get them one by one.
    pub(super) extra: Vec<(u16, crate::Field)>,
    /// Defaults of the application that differ.
    pub(super) defaults: Vec<(u16, Value)>,
}

/// Both ways from numbers to nodes. Nodes that are gone, or that never were here, stay as long as fields may refer to them.
#[derive(Default)]
pub(super) struct Nodes {
    pub(super) numbers: HashMap<NodeId, u64>,
    pub(super) dead: HashMap<u64, NodeId>,
    made_up: u64,
}

impl Nodes {
    /// A node that no graph has.
    fn nobody(&mut self) -> NodeId {
        let (version, place) = ((self.made_up >> 16) << 1 | 1, u32::MAX as u64 - 1 - (self.made_up & 0xFFFF));
        self.made_up += 1;
        NodeId::from(KeyData::from_ffi(version << 32 | place))
    }

    /// Forgets who is dead and not among those that fields refer to.
    pub(super) fn sweep(&mut self, referred: &std::collections::HashSet<NodeId>) {
        let numbers = &mut self.numbers;
        self.dead.retain(|_, id| referred.contains(id) || numbers.remove(id).is_none());
    }
}

/// Understands numbers in values.
pub(super) struct Finder<'a> {
    pub(super) nodes: &'a mut Nodes,
    pub(super) held: &'a [Option<super::apply::Held>],
    pub(super) bulk: &'a Bulk,
    pub(super) missed: usize,
}

impl Find for Finder<'_> {
    fn node(&mut self, name: &Ref) -> Option<NodeId> {
        let Ref::Number(number @ 1..) = name else { return None };
        if let Some(held) = self.held.get(*number as u32 as usize).and_then(Option::as_ref)
            && held.number == *number
        {
            return Some(held.id);
        }
        if let Some(dead) = self.nodes.dead.get(number) {
            return Some(*dead);
        }
        let nobody = self.nodes.nobody();
        self.nodes.dead.insert(*number, nobody);
        self.nodes.numbers.insert(nobody, *number);
        Some(nobody)
    }

    fn image(&mut self, name: &Ref) -> Option<Arc<Image>> {
        let Ref::Number(number @ 1..) = name else { return None };
        let image = self.bulk.image(*number);
        self.missed += image.is_none() as usize;
        image
    }
}

/// Names nodes by the application's numbers, and images by their content.
pub(super) struct Namer<'a> {
    pub(super) numbers: &'a HashMap<NodeId, u64>,
    pub(super) hashes: &'a mut super::bulk::ImageHashes,
}

impl Name for Namer<'_> {
    fn node(&mut self, node: Option<NodeId>) -> Ref {
        Ref::Number(node.map_or(0, |node| self.numbers.get(&node).copied().unwrap_or(u64::MAX)))
    }

    fn image(&mut self, image: Option<&Arc<Image>>) -> Ref {
        Ref::Number(image.map_or(0, |image| self.hashes.of(image)))
    }
}

/// The application's type as it is here: by name, field by field. Unknown ones come to be as they are declared there; nothing evaluates
/// or draws them, but they are held. The second part names a type that is not known here.
pub(super) fn local_type(
    graph: &Graph,
    herds: &mut Herds,
    record: &TypeRecord,
    find: &mut Finder<'_>,
) -> Result<(LocalType, Option<String>), ReplicaError> {
    let fields: Vec<_> = record
        .fields
        .iter()
        .map(|(index, plain)| {
            Ok((*index, plain.field(find).map_err(|fault| damaged(format!("type `{}`: {fault}", record.name)))?))
        })
        .collect::<Result<_, ReplicaError>>()?;
    if !fields.is_sorted_by(|(before, _), (after, _)| before < after) {
        return Err(damaged(format!("type `{}`: its fields are out of order", record.name)));
    }
    let known = graph.types().get(&record.name).ok();
    let is_unknown = known.is_none();
    let node_type = known.unwrap_or_else(|| {
        let declared = NodeType::new(record.name.as_str(), "Declared by the application.");
        Arc::new(declared.fields(fields.iter().map(|(_, field)| field.clone())))
    });
    let herd = herds.declare(fields.iter().map(|(index, field)| (*index, field.field_type)));
    let mut to_local = vec![NONE; fields.iter().map(|(index, _)| *index as usize + 1).max().unwrap_or(0)];
    let (mut extra, mut defaults) = (Vec::new(), Vec::new());
    for (index, field) in fields {
        let Some(local) = node_type.field_index(&field.name) else {
            extra.push((index, field));
            continue;
        };
        let ours = &node_type.fields[local as usize];
        if ours.field_type != field.field_type {
            return Err(ReplicaError::OtherField {
                node_type: record.name.clone(),
                field: field.name.to_string(),
                theirs: field.field_type.to_string(),
                ours: ours.field_type.to_string(),
            });
        }
        to_local[index as usize] = local;
        if ours.default != field.default {
            defaults.push((local, field.default));
        }
    }
    // A type that the graph does not know yet may be one of a script: it is news, but no fault.
    Ok((LocalType { node_type, herd, to_local, extra, defaults }, is_unknown.then(|| record.name.clone())))
}
