//! A seeded simulation of one application and several displays: messages are late, lost, repeated and out of order, displays and the
//! application freeze, crash and come back, replicas are corrupted, releases and frames are forged. What must hold holds at every step.
//!
//! `UMBRIEL_LOCK_SEEDS=2000 cargo test --release -p umbriel-displays lock` runs more of it.

mod display;
mod faults;
mod tests;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use super::{ApplicationAction, ApplicationEvent, ApplicationLock, DisplayId, TIMEOUT_US, TimeUs};

use self::display::Display;
use self::faults::{Dice, Faults};

const TICK_US: TimeUs = 5_000;
const FRAME_US: TimeUs = 16_667;
/// No run of the application and no frame has such a number, but garbage may.
const NEVER: u64 = 1 << 60;

/// Stands for all values of a world.
fn world_after(before: u64, epoch: u64, frame: u64) -> u64 {
    Dice(before ^ epoch.rotate_left(40) ^ frame).next()
}

#[derive(Clone, Debug)]
enum Message {
    Frame {
        epoch: u64,
        frame: u64,
        world: u64,
    },
    Release {
        epoch: u64,
        frame: u64,
        may_show: Vec<DisplayId>,
    },
    Snapshot {
        epoch: u64,
        frame: u64,
        world: u64,
    },
    Ready {
        epoch: u64,
        frame: u64,
        took_us: TimeUs,
    },
    Fetch,
    Gone,
    Drawn(u64),
    /// Frames came while the display was busy, and are gone.
    Flooded,
    Tick,
}

/// To the application, or to a display by its place.
type Address = Option<usize>;

/// How fast displays draw.
#[derive(Clone, Copy, Debug)]
struct Pace {
    /// The first frame after a snapshot takes once to twice this: pipelines are compiled, meshes go to the GPU.
    first_us: TimeUs,
    /// Each other one half to one and a half times this.
    each_us: TimeUs,
}

#[derive(Default, Debug)]
struct Tally {
    steps: u64,
    shown: u64,
    drops: u64,
    told_slow: u64,
    fetches: u64,
    diverged: u64,
    restarts: u64,
    forged: u64,
    longest_stall_us: TimeUs,
    longest_rejoin_us: TimeUs,
}

struct Simulation {
    dice: Dice,
    faults: Faults,
    pace: Pace,
    /// One that draws at another pace.
    slow: Option<(usize, Pace)>,
    now_us: TimeUs,
    queue: BinaryHeap<Reverse<(TimeUs, u64)>>,
    messages: BTreeMap<u64, (Address, DisplayId, Message)>,
    sent: u64,
    application: ApplicationLock,
    epoch: u64,
    world: u64,
    is_down_until_us: TimeUs,
    /// How long what is said in this turn is on its way.
    turn_us: TimeUs,
    published_us: TimeUs,
    displays: Vec<Display>,
    ids: u64,
    tally: Tally,
}

impl Simulation {
    fn new(seed: u64, displays: usize, faults: Faults, pace: Pace) -> Self {
        let mut simulation = Self {
            dice: Dice(seed),
            faults,
            pace,
            slow: None,
            now_us: 0,
            queue: BinaryHeap::new(),
            messages: BTreeMap::new(),
            sent: 0,
            application: ApplicationLock::new(TIMEOUT_US),
            epoch: 1,
            world: 1,
            is_down_until_us: 0,
            turn_us: 0,
            published_us: 0,
            displays: (0..displays).map(|place| Display::new(place as u64 + 1)).collect(),
            ids: displays as u64,
            tally: Tally::default(),
        };
        simulation.at(0, None, DisplayId(0), Message::Tick);
        (0..displays).for_each(|place| simulation.at(1, Some(place), DisplayId(0), Message::Tick));
        simulation
    }

    /// Something happens after a time.
    fn at(&mut self, after_us: TimeUs, to: Address, from: DisplayId, message: Message) {
        self.sent += 1;
        self.queue.push(Reverse((self.now_us + after_us, self.sent)));
        self.messages.insert(self.sent, (to, from, message));
    }

