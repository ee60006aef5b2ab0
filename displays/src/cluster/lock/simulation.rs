//! A seeded simulation of one application and several displays: messages are late, lost, repeated and out of order, displays and the
//! application freeze, crash and come back, replicas are corrupted, releases and frames are forged. What must hold holds at every step.
//!
//! `UMBRIEL_LOCK_SEEDS=2000 cargo test --release -p umbriel-displays lock` runs more of it.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};

use super::{
    ApplicationAction, ApplicationEvent, ApplicationLock, DisplayAction, DisplayEvent, DisplayId, DisplayLock, TIMEOUT_US, TimeUs,
};

const TICK_US: TimeUs = 5_000;
const FRAME_US: TimeUs = 16_667;
/// No run of the application has such a number, but garbage may.
const NEVER: u64 = 1 << 60;

/// A stream of random numbers (SplitMix64).
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn chance(&mut self, of_1000: u64) -> bool {
        self.below(1000) < of_1000
    }
}

/// Stands for all values of a world.
fn world_after(before: u64, epoch: u64, frame: u64) -> u64 {
    Dice(before ^ epoch.rotate_left(40) ^ frame).next()
}

#[derive(Clone, Debug)]
enum Message {
    Frame { epoch: u64, frame: u64, world: u64 },
    Release { epoch: u64, frame: u64, may_show: Vec<DisplayId> },
    Snapshot { epoch: u64, frame: u64, world: u64 },
    Ready { epoch: u64, frame: u64, took_us: TimeUs },
    Fetch,
    Gone,
    Drawn(u64),
    Tick,
}

/// To the application, or to a display by its place.
type Address = Option<usize>;

struct Display {
    id: DisplayId,
    lock: DisplayLock,
    world: u64,
    packets: BTreeMap<u64, (u64, u64)>,
    snapshot: u64,
    drawn: (u64, u64),
    /// Nothing was drawn since the last snapshot.
    is_cold: bool,
    took_us: TimeUs,
    shown: u64,
    /// Drawing or frozen until then; messages wait.
    busy_until_us: TimeUs,
    inbox: VecDeque<Message>,
    is_cut_off: bool,
}

