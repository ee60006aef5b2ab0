//! A display's end of the frame lock.

use std::collections::BTreeSet;

use super::TimeUs;

/// A snapshot that did not come within this time is asked for again.
const FETCH_US: TimeUs = 200_000;
/// A frame that is missing may be late for so long before a snapshot is fetched instead.
const PATIENCE_US: TimeUs = 20_000;
/// Ready is said again after so long without an answer: it may have been lost.
const REPEAT_US: TimeUs = 40_000;
/// What the others have shown already is drawn where nothing newer comes for so long.
const IDLE_US: TimeUs = 100_000;
/// More frames than this are not kept to catch up with: a snapshot is less work.
const BACKLOG: usize = 256;
/// No frame comes so far behind a snapshot of its own run: that was of none.
const FAR: u64 = 4096;
/// Who answers for so long, while nothing comes of the run that is followed, is the application: the word of a later run was none.
const BELIEVED_US: TimeUs = 1_000_000;

/// What happens to a display.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisplayEvent {
    /// A frame's packet came and is kept.
    Frame {
        /// The run of the application; later runs have greater numbers.
        epoch: u64,
        /// Its number.
        frame: u64,
    },
    /// A snapshot came and is kept.
    Snapshot {
        /// The run of the application.
        epoch: u64,
        /// The frame as of which it is.
        frame: u64,
    },
    /// The application lets a frame be shown.
    Release {
        /// The run of the application.
        epoch: u64,
        /// The frame.
        frame: u64,
        /// May this display show it?
        is_mine: bool,
    },
    /// The frame that was to be applied is in the replica, and the replica agrees with the application.
    Applied(u64),
    /// The frame could not be applied, or the replica does not agree with the application after it.
    Diverged(u64),
    /// No replica could be made of the snapshot.
    Unusable,
    /// The frame was drawn.
    Drawn(u64),
    /// Frames came and were not kept: too many for the memory that there is for them.
    Flooded,
    /// An application can be asked from now on. What was asked for before went to nobody.
    Linked,
    /// Nothing more has come for now; at least every few milliseconds. Only then is anything drawn: what came during a long drawing would
    /// otherwise be drawn one by one, for ever behind the others.
    Tick,
}

/// What a display is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisplayAction {
    /// Ask the application for a snapshot.
    Fetch,
    /// Make the replica anew from the snapshot that was kept, and forget packets up to it.
    Restore(u64),
    /// Apply the packet of this frame to the replica; answer with `Applied` or `Diverged` at once.
    Apply(u64),
    /// Draw the replica as it is; answer with `Drawn` when it is done.
    Draw(u64),
    /// Tell the application that the frame is drawn.
    Ready(u64),
    /// Show what was drawn.
    Show(u64),
    /// Forget all packets: they are of another run, or too many.
    Forget,
}

/// Which frame is where on its way to the screen.
#[derive(Clone, Debug, Default)]
pub struct DisplayLock {
    epoch: u64,
    /// The frame that the replica is as of; none without a replica.
    applied: Option<u64>,
    is_applying: bool,
    waiting: BTreeSet<u64>,
    drawing: Option<u64>,
    drawn: u64,
    shown: u64,
    /// The last frame that the application let others show. Those before it are not worth drawing, except to be warm.
    released: u64,
    /// The last frame that came, or that a snapshot was as of.
    newest: u64,
    /// Something was drawn just now, and what came meanwhile is not looked at yet.
    has_drawn: bool,
    /// The last frame that came while another one was drawn, and that the others have shown; and when it was passed over.
    passed: u64,
    passed_us: TimeUs,
    /// Nothing was drawn since the last snapshot: pipelines, meshes and textures are not on the GPU yet.
    is_cold: bool,
    /// When a snapshot was last asked for, while one is needed.
    fetching_since_us: Option<TimeUs>,
    missing_since_us: Option<TimeUs>,
    /// Since when a frame could be drawn, but for the release of the last one, which is not heard of.
    held_since_us: Option<TimeUs>,
    said_ready_us: TimeUs,
    /// Since when an earlier run answers, while nothing comes of this one.
    answered_since_us: Option<TimeUs>,
}

impl DisplayLock {
    /// Knows of no application yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The run of the application that is followed; zero before the first.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// The last frame that was shown.
    pub fn shown(&self) -> u64 {
        self.shown
    }

    /// True if the replica is as the application says.
    pub fn follows(&self) -> bool {
        self.applied.is_some()
    }

