//! What goes wrong, by dice, and what must be well again afterwards.

use super::super::{ApplicationLock, TIMEOUT_US};
use super::display::Display;
use super::{Message, NEVER, Simulation, TICK_US};

/// A stream of random numbers (SplitMix64).
pub(super) struct Dice(pub(super) u64);

impl Dice {
    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    pub(super) fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    pub(super) fn chance(&mut self, of_1000: u64) -> bool {
        self.below(1000) < of_1000
    }
}

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Faults {
    pub(super) lost: u64,
    pub(super) repeated: u64,
    pub(super) longest_us: u64,
    pub(super) disasters: bool,
    /// What the application says in one turn arrives together, as it does on the short line of one machine.
    pub(super) together: bool,
}

impl Simulation {
    pub(super) fn disaster(&mut self) {
        let place = self.dice.below(self.displays.len() as u64) as usize;
        match self.dice.below(4000) {
            0..6 => {
                // Dies; sometimes the application learns of it.
                let id = self.displays[place].id;
                if self.dice.chance(500) {
                    self.at(1000, None, id, Message::Gone);
                }
                self.ids += 1;
                self.displays[place] = Display::new(self.ids);
            }
            6..12 => {
                let frozen_us = self.dice.below(900_000);
                let busy = &mut self.displays[place].busy_until_us;
                *busy = (*busy).max(self.now_us + frozen_us);
            }
            12..18 => self.displays[place].is_cut_off = true,
            18..50 => self.displays.iter_mut().for_each(|display| display.is_cut_off = false),
            50..54 => self.displays[place].world ^= 1,
            54..55 => {
                self.tally.restarts += 1;
                self.is_down_until_us = self.now_us + self.dice.below(400_000);
                self.epoch += 1;
                self.world = self.epoch;
                self.application = ApplicationLock::new(TIMEOUT_US);
            }
            55..58 => {
                // Garbage that reads as a release.
                let epoch = if self.dice.chance(500) { self.epoch } else { NEVER + self.dice.below(5) };
                let frame = if self.dice.chance(500) { self.dice.below(1000) } else { u64::MAX };
                self.tally.forged += 1;
                let id = self.displays[place].id;
                self.at(100, Some(place), id, Message::Release { epoch, frame, may_show: Vec::new() });
            }
            58..59 => {
                // A frame that never was, as far from all others as can be.
                let (epoch, frame, world) = (self.epoch, u64::MAX - self.dice.below(300), self.dice.next());
                self.tally.forged += 1;
                let id = self.displays[place].id;
                self.at(100, Some(place), id, Message::Frame { epoch, frame, world });
            }
            59..61 => {
                // A display that starts is told of a world that never was, as far from all others as can be.
                self.ids += 1;
                self.displays[place] = Display::new(self.ids);
                self.tally.forged += 1;
                let (epoch, frame, world) = (self.epoch, u64::MAX - self.dice.below(300), self.dice.next());
                self.at(100, Some(place), self.displays[place].id, Message::Snapshot { epoch, frame, world });
            }
            _ => {}
        }
    }

    /// After the last fault everybody is back.
    pub(super) fn heal(&mut self) {
        self.faults = Faults { lost: 0, repeated: 0, longest_us: 400, disasters: false, together: self.faults.together };
        self.displays.iter_mut().for_each(|display| display.is_cut_off = false);
        self.is_down_until_us = self.now_us.min(self.is_down_until_us);
        let healed_us = self.now_us;
        let frozen_us = self.displays.iter().map(|display| display.busy_until_us.saturating_sub(healed_us)).max().unwrap_or(0);
        self.run_until(healed_us + frozen_us);
        self.now_us = healed_us + frozen_us;
        let awake_us = self.now_us;
        // What was lost before shows within the timeout.
        self.run_until(awake_us + 2 * TIMEOUT_US);
        self.now_us = awake_us + 2 * TIMEOUT_US;
        // A first drawing that was under way, then one after the snapshot.
        let patience_us = 4 * self.pace.first_us + 2_000_000;
        while self.now_us < awake_us + patience_us && !self.all_show() {
            let next_us = self.now_us + TICK_US;
            self.run_until(next_us);
            self.now_us = next_us;
        }
        self.tally.longest_rejoin_us = self.tally.longest_rejoin_us.max(self.now_us - awake_us);
        let (end_us, drops) = (self.now_us + 1_000_000, self.tally.drops);
        self.run_until(end_us);
        assert_eq!(self.tally.drops, drops, "who came back is in the lock for good");
        for (place, display) in self.displays.iter().enumerate() {
            let (shown, frame) = (display.lock.shown(), self.application.frame());
            assert!(self.all_show(), "display {place} shows {shown} of {frame}: {:?} {:?}", display.lock, self.application);
        }
    }
}
