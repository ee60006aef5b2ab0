//! The application's nodes as both ends know them: those of one type stand together, so that what is done with a field of many of them
//! runs along arrays. Here is the hash of all values as well, with what each field adds to it.

use std::collections::BTreeMap;
use std::ops::Range;

use super::packet::Place;
use super::shares::own_share;
use crate::FieldType;

/// Where a node stands; by its slot in the application.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seat {
    /// The node's number in the application; zero where nobody is.
    pub(super) number: u64,
    pub(super) herd: u32,
    pub(super) place: u32,
}

/// A field of all nodes of a type, by their places.
#[derive(Debug)]
pub(super) struct Strand {
    pub(super) field_type: FieldType,
    /// In the column of this process.
    pub(super) slots: Vec<u32>,
    /// What each adds to the hash; zero while it is not known.
    pub(super) shares: Vec<u64>,
}

/// Nodes of one type.
#[derive(Debug)]
pub(super) struct Herd {
    numbers: Vec<u64>,
    /// Slots of the nodes in this process.
    nodes: Vec<u32>,
    /// What each adds by its type and name.
    own: Vec<u64>,
    /// By the field's index in the application; none where replicas do not learn of it.
    pub(super) strands: Vec<Option<Strand>>,
    /// Where stretches begin within which numbers, slots and values are in equal steps, as those of nodes are that were made one after the
    /// other. In order; the first is zero.
    stretches: Vec<u32>,
}

/// Shorter stretches are not worth loops of their own.
pub(super) const FEW: usize = 8;

/// True if the last element of a list is as far from the one before as the second from the first.
fn goes_on<T: Copy + Into<u64>>(list: &[T]) -> bool {
    let ([first, second, ..], [.., before, last]) = (list, list) else { return true };
    let [first, second, before, last]: [u64; 4] = [*first, *second, *before, *last].map(T::into);
    second > first && last.wrapping_sub(before) == second - first
}

/// Where equal steps start, and how long they are.
#[inline]
pub(super) fn start_and_step<T: Copy + Into<u64>>(list: &[T]) -> (u64, u64) {
    match list {
        [] => (0, 1),
        [only] => ((*only).into(), 1),
        [first, second, ..] => ((*first).into(), (*second).into().wrapping_sub((*first).into())),
    }
}

/// The same for places in an array.
#[inline]
pub(super) fn places_in_steps(list: &[u32]) -> (usize, usize) {
    let (start, step) = start_and_step(list);
    (start as usize, step as usize)
}

impl Herd {
    fn new(strands: Vec<Option<Strand>>) -> Herd {
        Herd { numbers: Vec::new(), nodes: Vec::new(), own: Vec::new(), strands, stretches: Vec::new() }
    }

    /// A field of the nodes from a place on, of which so many are of interest.
    pub(super) fn rows(&mut self, place: usize, count: usize, index: u16) -> Option<Rows<'_>> {
        let next = self.stretch_after(place);
        let even = self.stretch_before(next).end - place;
        let uneven = if even < FEW { self.long_after(next, place.saturating_add(count)) - place } else { even };
        let Strand { field_type, slots, shares } = self.strands.get_mut(index as usize)?.as_mut()?;
        let (numbers, nodes) = (&self.numbers[place..], &self.nodes[place..]);
        Some(Rows { field_type: *field_type, numbers, nodes, slots: &slots[place..], shares: &mut shares[place..], even, uneven })
    }

    /// The stretch that a place lies in.
    pub(super) fn stretch(&self, place: usize) -> Range<usize> {
        self.stretch_before(self.stretch_after(place))
    }

    /// The number of the stretch after the one that a place lies in.
    fn stretch_after(&self, place: usize) -> usize {
        self.stretches.partition_point(|start| *start as usize <= place)
    }

    fn stretch_before(&self, next: usize) -> Range<usize> {
        let start = next.checked_sub(1).map_or(0, |at| self.stretches[at] as usize);
        start..self.stretches.get(next).map_or(self.numbers.len(), |start| *start as usize)
    }

    /// Where the first stretch after one begins that is worth a loop, or the end of what is of interest.
    fn long_after(&self, next: usize, end: usize) -> usize {
        let others = (next + 1..=self.stretches.len()).map(|next| self.stretch_before(next));
        let long = others.take_while(|stretch| stretch.start < end).find(|stretch| stretch.len() >= FEW);
        long.map_or(end, |stretch| stretch.start)
    }

    /// So many nodes from a place on have places in the order of their slots in the application, without gaps.
    pub(super) fn in_a_row(&self, place: u32) -> u32 {
        match self.numbers.get(place as usize..) {
            Some([first, second, ..]) if second.wrapping_sub(*first) == 1 => self.stretch(place as usize).end as u32 - place,
            _ => 1,
        }
    }

    /// Has a stretch end before a place, or go on over it.
    fn stretch_on(&mut self, place: usize) {
        let start = self.stretches.last().map_or(place, |start| *start as usize);
        let is_even = goes_on(&self.numbers[start..=place])
            && goes_on(&self.nodes[start..=place])
            && self.strands.iter().flatten().all(|strand| goes_on(&strand.slots[start..=place]));
        if start == place || !is_even {
            self.stretches.push(place as u32);
        }
    }

    /// Has a stretch begin at a place.
    fn cut(&mut self, place: usize) {
        let at = self.stretches.partition_point(|start| (*start as usize) < place);
        if place < self.numbers.len() && self.stretches.get(at).is_none_or(|start| *start as usize != place) {
            self.stretches.insert(at, place as u32);
        }
    }

    /// A field of all nodes, with the nodes' numbers by their places.
    #[inline]
    pub(super) fn strand_mut(&mut self, index: u16) -> Option<(&[u64], &mut Strand)> {
        Some((&self.numbers, self.strands.get_mut(index as usize)?.as_mut()?))
    }
}

