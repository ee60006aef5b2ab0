//! Trails: the hops of a chain beside each other in memory, so that following it waits for no memory to say where the next link is.

use crate::FieldType;
use crate::program::Hop;

/// So many hops at most: a change of the chain throws a trail away, and that must cost little however long the chain is.
pub(crate) const LONGEST: usize = 1024;

/// A field on a trail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Link {
    /// Its place in the column.
    pub(crate) slot: u32,
    pub(crate) node: u32,
}

/// A chain of copies between fields of one type: each link is the only source of the next. All but the last link's nodes do nothing else.
#[derive(Debug)]
pub(crate) struct Trail {
    links: Vec<Link>,
    pub(crate) field_type: FieldType,
    compare: bool,
}

impl Trail {
    pub(crate) fn new(node: u32, hop: Hop) -> Self {
        let links = vec![Link { slot: hop.source, node }, Link { slot: hop.target, node: hop.node }];
        Self { links, field_type: hop.field_type, compare: hop.compare }
    }

    pub(crate) fn push(&mut self, hop: Hop) {
        self.links.push(Link { slot: hop.target, node: hop.node });
    }

    /// Adds a trail that starts where this one ends.
    pub(crate) fn join(&mut self, next: Trail) {
        self.links.extend_from_slice(&next.links[1..]);
    }

    pub(crate) fn end(&self) -> Link {
        self.links[self.links.len() - 1]
    }

    /// The links whose nodes have the trail as their program.
    pub(crate) fn sources(&self) -> &[Link] {
        &self.links[..self.links.len() - 1]
    }

    /// True if a hop starts where this trail ends, and is of the same kind.
    pub(crate) fn continues_with(&self, hop: Hop) -> bool {
        (hop.source, hop.field_type, hop.compare) == (self.end().slot, self.field_type, self.compare)
    }

    #[inline]
    pub(crate) fn hop(&self, place: u32) -> Hop {
        let (from, to) = (self.links[place as usize], self.links[place as usize + 1]);
        let (field_type, compare) = (self.field_type, self.compare);
        Hop { source: from.slot, target: to.slot, node: to.node, field_type, compare }
    }

    /// The links behind the target of a place.
    #[inline]
    pub(crate) fn after(&self, place: u32) -> &[Link] {
        &self.links[place as usize + 2..]
    }
}

/// All trails. The places of those that were thrown away are used again.
#[derive(Debug, Default)]
pub(crate) struct Trails {
    all: Vec<Trail>,
    free: Vec<u32>,
}

impl Trails {
    #[inline]
    pub(crate) fn get(&self, trail: u32) -> &Trail {
        &self.all[trail as usize]
    }

    pub(crate) fn insert(&mut self, trail: Trail) -> u32 {
        if let Some(place) = self.free.pop() {
            self.all[place as usize] = trail;
            return place;
        }
        self.all.push(trail);
        (self.all.len() - 1) as u32
    }

    pub(crate) fn remove(&mut self, trail: u32) -> Trail {
        self.free.push(trail);
        let gone = &mut self.all[trail as usize];
        Trail { links: std::mem::take(&mut gone.links), ..*gone }
    }
}
