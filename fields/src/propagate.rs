//! From field to field: what a node's turn copies along its routes.

use crate::changes::{ChangeLog, Revision};
use crate::copy::Copier;
use crate::frame::FrameState;
use crate::graph::slot_of;
use crate::program::{Group, Hop, Program, Run};
use crate::route::Arrival;
use crate::schedule::SILENCED;
use crate::{Field, FieldId, Graph, Route, RouteId, SetRule, Value};

/// A value on its way along a weak route.
#[derive(Debug)]
pub(crate) struct Carried {
    pub(crate) route: RouteId,
    pub(crate) value: Value,
    pub(crate) written: Revision,
}

impl FrameState {
    /// Takes the revision that so many copies used, if any did.
    #[inline]
    fn copied(&mut self, changes: &mut ChangeLog, copied: usize) {
        if copied > 0 {
            changes.next();
            self.report.copied += copied;
        }
    }
}

impl Graph {
    /// Copies along the node's routes what was written since its last turn.
    #[inline]
    pub(crate) fn copy_out(&mut self, slot: u32) {
        let plain = self.schedule.flags[slot as usize] & SILENCED == 0 && self.explain.is_none();
        let mut copier = Copier { columns: &mut self.columns, changes: &mut self.changes, schedule: &mut self.schedule };
        match self.programs.get(slot) {
            Program::Hop(Hop { field_type, .. }) if plain => {
                self.frame.report.copied += copier.chain(*field_type, &self.programs, slot);
            }
            Program::Link { trail, .. } if plain => {
                let field_type = self.programs.trail_type(*trail);
                self.frame.report.copied += copier.chain(field_type, &self.programs, slot);
            }
            Program::Direct(groups) if plain => {
                let before = std::mem::replace(&mut copier.schedule.turns[slot as usize].propagated, copier.changes.last());
                for group in groups.iter() {
                    let written = copier.columns.revisions(group.field_type)[group.source as usize];
                    if written > before {
                        let revision = copier.changes.last() + 1;
                        let copied = copier.group(group, written, revision);
                        self.frame.copied(copier.changes, copied);
                    }
                }
            }
            _ => self.copy_out_slowly(slot),
        }
    }

    fn copy_out_slowly(&mut self, slot: u32) {
        let before = std::mem::replace(&mut self.schedule.turns[slot as usize].propagated, self.changes.last());
        if *self.programs.get(slot) == Program::Unmade {
            let program = self.make_program(slot);
            self.programs.put(slot, program);
        }
        let hop = self.programs.hop(slot).map(|hop| [self.hop_as_group(slot, hop)]);
        let program = self.programs.take(slot);
        let groups = match (&program, &hop) {
            (Program::Direct(groups) | Program::Mixed(groups), _) => groups,
            (_, Some(hop)) => &hop[..],
            _ => &[],
        };
        let silenced = self.schedule.flags[slot as usize] & SILENCED != 0;
        for group in groups {
            let written = self.columns.revisions(group.field_type)[group.source as usize];
            if written > before && !(silenced && self.is_silenced(slot, group.index, written)) {
                self.run_group(slot, group, written);
            }
        }
        self.programs.put(slot, program);
    }

    fn hop_as_group(&self, slot: u32, hop: Hop) -> Group {
        let Hop { source, target, node, field_type, compare } = hop;
        let (owner, index) = self.columns.owners(field_type)[source as usize];
        debug_assert_eq!(owner, slot);
        let direct = Box::new([Run { slot: target, node, count: 1, compare }]);
        Group { index, field_type, source, direct, slow: Box::default(), weak: Box::default() }
    }

    fn is_silenced(&self, slot: u32, index: u16, written: Revision) -> bool {
        self.silenced.get(&FieldId { node: self.ids[slot as usize], index }) == Some(&written)
    }