/// A field of some nodes that stand side by side.
pub(super) struct Rows<'a> {
    pub(super) field_type: FieldType,
    pub(super) numbers: &'a [u64],
    pub(super) nodes: &'a [u32],
    pub(super) slots: &'a [u32],
    pub(super) shares: &'a mut [u64],
    /// So many of them are in equal steps.
    pub(super) even: usize,
    /// So many are to be looked at one by one, where those are few.
    pub(super) uneven: usize,
}

/// All of them.
#[derive(Debug, Default)]
pub(super) struct Herds {
    pub(super) seats: Vec<Seat>,
    pub(super) herds: Vec<Herd>,
    /// What fields add that only single nodes have.
    loose: BTreeMap<Place, u64>,
    sum: u64,
}

impl Herds {
    /// The hash of all values, names, types and routes.
    pub(super) fn sum(&self) -> u64 {
        self.sum
    }

    pub(super) fn add(&mut self, share: u64) {
        self.sum = self.sum.wrapping_add(share);
    }

    pub(super) fn subtract(&mut self, share: u64) {
        self.sum = self.sum.wrapping_sub(share);
    }

    /// A new type, by the indices and types of its fields; gives its number here.
    pub(super) fn declare(&mut self, fields: impl Iterator<Item = (u16, FieldType)>) -> u32 {
        let mut strands = Vec::new();
        for (index, field_type) in fields {
            strands.resize_with(strands.len().max(index as usize + 1), || None);
            strands[index as usize] = Some(Strand { field_type, slots: Vec::new(), shares: Vec::new() });
        }
        self.herds.push(Herd::new(strands));
        self.herds.len() as u32 - 1
    }

    /// A new node, which has the slot `node` here; `slot` says where in its column a field lies, by its index.
    pub(super) fn insert(&mut self, number: u64, node: u32, herd: u32, slot: impl Fn(u16) -> u32) {
        let at = number as u32 as usize;
        if self.seats.len() <= at {
            self.seats.resize(at + 1, Seat::default());
        }
        let all = &mut self.herds[herd as usize];
        let place = all.numbers.len();
        self.seats[at] = Seat { number, herd, place: place as u32 };
        all.numbers.push(number);
        all.nodes.push(node);
        all.own.push(0);
        for (index, strand) in all.strands.iter_mut().enumerate() {
            let Some(strand) = strand else { continue };
            strand.slots.push(slot(index as u16));
            strand.shares.push(0);
        }
        all.stretch_on(place);
    }

    /// Fields may lie elsewhere now: where, by the node's number and the field's index; none for a node that is gone.
    pub(super) fn move_slots(&mut self, slot: impl Fn(u64, u16) -> Option<u32>) {
        for herd in &mut self.herds {
            for (index, strand) in herd.strands.iter_mut().enumerate() {
                let Some(strand) = strand else { continue };
                for (at, number) in strand.slots.iter_mut().zip(&herd.numbers) {
                    *at = slot(*number, index as u16).unwrap_or(*at);
                }
            }
            herd.stretches.clear();
            (0..herd.numbers.len()).for_each(|place| herd.stretch_on(place));
        }
    }

