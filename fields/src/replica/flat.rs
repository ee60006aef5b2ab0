//! Values that are nothing but a few floats, which most of what changes every frame is: their bytes are those of the codec, but they go
//! to and from columns without a [`Value`](crate::Value) and without serde.

use std::cell::OnceCell;
use std::ops::Range;

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};

use super::herd::{Herd, Herds, Rows, Seat, Strand, places_in_steps, start_and_step};
use super::packet::{Draft, FieldOf, GroupRead, Place};
use super::runs::Run;
use super::shares::{flat_share, share_evenly};
use super::{ReplicaError, damaged};
use crate::changes::ChangeLog;
use crate::column::{Column, Columns};
use crate::{Color, ColorA, FieldType, FieldValue, Graph, Revision};

/// A value of `COUNT` floats.
pub(super) trait Flat<const COUNT: usize>: FieldValue {
    fn floats(&self) -> [f32; COUNT];
    fn of_floats(floats: [f32; COUNT]) -> Self;
}

macro_rules! flat { ($($type:ty, $count:literal: $value:ident => $floats:expr, $back:ident => $of_floats:expr;)*) => { $(
    impl Flat<$count> for $type {
        #[inline]
        fn floats(&self) -> [f32; $count] { let $value = self; $floats }
        #[inline]
        fn of_floats($back: [f32; $count]) -> Self { $of_floats }
    }
)* } }
flat! {
    f32, 1: value => [*value], floats => floats[0];
    Vec2, 2: value => value.to_array(), floats => floats.into();
    Vec3, 3: value => value.to_array(), floats => floats.into();
    Vec4, 4: value => value.to_array(), floats => floats.into();
    Quat, 4: value => value.to_array(), floats => Quat::from_array(floats);
    Mat4, 16: value => value.to_cols_array(), floats => Mat4::from_cols_array(&floats);
    Color, 3: value => value.0.to_array(), floats => Color(floats.into());
    ColorA, 4: value => value.0.to_array(), floats => ColorA(floats.into());
}

/// So many values are gathered at a time: each step of the work is a loop of its own, and finds what the one before left in the first cache.
const BLOCK: usize = 64;
/// Fewer values are not worth finding out that they lie in equal steps.
const FEW: usize = 8;

/// Floats as bytes, little end first.
#[inline]
pub(super) fn put_floats<const COUNT: usize>(bytes: &mut Vec<u8>, floats: [f32; COUNT]) {
    bytes.extend_from_slice(floats.map(f32::to_le_bytes).as_flattened());
}

/// Values of so many floats, from their bytes.
#[inline]
fn values_of<const COUNT: usize>(bytes: &[u8]) -> &[[[u8; 4]; COUNT]] {
    bytes.as_chunks::<4>().0.as_chunks::<COUNT>().0
}

/// The same, each as its bits.
#[inline]
fn bits_of<const COUNT: usize>(bytes: &[u8]) -> impl Iterator<Item = [u32; COUNT]> {
    values_of::<COUNT>(bytes).iter().map(|value| value.map(u32::from_le_bytes))
}

/// Calls a function for the type of fields that hold nothing but a few floats; None for other types.
macro_rules! for_flat {
    ($field_type:expr, $function:ident $arguments:tt) => {
        match $field_type {
            $crate::FieldType { multiple: true, .. } => None,
            $crate::FieldType { kind: $crate::Kind::F32, .. } => Some($function::<f32, 1> $arguments),
            $crate::FieldType { kind: $crate::Kind::Vec2, .. } => Some($function::<glam::Vec2, 2> $arguments),
            $crate::FieldType { kind: $crate::Kind::Vec3, .. } => Some($function::<glam::Vec3, 3> $arguments),
            $crate::FieldType { kind: $crate::Kind::Vec4, .. } => Some($function::<glam::Vec4, 4> $arguments),
            $crate::FieldType { kind: $crate::Kind::Quat, .. } => Some($function::<glam::Quat, 4> $arguments),
            $crate::FieldType { kind: $crate::Kind::Mat4, .. } => Some($function::<glam::Mat4, 16> $arguments),
            $crate::FieldType { kind: $crate::Kind::Color, .. } => Some($function::<$crate::Color, 3> $arguments),
            $crate::FieldType { kind: $crate::Kind::ColorA, .. } => Some($function::<$crate::ColorA, 4> $arguments),
            _ => None,
        }
    };
}

/// Appends the bytes of a value in its column, if it is flat; false if it is not.
pub(super) fn put_flat(columns: &Columns, field_type: FieldType, slot: u32, bytes: &mut Vec<u8>) -> bool {
    fn put<T: Flat<COUNT>, const COUNT: usize>(columns: &Columns, slot: u32, bytes: &mut Vec<u8>) {
        put_floats(bytes, T::column(columns).values[slot as usize].floats());
    }
    for_flat!(field_type, put(columns, slot, bytes)).is_some()
}