    /// Takes an event at a time; gives what is to be done, in order.
    pub fn step(&mut self, now_us: TimeUs, event: DisplayEvent) -> Vec<DisplayAction> {
        let mut actions = Vec::new();
        match event {
            DisplayEvent::Frame { epoch, frame }
                if epoch == self.epoch && self.applied.is_some_and(|applied| applied.saturating_sub(frame) > FAR) =>
            {
                self.begin(epoch, &mut actions);
                self.advance(now_us, &mut actions);
            }
            DisplayEvent::Frame { epoch, frame } if self.is_current(epoch, &mut actions) => {
                if frame > self.newest {
                    // No later one is released, whatever was said.
                    (self.newest, self.released) = (frame, self.released.min(frame));
                }
                if self.applied.is_none_or(|applied| frame > applied) {
                    self.waiting.insert(frame);
                }
                if self.waiting.len() > BACKLOG {
                    self.lose(&mut actions);
                }
                self.advance(now_us, &mut actions);
            }
            DisplayEvent::Snapshot { epoch, frame }
                if self.believes(now_us, epoch, &mut actions) || self.is_current(epoch, &mut actions) =>
            {
                if self.applied.is_none() {
                    (self.applied, self.fetching_since_us) = (Some(frame), None);
                    self.is_cold = true;
                    actions.push(DisplayAction::Restore(frame));
                    self.waiting = self.waiting.split_off(&frame.saturating_add(1));
                    self.waiting.split_off(&frame.saturating_add(BACKLOG as u64));
                    self.newest = self.waiting.last().copied().unwrap_or(frame);
                }
                self.advance(now_us, &mut actions);
            }
            DisplayEvent::Release { epoch, frame, is_mine } if self.is_current(epoch, &mut actions) => {
                self.released = self.released.max(frame);
                if is_mine && self.drawn == frame {
                    self.show(&mut actions);
                }
                self.advance(now_us, &mut actions);
            }
            DisplayEvent::Frame { .. } | DisplayEvent::Snapshot { .. } | DisplayEvent::Release { .. } => {}
            DisplayEvent::Applied(frame) => {
                self.is_applying = false;
                if self.applied.is_some() {
                    self.applied = Some(frame);
                }
                self.advance(now_us, &mut actions);
            }
            DisplayEvent::Diverged(_) => {
                self.is_applying = false;
                self.applied = None;
                self.advance(now_us, &mut actions);
            }
            DisplayEvent::Unusable => {
                (self.applied, self.fetching_since_us) = (None, Some(now_us));
            }
            DisplayEvent::Drawn(frame) => {
                // What was drawn for another run of the application is worth nothing.
                if self.drawing == Some(frame) {
                    self.drawing = None;
                    (self.is_cold, self.has_drawn) = (false, true);
                    self.drawn = frame;
                    self.say_ready(now_us, &mut actions);
                }
                self.advance(now_us, &mut actions);
            }
            DisplayEvent::Flooded => {
                self.lose(&mut actions);
                self.advance(now_us, &mut actions);
            }
            DisplayEvent::Linked => {
                self.fetching_since_us = None;
                self.advance(now_us, &mut actions);
            }
            DisplayEvent::Tick => {
                if self.drawn > self.shown && self.drawing.is_none() && now_us >= self.said_ready_us + REPEAT_US {
                    self.say_ready(now_us, &mut actions);
                }
                self.advance(now_us, &mut actions);
                self.draw(now_us, &mut actions);
            }
        }
        actions
    }

    /// False for an earlier run of the application; a later one starts everything anew.
    fn is_current(&mut self, epoch: u64, actions: &mut Vec<DisplayAction>) -> bool {
        if epoch > self.epoch {
            // The first one that is heard of is the one that was asked.
            let fetching_since_us = self.fetching_since_us.filter(|_| self.epoch == 0);
            self.begin(epoch, actions);
            self.fetching_since_us = fetching_since_us;
        }
        let is_current = epoch == self.epoch;
        if is_current {
            self.answered_since_us = None;
        }
        is_current
    }

    /// True for the answer of an earlier run that turns out to be the one that there is.
    fn believes(&mut self, now_us: TimeUs, epoch: u64, actions: &mut Vec<DisplayAction>) -> bool {
        if epoch >= self.epoch || self.applied.is_some() {
            return false;
        }
        let since = *self.answered_since_us.get_or_insert(now_us);
        if now_us < since + BELIEVED_US {
            return false;
        }
        self.begin(epoch, actions);
        true
    }

    /// Nothing that came before counts.
    fn begin(&mut self, epoch: u64, actions: &mut Vec<DisplayAction>) {
        // What is being drawn goes on, but for nobody.
        *self = Self { epoch, is_applying: self.is_applying, ..Self::default() };
        actions.push(DisplayAction::Forget);
    }