impl Display {
    fn new(id: u64) -> Self {
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
            inbox: VecDeque::new(),
            is_cut_off: false,
        }
    }
}

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Faults {
    lost: u64,
    repeated: u64,
    longest_us: u64,
    disasters: bool,
    /// What the application says in one turn arrives together, as it does on the short line of one machine.
    together: bool,
}

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

    fn display_gets(&mut self, place: usize, from: DisplayId, message: Message) {
        let display = &mut self.displays[place];
        if matches!(message, Message::Tick) {
            self.at(TICK_US, Some(place), from, Message::Tick);
            if self.now_us < self.displays[place].busy_until_us {
                return;
            }
        } else if from.0 != 0 && from != display.id {
            return; // for one that crashed
        } else if self.now_us < display.busy_until_us && !matches!(message, Message::Drawn(_)) {
            return display.inbox.push_back(message);
        }
        self.display_handles(place, message);
        while self.now_us >= self.displays[place].busy_until_us
            && let Some(message) = self.displays[place].inbox.pop_front()
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
            Message::Drawn(frame) => {
                display.busy_until_us = 0;
                // What is drawn for a run that never was counts for none.
                if display.lock.epoch() < NEVER {
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
                    display.packets = display.packets.split_off(&(frame + 1));
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

    fn disaster(&mut self) {
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
            _ => {}
        }
    }

    /// After the last fault everybody is back.
    fn heal(&mut self) {
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

    /// Does everybody show the last frames, and is waited for?
    fn all_show(&self) -> bool {
        let is_last =
            |display: &Display| display.lock.epoch() == self.epoch && display.lock.shown() + 2 >= self.application.frame();
        self.application.live().count() == self.displays.len() && self.displays.iter().all(is_last)
    }
}

fn run(seed: u64) -> Tally {
    let mut dice = Dice(!seed);
    let faults = Faults {
        lost: [0, 0, 5, 50, 200][dice.below(5) as usize],
        repeated: [0, 20, 300][dice.below(3) as usize],
        longest_us: [300, 3_000, 40_000][dice.below(3) as usize],
        disasters: dice.below(4) > 0,
        together: seed.is_multiple_of(2),
    };
    let displays = 1 + dice.below(7) as usize;
    let pace = Pace {
        first_us: [1_000, 150_000, 1_000_000][dice.below(3) as usize],
        each_us: [1_000, 9_000, 80_000][dice.below(3) as usize],
    };
    let mut simulation = Simulation::new(seed, displays, faults, pace);
    simulation.run_until(4_000_000);
    simulation.now_us = 4_000_000;
    simulation.heal();
    simulation.tally
}

#[test]
fn the_lock_holds_in_every_run() {
    let seeds = std::env::var("UMBRIEL_LOCK_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(300);
    let mut all = Tally::default();
    for seed in 0..seeds {
        println!("seed {seed}");
        let tally = run(seed);
        assert!(tally.shown > 0, "nothing was shown");
        all.steps += tally.steps;
        all.shown += tally.shown;
        all.drops += tally.drops;
        all.fetches += tally.fetches;
        all.diverged += tally.diverged;
        all.restarts += tally.restarts;
        all.forged += tally.forged;
        all.longest_stall_us = all.longest_stall_us.max(tally.longest_stall_us);
        all.longest_rejoin_us = all.longest_rejoin_us.max(tally.longest_rejoin_us);
    }
    println!("{all:?}");
    assert!(all.drops > 0 && all.diverged > 0 && all.restarts > 0 && all.forged > 0, "no fault showed: {all:?}");
}

/// One display of three needs half to one and a half times the timeout for a frame. Each time that it is waited for in vain costs the
/// others the timeout, so that it must become rare.
#[test]
fn a_display_that_is_too_slow_holds_the_others_up_less_and_less() {
    let faults = Faults { lost: 0, repeated: 0, longest_us: 300, disasters: false, together: true };
    let pace = Pace { first_us: 100_000, each_us: 4_000 };
    let too_slow = Pace { first_us: 300_000, each_us: TIMEOUT_US };
    for seed in 0..20 {
        let mut simulation = Simulation::new(seed, 3, faults, pace);
        simulation.slow = Some((1, too_slow));
        let mut drops = Vec::new();
        for end_s in [5, 30, 60] {
            simulation.run_until(end_s * 1_000_000);
            drops.push(simulation.tally.drops);
        }
        assert!(drops[2] - drops[1] <= 4, "seed {seed}: late {drops:?} times by the 5th, 30th and 60th second");
        assert_eq!(simulation.tally.told_slow, 1, "seed {seed}");
        // Once it is as fast as the others, they wait for it again, and it is told of anew when it becomes slow.
        simulation.slow = None;
        simulation.run_until(60_000_000 + 14_000_000);
        assert_eq!(simulation.application.live().count(), 3, "seed {seed}");
        let dropped = simulation.tally.drops;
        simulation.run_until(140_000_000);
        assert_eq!((simulation.tally.drops, simulation.tally.told_slow), (dropped, 1), "seed {seed}");
        simulation.slow = Some((1, too_slow));
        simulation.run_until(170_000_000);
        assert_eq!(simulation.tally.told_slow, 2, "seed {seed}");
    }
}

/// A display that is never fast enough shows what it draws, late, from the first frame on; the operator hears of it, nobody waits for it,
/// and the world is fetched once. Once it is fast enough it is in the lock.
#[test]
fn a_display_that_is_always_too_slow_shows_late_what_it_draws() {
    let faults = Faults { lost: 0, repeated: 0, longest_us: 300, disasters: false, together: true };
    let pace = Pace { first_us: 100_000, each_us: 4_000 };
    let too_slow = Pace { first_us: 4_000_000, each_us: 2 * TIMEOUT_US };
    for (seed, displays) in (0..20).flat_map(|seed| [(seed, 1), (seed, 3)]) {
        let mut simulation = Simulation::new(seed, displays, faults, pace);
        simulation.slow = Some((0, too_slow));
        simulation.run_until(30_000_000);
        let (shown, tally) = (simulation.displays[0].shown, &simulation.tally);
        assert!(shown >= 30, "seed {seed}: {shown} shown");
        assert_eq!((tally.told_slow, tally.fetches, tally.drops), (1, displays as u64, 0), "seed {seed}");
        assert!(tally.longest_stall_us < 60_000, "seed {seed}: a stall of {} us", tally.longest_stall_us);
        simulation.slow = None;
        simulation.run_until(32_000_000);
        assert!(simulation.all_show(), "seed {seed}: {:?}", simulation.application);
        assert_eq!(simulation.tally.fetches, displays as u64, "seed {seed}");
    }
}

/// Where a frame takes several of the application's, the one that is drawn when the next is published is not waited for as well.
#[test]
fn who_draws_well_within_the_timeout_is_waited_for() {
    let faults = Faults { lost: 0, repeated: 0, longest_us: 300, disasters: false, together: true };
    let pace = Pace { first_us: 1_000_000, each_us: 85_000 };
    for seed in 0..20 {
        let mut simulation = Simulation::new(seed, 1, faults, pace);
        simulation.run_until(3_000_000);
        assert!(simulation.all_show(), "seed {seed}: {:?}", simulation.application);
        simulation.run_until(30_000_000);
        assert_eq!((simulation.tally.drops, simulation.tally.told_slow), (0, 0), "seed {seed}");
    }
}
