//! What was written since the last frame, and values of a few floats on their way from columns to packets.

use std::ops::Range;

use super::flat::{Flat, bits_of, for_flat};
use super::herd::{FEW, Herd, Herds, Strand, places_in_steps, start_and_step};
use super::packet::{Draft, FieldOf};
use super::runs::{Run, RunWriter};
use super::shares::{exchange, flat_share, share_evenly};
use crate::Revision;
use crate::column::{Column, Columns};

/// So many values are gathered at a time: each step of the work is a loop of its own, and finds what the one before left in the first cache.
const BLOCK: usize = 64;

/// Some of the nodes that were written.
enum Piece {
    /// These places: all that belongs to them is in equal steps.
    Even(Range<usize>),
    /// Others, by where they are in the list of such.
    Each(Range<usize>),
}

/// Nodes of a herd that were written after a revision, or may have been.
pub(super) struct Written {
    mark: Revision,
    pieces: Vec<Piece>,
    /// Places of those that are not in equal steps.
    places: Vec<u32>,
}

impl Written {
    /// Of runs of places.
    pub(super) fn of(herd: &Herd, runs: &[Range<u32>], mark: Revision) -> Written {
        let mut written = Written { mark, pieces: Vec::new(), places: Vec::new() };
        for run in runs {
            let mut place = run.start as usize;
            while place < run.end as usize {
                let even = place..herd.stretch(place).end.min(run.end as usize);
                place = even.end;
                if even.len() >= FEW {
                    written.pieces.push(Piece::Even(even));
                    continue;
                }
                let start = written.places.len();
                written.places.extend(even.map(|place| place as u32));
                match written.pieces.last_mut() {
                    Some(Piece::Each(others)) => others.end = written.places.len(),
                    _ => written.pieces.push(Piece::Each(start..written.places.len())),
                }
            }
        }
        written
    }

    /// Calls a function with places of which a field was written, by the revisions of its column.
    pub(super) fn each(&self, strand: &Strand, revisions: &[Revision], mut each: impl FnMut(usize)) {
        let is_new = |place: &usize| revisions[strand.slots[*place] as usize] > self.mark;
        for piece in &self.pieces {
            match piece {
                Piece::Even(places) if count_evenly(strand, places, revisions, self.mark) == 0 => {}
                Piece::Even(places) => places.clone().filter(is_new).for_each(&mut each),
                Piece::Each(part) => {
                    self.places[part.clone()].iter().map(|place| *place as usize).filter(is_new).for_each(&mut each);
                }
            }
        }
    }
}

/// Of how many places in equal steps a field was written.
fn count_evenly(strand: &Strand, places: &Range<usize>, revisions: &[Revision], mark: Revision) -> usize {
    let (at, step) = places_in_steps(&strand.slots[places.clone()]);
    let revisions = revisions[at..].iter().step_by(step).take(places.len());
    revisions.fold(0, |count, revision| count + (*revision > mark) as usize)
}

/// Puts those values of a strand into a packet that were written; None if they are not flat.
pub(super) fn gather_flat(
    columns: &Columns,
    herds: &mut Herds,
    herd: usize,
    index: u16,
    written: &Written,
    draft: &mut Draft,
) -> Option<()> {
    let strand = herds.herds[herd].strand_mut(index)?;
    let added = for_flat!(strand.1.field_type, gather(columns, strand, index, written, draft))?;
    herds.add(added);
    Some(())
}

fn gather<T: Flat<COUNT>, const COUNT: usize>(
    columns: &Columns,
    (numbers, strand): (&[u64], &mut Strand),
    index: u16,
    written: &Written,
    draft: &mut Draft,
) -> u64 {
    let mut added = 0u64;
    let (column, mark) = (T::column(columns), written.mark);
    draft.group(T::TYPE, FieldOf::Type(index), |bytes, runs| {
        let mut gathering = Gathering { column, mark, numbers, strand, index, bytes, runs };
        for piece in &written.pieces {
            let more = match piece {
                Piece::Even(places) => gathering.evenly(places.clone()),
                Piece::Each(part) => {
                    let blocks = written.places[part.clone()].chunks(BLOCK);
                    blocks.fold(0u64, |added, block| added.wrapping_add(gathering.block(block)))
                }
            };
            added = added.wrapping_add(more);
        }
    });
    added
}

