//! Copy lists: what a node's routes come down to, made when the node has its turn and thrown away when its routes change.

use crate::graph::slot_of;
use crate::schedule::{DIRTY, ROUTED};
use crate::trail::{LONGEST, Link, Trail, Trails};
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
    /// One copy that is part of a trail.
    Link { trail: u32, place: u32 },
    /// The groups in the order of the node's fields, all of them direct.
    Direct(Box<Vec<Group>>),
    /// The same, with routes that need more than a copy.
    Mixed(Box<Vec<Group>>),
}

/// By node slot.
#[derive(Debug, Default)]
pub(crate) struct Programs {
    made: Vec<Program>,
    trails: Trails,
    /// Counts programs that were thrown away.
    pub(crate) changed: u64,
}

impl Programs {
    pub(crate) fn grow(&mut self, slots: usize) {
        if self.made.len() < slots {
            self.made.resize_with(slots, Program::default);
        }
    }

    /// Throws a program away, with the trail that it is part of.
    pub(crate) fn forget(&mut self, slot: u32) {
        self.changed += 1;
        if let Program::Link { trail, .. } = std::mem::take(&mut self.made[slot as usize]) {
            for link in self.trails.remove(trail).sources() {
                self.made[link.node as usize] = Program::Unmade;
            }
        }
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

    /// The only copy of a node that does nothing else.
    #[inline]
    pub(crate) fn hop(&self, slot: u32) -> Option<Hop> {
        match self.made[slot as usize] {
            Program::Hop(hop) => Some(hop),
            Program::Link { trail, place } => Some(self.trails.get(trail).hop(place)),
            _ => None,
        }
    }

    /// What flows along a trail.
    #[inline]
    pub(crate) fn trail_type(&self, trail: u32) -> FieldType {
        self.trails.get(trail).field_type
    }

    /// The targets that follow that of a node, as far as they are in one trail with it.
    #[inline]
    pub(crate) fn after(&self, slot: u32) -> &[Link] {
        match self.made[slot as usize] {
            Program::Link { trail, place } => self.trails.get(trail).after(place),
            _ => &[],
        }
    }

    /// Makes a trail of links, which belongs to all of them but the last.
    fn lay(&mut self, trail: Trail) -> Program {
        let at = self.trails.insert(trail);
        for (place, link) in self.trails.get(at).sources().iter().enumerate() {
            self.made[link.node as usize] = Program::Link { trail: at, place: place as u32 };
        }
        Program::Link { trail: at, place: 0 }
    }
}

impl Graph {
    /// Makes the program of a node that has none, and a trail of the chain that starts there.
    pub(crate) fn make_program(&mut self, slot: u32) -> Program {
        let program = self.compile(self.ids[slot as usize]);
        let Program::Hop(hop) = program else { return program };
        let mut trail = Trail::new(slot, hop);
        while let Some(next) = self.next_on_trail(&trail) {
            match *self.programs.get(trail.end().node) {
                // What follows is short: the two become one.
                Program::Link { trail: follows, .. } => trail.join(self.programs.trails.remove(follows)),
                _ => trail.push(next),
            }
        }
        if trail.sources().len() > 1 { self.programs.lay(trail) } else { program }
    }

    /// The hop from the end of a trail, if it can be part of it.
    fn next_on_trail(&self, trail: &Trail) -> Option<Hop> {
        let end = trail.end().node;
        let room = LONGEST.checked_sub(trail.sources().len())?;
        let next = match *self.programs.get(end) {
            Program::Hop(hop) => hop,
            Program::Link { trail, place: 0 } if self.programs.trails.get(trail).sources().len() <= room => {
                self.programs.hop(end)?
            }
            // Only what does nothing but to pass values on is looked at ahead of its turn.
            Program::Unmade if room > 0 && self.schedule.flags[end as usize] & !DIRTY == ROUTED => {
                match self.compile(self.ids[end as usize]) {
                    Program::Hop(hop) => hop,
                    _ => return None,
                }
            }
            _ => return None,
        };
        (room > 0 && trail.continues_with(next)).then_some(next)
    }

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
