//! The application's end of the frame lock.

use std::collections::BTreeMap;

use super::{DisplayId, TimeUs};

/// How long a display that kept the others waiting is not waited for again: doubles each time.
const FIRST_REST_US: TimeUs = 100_000;
/// The longest where it stood still or was cut off.
const LONGEST_REST_US: TimeUs = 400_000;
/// The longest where it draws too slowly for the others. What it draws it shows all the same, in time or late.
const LONGEST_REST_OF_SLOW_US: TimeUs = 12_800_000;
/// Frames in a row, and times the rest, after which earlier failures are forgotten.
const GOOD_FRAMES: u32 = 60;
const GOOD_RESTS: u64 = 4;
/// Failures after which the operator is told that a display is too slow.
const TELLING: u32 = 4;
/// A display that was not heard of for so long is forgotten.
const FORGOTTEN_US: TimeUs = 10_000_000;

/// What happens to the application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ApplicationEvent {
    /// The next frame was evaluated and sent. Only after the release of the last one.
    Published(u64),
    /// A display has drawn a frame and waits to show it.
    Ready {
        /// The display.
        display: DisplayId,
        /// What it has drawn.
        frame: u64,
        /// How long it took for that.
        took_us: TimeUs,
    },
    /// A display left, or its connection broke.
    Gone(DisplayId),
    /// A display cannot draw what is published, and nobody shall wait for it.
    Excused(DisplayId),
    /// Time went on; at least every few milliseconds while a frame waits.
    Tick,
}

/// What the application is to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ApplicationAction {
    /// These displays may show the frame; the next one may be evaluated.
    Release(u64, Vec<DisplayId>),
    /// Others wait for this display from now on.
    Admitted(DisplayId),
    /// Nobody waits for this display any more; it was late for this frame.
    Dropped(DisplayId, u64),
    /// A display is late again and again, because it draws too slowly, whether it was ever waited for or not. Told once, until it was in
    /// time for long.
    TooSlow {
        /// The display.
        display: DisplayId,
        /// How often it was late.
        times: u32,
        /// In how long.
        within_us: TimeUs,
        /// How long it drew at the most.
        took_us: TimeUs,
    },
}

#[derive(Clone, Debug)]
struct Member {
    is_live: bool,
    /// The last frame that it was ready with.
    ready: u64,
    /// When it became so, and how long it took to draw.
    ready_us: TimeUs,
    took_us: TimeUs,
    heard_us: TimeUs,
    /// Not waited for before this time.
    rests_until_us: TimeUs,
    rest_us: TimeUs,
    good_frames: u32,
    /// Since when others wait for it.
    live_since_us: TimeUs,
    /// How often it was late since it was in time for long, and since when.
    failures: u32,
    failing_since_us: TimeUs,
    /// It was left behind, and has not drawn anything since.
    is_late: bool,
    /// What it drew last was shown by the others before, because it draws too slowly.
    is_behind: bool,
    /// The longest that it drew something that it was late with, where that is too long.
    too_long_us: TimeUs,
    is_told: bool,
}

/// Who draws faster than this is in time where there is so much time.
fn well_within(time_us: TimeUs) -> TimeUs {
    2 * time_us / 3
}

impl Member {
    /// Draws well within a time.
    fn is_fast(&self, within_us: TimeUs) -> bool {
        self.took_us < well_within(within_us)
    }

    fn may_come_in(&self, now_us: TimeUs) -> bool {
        !self.is_live && now_us >= self.rests_until_us
    }

    fn comes_in(&mut self, now_us: TimeUs) {
        (self.is_live, self.live_since_us) = (true, now_us);
    }

    fn is_late_once_more(&mut self, now_us: TimeUs) {
        if self.failures == 0 {
            self.failing_since_us = now_us;
        }
        self.failures += 1;
    }

    fn fails(&mut self, now_us: TimeUs) {
        self.is_late_once_more(now_us);
        (self.is_live, self.is_late, self.good_frames) = (false, true, 0);
        self.rest_us = self.rest_us.min(self.longest_rest_us());
        self.rests_until_us = now_us + self.rest_us;
        self.rest_us = self.longest_rest_us().min(2 * self.rest_us);
    }

    fn longest_rest_us(&self) -> TimeUs {
        if self.too_long_us > 0 { LONGEST_REST_OF_SLOW_US } else { LONGEST_REST_US }
    }

    /// Was in time once more.
    fn succeeds(&mut self, now_us: TimeUs) {
        self.good_frames += 1;
        if self.good_frames >= GOOD_FRAMES && now_us >= self.live_since_us + GOOD_RESTS * self.rest_us {
            (self.rest_us, self.failures) = (FIRST_REST_US, 0);
            (self.too_long_us, self.is_told) = (0, false);
        }
    }
}

/// Who is waited for, and since when.
#[derive(Clone, Debug)]
pub struct ApplicationLock {
    timeout_us: TimeUs,
    frame: u64,
    released: u64,
    published_us: TimeUs,
    released_us: TimeUs,
    members: BTreeMap<DisplayId, Member>,
}

impl ApplicationLock {
    /// Nobody there, nothing published.
    pub fn new(timeout_us: TimeUs) -> Self {
        Self { timeout_us, frame: 0, released: 0, published_us: 0, released_us: 0, members: BTreeMap::new() }
    }

