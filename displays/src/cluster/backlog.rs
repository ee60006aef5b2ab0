//! Packets that wait for their turn, by number, in bounded memory. They wait for a snapshot, or for long values; the oldest go first, since
//! a snapshot that is asked for now is as of a later frame.

use std::collections::BTreeMap;

/// Frames that wait take no more memory than this, unless a single one does. A first drawing of five seconds, after which nothing should
/// have to be fetched and drawn for the first time again, keeps what 10 000 transforms make at 60 Hz.
pub(super) const MOST_BYTES: usize = 128 << 20;

/// See above; with the bytes of each.
pub(super) struct Backlog<P> {
    packets: BTreeMap<u64, (P, usize)>,
    bytes: usize,
    most_bytes: usize,
}

impl<P> Backlog<P> {
    pub(super) fn new(most_bytes: usize) -> Backlog<P> {
        Backlog { packets: BTreeMap::new(), bytes: 0, most_bytes }
    }

    /// Keeps the packet of a frame. False if older ones had to go, or this one where it is older than they.
    pub(super) fn keep(&mut self, frame: u64, packet: P, bytes: usize) -> bool {
        self.take(frame);
        self.packets.insert(frame, (packet, bytes));
        self.bytes += bytes;
        let fits = self.bytes <= self.most_bytes || self.packets.len() == 1;
        while self.bytes > self.most_bytes
            && self.packets.len() > 1
            && let Some((_, (_, bytes))) = self.packets.pop_first()
        {
            self.bytes -= bytes;
        }
        fits
    }

    pub(super) fn get(&self, frame: u64) -> Option<&P> {
        self.packets.get(&frame).map(|(packet, _)| packet)
    }

    pub(super) fn take(&mut self, frame: u64) -> Option<P> {
        let (packet, bytes) = self.packets.remove(&frame)?;
        self.bytes -= bytes;
        Some(packet)
    }

    pub(super) fn last(&self) -> Option<u64> {
        self.packets.last_key_value().map(|(frame, _)| *frame)
    }

    /// Of this frame and earlier ones.
    pub(super) fn forget_to(&mut self, frame: u64) {
        self.packets = self.packets.split_off(&frame.saturating_add(1));
        self.bytes = self.packets.values().map(|(_, bytes)| bytes).sum();
    }

    pub(super) fn clear(&mut self) {
        self.packets.clear();
        self.bytes = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(backlog: &mut Backlog<u64>, expected: &[u64]) {
        assert_eq!(backlog.packets.keys().copied().collect::<Vec<_>>(), expected);
        assert_eq!(backlog.bytes, backlog.packets.values().map(|(_, bytes)| bytes).sum::<usize>());
        assert_eq!(backlog.last(), expected.last().copied());
        assert!(expected.iter().all(|frame| backlog.get(*frame) == Some(frame)));
    }

    #[test]
    fn the_oldest_go_first() {
        // The frame and its bytes, whether there is room for 100 of them, and what is there then.
        let rows: [(u64, usize, bool, &[u64]); 8] = [
            (4, 40, true, &[4]),
            (5, 40, true, &[4, 5]),
            (5, 60, true, &[4, 5]),
            (3, 1, false, &[4, 5]),
            (6, 10, false, &[5, 6]),
            (7, 500, false, &[7]),
            (8, 50, false, &[8]),
            (9, 50, true, &[8, 9]),
        ];
        let mut backlog = Backlog::new(100);
        for (frame, bytes, fits, expected) in rows {
            assert_eq!(backlog.keep(frame, frame, bytes), fits, "{frame}");
            check(&mut backlog, expected);
        }
        backlog.forget_to(8);
        check(&mut backlog, &[9]);
        assert_eq!((backlog.take(9), backlog.take(9)), (Some(9), None));
        check(&mut backlog, &[]);
        backlog.keep(u64::MAX, u64::MAX, 1);
        backlog.forget_to(u64::MAX - 1);
        check(&mut backlog, &[u64::MAX]);
        backlog.clear();
        check(&mut backlog, &[]);
    }
}
