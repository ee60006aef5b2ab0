//! Copy lists: what a node's routes come down to, made when the node has its turn and thrown away when its routes change.

use crate::graph::slot_of;
use crate::{FieldType, Graph, NodeId, RouteId, SetRule, Strength};

/// Copies into fields of the source's type, to each of which no other route goes. Targets that lie beside each other, and belong to nodes that
/// do, are one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Run {
    /// The first target's place in the column.
    pub(crate) slot: u32,
    /// The first target's node.
    pub(crate) node: u32,
    pub(crate) count: u32,
    pub(crate) compare: bool,
}

/// The only copy of a node that does nothing else: a link of a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hop {
    /// The source's place in the column.
    pub(crate) source: u32,
    /// The target's place in it.
    pub(crate) target: u32,
    /// The target's node.
    pub(crate) node: u32,
    pub(crate) field_type: FieldType,
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
    pub(crate) direct: Box<[Run]>,
    /// Strong routes that convert, clamp, or share their target with others; in the order in which they were made.
    pub(crate) slow: Box<[RouteId]>,
    pub(crate) weak: Box<[RouteId]>,
}

/// What a node's routes come down to.
#[derive(Debug, Default, PartialEq)]
// Boxed lists keep a hop, which is what most nodes have, within 16 bytes.
#[allow(clippy::box_collection)]
pub(crate) enum Program {
    /// It must be made first.
    #[default]
    Unmade,
    /// One copy.
    Hop(Hop),
    /// The groups in the order of the node's fields, all of them direct.
    Direct(Box<Vec<Group>>),
    /// The same, with routes that need more than a copy.
    Mixed(Box<Vec<Group>>),
}

/// By node slot.
#[derive(Debug, Default)]
pub(crate) struct Programs {
    made: Vec<Program>,
}

impl Programs {
    pub(crate) fn grow(&mut self, slots: usize) {
        if self.made.len() < slots {
            self.made.resize_with(slots, Program::default);
        }
    }

    pub(crate) fn forget(&mut self, slot: u32) {
        self.made[slot as usize] = Program::Unmade;
    }

    /// Takes a program out, for the time in which it runs.
    #[inline]
    pub(crate) fn take(&mut self, slot: u32) -> Program {
        std::mem::take(&mut self.made[slot as usize])
    }

    #[inline]
    pub(crate) fn put(&mut self, slot: u32, program: Program) {
        self.made[slot as usize] = program;
    }

    #[inline]
    pub(crate) fn get(&self, slot: u32) -> &Program {
        &self.made[slot as usize]
    }
}

impl Graph {
    /// The program of a node's routes.
    pub(crate) fn compile(&self, id: NodeId) -> Program {
        let mut routes: Vec<_> = self.nodes[id].outgoing.iter().map(|route| (*route, &self.routes.all[*route])).collect();
        routes.sort_unstable_by_key(|(_, route)| (route.from.index, route.ordinal));
        let fields = routes.chunk_by(|(_, a), (_, b)| a.from.index == b.from.index);
        let groups: Vec<Group> = fields.filter_map(|routes| self.group(routes)).collect();
        if groups.iter().any(|group| !group.slow.is_empty() || !group.weak.is_empty()) {
            return Program::Mixed(Box::new(groups));
        }
        if let [Group { field_type, source, direct, .. }] = &groups[..]
            && let [Run { slot: target, node, count: 1, compare }] = direct[..]
        {
            return Program::Hop(Hop { source: *source, target, node, field_type: *field_type, compare });
        }
        Program::Direct(Box::new(groups))
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
                direct.push(Run { slot, node: slot_of(route.to.node), count: 1, compare: target.on_set == SetRule::Compare });
            }
        }
        let (direct, slow, weak) = (runs(direct), slow.into(), weak.into());
        Some(Group { index: from.index, field_type: declared.field_type, source, direct, slow, weak })
    }
}

/// Joins neighbours.
fn runs(mut copies: Vec<Run>) -> Box<[Run]> {
    copies.sort_unstable_by_key(|copy| copy.slot);
    copies.dedup_by(|next, run| {
        let follows = run.slot + run.count == next.slot && run.node + run.count == next.node && run.compare == next.compare;
        run.count += follows as u32;
        follows
    });
    copies.into()
}
