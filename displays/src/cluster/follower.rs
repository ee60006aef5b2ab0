//! A display's end: follows the application's frames, has them drawn, and shown on release.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use umbriel_fields::replica::{Packet, Replica, ReplicaError};
use umbriel_fields::{Graph, TypeRegistry};
use zenoh::Wait;
use zenoh::pubsub::Publisher as ZenohPublisher;
use zenoh::qos::{CongestionControl, Priority};

use super::cache::{Cache, CacheOptions};
use super::event::Event;
use super::line::{Answer, Kinds, Line, Link};
use super::lock::{DisplayAction, DisplayEvent, DisplayLock};
use super::message::{
    DISPLAY, INPUT, Join, PROTOCOL, READY, RELEASE, Ready, Release, SNAPSHOT, Told, bytes_of, message_of, stamped_packet,
};
use super::ordered::Outbox;
use super::queue::Flood;
use super::transport::{ClusterError, End, Security, network};
use super::world::World;

/// Draws and shows what a follower follows.
pub trait Screen {
    /// What can go wrong with drawing.
    type Error: std::fmt::Display + From<ClusterError>;
    /// Draws the graph, but does not show it. `is_new` is true where the graph is another one than at the last call.
    fn draw(&mut self, graph: &Graph, frame: u64, is_new: bool) -> Result<(), Self::Error>;
    /// Shows what was drawn last.
    fn show(&mut self, frame: u64) -> Result<(), Self::Error>;
}

/// How an application is found.
#[derive(Clone, Debug)]
pub struct FollowerOptions {
    /// Its address, such as `tcp/127.0.0.1:7447`.
    pub endpoint: String,
    /// How links are protected.
    pub security: Security,
    /// A link without a sign of life for so long is broken: see [`LEASE`](super::LEASE).
    pub lease: Duration,
    /// Ends with the application, instead of waiting for it to come back.
    pub ends_with_application: bool,
    /// Where the application runs on the same machine, frames are read out of its memory.
    pub uses_memory: bool,
    /// Where long values are kept from one start to the next.
    pub cache: Option<CacheOptions>,
}

/// What happened to a display.
#[derive(Clone, Debug, Default)]
pub struct FollowerReport {
    /// Frames shown.
    pub shown: u64,
    /// Snapshots that were fetched.
    pub snapshots: u64,
    /// Differences that were found, and repaired before anything was shown.
    pub differences: Vec<String>,
    /// The longest time between two frames that were shown, milliseconds.
    pub longest_gap_ms: f64,
    /// Bytes of long values, such as meshes and images, that came from the application.
    pub fetched: u64,
    /// Bytes of those that were kept from an earlier start.
    pub kept: u64,
}

/// When a display came how far for the first time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    /// An application answers.
    pub found: Option<Instant>,
    /// Its world is here.
    pub world: Option<Instant>,
    /// Something is being drawn.
    pub draws: Option<Instant>,
    /// It is drawn.
    pub drawn: Option<Instant>,
    /// A frame was shown.
    pub shown: Option<Instant>,
}

fn note(when: &mut Option<Instant>) {
    when.get_or_insert_with(Instant::now);
}

enum Arrived {
    Frame(Vec<u8>),
    Flood(Flood),
    Release(Vec<u8>),
    Snapshot(Answer),
    Bulk(u64, Answer),
    Application(bool),
}

/// What waits for long values before it is told.
enum Parked {
    Frame(u64, u64),
    Snapshot(u64, u64),
}

/// A display process in the lock.
pub struct Follower {
    line: Line<Arrived>,
    name: String,
    ready: ZenohPublisher<'static>,
    input: ZenohPublisher<'static>,
    /// What was told to a run of the application.
    told: (u64, Outbox<Vec<u8>>),
    lock: DisplayLock,
    world: World,
    parked: VecDeque<Parked>,
    started: Instant,
    last_shown: Option<Instant>,
    refused_since: Option<Instant>,
    ends_with_application: bool,
    /// Since when there is no link to an application.
    alone_since: Option<Instant>,
    /// There is an application, and it owes no answer.
    can_ask: bool,
    is_over: bool,
    /// For the last drawing.
    took: Duration,
    /// Of the replica as it was drawn last; by now it may be further.
    drawn_hash: u64,
    drawn_frame: u64,
    progress: Progress,
    report: FollowerReport,
}

/// A display that crashed and comes back at once finds its own name taken until its old link is given up.
const NAME_IS_FREE_AFTER: Duration = Duration::from_secs(4);
/// A link that broke looks like an application that ended; after so long it did.
const APPLICATION_ENDED_AFTER: Duration = Duration::from_secs(5);

/// What the application did not confirm within this time is told again.
const TOLD_AGAIN_AFTER: Duration = Duration::from_millis(200);