    fn lose(&mut self, actions: &mut Vec<DisplayAction>) {
        self.waiting.clear();
        self.applied = None;
        actions.push(DisplayAction::Forget);
    }

    fn say_ready(&mut self, now_us: TimeUs, actions: &mut Vec<DisplayAction>) {
        self.said_ready_us = now_us;
        actions.push(DisplayAction::Ready(self.drawn));
    }

    /// Does what can be done next.
    fn advance(&mut self, now_us: TimeUs, actions: &mut Vec<DisplayAction>) {
        if self.is_applying || self.drawing.is_some() {
            return;
        }
        let Some(applied) = self.applied else { return self.fetch(now_us, actions) };
        // A later frame is there only once this one was released, to whomever: who was late for it shows it late.
        if applied > self.drawn {
            self.show(actions);
        }
        match self.waiting.first().copied() {
            Some(frame) if frame == applied.saturating_add(1) => {
                self.waiting.remove(&frame);
                self.missing_since_us = None;
                self.is_applying = true;
                actions.push(DisplayAction::Apply(frame));
            }
            Some(_) => {
                let since = *self.missing_since_us.get_or_insert(now_us);
                if now_us >= since + PATIENCE_US {
                    self.missing_since_us = None;
                    self.applied = None;
                    self.fetch(now_us, actions);
                }
            }
            None => self.missing_since_us = None,
        }
    }

    fn show(&mut self, actions: &mut Vec<DisplayAction>) {
        if self.shown < self.drawn {
            self.shown = self.drawn;
            actions.push(DisplayAction::Show(self.drawn));
        }
    }

    /// Draws the newest frame, unless the others are done with it.
    fn draw(&mut self, now_us: TimeUs, actions: &mut Vec<DisplayAction>) {
        let Some(applied) = self.applied.filter(|_| !self.is_applying && self.drawing.is_none()) else { return };
        let has_next = self.waiting.first() == Some(&applied.saturating_add(1));
        // Who idles when the next frame is published can be waited for. Where nobody is, that comes together with its release.
        if std::mem::take(&mut self.has_drawn) && applied <= self.released {
            (self.passed, self.passed_us) = (applied, now_us);
        }
        let is_next = applied > self.passed || now_us >= self.passed_us + IDLE_US;
        let is_wanted = applied > self.drawn && (self.is_cold || is_next && applied >= self.released);
        if has_next || !is_wanted {
            return;
        }
        // The release of what was drawn last may have been overtaken by this frame, and so may that of this one.
        if self.drawn > self.released {
            let since = *self.held_since_us.get_or_insert(now_us);
            if now_us < since + PATIENCE_US {
                return;
            }
        }
        self.held_since_us = None;
        self.drawing = Some(applied);
        actions.push(DisplayAction::Draw(applied));
    }

    fn fetch(&mut self, now_us: TimeUs, actions: &mut Vec<DisplayAction>) {
        if self.fetching_since_us.is_none_or(|since| now_us >= since + FETCH_US) {
            self.fetching_since_us = Some(now_us);
            actions.push(DisplayAction::Fetch);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forged, but numbers all the same.
    #[test]
    fn the_last_numbers_are_numbers_as_others() {
        for last in [u64::MAX, u64::MAX - 1, u64::MAX - BACKLOG as u64] {
            let mut lock = DisplayLock::new();
            lock.step(0, DisplayEvent::Frame { epoch: 1, frame: u64::MAX });
            let restored = lock.step(0, DisplayEvent::Snapshot { epoch: 1, frame: last });
            assert_eq!(restored.first(), Some(&DisplayAction::Restore(last)));
            lock.step(0, DisplayEvent::Frame { epoch: 1, frame: u64::MAX });
            lock.step(0, DisplayEvent::Release { epoch: 1, frame: u64::MAX, is_mine: true });
            assert!(lock.step(0, DisplayEvent::Tick).len() < 2);
        }
    }

    /// Nothing may come any more that would show the gap.
    #[test]
    fn who_was_flooded_fetches_the_world_at_once() {
        let mut lock = DisplayLock::new();
        lock.step(0, DisplayEvent::Snapshot { epoch: 1, frame: 7 });
        lock.step(0, DisplayEvent::Tick);
        assert_eq!(lock.step(9_000_000, DisplayEvent::Drawn(7)), [DisplayAction::Ready(7)]);
        assert_eq!(lock.step(9_000_000, DisplayEvent::Flooded), [DisplayAction::Forget, DisplayAction::Fetch]);
        let restored = lock.step(9_100_000, DisplayEvent::Snapshot { epoch: 1, frame: 500 });
        assert_eq!(restored, [DisplayAction::Restore(500), DisplayAction::Show(7)]);
    }
}
