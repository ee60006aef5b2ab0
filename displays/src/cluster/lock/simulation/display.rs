//! A display of the simulation: it draws, freezes, and hears what came meanwhile when it is done.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use super::super::{DisplayAction, DisplayEvent, DisplayId, DisplayLock, TimeUs};
use super::{Message, NEVER, Simulation, TICK_US, world_after};
use crate::cluster::queue::Queue;

/// So many frames wait while a display draws or is frozen.
const MOST_FRAMES: usize = 500;

pub(super) struct Display {
    pub(super) id: DisplayId,
    pub(super) lock: DisplayLock,
    pub(super) world: u64,
    pub(super) packets: BTreeMap<u64, (u64, u64)>,
    pub(super) snapshot: u64,
    pub(super) drawn: (u64, u64),
    /// Nothing was drawn since the last snapshot.
    pub(super) is_cold: bool,
    pub(super) took_us: TimeUs,
    pub(super) shown: u64,
    /// Drawing or frozen until then; messages wait.
    pub(super) busy_until_us: TimeUs,
    pub(super) inbox: Queue<Message>,
    pub(super) is_cut_off: bool,
}

impl Display {
    pub(super) fn new(id: u64) -> Self {
        Self {
            id: DisplayId(id),
            lock: DisplayLock::new(),
            world: 0,
            packets: BTreeMap::new(),
            snapshot: 0,
            drawn: (0, 0),
            is_cold: true,
            took_us: 0,
            shown: 0,
            busy_until_us: 0,
            inbox: Queue::new(MOST_FRAMES, |_| Message::Flooded),
            is_cut_off: false,
        }
    }
}

impl Simulation {
    pub(super) fn display_gets(&mut self, place: usize, from: DisplayId, message: Message) {
        let display = &mut self.displays[place];
        if matches!(message, Message::Tick) {
            self.at(TICK_US, Some(place), from, Message::Tick);
            if self.now_us < self.displays[place].busy_until_us {
                return;
            }
        } else if from.0 != 0 && from != display.id {
            return; // for one that crashed
        } else if self.now_us < display.busy_until_us && !matches!(message, Message::Drawn(_)) {
            return match message {
                Message::Frame { .. } => display.inbox.push_frame(message, 1),
                _ => display.inbox.push(message),
            };
        }
        self.display_handles(place, message);
        while self.now_us >= self.displays[place].busy_until_us
            && let Some(message) = self.displays[place].inbox.pop()
        {
            self.display_handles(place, message);
        }
        if self.now_us >= self.displays[place].busy_until_us && !self.comes_more(place) {
            self.display_handles(place, Message::Tick);
        }
    }

    /// Does something else arrive at a display at this very moment?
    fn comes_more(&self, place: usize) -> bool {
        let mut now = self.queue.iter().filter(|Reverse((time_us, _))| *time_us == self.now_us);
        now.any(|Reverse((_, number))| self.messages.get(number).is_some_and(|(to, ..)| *to == Some(place)))
    }

    fn display_handles(&mut self, place: usize, message: Message) {
        // As displays do: a run of the application is made known before its first packet is kept.
        if let Message::Frame { epoch, .. } = message
            && epoch > self.displays[place].lock.epoch()
        {
            self.display_steps(place, DisplayEvent::Release { epoch, frame: 0, is_mine: false });
        }
        let display = &mut self.displays[place];
        let event = match message {
            Message::Frame { epoch, frame, world } => {
                if epoch == display.lock.epoch() {
                    display.packets.insert(frame, (epoch, world));
                }
                DisplayEvent::Frame { epoch, frame }
            }
            Message::Snapshot { epoch, frame, world } => {
                display.snapshot = world;
                DisplayEvent::Snapshot { epoch, frame }
            }
            Message::Release { epoch, frame, may_show } => {
                DisplayEvent::Release { epoch, frame, is_mine: may_show.contains(&display.id) }
            }
            Message::Flooded => DisplayEvent::Flooded,
            Message::Drawn(frame) => {
                display.busy_until_us = 0;
                // What is drawn for a run that never was counts for none, nor does a frame that never was.
                if display.lock.epoch() < NEVER && frame < NEVER {
                    display.drawn = display.drawn.max((display.lock.epoch(), frame));
                }
                DisplayEvent::Drawn(frame)
            }
            _ => DisplayEvent::Tick,
        };
        self.display_steps(place, event);
    }

    fn display_steps(&mut self, place: usize, event: DisplayEvent) {
        self.tally.steps += 1;
        let actions = self.displays[place].lock.step(self.now_us, event);
        for action in actions {
            let display = &mut self.displays[place];
            let epoch = display.lock.epoch();
            match action {
                DisplayAction::Fetch => {
                    self.tally.fetches += 1;
                    self.send(place, None, Message::Fetch);
                }
                DisplayAction::Restore(frame) => {
                    display.world = display.snapshot;
                    display.is_cold = true;
                    display.packets = display.packets.split_off(&frame.saturating_add(1));
                }
                DisplayAction::Apply(frame) => {
                    let (of, world) = display.packets.remove(&frame).expect("only packets that came are applied");
                    assert_eq!(of, epoch, "a packet of another run is applied");
                    display.world = world_after(display.world, epoch, frame);
                    let agrees = display.world == world;
                    self.tally.diverged += !agrees as u64;
                    self.display_steps(place, if agrees { DisplayEvent::Applied(frame) } else { DisplayEvent::Diverged(frame) });
                }
                DisplayAction::Draw(frame) => {
                    let pace = self.slow.filter(|(slow, _)| *slow == place).map_or(self.pace, |(_, pace)| pace);
                    let draws_us = match std::mem::take(&mut display.is_cold) {
                        true => pace.first_us + self.dice.below(pace.first_us),
                        false => pace.each_us / 2 + self.dice.below(pace.each_us),
                    };
                    let display = &mut self.displays[place];
                    display.took_us = draws_us;
                    display.busy_until_us = self.now_us + draws_us;
                    let id = display.id;
                    self.at(draws_us, Some(place), id, Message::Drawn(frame));
                }
                DisplayAction::Ready(frame) => {
                    let took_us = display.took_us;
                    self.send(place, None, Message::Ready { epoch, frame, took_us });
                }
                DisplayAction::Show(frame) => {
                    assert!(display.drawn >= (epoch, frame));
                    self.tally.shown += 1;
                    display.shown += 1;
                    self.shows(place, epoch, frame);
                }
                DisplayAction::Forget => display.packets.clear(),
            }
        }
    }

    /// No frame is shown that the application did not release.
    fn shows(&self, place: usize, epoch: u64, frame: u64) {
        if epoch == self.epoch {
            let released = self.application.frame() - self.application.waits() as u64;
            assert!(frame <= released, "display {place} shows {frame}, released is {released}");
        }
    }
}
