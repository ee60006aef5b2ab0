//! A set of small numbers that gives its lowest member quickly: bits, and bits over the words of bits below, up to one word. One low member
//! is held apart, so that a chain, which puts one in and takes one out, never waits for the memory.

/// Ordered set of numbers below its capacity.
#[derive(Debug)]
pub(crate) struct BitSet {
    /// `levels[0]` holds the members; a bit of `levels[n + 1]` says that a word of `levels[n]` is not zero. The last level is one word.
    levels: Vec<Vec<u64>>,
    /// A member that is not among the bits, or `NONE`.
    held: usize,
    /// How many bits are set.
    bits: usize,
}

const NONE: usize = usize::MAX;

impl Default for BitSet {
    fn default() -> Self {
        Self { levels: Vec::new(), held: NONE, bits: 0 }
    }
}

impl BitSet {
    /// Makes room for numbers below `capacity`; keeps the members.
    pub(crate) fn reserve(&mut self, capacity: usize) {
        if capacity <= self.levels.first().map_or(0, |level| level.len() * 64) {
            return;
        }
        let members: Vec<usize> = std::iter::from_fn(|| self.pop_lowest()).collect();
        self.levels.clear();
        let mut words = capacity.next_power_of_two().max(64) / 64;
        loop {
            self.levels.push(vec![0; words]);
            if words == 1 {
                break;
            }
            words = words.div_ceil(64);
        }
        members.into_iter().for_each(|member| self.insert(member));
    }

    /// Adds a number below the capacity.
    #[inline]
    pub(crate) fn insert(&mut self, number: usize) {
        if self.held == NONE {
            if !self.has_bit(number) {
                self.held = number;
            }
        } else if number < self.held {
            let held = std::mem::replace(&mut self.held, number);
            self.clear_bit(number);
            self.set_bit(held);
        } else if number != self.held {
            self.set_bit(number);
        }
    }

    #[inline]
    fn set_bit(&mut self, number: usize) {
        self.bits += !self.has_bit(number) as usize;
        let mut at = number;
        for level in &mut self.levels {
            let word = &mut level[at / 64];
            let was_empty = *word == 0;
            *word |= 1 << (at % 64);
            if !was_empty {
                return;
            }
            at /= 64;
        }
    }

    /// Takes the lowest number out.
    #[inline]
    pub(crate) fn pop_lowest(&mut self) -> Option<usize> {
        let lowest = self.lowest_bit();
        if self.held < lowest {
            return Some(std::mem::replace(&mut self.held, NONE));
        }
        if lowest == NONE {
            return None;
        }
        self.clear_bit(lowest);
        Some(lowest)
    }

    /// The lowest number.
    #[inline]
    pub(crate) fn lowest(&self) -> Option<usize> {
        Some(self.held.min(self.lowest_bit())).filter(|lowest| *lowest != NONE)
    }

    /// The lowest bit from one on, or `NONE`: up until a word has one, and down again.
    fn next_bit(&self, from: usize) -> usize {
        let mut at = from;
        for (height, level) in self.levels.iter().enumerate() {
            let Some(word) = level.get(at / 64) else { return NONE };
            let rest = word >> (at % 64) << (at % 64);
            if rest != 0 {
                at = at / 64 * 64 + rest.trailing_zeros() as usize;
                for level in self.levels[..height].iter().rev() {
                    at = at * 64 + level[at].trailing_zeros() as usize;
                }
                return at;
            }
            at = at / 64 + 1;
        }
        NONE
    }

    /// The lowest bit, or `NONE`.
    #[inline]
    fn lowest_bit(&self) -> usize {
        let mut at = 0;
        for level in self.levels.iter().rev() {
            let word = level[at];
            if word == 0 {
                return NONE;
            }
            at = at * 64 + word.trailing_zeros() as usize;
        }
        if self.levels.is_empty() { NONE } else { at }
    }

