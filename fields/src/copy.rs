//! Running copy lists: chains of single copies in one loop, neighbours as blocks of memory.

use std::ops::Range;

use crate::changes::{ChangeLog, Revision};
use crate::column::{Column, Columns};
use crate::kind::for_each_kind;
use crate::program::{Group, Programs, Run};
use crate::schedule::{ROUTED, Schedule};
use crate::trail::Link;
use crate::{FieldType, FieldValue, Kind};

/// Shorter runs are copied one by one.
const BLOCK_FROM: usize = 8;
/// So many at a time, that the second look at a block finds it in the first cache.
const BLOCK: usize = 1024;

/// All that a copy touches.
pub(crate) struct Copier<'a> {
    pub(crate) columns: &'a mut Columns,
    pub(crate) changes: &'a mut ChangeLog,
    pub(crate) schedule: &'a mut Schedule,
}

impl Copier<'_> {
    /// Copies the group's source to its direct targets, unless they were written later than the source; gives how many it wrote.
    fn direct<T: FieldValue>(&mut self, group: &Group, written: Revision, revision: Revision) -> usize {
        let value = T::column(self.columns).values[group.source as usize].clone();
        group.direct.iter().map(|run| self.run(run, &value, written, revision)).sum()
    }

    #[inline]
    fn run<T: FieldValue>(&mut self, run: &Run, value: &T, written: Revision, revision: Revision) -> usize {
        let (slot, node, count) = (run.slot as usize, run.node as usize, run.count as usize);
        if count < BLOCK_FROM || std::mem::needs_drop::<T>() {
            return (0..count).filter(|at| self.one(slot + at, node + at, run.compare, value, written, revision)).count();
        }
        let mut copied = 0;
        for start in (0..count).step_by(BLOCK) {
            let block = start..count.min(start + BLOCK);
            let (slots, nodes) = (slot + block.start..slot + block.end, node + block.start..node + block.end);
            if block_is_due(T::column(self.columns), slots.clone(), run.compare, value, written) {
                let column = T::column_mut(self.columns);
                column.values[slots.clone()].fill(value.clone());
                column.revisions[slots].fill(revision);
                self.changes.wrote_all(nodes.clone(), revision);
                self.schedule.mark_all(nodes);
                copied += block.len();
            } else {
                let one = |at: &usize| self.one(slot + at, node + at, run.compare, value, written, revision);
                copied += block.filter(one).count();
            }
        }
        copied
    }

    #[inline]
    fn one<T: FieldValue>(
        &mut self,
        slot: usize,
        node: usize,
        compare: bool,
        value: &T,
        written: Revision,
        revision: Revision,
    ) -> bool {
        let column = T::column_mut(self.columns);
        if column.revisions[slot] >= written || compare && column.values[slot].same(value) {
            return false;
        }
        column.values[slot] = value.clone();
        column.revisions[slot] = revision;
        self.changes.wrote(node as u32, revision);
        self.schedule.mark(node as u32);
        true
    }

    /// Follows a chain: the turn of a node with one copy, and then of its target, as long as that does nothing else and is next.
    #[inline]
    fn hops<T: FieldValue>(&mut self, programs: &Programs, mut slot: u32) -> usize {
        let mut copied = 0;
        while let Some(hop) = programs.hop(slot)
            && hop.field_type == T::TYPE
        {
            let column = T::column_mut(self.columns);
            let (source, target) = (hop.source as usize, hop.target as usize);
            let before = std::mem::replace(&mut self.schedule.turns[slot as usize].propagated, self.changes.last());
            let written = column.revisions[source];
            if written <= before || column.revisions[target] >= written {
                return copied;
            }
            let value = column.values[source].clone();
            if hop.compare && column.values[target].same(&value) {
                return copied;
            }
            let revision = self.changes.next();
            column.revisions[target] = revision;
            column.values[target] = value.clone();
            self.changes.wrote(hop.node, revision);
            let links = programs.after(slot);
            let followed = self.follow(hop.node, links, hop.compare, &value);
            copied += 1 + followed;
            if followed < links.len() {
                return copied;
            }
            slot = links.last().map_or(hop.node, |link| link.node);
            if !self.takes_turn(slot, programs.hop(slot).is_some_and(|hop| hop.field_type == T::TYPE)) {
                return copied;
            }
        }
        copied
    }

    /// Has the turns of a node and of those behind it on its trail, each of which copies a value that is new to the node; ends where a node has
    /// more to do or is not next, or where the target held the value. Gives how many links it wrote.
    #[inline]
    fn follow<T: FieldValue>(&mut self, mut node: u32, links: &[Link], compare: bool, value: &T) -> usize {
        let column = T::column_mut(self.columns);
        let (frame, lowest_waiting) = (self.schedule.frame, self.schedule.lowest_waiting());
        let mut revision = self.changes.last();
        let mut copied = 0;
        for link in links {
            let turn = &mut self.schedule.turns[node as usize];
            // Only routes, and not waiting; a node without a rank fails the comparison.
            let next =
                self.schedule.flags[node as usize] == ROUTED && turn.frame != frame && (turn.rank as usize) < lowest_waiting;
            if !next {
                self.changes.catch_up(revision);
                self.schedule.mark(node);
                return copied;
            }
            (turn.frame, turn.propagated) = (frame, revision);
            let target = &mut column.values[link.slot as usize];
            if compare && target.same(value) {
                break;
            }
            revision += 1;
            *target = value.clone();
            column.revisions[link.slot as usize] = revision;
            self.changes.wrote(link.node, revision);
            copied += 1;
            node = link.node;
        }
        self.changes.catch_up(revision);
        copied
    }

    /// Gives a node its turn at once, if it only has routes and is next, and the chain can go on; marks it otherwise.
    #[inline]
    fn takes_turn(&mut self, node: u32, goes_on: bool) -> bool {
        let (frame, lowest_waiting) = (self.schedule.frame, self.schedule.lowest_waiting());
        let turn = &mut self.schedule.turns[node as usize];
        let next = self.schedule.flags[node as usize] == ROUTED && turn.frame != frame && (turn.rank as usize) < lowest_waiting;
        if goes_on && next {
            turn.frame = frame;
        } else {
            self.schedule.mark(node);
        }
        goes_on && next
    }
}

