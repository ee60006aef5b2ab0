//! The one question: what was written after revision N? A bounded log of the nodes that were written, in segments between the
//! revisions that readers asked for.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::graph::slot_of;
use crate::{Graph, NodeId};

/// Counts writes: every write takes the next one. Zero is before the first.
pub type Revision = u64;

/// What was written since a revision.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Changes {
    /// Nodes written, created or deleted, each once; of those that do not exist any more, only the id is left.
    Nodes(Vec<NodeId>),
    /// The revision is too old to know: look at all nodes.
    All,
}

/// A log shorter than this is never cut.
const SMALLEST_LIMIT: usize = 65_536;

/// Nodes side by side that are looked at together.
const BLOCK: usize = 64;

/// Appends a run to others that end before it.
pub(crate) fn append_run(runs: &mut Vec<Range<u32>>, run: Range<u32>) {
    match runs.last_mut() {
        Some(last) if last.end == run.start => last.end = run.end,
        _ => runs.push(run),
    }
}

/// Who was written when.
#[derive(Debug, Default)]
pub(crate) struct ChangeLog {
    /// Of the last write.
    revision: Revision,
    /// Of the last time that a node came, went, was named or shown to replicas, or that a field was added or removed.
    shape: Revision,
    /// By node slot: the revision of the node's last write.
    nodes: Vec<Revision>,
    /// The last revision that a reader asked for. A node is logged again only if it was not written since.
    boundary: AtomicU64,
    /// Slots of nodes, in the order of their first write after their segment's boundary.
    log: VecDeque<u32>,
    /// Boundary, and where in the log its segment starts, counted from the first entry ever logged.
    segments: VecDeque<(Revision, usize)>,
    /// How many entries were dropped from the front of the log.
    dropped: usize,
    deleted: VecDeque<(Revision, NodeId)>,
    /// Questions about older revisions cannot be answered.
    floor: Revision,
}

impl ChangeLog {
    /// The next revision, for a write that happens now.
    #[inline]
    pub(crate) fn next(&mut self) -> Revision {
        self.revision += 1;
        self.revision
    }

    /// Takes over the revisions that a run of writes counted for itself.
    #[inline]
    pub(crate) fn catch_up(&mut self, revision: Revision) {
        self.revision = revision;
    }

    /// The revision of the last write, without making it a boundary.
    #[inline]
    pub(crate) fn last(&self) -> Revision {
        self.revision
    }

    /// The revision of the last write, for a reader who will ask what changed since.
    pub(crate) fn boundary(&self) -> Revision {
        self.boundary.store(self.revision, Ordering::Relaxed);
        self.revision
    }

    /// When nodes, their names and their fields were last what they had not been before.
    pub(crate) fn shape(&self) -> Revision {
        self.shape
    }

    /// Notes a write after which a node is made of something else than before, whatever its fields hold.
    pub(crate) fn reshaped(&mut self, slot: u32, revision: Revision) {
        self.shape = revision;
        self.wrote(slot, revision);
    }

    pub(crate) fn node(&self, slot: u32) -> Revision {
        self.nodes[slot as usize]
    }

    pub(crate) fn grow(&mut self, slots: usize) {
        if self.nodes.len() < slots {
            self.nodes.resize(slots, 0);
        }
    }

    /// Notes a write of a node.
    #[inline]
    pub(crate) fn wrote(&mut self, slot: u32, revision: Revision) {
        let boundary = *self.boundary.get_mut();
        let last = &mut self.nodes[slot as usize];
        let unlogged = *last <= boundary;
        *last = revision;
        if unlogged {
            self.append(slot, boundary);
        }
    }

    /// Notes a write of nodes whose slots lie beside each other.
    #[inline]
    pub(crate) fn wrote_all(&mut self, slots: Range<usize>, revision: Revision) {
        let boundary = *self.boundary.get_mut();
        let last = &mut self.nodes[slots.clone()];
        let logged = last.iter().filter(|last| **last > boundary).count();
        if logged > 0 && logged < slots.len() {
            return slots.for_each(|slot| self.wrote(slot as u32, revision));
        }
        last.fill(revision);
        if logged == 0 {
            let mut slots = slots.map(|slot| slot as u32);
            slots.next().into_iter().for_each(|first| self.append(first, boundary));
            self.log.extend(slots);
        }
    }

    /// Notes a write of so many nodes whose slots lie in equal steps.
    pub(crate) fn wrote_in_steps(&mut self, first: usize, step: usize, count: usize, revision: Revision) {
        if step == 1 {
            return self.wrote_all(first..first + count, revision);
        }
        let boundary = *self.boundary.get_mut();
        for slot in (first..).step_by(step).take(count) {
            if std::mem::replace(&mut self.nodes[slot], revision) <= boundary {
                self.append(slot as u32, boundary);
            }
        }
    }

    /// The last revision that a reader asked for, and the nodes' revisions; who writes these logs those who were not written since.
    pub(crate) fn parts(&mut self) -> (Revision, &mut [Revision]) {
        (*self.boundary.get_mut(), &mut self.nodes)
    }

    /// Notes nodes that were not written since the last revision that a reader asked for.
    pub(crate) fn log(&mut self, slots: &[u32]) {
        let boundary = *self.boundary.get_mut();
        if let Some((first, others)) = slots.split_first() {
            self.append(*first, boundary);
            self.log.extend(others);
        }
    }

    #[inline]
    fn append(&mut self, slot: u32, boundary: Revision) {
        if self.segments.back().is_none_or(|(start, _)| *start != boundary) {
            self.segments.push_back((boundary, self.dropped + self.log.len()));
            self.cut();
        }
        self.log.push_back(slot);
    }