    /// How many members there are.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.bits + (self.held != NONE) as usize
    }

    /// Calls a function with each member below a number, in order.
    pub(crate) fn members_below(&self, end: usize, mut each: impl FnMut(usize)) {
        let mut held = Some(self.held).filter(|held| *held < end);
        self.words_below(end, |first, word| {
            let mut rest = word;
            while rest != 0 {
                let number = first + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                if let Some(held) = held.take_if(|held| *held < number) {
                    each(held);
                }
                each(number);
            }
        });
        held.into_iter().for_each(each);
    }

    /// Takes those out that are below a number and fit.
    pub(crate) fn remove_below(&mut self, end: usize, fits: impl Fn(usize) -> bool) {
        if self.held < end && fits(self.held) {
            self.held = NONE;
        }
        let mut words = Vec::new();
        self.words_below(end, |first, word| words.push((first, word)));
        for (first, word) in words {
            let gone = (0..64).filter(|bit| word >> bit & 1 == 1 && fits(first + bit)).fold(0u64, |gone, bit| gone | 1 << bit);
            self.levels[0][first / 64] &= !gone;
            self.bits -= gone.count_ones() as usize;
            let mut at = first / 64;
            for height in 1..self.levels.len() {
                if self.levels[height - 1][at] != 0 {
                    break;
                }
                self.levels[height][at / 64] &= !(1 << (at % 64));
                at /= 64;
            }
        }
    }

    /// Calls a function with the words that have members below a number: the number of the first bit, and those bits.
    fn words_below(&self, end: usize, mut each: impl FnMut(usize, u64)) {
        let mut at = self.next_bit(0);
        while at < end {
            let first = at / 64 * 64;
            let word = self.levels[0][first / 64];
            each(first, if end - first < 64 { word & ((1 << (end - first)) - 1) } else { word });
            at = self.next_bit(first + 64);
        }
    }

    /// True if the number is a member.
    pub(crate) fn contains(&self, number: usize) -> bool {
        self.held == number || self.has_bit(number)
    }

    fn has_bit(&self, number: usize) -> bool {
        self.levels.first().and_then(|level| level.get(number / 64)).is_some_and(|word| word >> (number % 64) & 1 == 1)
    }

    /// Takes a number out.
    pub(crate) fn remove(&mut self, number: usize) {
        if self.held == number {
            self.held = NONE;
        }
        self.clear_bit(number);
    }

    fn clear_bit(&mut self, number: usize) {
        if !self.has_bit(number) {
            return;
        }
        self.bits -= 1;
        let mut at = number;
        for level in &mut self.levels {
            level[at / 64] &= !(1 << (at % 64));
            if level[at / 64] != 0 {
                return;
            }
            at /= 64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn gives_its_members_in_order() {
        for capacity in [1, 64, 65, 4096, 5000, 300_000] {
            let mut set = BitSet::default();
            let mut model = BTreeSet::new();
            let mut random = 88172645463325252u64;
            for step in 0..4000 {
                random ^= random << 13;
                random ^= random >> 7;
                random ^= random << 17;
                let number = (random >> 20) as usize % capacity;
                set.reserve(if step < 10 { number + 1 } else { capacity });
                match random % 8 {
                    0 => assert_eq!(set.pop_lowest(), model.pop_first()),
                    1 => {
                        set.remove(number);
                        model.remove(&number);
                    }
                    2 => assert_eq!(set.len(), model.len()),
                    3 => assert_eq!(set.lowest(), model.first().copied()),
                    4 if random.is_multiple_of(5) => {
                        let mut below = Vec::new();
                        set.members_below(number, |member| below.push(member));
                        assert_eq!(below, model.range(..number).copied().collect::<Vec<_>>());
                        set.remove_below(number, |member| member % 3 != 0);
                        model.retain(|member| *member >= number || member % 3 == 0);
                        assert_eq!(set.len(), model.len());
                    }
                    _ => {
                        set.insert(number);
                        model.insert(number);
                    }
                }
                assert_eq!(set.contains(number), model.contains(&number));
            }
            assert_eq!(std::iter::from_fn(|| set.pop_lowest()).collect::<Vec<_>>(), model.into_iter().collect::<Vec<_>>());
        }
    }
}