/// True if every target of a block would be written. Signs of differences, because they are what every processor computes side by side.
#[inline]
fn block_is_due<T: FieldValue>(column: &Column<T>, slots: Range<usize>, compare: bool, value: &T, written: Revision) -> bool {
    let older = column.revisions[slots.clone()].iter().fold(u64::MAX, |all, revision| all & revision.wrapping_sub(written));
    let differ = || column.values[slots].iter().fold(true, |all, old| all & !old.same(value));
    older >> 63 == 1 && (!compare || differ())
}

macro_rules! by_type {
    ($(($one:ident, $many:ident, $type:ty, $one_column:ident, $many_column:ident, $name:literal, $default:expr))*) => {
        impl Copier<'_> {
            /// Copies the group's source, last written at a revision, to its direct targets; gives how many it wrote.
            #[inline]
            pub(crate) fn group(&mut self, group: &Group, written: Revision, revision: Revision) -> usize {
                match (group.field_type.kind, group.field_type.multiple) { $(
                    (Kind::$one, false) => self.direct::<$type>(group, written, revision),
                    (Kind::$one, true) => self.direct::<std::sync::Arc<[$type]>>(group, written, revision),
                )* }
            }

            /// Has the turn of a node that does nothing but one copy, and the turns of the chain that it starts; gives how many it wrote.
            #[inline]
            pub(crate) fn chain(&mut self, FieldType { kind, multiple }: FieldType, programs: &Programs, slot: u32) -> usize {
                match (kind, multiple) { $(
                    (Kind::$one, false) => self.hops::<$type>(programs, slot),
                    (Kind::$one, true) => self.hops::<std::sync::Arc<[$type]>>(programs, slot),
                )* }
            }
        }
    };
}
for_each_kind!(by_type);