    /// One write of a source is one write of all its targets: they share a revision.
    #[inline]
    fn run_group(&mut self, slot: u32, group: &Group, written: Revision) {
        let revision = self.changes.last() + 1;
        let mut copied = 0;
        if !group.direct.is_empty() {
            let (columns, changes, schedule) = (&mut self.columns, &mut self.changes, &mut self.schedule);
            copied = Copier { columns, changes, schedule }.group(group, written, revision);
            self.explain_group(slot, group, revision);
        }
        if !group.slow.is_empty() {
            let value = self.columns.value(group.field_type, group.source);
            copied += group.slow.iter().filter(|route| self.deliver(**route, &value, written, revision)).count();
        }
        self.frame.copied(&mut self.changes, copied);
        if !group.weak.is_empty() {
            self.explain_departure(slot, group);
            self.depart(group);
        }
    }

    /// Values leave along weak routes. That they leave is the write that counts when they arrive: the source's own is a frame old by then.
    fn depart(&mut self, group: &Group) {
        let value = self.columns.value(group.field_type, group.source);
        let written = self.changes.next();
        let carried = group.weak.iter().map(|route| Carried { route: *route, value: value.clone(), written });
        self.frame.carried.extend(carried);
    }

    /// Delivers what weak routes carry since the last frame, as one write.
    pub(crate) fn deliver_carried(&mut self) {
        let revision = self.changes.last() + 1;
        let carried = std::mem::take(&mut self.frame.carried);
        let copied =
            carried.iter().filter(|carried| self.deliver(carried.route, &carried.value, carried.written, revision)).count();
        self.frame.copied(&mut self.changes, copied);
    }

    /// Delivers a value along a route, unless the target was written later than the source, or a route with a later write was here before.
    fn deliver(&mut self, id: RouteId, value: &Value, written: Revision, revision: Revision) -> bool {
        let Some(route) = self.routes.all.get(id).copied() else { return false };
        let Ok((target, slot)) = self.place(route.to) else { return false };
        let (field_type, compare) = (target.field_type, target.on_set == SetRule::Compare);
        let fan_in = self.is_fan_in(route.to);
        let last = self.columns.revisions(field_type)[slot as usize];
        let arrival = self.routes.arrivals.get(&route.to).copied().filter(|arrival| fan_in && arrival.delivered == last);
        let late = match arrival {
            Some(arrival) => (written, route.ordinal) <= arrival.won,
            None => written <= last,
        };
        let Some(value) = (if late { None } else { carried_as(value, target) }) else { return false };
        let copied = self.columns.write(slot, &value, compare, revision);
        if copied {
            self.changes.wrote(slot_of(route.to.node), revision);
            self.schedule.mark(slot_of(route.to.node));
            self.explain_route(id);
        }
        if fan_in {
            let delivered = if copied { revision } else { last };
            self.routes.arrivals.insert(route.to, Arrival { won: (written, route.ordinal), delivered });
        }
        copied
    }

    /// What a new route does: the target takes the source's value, if that was ever written.
    pub(crate) fn deliver_at_once(&mut self, route: RouteId) {
        let Route { from, to, .. } = self.routes.all[route];
        let created = self.nodes[from.node].created;
        let Ok((source, slot)) = self.place(from) else { return };
        if self.columns.revisions(source.field_type)[slot as usize] <= created {
            return;
        }
        let value = self.columns.value(source.field_type, slot);
        let Ok((target, slot)) = self.place(to) else { return };
        let Some(value) = carried_as(&value, target) else { return };
        let revision = self.changes.last() + 1;
        if self.columns.write(slot, &value, true, revision) {
            self.changes.next();
            self.changes.wrote(slot_of(to.node), revision);
            self.schedule.mark(slot_of(to.node));
            self.explain_route(route);
        }
    }
}

/// What a value becomes on its way into a field: converted, and moved into the field's range.
fn carried_as(value: &Value, target: &Field) -> Option<Value> {
    let value = value.convert(target.field_type)?;
    Some(match target.range {
        Some((smallest, largest)) => value.clamped(smallest, largest),
        None => value,
    })
}