    /// True while a frame waits for displays.
    pub fn waits(&self) -> bool {
        self.released < self.frame
    }

    /// How long a frame waits.
    pub fn timeout_us(&self) -> TimeUs {
        self.timeout_us
    }

    /// Who draws faster than this is waited for.
    pub fn fast_us(&self) -> TimeUs {
        well_within(self.timeout_us)
    }

    /// The last frame that was published.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// Displays that are waited for.
    pub fn live(&self) -> impl Iterator<Item = DisplayId> {
        self.members.iter().filter(|(_, member)| member.is_live).map(|(id, _)| *id)
    }

    /// How many displays have drawn the last frame, waited for or not.
    pub fn in_time(&self) -> usize {
        self.members.values().filter(|member| member.ready == self.frame).count()
    }

    /// Takes an event at a time; gives what is to be done, in order.
    pub fn step(&mut self, now_us: TimeUs, event: ApplicationEvent) -> Vec<ApplicationAction> {
        let mut actions = Vec::new();
        match event {
            ApplicationEvent::Published(frame) => {
                (self.frame, self.published_us) = (frame, now_us);
                for (id, member) in &mut self.members {
                    // It idles now: it has drawn the last one, or became ready since that was released, and passes it over.
                    let had_last = member.ready + 1 == frame && member.took_us < self.timeout_us;
                    let has_passed = member.ready_us >= self.released_us && member.is_fast(self.timeout_us);
                    if member.may_come_in(now_us) && (had_last || has_passed) {
                        member.comes_in(now_us);
                        actions.push(ApplicationAction::Admitted(*id));
                    }
                }
            }
            ApplicationEvent::Ready { display, frame, took_us } => self.ready(now_us, display, frame, took_us, &mut actions),
            ApplicationEvent::Gone(id) => drop(self.members.remove(&id)),
            ApplicationEvent::Excused(id) => self.members.get_mut(&id).into_iter().for_each(|member| member.is_live = false),
            ApplicationEvent::Tick => {
                self.members.retain(|_, member| now_us < member.heard_us + FORGOTTEN_US.max(4 * self.timeout_us))
            }
        }
        self.release(now_us, &mut actions);
        actions
    }

    fn ready(&mut self, now_us: TimeUs, id: DisplayId, frame: u64, took_us: TimeUs, actions: &mut Vec<ApplicationAction>) {
        let (is_waiting, current, released) = (self.waits(), self.frame, self.released);
        let member = self.members.entry(id).or_insert(Member {
            is_live: false,
            ready: 0,
            ready_us: now_us,
            took_us: 0,
            heard_us: now_us,
            rests_until_us: 0,
            rest_us: FIRST_REST_US,
            good_frames: 0,
            live_since_us: now_us,
            failures: 0,
            failing_since_us: now_us,
            is_late: false,
            is_behind: false,
            too_long_us: 0,
            is_told: false,
        });
        member.heard_us = now_us;
        // A frame of the future is one of another run of the application; what is said again is no news.
        if frame > current || frame <= member.ready {
            return;
        }
        (member.ready, member.ready_us, member.took_us) = (frame, now_us, took_us);
        let (was_dropped, is_slow) = (std::mem::take(&mut member.is_late), !member.is_fast(self.timeout_us));
        let is_behind = is_slow && !member.is_live && frame <= released;
        // What is drawn first after a snapshot may take long: who is behind twice in a row is too slow.
        let is_behind_again = std::mem::replace(&mut member.is_behind, is_behind) && is_behind;
        if is_behind_again && !was_dropped {
            member.is_late_once_more(now_us);
        }
        if is_slow && (is_behind_again || was_dropped) {
            member.too_long_us = member.too_long_us.max(took_us);
        }
        if member.too_long_us > 0 && member.failures >= TELLING && !std::mem::replace(&mut member.is_told, true) {
            let (times, within_us) = (member.failures, now_us - member.failing_since_us);
            let took_us = member.too_long_us;
            actions.push(ApplicationAction::TooSlow { display: id, times, within_us, took_us });
        }
        // The others take their time for the last frame, and it turns to that too. If it will be in time, it is waited for.
        let spent_us = now_us - self.published_us;
        if is_waiting && frame < current && member.is_fast(self.timeout_us.saturating_sub(spent_us)) && member.may_come_in(now_us)
        {
            member.comes_in(now_us);
            actions.push(ApplicationAction::Admitted(id));
        }
    }

    fn release(&mut self, now_us: TimeUs, actions: &mut Vec<ApplicationAction>) {
        if !self.waits() {
            return;
        }
        let frame = self.frame;
        let is_late = now_us >= self.published_us + self.timeout_us;
        if !is_late && self.members.values().any(|member| member.is_live && member.ready < frame) {
            return;
        }
        for (id, member) in self.members.iter_mut().filter(|(_, member)| member.is_live) {
            if member.ready < frame {
                member.fails(now_us);
                actions.push(ApplicationAction::Dropped(*id, frame));
            } else {
                member.succeeds(now_us);
            }
        }
        (self.released, self.released_us) = (frame, now_us);
        // Who was not waited for but is in time may show the frame with the others.
        let in_time = self.members.iter().filter(|(_, member)| member.ready == frame).map(|(id, _)| *id).collect();
        actions.push(ApplicationAction::Release(frame, in_time));
    }
}
