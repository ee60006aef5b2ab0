//! One hash for all values of a graph, kept up to date in time proportional to what changed: a sum of a hash for each field, so that the
//! order of nodes plays no part.

use std::collections::HashMap;

use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

use super::blocks::{Place, Seen};
use super::numbers::Numbers;
use crate::{Changes, FieldId, Graph, NodeId, Revision};

/// Values of no more bytes are kept as they are: a quaternion is.
const SHORT: usize = 16;

/// A node's share of the sum.
#[derive(Default)]
struct Shares {
    /// Its type and name.
    own: u64,
    /// By field index; zero where no field is.
    fields: Vec<u64>,
}

impl Shares {
    fn sum(&self) -> u64 {
        self.fields.iter().fold(self.own, |sum, share| sum.wrapping_add(*share))
    }
}

/// What a field holds since it was last looked at.
pub(super) struct Changed {
    pub(super) field: FieldId,
    pub(super) place: Place,
    pub(super) seen: Seen,
    revision: Revision,
}

#[derive(Default)]
pub(super) struct Hashes {
    shares: HashMap<NodeId, Shares>,
    sum: u64,
    /// Writes up to this one are in the sum.
    mark: Revision,
}

impl Hashes {
    /// Looks at everything.
    pub(super) fn of(graph: &Graph, numbers: &mut Numbers) -> Self {
        let mut hashes = Self::default();
        for node in graph.nodes() {
            hashes.look_at(graph, node, numbers, &mut Vec::new());
        }
        hashes.mark = graph.revision();
        hashes
    }

    /// Brings the sum up to date; gives the fields that were written, in the order of their writes.
    pub(super) fn update(&mut self, graph: &Graph, numbers: &mut Numbers) -> Vec<Changed> {
        let nodes = match graph.changes_since(self.mark) {
            Changes::Nodes(nodes) => nodes,
            Changes::All => graph.nodes().chain(self.shares.keys().copied().filter(|node| !graph.contains(*node))).collect(),
        };
        let mut changed = Vec::new();
        for node in nodes {
            if graph.contains(node) {
                self.look_at(graph, node, numbers, &mut changed);
            } else if let Some(shares) = self.shares.remove(&node) {
                self.sum = self.sum.wrapping_sub(shares.sum());
            }
        }
        changed.sort_by_key(|changed| (changed.revision, changed.place));
        self.mark = graph.revision();
        changed
    }

    fn look_at(&mut self, graph: &Graph, id: NodeId, numbers: &mut Numbers, changed: &mut Vec<Changed>) {
        let shares = self.shares.entry(id).or_default();
        let before = shares.sum();
        let node = &graph.nodes[id];
        let number = numbers.nodes.number(id);
        let name = node.name.as_deref().unwrap_or_default();
        let own = xxh3_64_with_seed(name.as_bytes(), !number);
        shares.own = own ^ xxh3_64_with_seed(node.node_type.name.as_bytes(), number);
        shares.fields.resize(node.slots.len(), 0);
        let mut alive = vec![false; node.slots.len()];
        for (index, declared) in node.fields() {
            alive[index as usize] = true;
            let revision = graph.columns.revisions(declared.field_type)[node.slots[index as usize] as usize];
            let new = shares.fields[index as usize] == 0;
            if revision <= self.mark && !new {
                continue;
            }
            let value = graph.columns.value(declared.field_type, node.slots[index as usize]);
            let bytes = numbers.bytes_to_compare(&value);
            let seed = number << 24 ^ (index as u64) << 8 ^ declared.field_type.kind as u64;
            shares.fields[index as usize] = xxh3_64_with_seed(&bytes, seed).max(1);
            if revision > node.created {
                let seen = if bytes.len() <= SHORT { Seen::Value(bytes) } else { Seen::Hash(xxh3_64(&bytes)) };
                changed.push(Changed { field: FieldId { node: id, index }, place: (number, index), seen, revision });
            }
        }
        for (share, _) in shares.fields.iter_mut().zip(alive).filter(|(_, alive)| !alive) {
            *share = 0;
        }
        self.sum = self.sum.wrapping_sub(before).wrapping_add(shares.sum());
    }

    /// The hash of all values, names and types, and of how many routes there are.
    pub(super) fn hash(&self, graph: &Graph) -> u64 {
        self.sum ^ (graph.routes.all.len() as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
    }
}

/// What a field holds now, to compare with what was seen.
pub(super) fn seen_now(graph: &Graph, field: FieldId, numbers: &mut Numbers) -> Option<Seen> {
    let bytes = numbers.bytes_to_compare(&graph.value(field).ok()?);
    Some(if bytes.len() <= SHORT { Seen::Value(bytes) } else { Seen::Hash(xxh3_64(&bytes)) })
}