    /// A message goes over the network; `place` is the display at the other end.
    fn send(&mut self, place: usize, to: Address, message: Message) {
        let copies = 1 + self.dice.chance(self.faults.repeated) as u64;
        for _ in 0..copies {
            if self.displays[place].is_cut_off || self.dice.chance(self.faults.lost) {
                continue;
            }
            let is_news = self.faults.together && matches!(message, Message::Frame { .. } | Message::Release { .. });
            let after_us = if is_news { self.turn_us } else { 30 + self.dice.below(self.faults.longest_us) };
            let from = self.displays[place].id;
            self.at(after_us, to, from, message.clone());
        }
    }

    fn run_until(&mut self, end_us: TimeUs) {
        while let Some(Reverse((time_us, number))) = self.queue.peek().copied() {
            if time_us > end_us {
                break;
            }
            self.queue.pop();
            self.now_us = time_us;
            let Some((to, from, message)) = self.messages.remove(&number) else { continue };
            match to {
                None => self.application_gets(from, message),
                Some(place) => self.display_gets(place, from, message),
            }
        }
    }

    fn application_gets(&mut self, from: DisplayId, message: Message) {
        self.turn_us = 30 + self.dice.below(self.faults.longest_us);
        let place = self.displays.iter().position(|display| display.id == from);
        let is_down = self.now_us < self.is_down_until_us;
        match message {
            Message::Tick => {
                if self.faults.disasters {
                    self.disaster();
                }
                self.at(TICK_US, None, from, Message::Tick);
                if is_down {
                    return;
                }
                if !self.application.waits() && self.now_us >= self.published_us + FRAME_US {
                    self.publish();
                }
                self.application_steps(ApplicationEvent::Tick);
            }
            _ if is_down => {}
            Message::Ready { epoch, frame, took_us } if epoch == self.epoch => {
                self.application_steps(ApplicationEvent::Ready { display: from, frame, took_us })
            }
            Message::Gone => self.application_steps(ApplicationEvent::Gone(from)),
            Message::Fetch => {
                let Some(place) = place else { return };
                let snapshot = Message::Snapshot { epoch: self.epoch, frame: self.application.frame(), world: self.world };
                self.send(place, Some(place), snapshot);
            }
            _ => {}
        }
    }

    fn publish(&mut self) {
        let frame = self.application.frame() + 1;
        self.world = world_after(self.world, self.epoch, frame);
        self.published_us = self.now_us;
        for place in 0..self.displays.len() {
            self.send(place, Some(place), Message::Frame { epoch: self.epoch, frame, world: self.world });
        }
        self.application_steps(ApplicationEvent::Published(frame));
    }

    fn application_steps(&mut self, event: ApplicationEvent) {
        self.tally.steps += 1;
        for action in self.application.step(self.now_us, event) {
            match action {
                ApplicationAction::Release(frame, may_show) => {
                    let stall_us = self.now_us - self.published_us;
                    assert!(stall_us <= TIMEOUT_US + TICK_US, "a stall of {stall_us} us");
                    self.tally.longest_stall_us = self.tally.longest_stall_us.max(stall_us);
                    // The invariant: who may show it, and who is waited for, has drawn it.
                    for id in may_show.iter().copied().chain(self.application.live()) {
                        let Some(display) = self.displays.iter().find(|display| display.id == id) else { continue };
                        assert!(
                            display.drawn >= (self.epoch, frame),
                            "{id:?} has drawn {:?} at the release of {frame}",
                            display.drawn
                        );
                    }
                    for place in 0..self.displays.len() {
                        self.send(place, Some(place), Message::Release { epoch: self.epoch, frame, may_show: may_show.clone() });
                    }
                }
                ApplicationAction::Dropped(..) => self.tally.drops += 1,
                ApplicationAction::TooSlow { took_us, .. } => {
                    assert!(took_us > TIMEOUT_US / 2);
                    self.tally.told_slow += 1;
                }
                ApplicationAction::Admitted(_) => {}
            }
        }
    }

    /// Does everybody show the last frames, and is waited for?
    fn all_show(&self) -> bool {
        let is_last =
            |display: &Display| display.lock.epoch() == self.epoch && display.lock.shown() + 2 >= self.application.frame();
        self.application.live().count() == self.displays.len() && self.displays.iter().all(is_last)
    }
}
