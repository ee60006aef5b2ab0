//! Whose turn it is: flags, ranks and the set of nodes that wait for their turn in this frame or the next.

use std::ops::Range;

use crate::bits::BitSet;
use crate::changes::Revision;

/// The node has an evaluate that changes trigger.
pub(crate) const EVALUATES: u8 = 1;
/// Routes leave the node.
pub(crate) const ROUTED: u8 = 2;
/// Somebody observes one of the node's fields.
pub(crate) const OBSERVED: u8 = 4;
/// The node waits for its turn.
pub(crate) const DIRTY: u8 = 8;
/// It is the node's turn: its own writes do not ask for another one.
pub(crate) const IN_TURN: u8 = 16;
/// Some fields were last written silently.
pub(crate) const SILENCED: u8 = 32;
/// A function evaluates the node.
pub(crate) const NATIVE: u8 = 64;
/// Somebody has to hear of the node's changes.
const INTEREST: u8 = EVALUATES | ROUTED | OBSERVED;

/// True if somebody has to hear of a write of a node with such flags, who does not wait for that already.
#[inline]
pub(crate) fn is_news(flags: u8) -> bool {
    flags & INTEREST != 0 && flags & (DIRTY | IN_TURN) == 0
}

/// The node has no place in the order.
pub(crate) const NO_RANK: u32 = u32::MAX;

/// What is known of a node's turns. Never across two cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(crate) struct Turn {
    /// Writes up to this revision were copied along routes.
    pub(crate) propagated: Revision,
    /// Writes up to this revision were seen by evaluate.
    pub(crate) evaluated: Revision,
    /// The frame of the last turn.
    pub(crate) frame: u64,
    pub(crate) rank: u32,
    /// How often the node was evaluated.
    pub(crate) count: u32,
}

impl Turn {
    /// Notes an evaluation.
    #[inline]
    pub(crate) fn had(&mut self, frame: u64, revision: Revision) {
        (self.frame, self.evaluated, self.count) = (frame, revision, self.count.wrapping_add(1));
    }
}

#[derive(Debug, Default)]
pub(crate) struct Schedule {
    /// By node slot, beside each other because every write reads them.
    pub(crate) flags: Vec<u8>,
    /// By node slot.
    pub(crate) turns: Vec<Turn>,
    /// By rank: the node's slot, or `NO_RANK` where the node is gone. A topological order of the strong routes unless `stale`.
    pub(crate) by_rank: Vec<u32>,
    /// A route contradicts the ranks: make them anew before the next turn.
    pub(crate) stale: bool,
    /// Ranks of nodes that wait for their turn in this frame.
    queue: BitSet,
    /// Slots of nodes that wait for the next frame.
    pub(crate) pending: Vec<u32>,
    pub(crate) frame: u64,
    pub(crate) running: bool,
    /// Ranks without a node, and nodes that came after the last numbering.
    pub(crate) holes: usize,
    /// Where the levels of the order end, by rank: nodes of a level have no strong routes between each other, and are in the order of their
    /// slots. Nodes that came later follow.
    pub(crate) levels: Vec<u32>,
    /// Counts what may change where the values of a level's nodes lie.
    pub(crate) layout: u64,
}

impl Schedule {
    pub(crate) fn grow(&mut self, slots: usize) {
        if self.flags.len() < slots {
            self.flags.resize(slots, 0);
            self.turns.resize(slots, Turn { propagated: 0, evaluated: 0, frame: 0, rank: NO_RANK, count: 0 });
        }
    }

    /// Starts the life of a node.
    pub(crate) fn created(&mut self, slot: u32, flags: u8, revision: Revision) {
        self.flags[slot as usize] = flags;
        self.turns[slot as usize] = Turn { propagated: revision, evaluated: revision, frame: 0, rank: NO_RANK, count: 0 };
    }

    /// Ends it.
    pub(crate) fn deleted(&mut self, slot: u32) {
        let rank = self.turns[slot as usize].rank;
        if rank != NO_RANK {
            self.queue.remove(rank as usize);
            self.by_rank[rank as usize] = NO_RANK;
            self.made_hole();
        }
        self.created(slot, 0, 0);
        // Slots of nodes that came and went without a frame must not pile up.
        if self.pending.len() > 2 * self.flags.len() + 64 {
            self.pending.sort_unstable();
            self.pending.dedup();
            self.pending.retain(|slot| self.flags[*slot as usize] & DIRTY != 0);
        }
    }

    /// Asks for a turn if anybody would hear of it: in this frame, or in the next if the node had its turn already.
    #[inline(always)]
    pub(crate) fn mark(&mut self, slot: u32) {
        if is_news(self.flags[slot as usize]) {
            self.enqueue(slot);
        }
    }

    /// Marks nodes whose slots lie beside each other.
    #[inline]
    pub(crate) fn mark_all(&mut self, slots: Range<usize>) {
        let any = self.flags[slots.clone()].iter().fold(0, |any, flags| any | flags);
        if any & INTEREST != 0 {
            slots.for_each(|slot| self.mark(slot as u32));
        }
    }

    /// The rank of the first node that waits for its turn in this frame, or `usize::MAX`.
    #[inline]
    pub(crate) fn lowest_waiting(&self) -> usize {
        self.queue.lowest().unwrap_or(usize::MAX)
    }

    /// Asks for a turn even if nobody would hear of it.
    #[inline]
    pub(crate) fn enqueue(&mut self, slot: u32) {
        self.flags[slot as usize] |= DIRTY;
        let turn = &self.turns[slot as usize];
        if self.running && turn.frame != self.frame && turn.rank != NO_RANK {
            self.queue.insert(turn.rank as usize);
        } else {
            self.pending.push(slot);
        }
    }