/// Values of one field on their way into a packet. What is gathered is given by what it adds to the hash.
struct Gathering<'a, T> {
    column: &'a Column<T>,
    mark: Revision,
    numbers: &'a [u64],
    strand: &'a mut Strand,
    index: u16,
    bytes: &'a mut Vec<u8>,
    runs: &'a mut RunWriter,
}

impl<T> Gathering<'_, T> {
    /// Places in equal steps.
    fn evenly<const COUNT: usize>(&mut self, places: Range<usize>) -> u64
    where
        T: Flat<COUNT>,
    {
        match count_evenly(self.strand, &places, &self.column.revisions, self.mark) {
            0 => return 0,
            count if count == places.len() => {}
            _ => {
                let blocks = places.clone().step_by(BLOCK).map(|first| first..places.end.min(first + BLOCK));
                return blocks.fold(0u64, |added, block| {
                    let mut list = [0; BLOCK];
                    let count = block.len();
                    list.iter_mut().zip(block).for_each(|(one, place)| *one = place as u32);
                    added.wrapping_add(self.block(&list[..count]))
                });
            }
        }
        let (at, step) = places_in_steps(&self.strand.slots[places.clone()]);
        let (first, number_step) = start_and_step(&self.numbers[places.clone()]);
        self.runs.push_run(Run { first: first as u32, step: number_step as u32, count: places.len() as u32 });
        let start = self.put(places.len(), self.column.values[at..].iter().step_by(step));
        let values = bits_of::<COUNT>(&self.bytes[start..]);
        share_evenly((first, number_step), self.index, values, &mut self.strand.shares[places])
    }

    /// Appends so many values; gives where they begin.
    #[inline]
    fn put<'v, const COUNT: usize>(&mut self, count: usize, values: impl Iterator<Item = &'v T>) -> usize
    where
        T: Flat<COUNT>,
    {
        let start = self.bytes.len();
        self.bytes.resize(start + 4 * COUNT * count, 0);
        let into = self.bytes[start..].as_chunks_mut::<4>().0.as_chunks_mut::<COUNT>().0;
        values.zip(into).for_each(|(value, into)| *into = value.floats().map(f32::to_le_bytes));
        start
    }

    /// Those of a few places that were written.
    fn block<const COUNT: usize>(&mut self, places: &[u32]) -> u64
    where
        T: Flat<COUNT>,
    {
        let (revisions, slots) = (&self.column.revisions[..], &self.strand.slots[..]);
        if places.iter().all(|place| revisions[slots[*place as usize] as usize] <= self.mark) {
            return 0;
        }
        // Those that were written: their slots in the application, their places, and where their values are.
        let (mut written, mut count) = ([[0u32; BLOCK]; 3], 0);
        for place in places {
            let (slot, at) = (self.numbers[*place as usize] as u32, slots[*place as usize]);
            written.iter_mut().zip([slot, *place, at]).for_each(|(all, one)| all[count] = one);
            count += (revisions[at as usize] > self.mark) as usize;
        }
        let [slots, places, ats] = written.each_ref().map(|all| &all[..count]);
        self.runs.extend(slots);
        let column = self.column;
        let start = self.put(count, ats.iter().map(|at| &column.values[*at as usize]));
        let mut added = 0u64;
        for (place, bits) in places.iter().zip(bits_of::<COUNT>(&self.bytes[start..])) {
            let place = *place as usize;
            let stands = flat_share(self.numbers[place], self.index, bits);
            added = added.wrapping_add(exchange(&mut self.strand.shares[place], stands));
        }
        added
    }
}