    /// Takes a node out, with all that it added.
    pub(super) fn remove(&mut self, number: u64) {
        let Some(Seat { herd, place, .. }) = self.seat(number) else { return };
        self.seats[number as u32 as usize] = Seat::default();
        let (place, all) = (place as usize, &mut self.herds[herd as usize]);
        // The last one comes here, and stands for itself.
        all.cut(place);
        all.cut(place + 1);
        if all.stretches.last().is_some_and(|start| *start as usize + 1 == all.numbers.len()) {
            all.stretches.pop();
        }
        let Herd { numbers, nodes, own, strands, .. } = all;
        numbers.swap_remove(place);
        nodes.swap_remove(place);
        let mut gone = own.swap_remove(place);
        for strand in strands.iter_mut().flatten() {
            strand.slots.swap_remove(place);
            gone = gone.wrapping_add(strand.shares.swap_remove(place));
        }
        if let Some(moved) = numbers.get(place) {
            self.seats[*moved as u32 as usize].place = place as u32;
        }
        let loose: Vec<Place> = self.loose_of(number).map(|(index, _)| (number, index)).collect();
        gone = loose.iter().fold(gone, |gone, place| gone.wrapping_add(self.loose.remove(place).unwrap_or(0)));
        self.subtract(gone);
    }

    pub(super) fn set_own(&mut self, number: u64, type_name: &str, name: &str) {
        let Some(seat) = self.seat(number) else { return };
        let own = own_share(number, type_name, name);
        let before = std::mem::replace(&mut self.herds[seat.herd as usize].own[seat.place as usize], own);
        self.sum = self.sum.wrapping_sub(before).wrapping_add(own);
    }

    /// Sets what a field adds; zero takes it out.
    pub(super) fn set_field(&mut self, number: u64, index: u16, share: u64) {
        let Some(seat) = self.seat(number) else { return };
        let strand = self.herds[seat.herd as usize].strands.get_mut(index as usize).and_then(Option::as_mut);
        let before = match strand {
            Some(strand) => std::mem::replace(&mut strand.shares[seat.place as usize], share),
            None if share == 0 => self.loose.remove(&(number, index)).unwrap_or(0),
            None => self.loose.insert((number, index), share).unwrap_or(0),
        };
        self.sum = self.sum.wrapping_sub(before).wrapping_add(share);
    }

    /// What a field adds.
    pub(super) fn field(&self, number: u64, index: u16) -> u64 {
        let Some(seat) = self.seat(number) else { return 0 };
        match self.herds[seat.herd as usize].strands.get(index as usize).and_then(Option::as_ref) {
            Some(strand) => strand.shares[seat.place as usize],
            None => self.loose.get(&(number, index)).copied().unwrap_or(0),
        }
    }

    /// Is it a field that all nodes of the type have?
    pub(super) fn is_declared(&self, (number, index): Place) -> bool {
        let strands = self.seat(number).map(|seat| &self.herds[seat.herd as usize].strands);
        strands.and_then(|strands| strands.get(index as usize)).is_some_and(Option::is_some)
    }

    /// What a node adds by its type and name.
    pub(super) fn own(&self, number: u64) -> u64 {
        self.seat(number).map_or(0, |seat| self.herds[seat.herd as usize].own[seat.place as usize])
    }

    /// Indices of all fields of a node, in order.
    pub(super) fn fields(&self, number: u64) -> Vec<u16> {
        let Some(seat) = self.seat(number) else { return Vec::new() };
        let strands = &self.herds[seat.herd as usize].strands;
        let declared = strands.iter().enumerate().filter(|(_, strand)| strand.is_some()).map(|(index, _)| index as u16);
        declared.chain(self.loose_of(number).map(|(index, _)| index)).collect()
    }

    fn loose_of(&self, number: u64) -> impl Iterator<Item = (u16, u64)> {
        self.loose.range((number, 0)..=(number, u16::MAX)).map(|((_, index), share)| (*index, *share))
    }

    /// Where a node stands, if it does.
    pub(super) fn seat(&self, number: u64) -> Option<Seat> {
        self.seats.get(number as u32 as usize).copied().filter(|seat| seat.number == number && number > 0)
    }
}
