//! Values of a few floats, from packets to columns.

use super::flat::{Flat, bits_of, for_flat, values_of};
use super::herd::{FEW, Herds, Rows, Seat, places_in_steps, start_and_step};
use super::packet::GroupRead;
use super::shares::{exchange, flat_share, share_evenly};
use super::{ReplicaError, damaged};
use crate::changes::ChangeLog;
use crate::column::Column;
use crate::{Graph, Revision};

/// Writes a group of a packet to the nodes' fields; None if its values are not flat. The hash follows what stands there then.
pub(super) fn scatter_flat(
    graph: &mut Graph,
    herds: &mut Herds,
    index: u16,
    group: GroupRead<'_>,
) -> Option<Result<(), ReplicaError>> {
    for_flat!(group.field_type, scatter(graph, herds, index, group))
}

fn scatter<T: Flat<COUNT>, const COUNT: usize>(
    graph: &mut Graph,
    herds: &mut Herds,
    index: u16,
    group: GroupRead<'_>,
) -> Result<(), ReplicaError> {
    if group.values.len() != group.runs.slots.saturating_mul(4 * COUNT) {
        return Err(damaged("it has more places than values, or fewer"));
    }
    let column = T::column_mut(&mut graph.columns);
    let (mut bytes, mut added) = (group.values, 0u64);
    for run in group.runs.iter() {
        // One write, as far as readers are concerned.
        let revision = graph.changes.next();
        let mut target = Target { column: &mut *column, changes: &mut graph.changes, revision };
        let (mut slot, mut left) = (run.first, run.count as usize);
        while left > 0 {
            let seat = herds.seats.get(slot as usize).filter(|seat| seat.number > 0);
            let Seat { herd, place, .. } = *seat.ok_or_else(|| damaged("it writes to a node that is not there"))?;
            let rows = herds.herds[herd as usize].rows(place as usize, left, index).filter(|rows| rows.field_type == T::TYPE);
            let mut rows = rows.ok_or_else(|| damaged(format!("it writes a {} where none is", T::TYPE)))?;
            let values = &bytes[..bytes.len().min(4 * COUNT * left)];
            let (done, share) = target.write(&mut rows, (slot, run.step), index, values);
            if done == 0 {
                return Err(damaged("it has more places than values"));
            }
            added = added.wrapping_add(share);
            left -= done;
            slot = slot.wrapping_add(run.step.wrapping_mul(done as u32));
            bytes = &bytes[4 * COUNT * done..];
        }
    }
    herds.add(added);
    Ok(())
}

/// Where values go.
struct Target<'a, T> {
    column: &'a mut Column<T>,
    changes: &'a mut ChangeLog,
    revision: Revision,
}

impl<T> Target<'_, T> {
    /// Writes values to rows of a strand, until a node is not the one that follows in the run. Gives how many were written, and what that
    /// adds to the hash.
    fn write<const COUNT: usize>(
        &mut self,
        rows: &mut Rows<'_>,
        (first, step): (u32, u32),
        index: u16,
        bytes: &[u8],
    ) -> (usize, u64)
    where
        T: Flat<COUNT>,
    {
        let even = rows.even.min(bytes.len() / (4 * COUNT));
        if even >= FEW && rows.numbers[0] as u32 == first && rows.numbers[1] - rows.numbers[0] == step as u64 {
            return (even, self.write_evenly(rows, index, &bytes[..4 * COUNT * even]));
        }
        let (values, revisions) = (&mut self.column.values[..], &mut self.column.revisions[..]);
        let revision = self.revision;
        let (mut done, mut added, mut slot) = (0, 0u64, first);
        let places = rows.numbers.iter().zip(rows.slots).zip(&mut *rows.shares);
        for (((number, at), share), bits) in places.take(rows.uneven).zip(bits_of::<COUNT>(bytes)) {
            if *number as u32 != slot {
                break;
            }
            // What stands there counts, which is what was to be written, to the bit.
            values[*at as usize] = T::of_floats(bits.map(f32::from_bits));
            let stands = flat_share(*number, index, bits);
            added = added.wrapping_add(exchange(share, stands));
            revisions[*at as usize] = revision;
            done += 1;
            slot = slot.wrapping_add(step);
        }
        rows.nodes[..done].iter().for_each(|node| self.changes.wrote(*node, revision));
        (done, added)
    }

    /// The same for values that are all in equal steps, one loop for each array, so that it has registers for all it needs.
    fn write_evenly<const COUNT: usize>(&mut self, rows: &mut Rows<'_>, index: u16, bytes: &[u8]) -> u64
    where
        T: Flat<COUNT>,
    {
        let values = values_of::<COUNT>(bytes);
        let (at, step) = places_in_steps(rows.slots);
        for (place, value) in self.column.values[at..].iter_mut().step_by(step).zip(values) {
            *place = T::of_floats(value.map(f32::from_le_bytes));
        }
        self.column.revisions[at..].iter_mut().step_by(step).take(values.len()).for_each(|revision| *revision = self.revision);
        let (node, step) = places_in_steps(rows.nodes);
        self.changes.wrote_in_steps(node, step, values.len(), self.revision);
        share_evenly(start_and_step(rows.numbers), index, bits_of::<COUNT>(bytes), rows.shares)
    }
}
