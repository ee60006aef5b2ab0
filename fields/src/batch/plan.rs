//! Plans: where a level may be cut, so that all that belongs to its nodes lies on either side, and each thread can have a side for itself.

use crate::column::Places;
use crate::schedule::NO_RANK;
use crate::{Evaluator, Graph};

/// Nodes between places where a level may be cut.
const BLOCK: usize = 16;

/// Where a level may be cut.
#[derive(Debug, Default)]
pub(super) struct Plan {
    pub(super) cuts: Vec<Cut>,
    /// What nodes copy along their routes lies on their side, too.
    pub(super) copies: bool,
    /// What it was made for.
    made_for: Option<(u64, u64)>,
}

/// Nodes before it and their values lie before these places, those after do not.
#[derive(Clone, Debug)]
pub(super) struct Cut {
    pub(super) node: u32,
    pub(super) places: Places,
}

/// The lowest place in each column, and the one behind the highest; the same of nodes.
#[derive(Clone)]
struct Bounds {
    low: Cut,
    high: Cut,
}

impl Bounds {
    fn none() -> Self {
        let all = |place| Cut { node: place, places: Places::filled(place) };
        Self { low: all(u32::MAX), high: all(0) }
    }

    fn join(self, other: &Self) -> Self {
        let low = Cut { node: self.low.node.min(other.low.node), places: self.low.places.each(&other.low.places, u32::min) };
        let high = Cut { node: self.high.node.max(other.high.node), places: self.high.places.each(&other.high.places, u32::max) };
        Self { low, high }
    }

    fn add_node(&mut self, node: u32) {
        (self.low.node, self.high.node) = (self.low.node.min(node), self.high.node.max(node + 1));
    }

    fn add_place(&mut self, field_type: crate::FieldType, place: u32) {
        let (low, high) = (self.low.places.of_mut(field_type), self.high.places.of_mut(field_type));
        (*low, *high) = ((*low).min(place), (*high).max(place + 1));
    }
}

impl Graph {
    /// Finds where the level that ends at a rank may be cut, unless that is known.
    pub(super) fn plan(&mut self, end: usize) {
        let now = Some((self.schedule.layout, self.programs.changed));
        if self.batches.levels.get(&end).is_some_and(|level| level.plan.made_for == now) {
            return;
        }
        let native = |slot: &u32| matches!(self.nodes[self.ids[*slot as usize]].node_type.evaluator, Evaluator::Native(_));
        let slots: Vec<u32> = self.schedule.level(end).iter().copied().filter(|slot| *slot != NO_RANK).filter(native).collect();
        self.make_programs(&slots);
        let (together, alone) = (self.cuts(&slots, true), self.cuts(&slots, false));
        let copies = 2 * together.len() >= alone.len();
        let plan = Plan { cuts: if copies { together } else { alone }, copies, made_for: now };
        self.batches.levels.entry(end).or_default().plan = plan;
    }

    fn cuts(&self, slots: &[u32], copies: bool) -> Vec<Cut> {
        let bounds = |block: &[u32]| {
            let mut bounds = Bounds::none();
            for slot in block {
                let node = &self.nodes[self.ids[*slot as usize]];
                bounds.add_node(*slot);
                for (index, field) in node.fields() {
                    bounds.add_place(field.field_type, node.slots[index as usize]);
                }
                if let Some(hop) = self.programs.hop(*slot).filter(|_| copies) {
                    bounds.add_node(hop.node);
                    bounds.add_place(hop.field_type, hop.target);
                }
            }
            bounds
        };
        let blocks: Vec<Bounds> = slots.chunks(BLOCK).map(bounds).collect();
        let mut after = vec![Bounds::none(); blocks.len() + 1];
        for (at, block) in blocks.iter().enumerate().rev() {
            after[at] = block.clone().join(&after[at + 1]);
        }
        let mut before = Bounds::none();
        let mut cuts = Vec::new();
        for (block, after) in blocks.iter().zip(&after[1..]).take(blocks.len().saturating_sub(1)) {
            before = before.join(block);
            if before.high.node <= after.low.node && before.high.places.all_up_to(&after.low.places) {
                cuts.push(before.high.clone());
            }
        }
        cuts
    }
}