    /// Asks for a turn in the next frame.
    pub(crate) fn again(&mut self, slot: u32) {
        self.flags[slot as usize] |= DIRTY;
        self.pending.push(slot);
    }

    /// True if no node waits.
    pub(crate) fn is_idle(&self) -> bool {
        self.pending.is_empty()
    }

    /// Gives all that wait a place in the order, and asks for a new order once as many came since the last one as it has.
    pub(crate) fn rank_pending(&mut self) {
        for at in 0..self.pending.len() {
            let slot = self.pending[at];
            if self.flags[slot as usize] & DIRTY != 0 {
                self.ranked(slot);
            }
        }
        self.stale |= self.is_disordered();
    }

    /// The end of the level that a rank lies in; none for nodes that came after the last numbering.
    pub(crate) fn level_end(&self, rank: usize) -> Option<usize> {
        let level = self.levels.partition_point(|end| *end as usize <= rank);
        self.levels.get(level).map(|end| *end as usize)
    }

    /// By rank, the slots of the level with this end.
    pub(crate) fn level(&self, end: usize) -> &[u32] {
        let before = self.levels.partition_point(|other| (*other as usize) < end);
        let start = before.checked_sub(1).map_or(0, |before| self.levels[before] as usize);
        &self.by_rank[start..end]
    }

    /// How many nodes wait for their turn in this frame.
    #[inline]
    pub(crate) fn waiting(&self) -> usize {
        self.queue.len()
    }

    /// Gives those that wait and come before a rank, and whose flags fit, their turn together, unless they are fewer than some.
    pub(crate) fn take_together(&mut self, end: usize, slots: &mut Vec<u32>, fits: impl Fn(u8) -> bool, least: usize) {
        let (by_rank, flags) = (&self.by_rank, &self.flags);
        let fits = |rank: usize| fits(flags[by_rank[rank] as usize]);
        self.queue.members_below(end, |rank| slots.extend(fits(rank).then(|| by_rank[rank])));
        if slots.len() < least {
            return slots.clear();
        }
        self.queue.remove_below(end, fits);
        slots.iter().for_each(|slot| self.flags[*slot as usize] &= !DIRTY);
    }

    /// Starts a frame: all that wait get a place in the queue.
    pub(crate) fn start(&mut self) {
        self.frame += 1;
        self.running = true;
        let mut pending = std::mem::take(&mut self.pending);
        for slot in pending.drain(..) {
            if self.flags[slot as usize] & DIRTY != 0 {
                let rank = self.ranked(slot);
                self.queue.insert(rank as usize);
            }
        }
        // Marks during the drain are impossible, so the allocation can be kept.
        self.pending = pending;
    }

    /// The node that is next, by slot. It is not dirty any more.
    #[inline]
    pub(crate) fn next(&mut self) -> Option<u32> {
        let slot = self.by_rank[self.queue.pop_lowest()?];
        self.flags[slot as usize] &= !DIRTY;
        self.turns[slot as usize].frame = self.frame;
        Some(slot)
    }

    /// The node's rank; at the end of the order if it had none.
    pub(crate) fn ranked(&mut self, slot: u32) -> u32 {
        let turn = &mut self.turns[slot as usize];
        if turn.rank == NO_RANK {
            turn.rank = self.by_rank.len() as u32;
            self.by_rank.push(slot);
            self.holes += 1;
            self.queue.reserve(self.by_rank.len());
        }
        self.turns[slot as usize].rank
    }

    /// Moves a node behind all others.
    pub(crate) fn move_to_end(&mut self, slot: u32) {
        let old = self.turns[slot as usize].rank;
        let waits = self.waits(slot);
        if old != NO_RANK {
            self.queue.remove(old as usize);
            self.by_rank[old as usize] = NO_RANK;
            self.turns[slot as usize].rank = NO_RANK;
            self.made_hole();
        }
        let rank = self.ranked(slot);
        if waits {
            self.queue.insert(rank as usize);
        }
    }

    fn is_disordered(&self) -> bool {
        self.holes > 64 && self.holes > self.by_rank.len() / 2
    }

    /// Too many holes are a reason to number anew.
    fn made_hole(&mut self) {
        self.holes += 1;
        self.stale |= self.is_disordered();
    }

    /// Replaces the order; every node that waits in this frame must have a place in it.
    pub(crate) fn set_order(&mut self, order: Vec<u32>, levels: Vec<u32>) {
        let waiting: Vec<u32> = std::iter::from_fn(|| self.queue.pop_lowest()).map(|rank| self.by_rank[rank]).collect();
        for slot in std::mem::replace(&mut self.by_rank, order) {
            if slot != NO_RANK {
                self.turns[slot as usize].rank = NO_RANK;
            }
        }
        for (rank, slot) in self.by_rank.iter().enumerate() {
            self.turns[*slot as usize].rank = rank as u32;
        }
        self.queue.reserve(self.by_rank.len());
        for slot in waiting {
            let rank = self.ranked(slot);
            self.queue.insert(rank as usize);
        }
        (self.stale, self.holes, self.levels) = (false, 0, levels);
        self.layout += 1;
    }

    /// Takes an order with its holes from a snapshot, between frames.
    pub(crate) fn restore_order(&mut self, by_rank: Vec<u32>, levels: Vec<u32>) {
        self.queue.reserve(by_rank.len());
        (self.by_rank, self.levels) = (by_rank, levels);
        self.layout += 1;
    }

    /// True if the node will have a turn in this frame.
    pub(crate) fn waits(&self, slot: u32) -> bool {
        let rank = self.turns[slot as usize].rank;
        rank != NO_RANK && self.queue.contains(rank as usize)
    }
}