    pub(crate) fn deleted(&mut self, id: NodeId, revision: Revision) {
        self.shape = revision;
        self.deleted.push_back((revision, id));
        if self.deleted.len() > self.limit() {
            self.floor = self.floor.max(self.deleted[self.deleted.len() / 2].0);
            self.forget_below_floor();
        }
    }

    /// All node revisions by slot, for a snapshot.
    pub(crate) fn by_node(&self) -> &[Revision] {
        &self.nodes
    }

    /// Takes the place of a fresh log: readers must look at everything.
    pub(crate) fn restore(&mut self, revision: Revision, nodes: Vec<Revision>) {
        *self = Self { revision, shape: revision, nodes, boundary: AtomicU64::new(revision), floor: revision, ..Self::default() };
    }

    fn limit(&self) -> usize {
        SMALLEST_LIMIT.max(4 * self.nodes.len())
    }

    /// Drops the older half once the log is too long.
    fn cut(&mut self) {
        if self.log.len() <= self.limit() {
            return;
        }
        let keep_from = self.dropped + self.log.len() / 2;
        let first_kept = self.segments.partition_point(|(_, start)| *start < keep_from).min(self.segments.len() - 1);
        self.floor = self.floor.max(self.segments[first_kept].0);
        self.forget_below_floor();
    }

    fn forget_below_floor(&mut self) {
        let floor = self.floor;
        // The segment that the floor lies in must stay.
        let first_kept = self.segments.partition_point(|(boundary, _)| *boundary <= floor).saturating_sub(1);
        self.segments.drain(..first_kept);
        if let Some((_, start)) = self.segments.front() {
            self.log.drain(..start - self.dropped);
            self.dropped = *start;
        }
        let gone = self.deleted.partition_point(|(revision, _)| *revision <= floor);
        self.deleted.drain(..gone);
    }

    /// The segment that a revision lies in, and where in the log it starts.
    fn segment(&self, revision: Revision) -> (usize, usize) {
        let segment = self.segments.partition_point(|(boundary, _)| *boundary <= revision).saturating_sub(1);
        (segment, self.segments.get(segment).map_or(0, |(_, start)| start - self.dropped))
    }

    /// Slots of nodes written after a revision, those side by side together, in ascending order, whether or not anything stands there still.
    pub(crate) fn slots_since(&self, revision: Revision) -> Vec<Range<u32>> {
        let mut runs = Vec::new();
        if revision >= self.revision {
            return runs;
        }
        let is_new = |slot: &u32| self.nodes[*slot as usize] > revision;
        let (_, start) = self.segment(revision);
        // Looking at all nodes in a row takes no longer than sorting an eighth of them.
        if revision < self.floor || (self.log.len() - start) * 8 > self.nodes.len() {
            for (first, nodes) in (0..).step_by(BLOCK).zip(self.nodes.chunks(BLOCK)) {
                let slots = first..first + nodes.len() as u32;
                match nodes.iter().filter(|node| **node > revision).count() {
                    0 => {}
                    count if count == nodes.len() => append_run(&mut runs, slots),
                    _ => slots.filter(is_new).for_each(|slot| append_run(&mut runs, slot..slot + 1)),
                }
            }
            return runs;
        }
        let mut slots: Vec<u32> = self.log.range(start..).copied().filter(is_new).collect();
        slots.sort_unstable();
        slots.dedup();
        slots.into_iter().for_each(|slot| append_run(&mut runs, slot..slot + 1));
        runs
    }

    /// Nodes written or deleted after a revision. `ids` by slot; dead slots hold null.
    pub(crate) fn since(&self, revision: Revision, ids: &[NodeId]) -> Changes {
        if revision < self.floor {
            return Changes::All;
        }
        if revision >= self.revision {
            return Changes::Nodes(Vec::new());
        }
        let (segment, start) = self.segment(revision);
        let mut slots: Vec<u32> = self.log.range(start..).copied().filter(|slot| self.nodes[*slot as usize] > revision).collect();
        if segment + 1 < self.segments.len() {
            slots.sort_unstable();
            slots.dedup();
        }
        let deleted = self.deleted.partition_point(|(at, _)| *at <= revision);
        let dead = self.deleted.range(deleted..).map(|(_, id)| *id);
        let alive = slots.into_iter().map(|slot| ids[slot as usize]).filter(|id| *id != NodeId::default());
        Changes::Nodes(alive.chain(dead).collect())
    }

    /// For tests: lengths of log and deletions, which are bounded by the limit.
    pub(crate) fn check(&self) -> Result<(), String> {
        if self.log.len() > 2 * self.limit() || self.deleted.len() > self.limit() + 1 {
            return Err(format!("the change log holds {} entries and {} deletions", self.log.len(), self.deleted.len()));
        }
        let ordered = self.segments.iter().zip(self.segments.iter().skip(1)).all(|(a, b)| a.0 < b.0 && a.1 < b.1);
        if !ordered || self.segments.front().is_some_and(|(_, start)| *start != self.dropped) {
            return Err("the segments of the change log are out of order".into());
        }
        Ok(())
    }
}

impl Graph {
    /// The revision of the last write. Ask [`Graph::changes_since`] with it later.
    pub fn revision(&self) -> Revision {
        self.changes.boundary()
    }

    /// The revision of the last write of any of the node's fields, of its name, or of its creation; 0 for a deleted node.
    pub fn node_revision(&self, id: NodeId) -> Revision {
        if self.contains(id) { self.changes.node(slot_of(id)) } else { 0 }
    }

    /// Which nodes were written, created, or deleted after a revision.
    pub fn changes_since(&self, revision: Revision) -> Changes {
        self.changes.since(revision, &self.ids)
    }
}
