//! Values that are nothing but a few floats, which most of what changes every frame is: their bytes are those of the codec, but they go
//! to and from columns without a [`Value`](crate::Value) and without serde.

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};

use super::herd::{Herds, Rows, Seat, Strand};
use super::packet::{Draft, FieldOf, GroupRead, Place};
use super::shares::flat_share;
use super::{ReplicaError, damaged};
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

/// Floats as bytes, little end first.
#[inline]
pub(super) fn put_floats<const COUNT: usize>(bytes: &mut Vec<u8>, floats: [f32; COUNT]) {
    bytes.extend_from_slice(floats.map(f32::to_le_bytes).as_flattened());
}

/// Floats from their bytes, of which there are four for each.
#[inline]
pub(super) fn floats_of<const COUNT: usize>(bytes: &[u8]) -> [f32; COUNT] {
    std::array::from_fn(|place| {
        let bytes = bytes.get(4 * place..4 * place + 4).and_then(|bytes| bytes.try_into().ok());
        f32::from_le_bytes(bytes.unwrap_or_default())
    })
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
        flat_share(number, index, T::column(columns).values[slot as usize].floats())
    }
    for_flat!(field_type, share(columns, slot, number, index))
}

/// Puts those values of a strand into a packet that were written after a revision; None if they are not flat. `nodes` are the slots and
/// places of those that may have been.
pub(super) fn gather_flat(
    columns: &Columns,
    herds: &mut Herds,
    herd: usize,
    index: u16,
    nodes: &[(u32, u32)],
    mark: Revision,
    draft: &mut Draft,
) -> Option<()> {
    fn gather<T: Flat<COUNT>, const COUNT: usize>(
        columns: &Columns,
        (numbers, strand): (&[u64], &mut Strand),
        index: u16,
        nodes: &[(u32, u32)],
        mark: Revision,
        draft: &mut Draft,
    ) -> u64 {
        let (column, mut added) = (T::column(columns), 0u64);
        draft.group(T::TYPE, FieldOf::Type(index), |bytes, runs| {
            for (slot, place) in nodes {
                let place = *place as usize;
                let at = strand.slots[place] as usize;
                if column.revisions[at] <= mark {
                    continue;
                }
                let floats = column.values[at].floats();
                put_floats(bytes, floats);
                runs.push(*slot);
                let share = flat_share(numbers[place], index, floats);
                added = added.wrapping_add(share).wrapping_sub(std::mem::replace(&mut strand.shares[place], share));
            }
        });
        added
    }
    let strand = herds.herds[herd].strand_mut(index)?;
    let added = for_flat!(strand.1.field_type, gather(columns, strand, index, nodes, mark, draft))?;
    herds.add(added);
    Some(())
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
    let mut written = Vec::new();
    let (mut bytes, mut added) = (group.values, 0u64);
    for run in group.runs.iter() {
        // One write, as far as readers are concerned.
        let revision = graph.changes.next();
        let (boundary, nodes) = graph.changes.parts();
        let mut target = Target { column: &mut *column, nodes, boundary, revision, written: &mut written };
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
        graph.changes.log(&written);
        written.clear();
    }
    herds.add(added);
    Ok(())
}

/// Where values go.
struct Target<'a, T> {
    column: &'a mut Column<T>,
    /// The revisions of nodes, and the one up to which they must be logged again.
    nodes: &'a mut [Revision],
    boundary: Revision,
    revision: Revision,
    /// Nodes to be logged.
    written: &'a mut Vec<u32>,
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
        let (values, revisions) = (&mut self.column.values[..], &mut self.column.revisions[..]);
        let (revision, boundary) = (self.revision, self.boundary);
        let (mut done, mut added, mut slot) = (0, 0u64, first);
        let places = rows.numbers.iter().zip(rows.nodes).zip(rows.slots).zip(&mut *rows.shares);
        for ((((number, node), at), share), bytes) in places.zip(bytes.chunks_exact(4 * COUNT)) {
            if *number as u32 != slot {
                break;
            }
            let value = &mut values[*at as usize];
            *value = T::of_floats(floats_of(bytes));
            // What stands there counts, not what was to be written.
            let stands = flat_share(*number, index, value.floats());
            added = added.wrapping_add(stands).wrapping_sub(std::mem::replace(share, stands));
            revisions[*at as usize] = revision;
            if std::mem::replace(&mut self.nodes[*node as usize], revision) <= boundary {
                self.written.push(*node);
            }
            done += 1;
            slot = slot.wrapping_add(step);
        }
        (done, added)
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
        assert_eq!(floats_of::<3>(&bytes), [1.0, -2.0, 3.5]);
    }
}