/// What a value in its column adds to the hash, if it is flat.
pub(super) fn share_of_flat(columns: &Columns, field_type: FieldType, slot: u32, (number, index): Place) -> Option<u64> {
    fn share<T: Flat<COUNT>, const COUNT: usize>(columns: &Columns, slot: u32, number: u64, index: u16) -> u64 {
        flat_share(number, index, T::column(columns).values[slot as usize].floats().map(f32::to_bits))
    }
    for_flat!(field_type, share(columns, slot, number, index))
}

/// Nodes of a herd that were written after a revision.
pub(super) struct Written<'a> {
    mark: Revision,
    /// Their places, those side by side together.
    runs: &'a [Range<u32>],
    /// The same one by one, once they were asked for.
    places: OnceCell<Vec<u32>>,
    /// Where they are side by side, and all that belongs to them lies in equal steps.
    even: Option<Range<usize>>,
}

impl<'a> Written<'a> {
    pub(super) fn of(herd: &Herd, runs: &'a [Range<u32>], mark: Revision) -> Written<'a> {
        let even = match runs {
            [run] if run.len() >= FEW && herd.is_even_to(run.end) => Some(run.start as usize..run.end as usize),
            _ => None,
        };
        Written { mark, runs, places: OnceCell::new(), even }
    }

    /// The places of all.
    pub(super) fn places(&self) -> &[u32] {
        self.places.get_or_init(|| self.runs.iter().cloned().flatten().collect())
    }

    /// How many of them had a field written, by the revisions of its column; None where to count is no less work than to look at each.
    pub(super) fn count(&self, strand: &Strand, revisions: &[Revision]) -> Option<usize> {
        let places = self.even.clone()?;
        let (at, step) = places_in_steps(&strand.slots[places.clone()]);
        let revisions = revisions[at..].iter().step_by(step).take(places.len());
        Some(revisions.fold(0, |count, revision| count + (*revision > self.mark) as usize))
    }
}

/// Puts those values of a strand into a packet that were written; None if they are not flat.
pub(super) fn gather_flat(
    columns: &Columns,
    herds: &mut Herds,
    herd: usize,
    index: u16,
    written: &Written<'_>,
    draft: &mut Draft,
) -> Option<()> {
    fn gather<T: Flat<COUNT>, const COUNT: usize>(
        columns: &Columns,
        (numbers, strand): (&[u64], &mut Strand),
        index: u16,
        written: &Written<'_>,
        draft: &mut Draft,
    ) -> u64 {
        let column = T::column(columns);
        let count = written.count(strand, &column.revisions);
        match &written.even {
            _ if count == Some(0) => 0,
            Some(even) if count == Some(even.len()) => gather_even(column, (numbers, strand), index, even.clone(), draft),
            _ => gather_each(column, (numbers, strand), index, written, draft),
        }
    }
    let strand = herds.herds[herd].strand_mut(index)?;
    let added = for_flat!(strand.1.field_type, gather(columns, strand, index, written, draft))?;
    herds.add(added);
    Some(())
}

/// Gathers those of some values that were written; gives what that adds to the hash.
fn gather_each<T: Flat<COUNT>, const COUNT: usize>(
    column: &Column<T>,
    (numbers, strand): (&[u64], &mut Strand),
    index: u16,
    written: &Written<'_>,
    draft: &mut Draft,
) -> u64 {
    let (values, revisions, mark, mut added) = (&column.values[..], &column.revisions[..], written.mark, 0u64);
    let (slots, shares) = (&strand.slots[..], &mut strand.shares[..]);
    draft.group(T::TYPE, FieldOf::Type(index), |bytes, runs| {
        let is_old = |place: &u32| revisions[slots[*place as usize] as usize] <= mark;
        for places in written.places().chunks(BLOCK) {
            if places.iter().all(is_old) {
                continue;
            }
            // Those that were written: their slots in the application, their places, and where their values are.
            let (mut written, mut count) = ([[0u32; BLOCK]; 3], 0);
            for place in places {
                let (slot, at) = (numbers[*place as usize] as u32, slots[*place as usize]);
                written.iter_mut().zip([slot, *place, at]).for_each(|(all, one)| all[count] = one);
                count += (revisions[at as usize] > mark) as usize;
            }
            let [slots, places, ats] = written.each_ref().map(|all| &all[..count]);
            runs.extend(slots);
            let start = bytes.len();
            bytes.resize(start + 4 * COUNT * count, 0);
            let into = bytes[start..].as_chunks_mut::<4>().0.as_chunks_mut::<COUNT>().0;
            for (at, into) in ats.iter().zip(into) {
                *into = values[*at as usize].floats().map(f32::to_le_bytes);
            }
            for (place, bits) in places.iter().zip(bits_of::<COUNT>(&bytes[start..])) {
                let place = *place as usize;
                let share = flat_share(numbers[place], index, bits);
                added = added.wrapping_add(share).wrapping_sub(std::mem::replace(&mut shares[place], share));
            }
        }
    });
    added
}

/// Gathers values in equal steps, all of which were written.
fn gather_even<T: Flat<COUNT>, const COUNT: usize>(
    column: &Column<T>,
    (numbers, strand): (&[u64], &mut Strand),
    index: u16,
    places: Range<usize>,
    draft: &mut Draft,
) -> u64 {
    let (at, step) = places_in_steps(&strand.slots[places.clone()]);
    let numbers = start_and_step(&numbers[places.clone()]);
    let mut added = 0u64;
    draft.group(T::TYPE, FieldOf::Type(index), |bytes, runs| {
        runs.push_run(Run { first: numbers.0 as u32, step: numbers.1 as u32, count: places.len() as u32 });
        let start = bytes.len();
        bytes.resize(start + 4 * COUNT * places.len(), 0);
        let into = bytes[start..].as_chunks_mut::<4>().0.as_chunks_mut::<COUNT>().0;
        for (value, into) in column.values[at..].iter().step_by(step).zip(into) {
            *into = value.floats().map(f32::to_le_bytes);
        }
        added = share_evenly(numbers, index, bits_of::<COUNT>(&bytes[start..]), &mut strand.shares[places]);
    });
    added
}

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
            let rows = herds.herds[herd as usize].rows(place as usize, index).filter(|rows| rows.field_type == T::TYPE);
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
        for (((number, at), share), bits) in places.zip(bits_of::<COUNT>(bytes)) {
            if *number as u32 != slot {
                break;
            }
            // What stands there counts, which is what was to be written, to the bit.
            values[*at as usize] = T::of_floats(bits.map(f32::from_bits));
            let stands = flat_share(*number, index, bits);
            added = added.wrapping_add(stands).wrapping_sub(std::mem::replace(share, stands));
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
        match step {
            1 => self.changes.wrote_all(node..node + values.len(), self.revision),
            _ => rows.nodes[..values.len()].iter().for_each(|node| self.changes.wrote(*node, self.revision)),
        }
        share_evenly(start_and_step(rows.numbers), index, bits_of::<COUNT>(bytes), rows.shares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::{Name, Ref, to_bytes};
    use crate::{Field, Graph, Image, NodeId, NodeType, Value};
    use std::sync::Arc;

    struct Nameless;

    impl Name for Nameless {
        fn node(&mut self, _: Option<NodeId>) -> Ref {
            Ref::Number(0)
        }
        fn image(&mut self, _: Option<&Arc<Image>>) -> Ref {
            Ref::Number(0)
        }
    }

    #[test]
    fn flat_values_have_the_bytes_of_the_codec() {
        let values: [Value; 8] = [
            (-1.5f32).into(),
            Vec2::new(f32::NAN, 2.0).into(),
            Vec3::new(1.0, -0.0, 3.0).into(),
            Vec4::new(1.0, 2.0, 3.0, f32::INFINITY).into(),
            Quat::from_rotation_x(0.3).into(),
            Mat4::from_rotation_y(1.0).into(),
            Color(Vec3::new(0.1, 0.2, 0.3)).into(),
            ColorA(Vec4::new(0.1, 0.2, 0.3, 0.4)).into(),
        ];
        for value in values {
            let field_type = value.field_type();
            let mut graph = Graph::new(vec![NodeType::new("Box", "").field(Field::of_type("value", field_type))]);
            let node = graph.create("Box").unwrap();
            let field = graph.field(node, "value").unwrap();
            graph.set_value(field, value.clone()).unwrap();
            let (declared, slot) = graph.place(field).unwrap();
            let by_codec = to_bytes(&value, declared, &mut Nameless, Vec::new());
            let mut flat = Vec::new();
            assert!(put_flat(&graph.columns, field_type, slot, &mut flat));
            assert_eq!(flat, by_codec, "{field_type}");
        }
        let mut bytes = Vec::new();
        put_floats(&mut bytes, [1.0, -2.0, 3.5]);
        assert_eq!(bits_of::<3>(&bytes).next(), Some([1.0f32, -2.0, 3.5].map(f32::to_bits)));
    }
}
