//! Copy lists: what a node's routes come down to, made when the node has its turn and thrown away when its routes change.

use crate::changes::{ChangeLog, Revision};
use crate::column::Columns;
use crate::graph::slot_of;
use crate::kind::for_each_kind;
use crate::schedule::Schedule;
use crate::{FieldType, FieldValue, Graph, Kind, NodeId, RouteId, SetRule, Strength};

/// A copy into a field of the source's type, to which no other route goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Copy {
    /// The target's place in the column.
    pub(crate) slot: u32,
    /// The target's node.
    pub(crate) node: u32,
    pub(crate) compare: bool,
}

/// What happens when one field was written.
#[derive(Debug, PartialEq)]
pub(crate) struct Group {
    pub(crate) index: u16,
    pub(crate) field_type: FieldType,
    /// The source's place in the column.
    pub(crate) source: u32,
    /// In the order of the column.
    pub(crate) direct: Box<[Copy]>,
    /// Strong routes that convert, clamp, or share their target with others; in the order in which they were made.
    pub(crate) slow: Box<[RouteId]>,
    pub(crate) weak: Box<[RouteId]>,
}

/// The groups of one node, in the order of its fields.
pub(crate) type Program = Box<[Group]>;

/// The programs that are up to date, by node slot.
#[derive(Debug, Default)]
pub(crate) struct Programs {
    made: Vec<Option<Program>>,
}

impl Programs {
    pub(crate) fn grow(&mut self, slots: usize) {
        if self.made.len() < slots {
            self.made.resize_with(slots, || None);
        }
    }

    pub(crate) fn forget(&mut self, slot: u32) {
        self.made[slot as usize] = None;
    }

    /// Takes a program out, for the time in which it runs.
    #[inline]
    pub(crate) fn take(&mut self, slot: u32) -> Option<Program> {
        self.made[slot as usize].take()
    }

    #[inline]
    pub(crate) fn put(&mut self, slot: u32, program: Program) {
        self.made[slot as usize] = Some(program);
    }

    pub(crate) fn get(&self, slot: u32) -> Option<&Program> {
        self.made[slot as usize].as_ref()
    }
}

impl Graph {
    /// The program of a node's routes.
    pub(crate) fn compile(&self, id: NodeId) -> Program {
        let mut routes: Vec<_> = self.nodes[id].outgoing.iter().map(|route| (*route, &self.routes.all[*route])).collect();
        routes.sort_unstable_by_key(|(_, route)| (route.from.index, route.ordinal));
        routes.chunk_by(|(_, a), (_, b)| a.from.index == b.from.index).filter_map(|chunk| self.group(chunk)).collect()
    }

    fn group(&self, routes: &[(RouteId, &crate::Route)]) -> Option<Group> {
        let from = routes.first()?.1.from;
        let (declared, source) = self.place(from).ok()?;
        let (mut direct, mut slow, mut weak) = (Vec::new(), Vec::new(), Vec::new());
        for (id, route) in routes {
            let (target, slot) = self.place(route.to).ok()?;
            if route.strength == Strength::Weak {
                weak.push(*id);
            } else if target.field_type != declared.field_type || target.range.is_some() || self.is_fan_in(route.to) {
                slow.push(*id);
            } else {
                direct.push(Copy { slot, node: slot_of(route.to.node), compare: target.on_set == SetRule::Compare });
            }
        }
        direct.sort_unstable_by_key(|copy| copy.slot);
        let (direct, slow, weak) = (direct.into(), slow.into(), weak.into());
        Some(Group { index: from.index, field_type: declared.field_type, source, direct, slow, weak })
    }
}

/// Copies the group's source to its direct targets, unless they were written later than the source; gives how many it wrote.
fn copy_direct<T: FieldValue>(
    columns: &mut Columns,
    changes: &mut ChangeLog,
    schedule: &mut Schedule,
    group: &Group,
    written: Revision,
    revision: Revision,
) -> usize {
    let column = T::column_mut(columns);
    let value = column.values[group.source as usize].clone();
    let mut copied = 0;
    for copy in &group.direct {
        let slot = copy.slot as usize;
        if column.revisions[slot] >= written || copy.compare && column.values[slot].same(&value) {
            continue;
        }
        column.values[slot] = value.clone();
        column.revisions[slot] = revision;
        changes.wrote(copy.node, revision);
        schedule.mark(copy.node);
        copied += 1;
    }
    copied
}

macro_rules! copy_group {
    ($(($one:ident, $many:ident, $type:ty, $one_column:ident, $many_column:ident, $name:literal, $default:expr))*) => {
        /// Copies the group's source, last written at a revision, to its direct targets; gives how many it wrote.
        #[inline]
        pub(crate) fn copy_group(
            columns: &mut Columns,
            changes: &mut ChangeLog,
            schedule: &mut Schedule,
            group: &Group,
            written: Revision,
            revision: Revision,
        ) -> usize {
            match (group.field_type.kind, group.field_type.multiple) { $(
                (Kind::$one, false) => copy_direct::<$type>(columns, changes, schedule, group, written, revision),
                (Kind::$one, true) => copy_direct::<std::sync::Arc<[$type]>>(columns, changes, schedule, group, written, revision),
            )* }
        }
    };
}
for_each_kind!(copy_group);
