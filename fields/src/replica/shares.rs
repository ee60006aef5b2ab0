//! One hash for all values: a sum of a hash for each field, so that order plays no part and a frame costs what was written in it.

use xxhash_rust::xxh3::xxh3_64_with_seed;

/// What one node adds to the sum.
#[derive(Clone, Debug, Default)]
pub(super) struct NodeShares {
    /// The node's number in the application.
    pub(super) number: u64,
    /// Of its type and name.
    pub(super) own: u64,
    /// By the field's index in the application; zero where none is.
    pub(super) fields: Vec<u64>,
}

/// Of all nodes, by their slot in the application.
#[derive(Debug, Default)]
pub(super) struct Shares {
    pub(super) nodes: Vec<Option<NodeShares>>,
    sum: u64,
}

/// What a field adds.
pub(super) fn field_share(number: u64, index: u16, bytes: &[u8]) -> u64 {
    xxh3_64_with_seed(bytes, number.rotate_left(17) ^ (index as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15)).max(1)
}

/// What a route adds.
pub(super) fn route_share(from: (u64, u16), to: (u64, u16), weak: bool) -> u64 {
    let words = [from.0, from.1 as u64, to.0, to.1 as u64, weak as u64];
    xxh3_64_with_seed(&words.map(u64::to_le_bytes).concat(), 1)
}

impl Shares {
    pub(super) fn sum(&self) -> u64 {
        self.sum
    }

    pub(super) fn add(&mut self, share: u64) {
        self.sum = self.sum.wrapping_add(share);
    }

    pub(super) fn subtract(&mut self, share: u64) {
        self.sum = self.sum.wrapping_sub(share);
    }

    /// Begins a node.
    pub(super) fn insert(&mut self, number: u64) {
        let slot = number as u32 as usize;
        if self.nodes.len() <= slot {
            self.nodes.resize_with(slot + 1, || None);
        }
        self.nodes[slot] = Some(NodeShares { number, ..NodeShares::default() });
    }

    /// Takes a node out, with all that it added.
    pub(super) fn remove(&mut self, number: u64) {
        let Some(place) = self.nodes.get_mut(number as u32 as usize) else { return };
        if let Some(node) = place.take_if(|node| node.number == number) {
            self.subtract(node.fields.iter().fold(node.own, |sum, share| sum.wrapping_add(*share)));
        }
    }

    pub(super) fn set_own(&mut self, number: u64, type_name: &str, name: &str) {
        let own = xxh3_64_with_seed(name.as_bytes(), !number) ^ xxh3_64_with_seed(type_name.as_bytes(), number);
        if let Some(node) = self.node_mut(number) {
            let before = std::mem::replace(&mut node.own, own);
            self.sum = self.sum.wrapping_sub(before).wrapping_add(own);
        }
    }

    /// Sets what a field adds; zero takes it out.
    pub(super) fn set_field(&mut self, number: u64, index: u16, share: u64) {
        let Some(node) = self.node_mut(number) else { return };
        if node.fields.len() <= index as usize {
            node.fields.resize(index as usize + 1, 0);
        }
        let before = std::mem::replace(&mut node.fields[index as usize], share);
        self.sum = self.sum.wrapping_sub(before).wrapping_add(share);
    }

    pub(super) fn field(&self, number: u64, index: u16) -> u64 {
        let node = self.nodes.get(number as u32 as usize).and_then(Option::as_ref);
        node.and_then(|node| node.fields.get(index as usize)).copied().unwrap_or(0)
    }

    fn node_mut(&mut self, number: u64) -> Option<&mut NodeShares> {
        self.nodes.get_mut(number as u32 as usize)?.as_mut().filter(|node| node.number == number)
    }
}
