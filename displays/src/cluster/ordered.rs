//! Numbered messages over a line that loses, repeats and overtakes: each is taken once, in order.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// So many messages may be on their way.
const WINDOW: u64 = 4096;

/// The sender's end: keeps what is not known to have been taken.
#[derive(Clone, Debug)]
pub(super) struct Outbox<M> {
    last: u64,
    unconfirmed: BTreeMap<u64, (M, Instant)>,
}

impl<M> Default for Outbox<M> {
    fn default() -> Outbox<M> {
        Outbox { last: 0, unconfirmed: BTreeMap::new() }
    }
}

impl<M> Outbox<M> {
    /// The number of the next message; they count from one.
    pub(super) fn next(&self) -> u64 {
        self.last + 1
    }

    /// False while more messages are on their way than the other end keeps.
    pub(super) fn has_room(&self) -> bool {
        (self.unconfirmed.len() as u64) < WINDOW
    }

    /// Keeps the next message, which is being sent.
    pub(super) fn sent(&mut self, message: M) {
        self.last += 1;
        self.unconfirmed.insert(self.last, (message, Instant::now()));
    }

    /// All messages up to this one were taken.
    pub(super) fn confirm(&mut self, number: u64) {
        self.unconfirmed = self.unconfirmed.split_off(&(number + 1));
    }

    /// What was sent this long ago and is not confirmed, to be sent again now.
    pub(super) fn overdue(&mut self, after: Duration) -> impl Iterator<Item = &M> {
        let now = Instant::now();
        let late = self.unconfirmed.values_mut().filter(move |(_, sent)| now.saturating_duration_since(*sent) >= after);
        late.map(move |(message, sent)| {
            *sent = now;
            &*message
        })
    }
}

/// The receiver's end for one sender.
#[derive(Clone, Debug)]
pub(super) struct Inbox<M> {
    taken: u64,
    early: BTreeMap<u64, M>,
}

impl<M> Default for Inbox<M> {
    fn default() -> Inbox<M> {
        Inbox { taken: 0, early: BTreeMap::new() }
    }
}

impl<M> Inbox<M> {
    /// The last message that was taken.
    pub(super) fn taken(&self) -> u64 {
        self.taken
    }

    /// A message came. Gives all that can be taken now, in order.
    pub(super) fn arrived(&mut self, number: u64, message: M) -> Vec<M> {
        if number > self.taken && number <= self.taken.saturating_add(WINDOW) {
            self.early.insert(number, message);
        }
        std::iter::from_fn(|| {
            let message = self.early.remove(&(self.taken + 1))?;
            self.taken += 1;
            Some(message)
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 100 transmissions `lost` are lost, as many come twice, and the rest in any order.
    fn check(lost: u64, seed: u64) {
        let mut random = seed | 1;
        let mut dice = move |below: u64| {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            random % below
        };
        let (mut outbox, mut inbox) = (Outbox::default(), Inbox::default());
        let (mut line, mut taken) = (Vec::new(), Vec::new());
        while taken.len() < 500 {
            if outbox.next() <= 500 {
                let message = outbox.next();
                outbox.sent(message);
                line.push(message);
            }
            line.extend(outbox.overdue(Duration::ZERO).filter(|_| dice(20) == 0).copied().collect::<Vec<u64>>());
            while line.len() > 5 || !line.is_empty() && outbox.next() > 500 {
                let message: u64 = line.swap_remove(dice(line.len() as u64) as usize);
                let times = if dice(100) < lost { 0 } else { 1 + u64::from(dice(100) < lost) };
                for _ in 0..times {
                    taken.extend(inbox.arrived(message, message));
                }
            }
            if dice(3) == 0 {
                outbox.confirm(inbox.taken());
            }
        }
        assert_eq!(taken, (1..=500).collect::<Vec<u64>>(), "lost {lost}, seed {seed}");
        outbox.confirm(inbox.taken());
        assert!(outbox.unconfirmed.is_empty() && inbox.early.is_empty());
    }

    #[test]
    fn everything_is_taken_once_and_in_order() {
        for seed in 1..20 {
            [0, 10, 60].into_iter().for_each(|lost| check(lost, seed));
        }
    }

    #[test]
    fn a_sender_cannot_fill_the_memory() {
        let mut inbox = Inbox::default();
        for number in [2, 3, WINDOW + 1, u64::MAX, 0] {
            assert!(inbox.arrived(number, ()).is_empty());
        }
        assert_eq!(inbox.early.len(), 2);
        let mut outbox = Outbox::default();
        (0..WINDOW).for_each(|_| outbox.sent(()));
        assert!(!outbox.has_room());
        outbox.confirm(1);
        assert!(outbox.has_room());
    }
}