/// Who drew for so long may miss frames while it draws the next one.
const LONG: Duration = Duration::from_millis(30);

fn put(publisher: &ZenohPublisher<'static>, bytes: &[u8]) {
    if let Err(error) = publisher.put(bytes).wait() {
        tracing::debug!("cannot tell: {error}");
    }
}

impl Follower {
    /// Joins the application, now or as soon as it is there. `name` is that of the display; `types` are those that can
    /// be drawn.
    pub fn connect(options: FollowerOptions, name: &str, types: impl Into<TypeRegistry>) -> Result<Follower, ClusterError> {
        let FollowerOptions { endpoint, security, lease, ends_with_application, uses_memory, cache } = options;
        let kinds = Kinds {
            frame: Arrived::Frame,
            flood: Arrived::Flood,
            subject: (RELEASE, Arrived::Release),
            application: Arrived::Application,
        };
        let cache = cache.map(Cache::open);
        let link = Link { end: End::Display, endpoint: &endpoint, security: &security, lease, uses_memory, cache };
        let mut line = Line::open(link, kinds)?;
        let declare = |key: &'static str| {
            let publisher = line.session.declare_publisher(key).congestion_control(CongestionControl::Drop);
            publisher.priority(Priority::RealTime).express(true).wait().map_err(network)
        };
        let (ready, input) = (declare(READY)?, declare(INPUT)?);
        line.announce(DISPLAY)?;
        Ok(Follower {
            line,
            name: name.into(),
            ready,
            input,
            told: (0, Outbox::default()),
            lock: DisplayLock::new(),
            world: World::of(endpoint, types.into()),
            parked: VecDeque::new(),
            started: Instant::now(),
            last_shown: None,
            refused_since: None,
            ends_with_application,
            alone_since: None,
            can_ask: false,
            is_over: false,
            took: Duration::ZERO,
            drawn_hash: 0,
            drawn_frame: 0,
            progress: Progress::default(),
            report: FollowerReport::default(),
        })
    }

    /// What happened so far.
    pub fn report(&self) -> &FollowerReport {
        &self.report
    }

    /// How far it came, and when.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// True once the application said that it ends.
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    /// True once anything came from an application.
    pub fn found_application(&self) -> bool {
        self.lock.epoch() > 0
    }

    /// True if frames are read out of the application's memory, and do not come over the network.
    pub fn reads_memory(&self) -> bool {
        self.line.is_near()
    }

    /// True if the application is heard down the short line of displays of its machine, and not over the network.
    pub fn is_beside(&self) -> bool {
        self.line.is_short()
    }

    /// The world here, once it came.
    pub fn replica(&self) -> Option<&Replica> {
        self.world.replica.as_ref()
    }

    /// The replica, for tests that corrupt it.
    pub fn replica_mut(&mut self) -> Option<&mut Replica> {
        self.world.replica.as_mut()
    }

    /// The frame that was drawn last, shown or not.
    pub fn drawn_frame(&self) -> u64 {
        self.drawn_frame
    }

    /// Tells the application of something that happened here. It arrives once and in order, whatever the line does; with an application
    /// that ends, it is gone.
    pub fn tell(&mut self, event: Event) {
        let (display, epoch) = (self.line.id, self.lock.epoch());
        if self.told.0 != epoch {
            self.told = (epoch, Outbox::default());
        }
        if epoch == 0 || !self.told.1.has_room() {
            return tracing::debug!("nobody hears what happens at `{}`", self.name);
        }
        let bytes = bytes_of(&Told { display, epoch, number: self.told.1.next(), event });
        put(&self.input, &bytes);
        self.told.1.sent(bytes);
    }

    /// Handles what comes within some time.
    pub fn run<S: Screen>(&mut self, screen: &mut S, patience: Duration) -> Result<(), S::Error> {
        let until = Instant::now() + patience;
        loop {
            self.line.settle();
            let left = until.saturating_duration_since(Instant::now());
            let mut arrived = self.line.next(left.min(Duration::from_millis(5)));
            while let Some(next) = arrived {
                self.handle(next, screen)?;
                arrived = self.line.next(Duration::ZERO);
            }
            self.step(DisplayEvent::Tick, screen)?;
            if self.told.0 == self.lock.epoch() {
                self.told.1.overdue(TOLD_AGAIN_AFTER).for_each(|bytes| put(&self.input, bytes));
            }
            let is_alone = self.alone_since.is_some_and(|since| since.elapsed() > APPLICATION_ENDED_AFTER);
            self.is_over |= self.ends_with_application && is_alone;
            if left.is_zero() || self.is_over {
                return Ok(());
            }
        }
    }

    fn handle<S: Screen>(&mut self, arrived: Arrived, screen: &mut S) -> Result<(), S::Error> {
        match arrived {
            Arrived::Frame(bytes) => {
                let length = bytes.len();
                match stamped_packet(bytes) {
                    Ok((epoch, packet)) => self.framed(epoch, packet, length, screen)?,
                    // What is damaged is a gap: a snapshot closes it.
                    Err(error) => self.world.complain("a frame", &error.into()),
                }
            }
            Arrived::Flood(flood) => {
                self.world.flooded(flood);
                self.parked.retain(|parked| matches!(parked, Parked::Snapshot(..)));
                self.step(DisplayEvent::Flooded, screen)?;
            }
            Arrived::Release(bytes) => match message_of::<Release>(&bytes) {
                Ok(release) => {
                    let is_mine = release.may_show.contains(&self.line.id);
                    if let Some((_, number)) = release.heard.iter().find(|(display, _)| *display == self.line.id)
                        && release.epoch == self.told.0
                    {
                        self.told.1.confirm(*number);
                    }
                    self.unpark(screen)?;
                    self.step(DisplayEvent::Release { epoch: release.epoch, frame: release.frame, is_mine }, screen)?;
                    self.is_over |= self.ends_with_application && release.is_last && release.epoch == self.lock.epoch();
                }
                Err(error) => self.world.complain("a release", &error),
            },
            Arrived::Snapshot(answer) => self.answered(answer)?,
            Arrived::Bulk(hash, Ok(bytes)) => {
                self.line.bulk_answered(hash);
                match self.world.bulk.learn(hash, &bytes) {
                    Ok(()) => self.line.keep_bulk(hash, bytes),
                    Err(error) => {
                        self.world.complain("a long value", &error.into());
                        // What waits for it is a gap as well.
                        self.parked.clear();
                    }
                }
                [self.report.fetched, self.report.kept] = self.line.fetched;
            }
            Arrived::Bulk(hash, Err(reason)) => {
                self.line.bulk_answered(hash);
                tracing::debug!("no long value {hash:016x}: {reason}");
                // What waits for it is of the past: a snapshot knows what is needed now.
                self.parked.clear();
            }
            Arrived::Application(true) => {
                self.alone_since = None;
                self.can_ask = true;
                note(&mut self.progress.found);
                self.line.begin();
                self.step(DisplayEvent::Linked, screen)?;
            }
            Arrived::Application(false) if self.is_over => {}
            Arrived::Application(false) => {
                for release in self.line.last_words() {
                    self.handle(release, screen)?;
                }
                if self.is_over {
                    return Ok(());
                }
                self.line.begin();
                tracing::warn!("display `{}`: the application is gone; waiting for it to come back", self.name);
                (self.alone_since, self.can_ask) = (Some(Instant::now()), false);
            }
        }
        self.unpark(screen)
    }

    /// A packet of so many bytes came.
    fn framed<S: Screen>(&mut self, epoch: u64, packet: Packet<'static>, bytes: usize, screen: &mut S) -> Result<(), S::Error> {
        let (frame, missing) = (packet.frame(), packet.missing(&self.world.bulk));
        if epoch > self.lock.epoch() {
            self.world.packets.clear();
            self.parked.clear();
            self.step(DisplayEvent::Release { epoch, frame: 0, is_mine: false }, screen)?;
        }
        self.line.ask_for_bulk(missing, Arrived::Bulk);
        if epoch != self.lock.epoch() {
            return Ok(());
        }
        if self.world.replica.as_ref().is_none_or(|replica| frame > replica.frame()) {
            self.world.keep(packet, bytes);
            self.parked.push_back(Parked::Frame(epoch, frame));
        } else if self.lock.follows() {
            // It is here already, unless what is here is none of this run.
            self.step(DisplayEvent::Frame { epoch, frame }, screen)?;
        }
        Ok(())
    }

    /// The application answers who asked for everything.
    fn answered(&mut self, answer: Answer) -> Result<(), ClusterError> {
        self.can_ask = true;
        match answer {
            Ok(bytes) => {
                self.refused_since = None;
                match stamped_packet(bytes) {
                    Ok((epoch, packet)) => {
                        let (frame, missing) = (packet.frame(), packet.missing(&self.world.bulk));
                        self.line.ask_for_bulk(missing, Arrived::Bulk);
                        self.world.snapshot = Some(packet);
                        self.parked.retain(|parked| matches!(parked, Parked::Frame(..)));
                        self.parked.push_front(Parked::Snapshot(epoch, frame));
                    }
                    // It is asked for again.
                    Err(error) => self.world.complain("the world", &error.into()),
                }
            }
            Err(reason) if reason.starts_with("there is a display") => {
                let since = *self.refused_since.get_or_insert_with(Instant::now);
                if since.elapsed() > NAME_IS_FREE_AFTER {
                    return Err(ClusterError::Refused(reason));
                }
            }
            Err(reason) if reason.starts_with("it ") => return Err(ClusterError::Refused(reason)),
            Err(reason) => tracing::debug!("no snapshot: {reason}"),
        }
        Ok(())
    }

    /// Long values are awaited that the world here needs first.
    fn awaits_world(&self) -> bool {
        self.line.awaits_bulk() && self.parked.iter().any(|parked| matches!(parked, Parked::Snapshot(..)))
    }

    /// Tells the lock what is complete, in order.
    fn unpark<S: Screen>(&mut self, screen: &mut S) -> Result<(), S::Error> {
        while let Some(parked) = self.parked.front() {
            let packet = match parked {
                Parked::Frame(_, frame) => self.world.packets.get(*frame),
                Parked::Snapshot(..) => self.world.snapshot.as_ref(),
            };
            if packet.is_some_and(|packet| !packet.missing(&self.world.bulk).is_empty()) {
                return Ok(());
            }
            match self.parked.pop_front() {
                Some(Parked::Frame(epoch, frame)) => self.step(DisplayEvent::Frame { epoch, frame }, screen)?,
                Some(Parked::Snapshot(epoch, frame)) => self.step(DisplayEvent::Snapshot { epoch, frame }, screen)?,
                None => {}
            }
        }
        Ok(())
    }

    fn step<S: Screen>(&mut self, event: DisplayEvent, screen: &mut S) -> Result<(), S::Error> {
        let mut events = VecDeque::from([event]);
        while let Some(event) = events.pop_front() {
            let now_us = self.started.elapsed().as_micros() as u64;
            for action in self.lock.step(now_us, event) {
                match action {
                    // What is on its way already does not come sooner for being asked for twice.
                    DisplayAction::Fetch if !self.can_ask || self.awaits_world() => {}
                    DisplayAction::Fetch => {
                        self.can_ask = false;
                        let join = Join { protocol: PROTOCOL, display: self.line.id, name: self.name.clone() };
                        self.line.get(SNAPSHOT.into(), bytes_of(&join), Arrived::Snapshot);
                    }
                    DisplayAction::Restore(frame) => {
                        match self.restore() {
                            Ok(()) => {}
                            Err(error @ ClusterError::Replica(ReplicaError::OtherField { .. })) => return Err(error.into()),
                            Err(error) => {
                                self.world.complain("the world", &error);
                                events.push_back(DisplayEvent::Unusable);
                            }
                        }
                        self.world.packets.forget_to(frame);
                    }
                    DisplayAction::Apply(frame) => events.push_back(self.apply(frame)),
                    DisplayAction::Draw(frame) => {
                        let began = Instant::now();
                        note(&mut self.progress.draws);
                        if let Some(replica) = &mut self.world.replica {
                            self.drawn_hash = replica.hash_now();
                            self.drawn_frame = frame;
                            let is_new = std::mem::take(&mut self.world.is_new);
                            let mut draw = || screen.draw(replica.graph(), frame, is_new);
                            match is_new || self.took > LONG {
                                true => self.line.meanwhile(draw)?,
                                false => draw()?,
                            }
                        }
                        self.took = began.elapsed();
                        note(&mut self.progress.drawn);
                        tracing::debug!("display `{}` drew frame {frame} in {:.1?}", self.name, self.took);
                        events.push_back(DisplayEvent::Drawn(frame));
                    }
                    DisplayAction::Ready(frame) => {
                        let hash = self.drawn_hash;
                        let name = self.name.clone();
                        let (epoch, took_us) = (self.lock.epoch(), self.took.as_micros() as u64);
                        let ready = Ready { display: self.line.id, name, epoch, frame, took_us, hash };
                        let bytes = bytes_of(&ready);
                        if !self.line.say_ready(&bytes) {
                            put(&self.ready, &bytes);
                        }
                    }
                    DisplayAction::Show(frame) => {
                        screen.show(frame)?;
                        self.note_shown();
                    }
                    DisplayAction::Forget => self.world.packets.clear(),
                }
            }
        }
        Ok(())
    }

    fn note_shown(&mut self) {
        let now = Instant::now();
        if let Some(last) = self.last_shown.replace(now) {
            let gap_ms = (now - last).as_secs_f64() * 1e3;
            self.report.longest_gap_ms = self.report.longest_gap_ms.max(gap_ms);
        }
        self.report.shown += 1;
        note(&mut self.progress.shown);
    }

    fn restore(&mut self) -> Result<(), ClusterError> {
        self.report.differences.extend(self.world.restore()?);
        self.report.snapshots += 1;
        note(&mut self.progress.world);
        Ok(())
    }

    fn apply(&mut self, frame: u64) -> DisplayEvent {
        let (agrees, packet) = self.world.apply(frame);
        self.line.reuse(packet);
        if agrees { DisplayEvent::Applied(frame) } else { DisplayEvent::Diverged(frame) }
    }
}
