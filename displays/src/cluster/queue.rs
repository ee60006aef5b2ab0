//! What came and was not taken yet, in order. Frames of it are bounded: they pile up while who takes them draws for seconds, or while a line
//! is slower than frames are made. Where they would be too many all are dropped, and so is what comes until that is noticed: a snapshot is
//! less work by then.

use std::collections::VecDeque;

/// Frames that were dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Flood {
    pub(super) frames: usize,
    pub(super) bytes: usize,
}

impl Flood {
    fn adds(&mut self, bytes: usize) {
        self.frames += 1;
        self.bytes += bytes;
    }
}

impl std::fmt::Display for Flood {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(to, "{} frames, {:.1} MiB", self.frames, self.bytes as f64 / (1 << 20) as f64)
    }
}

/// See above.
pub(super) struct Queue<A> {
    /// With its bytes, where it is a frame.
    waiting: VecDeque<(A, Option<usize>)>,
    /// Of all frames that wait.
    bytes: usize,
    most_bytes: usize,
    /// Not told yet.
    flood: Option<Flood>,
    flooded: fn(Flood) -> A,
}

impl<A> Queue<A> {
    /// Nothing waits; `flooded` is what comes out instead of frames that were dropped.
    pub(super) fn new(most_bytes: usize, flooded: fn(Flood) -> A) -> Queue<A> {
        Queue { waiting: VecDeque::new(), bytes: 0, most_bytes, flood: None, flooded }
    }

    /// Takes a frame of so many bytes, or drops it with all others.
    pub(super) fn push_frame(&mut self, frame: A, bytes: usize) {
        if self.bytes > 0 && self.bytes + bytes > self.most_bytes {
            let flood = self.flood.get_or_insert_default();
            self.waiting.iter().filter_map(|(_, bytes)| *bytes).for_each(|bytes| flood.adds(bytes));
            self.waiting.retain(|(_, bytes)| bytes.is_none());
            self.bytes = 0;
        }
        match &mut self.flood {
            Some(flood) => flood.adds(bytes),
            None => {
                self.bytes += bytes;
                self.waiting.push_back((frame, Some(bytes)));
            }
        }
    }

    /// Takes something else, which is never dropped.
    pub(super) fn push(&mut self, other: A) {
        self.waiting.push_back((other, None));
    }

    /// What is next. That frames were dropped comes before all else.
    pub(super) fn pop(&mut self) -> Option<A> {
        if let Some(flood) = self.flood.take() {
            return Some((self.flooded)(flood));
        }
        let (next, bytes) = self.waiting.pop_front()?;
        self.bytes -= bytes.unwrap_or(0);
        Some(next)
    }

    /// Is there nothing?
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty() && self.flood.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq)]
    enum Came {
        Frame(usize),
        Word(u8),
        Flood(usize, usize),
    }
    use Came::{Flood as Dropped, Frame, Word};

    /// What comes out of a queue of 100 bytes where each row comes in.
    #[test]
    fn frames_are_bounded_and_words_are_kept() {
        let rows: [(&[Came], &[Came]); 6] = [
            (&[], &[]),
            (&[Frame(60), Word(1), Frame(40)], &[Frame(60), Word(1), Frame(40)]),
            // The first that is too many takes all with it, and so does what comes before that is known.
            (&[Word(1), Frame(60), Word(2), Frame(41), Word(3), Frame(1)], &[Dropped(3, 102), Word(1), Word(2), Word(3)]),
            (&[Frame(500)], &[Frame(500)]),
            (&[Frame(500), Frame(500)], &[Dropped(2, 1000)]),
            (&[Word(7), Frame(500), Word(8)], &[Word(7), Frame(500), Word(8)]),
        ];
        let mut queue = Queue::new(100, |flood| Dropped(flood.frames, flood.bytes));
        for (came, expected) in rows {
            for next in came {
                match next {
                    Frame(bytes) => queue.push_frame(next.clone(), *bytes),
                    _ => queue.push(next.clone()),
                }
            }
            assert_eq!(queue.is_empty(), expected.is_empty());
            let taken: Vec<Came> = std::iter::from_fn(|| queue.pop()).collect();
            assert_eq!(taken, expected, "{came:?}");
            assert!(queue.is_empty() && queue.bytes == 0, "{came:?}");
        }
    }
}
