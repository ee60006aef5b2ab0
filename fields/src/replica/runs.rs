//! Nodes in a row: slots that begin somewhere and go on in equal steps, so that what changes every frame names its nodes in a few bytes.

use super::{ReplicaError, damaged};

/// Slots of nodes in the application: `first`, `first + step`, and so on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub(super) first: u32,
    pub(super) step: u32,
    pub(super) count: u32,
}

/// Bytes of a run in a packet.
const BYTES: usize = 12;

impl Run {
    pub(super) fn slots(self) -> impl Iterator<Item = usize> {
        (0..self.count as usize).map(move |place| self.first as usize + place * self.step as usize)
    }
}

/// Makes runs of slots that come one by one.
#[derive(Debug, Default)]
pub(super) struct RunWriter {
    runs: Vec<Run>,
}

impl RunWriter {
    #[inline]
    pub(super) fn push(&mut self, slot: u32) {
        if let Some(run) = self.runs.last_mut() {
            let step = slot.wrapping_sub(run.first);
            if run.count == 1 && slot > run.first {
                (run.step, run.count) = (step, 2);
                return;
            }
            if run.count > 1 && slot > run.first && step as u64 == run.step as u64 * run.count as u64 {
                run.count += 1;
                return;
            }
        }
        self.runs.push(Run { first: slot, step: 0, count: 1 });
    }

    /// A run that is known to be one.
    pub(super) fn push_run(&mut self, run: Run) {
        self.runs.push(run);
    }

    /// Many slots.
    #[inline]
    pub(super) fn extend(&mut self, slots: &[u32]) {
        if let Some(run) = self.runs.last_mut().filter(|run| run.count > 1) {
            let next = run.first.wrapping_add(run.step.wrapping_mul(run.count));
            let expected = |place: usize| next.wrapping_add(run.step.wrapping_mul(place as u32));
            let count = run.count as usize + slots.len();
            let ends_within = run.first as u64 + run.step as u64 * (count as u64 - 1) <= u32::MAX as u64;
            // One after the other, without a branch for each.
            let differ = slots.iter().enumerate().fold(0, |differ, (place, slot)| differ | (slot ^ expected(place)));
            if ends_within && differ == 0 {
                run.count = count as u32;
                return;
            }
        }
        slots.iter().for_each(|slot| self.push(*slot));
    }

    pub(super) fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    pub(super) fn write(&self, bytes: &mut Vec<u8>) {
        for run in &self.runs {
            [run.first, run.step, run.count].iter().for_each(|word| bytes.extend_from_slice(&word.to_le_bytes()));
        }
    }
}

/// Runs from a packet.
#[derive(Clone, Copy)]
pub(super) struct Runs<'a> {
    bytes: &'a [u8],
    /// Slots in all of them.
    pub(super) slots: usize,
}

fn run_of(bytes: &[u8]) -> Run {
    let word = |place: usize| u32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * place + byte]));
    Run { first: word(0), step: word(1), count: word(2) }
}

impl<'a> Runs<'a> {
    pub(super) fn read(bytes: &'a [u8]) -> Result<Runs<'a>, ReplicaError> {
        let is_run = |run: Run| match run.count {
            0 => false,
            1 => true,
            _ => run.step > 0 && run.first as u64 + run.step as u64 * (run.count as u64 - 1) <= u32::MAX as u64,
        };
        if !bytes.len().is_multiple_of(BYTES) || !bytes.chunks_exact(BYTES).all(|run| is_run(run_of(run))) {
            return Err(damaged("places of values make no sense"));
        }
        Ok(Runs { bytes, slots: bytes.chunks_exact(BYTES).map(|run| run_of(run).count as usize).sum() })
    }

    pub(super) fn iter(self) -> impl Iterator<Item = Run> {
        self.bytes.chunks_exact(BYTES).map(run_of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(slots: &[u32], runs: usize) {
        let mut writer = RunWriter::default();
        slots.iter().for_each(|slot| writer.push(*slot));
        assert_eq!(writer.runs.len(), runs, "{slots:?}");
        for piece in [1, 2, 3, 64] {
            let mut in_pieces = RunWriter::default();
            slots.chunks(piece).for_each(|piece| in_pieces.extend(piece));
            assert_eq!(in_pieces.runs, writer.runs, "{slots:?} by {piece}");
        }
        let mut bytes = Vec::new();
        writer.write(&mut bytes);
        let read = Runs::read(&bytes).unwrap();
        let found: Vec<u32> = read.iter().flat_map(Run::slots).map(|slot| slot as u32).collect();
        assert_eq!((&found[..], read.slots), (slots, slots.len()));
    }

    #[test]
    fn slots_in_equal_steps_are_one_run() {
        check(&[], 0);
        check(&[7], 1);
        check(&[7, 8, 9, 10], 1);
        check(&[1, 3, 5, 7, 9], 1);
        check(&[0, 1, 2, 10, 20, 30, 31], 3);
        check(&[5, 4, 3], 3);
        check(&[9, 9], 2);
        check(&[0, u32::MAX, 3], 2);
        check(&[1 << 30, 2 << 30, 3 << 30, 0, 1 << 30], 2);
        check(&(0..1000).map(|place| place * 4_000_000).collect::<Vec<u32>>(), 1);
    }

    #[test]
    fn what_is_no_run_is_refused() {
        let bytes = |words: [u32; 3]| words.map(u32::to_le_bytes).concat();
        for words in [[0, 0, 2], [0, 1, 0], [u32::MAX, 1, 2], [0, u32::MAX, 3], [0, 1, u32::MAX]] {
            assert_eq!(Runs::read(&bytes(words)).is_err(), words[2] != u32::MAX, "{words:?}");
        }
        assert!(Runs::read(&[0; 11]).is_err());
    }
}
