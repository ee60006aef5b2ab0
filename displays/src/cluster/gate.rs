//! Where the application's thread and those of the network meet: who is there, what waits to be published, and the lock, which
//! releases a frame the moment that the last display is ready, whatever the application does meanwhile.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::event::{Event, Input};
use super::lines::{self, Lines};
use super::lock::{ApplicationAction, ApplicationEvent, ApplicationLock, DisplayId};
use super::message::{Ready, Release, Told, message_of};
use super::ordered::Inbox;
use super::outlets::{Outlets, Parcel};
use super::quiet::{Quiet, Words};
use super::transport::ClusterError;
use super::waits::Waits;

/// How often it is looked whether somebody is late.
const TICK: Duration = Duration::from_millis(2);

/// What happened since the start.
#[derive(Clone, Debug, Default)]
pub struct HostReport {
    /// Frames published.
    pub frames: u64,
    /// Bytes of packets.
    pub bytes: u64,
    /// From publishing a frame to its release.
    pub waits: Waits,
    /// How often a display was left behind.
    pub dropped: u64,
    /// Displays that were ready with other values than the application's.
    pub disagreed: u64,
    /// Reports of displays that were ready and agreed.
    pub agreed: u64,
    /// Joins that were refused.
    pub refused: u64,
}

/// A frame that is published once the one before is released.
pub(super) struct Staged {
    pub(super) frame: u64,
    pub(super) hash: u64,
    pub(super) parcel: Parcel,
    pub(super) is_last: bool,
}

/// See above.
pub(super) struct Gate {
    lock: ApplicationLock,
    /// This run: later ones have greater numbers.
    epoch: u64,
    started: Instant,
    outlets: Arc<Outlets>,
    staged: Option<Staged>,
    published: Instant,
    /// The application goes on once a frame is published.
    ahead: bool,
    is_last: bool,
    hashes: HashMap<u64, u64>,
    /// Displays whose lines stand. Nobody else is waited for, or has a name.
    there: BTreeSet<u64>,
    pub(super) names: BTreeMap<u64, String>,
    /// Of this process, where they are known.
    lines: Option<Lines>,
    quiet: Quiet,
    /// What is to be said in the log.
    log: Vec<Words>,
    pub(super) inputs: Vec<Input>,
    /// By number of the display.
    inboxes: BTreeMap<u64, Inbox<Event>>,
    pub(super) report: HostReport,
    /// The application's thread waits until this is through.
    is_awaited: bool,
    wake: Box<dyn Fn() + Send>,
}

/// Held by threads of the network as well.
pub(super) type SharedGate = Arc<Mutex<Gate>>;

/// Who is at the gate. What is said to the network and to the log meanwhile goes out once others can come in: both may take long, and the
/// next one may be who looks for the late.
pub(super) struct Entered<'a>(Option<MutexGuard<'a, Gate>>);

/// A thread that panicked has left nothing half done that the lock could not stand.
pub(super) fn enter(gate: &Mutex<Gate>) -> Entered<'_> {
    Entered(Some(gate.lock().unwrap_or_else(PoisonError::into_inner)))
}

impl Deref for Entered<'_> {
    type Target = Gate;
    fn deref(&self) -> &Gate {
        self.0.as_ref().expect("it is there until it is dropped")
    }
}

impl DerefMut for Entered<'_> {
    fn deref_mut(&mut self) -> &mut Gate {
        self.0.as_mut().expect("it is there until it is dropped")
    }
}

impl Drop for Entered<'_> {
    fn drop(&mut self) {
        let Some(mut gate) = self.0.take() else { return };
        let (outlets, log) = (gate.outlets.clone(), std::mem::take(&mut gate.log));
        drop(gate);
        outlets.flush();
        log.into_iter().for_each(Words::say);
    }
}

impl Gate {
    /// A gate, and a thread that looks for the late while it is there.
    pub(super) fn open(
        timeout: Duration,
        ahead: bool,
        epoch: u64,
        outlets: Arc<Outlets>,
        lines: Option<Lines>,
        wake: impl Fn() + Send + 'static,
    ) -> SharedGate {
        let gate = Arc::new(Mutex::new(Gate {
            lock: ApplicationLock::new(timeout.as_micros() as u64),
            epoch,
            started: Instant::now(),
            outlets,
            staged: None,
            published: Instant::now(),
            ahead,
            is_last: false,
            hashes: HashMap::new(),
            there: BTreeSet::new(),
            names: BTreeMap::new(),
            lines,
            quiet: Quiet::default(),
            log: Vec::new(),
            inputs: Vec::new(),
            inboxes: BTreeMap::new(),
            report: HostReport::default(),
            is_awaited: false,
            wake: Box::new(wake),
        }));
        let watched = Arc::downgrade(&gate);
        std::thread::spawn(move || {
            while let Some(gate) = watched.upgrade() {
                enter(&gate).step(ApplicationEvent::Tick);
                drop(gate);
                std::thread::sleep(TICK);
            }
        });
        gate
    }

    pub(super) fn lock(&self) -> &ApplicationLock {
        &self.lock
    }

    /// Is the staged frame still to be published, and may the application go on? If not, its thread is woken when something becomes of it.
    pub(super) fn progress(&mut self) -> (bool, bool) {
        // The thread that looks for the late may be late itself.
        self.step(ApplicationEvent::Tick);
        let is_staged = self.staged.is_some();
        let is_through = !is_staged && (self.ahead && !self.is_last || !self.lock.waits());
        self.is_awaited = !is_through;
        (is_staged, is_through)
    }

    /// Publishes a frame, now or once the one before is released.
    pub(super) fn stage(&mut self, staged: Staged) {
        self.staged = Some(staged);
        self.publish();
        self.outlets.neighbours.send();
    }

    /// A display has drawn a frame.
    pub(super) fn is_ready(&mut self, bytes: &[u8]) {
        let ready = match message_of::<Ready>(bytes) {
            Ok(ready) => ready,
            Err(error) => return self.cannot_read("a report", bytes, &error),
        };
        let Ready { display, frame, epoch, .. } = ready;
        if epoch != self.epoch {
            return;
        }
        let (name, last) = (&ready.name, self.lock.frame());
        let at = || lines::at(self.lines, display);
        let fault = if !self.there.contains(&display) {
            Some(format!("somebody who is no display{} says that `{name}` is ready with frame {frame}", at()))
        } else if self.twin(display, name).is_some() {
            Some(format!("another process{} says that it is display `{name}`, ready with frame {frame}", at()))
        } else if frame > last {
            Some(format!("display `{name}`{} says that it is ready with frame {frame}, and the last one is {last}", at()))
        } else {
            None
        };
        if let Some(fault) = fault {
            return self.complain(format!("{fault}; it is not listened to"));
        }
        // Its link broke and came back before it missed a frame.
        let name = self.names.entry(ready.display).or_insert(ready.name);
        let is_known = self.hashes.get(&ready.frame);
        if is_known.is_some_and(|hash| *hash != ready.hash) {
            self.report.disagreed += 1;
            let words = format!("display `{name}` is ready with frame {}, but its values differ", ready.frame);
            return self.log.push(Words::Error(words));
        }
        self.report.agreed += is_known.is_some() as u64;
        let display = DisplayId(ready.display);
        self.step(ApplicationEvent::Ready { display, frame: ready.frame, took_us: ready.took_us });
    }

    /// Something happened at a display.
    pub(super) fn is_told(&mut self, bytes: &[u8]) {
        let told = match message_of::<Told>(bytes) {
            Ok(told) => told,
            Err(error) => return self.cannot_read("what happened at a display", bytes, &error),
        };
        // Who is not known by name says it again once it has joined.
        let Some(name) = self.names.get(&told.display).filter(|_| told.epoch == self.epoch) else { return };
        let inbox = self.inboxes.entry(told.display).or_default();
        let inputs = inbox.arrived(told.number, told.event).into_iter();
        self.inputs.extend(inputs.map(|event| Input { display: name.clone(), event }));
    }

    fn cannot_read(&mut self, what: &str, bytes: &[u8], error: &ClusterError) {
        let (length, frame) = (bytes.len(), self.lock.frame());
        let whom = lines::others(self.lines, |number| self.names.contains_key(&number));
        self.complain(format!("{what}, {length} bytes, at frame {frame}: {error}{whom}"));
    }

    fn complain(&mut self, words: String) {
        self.log.extend(self.quiet.news(Words::Warn(words)));
    }

    /// The line of a display stands.
    pub(super) fn is_there(&mut self, number: u64) {
        self.there.insert(number);
    }

    /// A display joins; false if it was known already. Its name is its own as long as its line stands.
    pub(super) fn joins(&mut self, number: u64, name: &str) -> bool {
        self.there.contains(&number) && self.names.insert(number, name.into()).is_none()
    }

    /// A refused display, with where it is.
    pub(super) fn refuses(&mut self, number: Option<u64>, reason: &str) {
        let whom = match number {
            Some(number) => lines::at(self.lines, number),
            None => lines::others(self.lines, |number| self.names.contains_key(&number)),
        };
        self.complain(match number {
            Some(_) => format!("a display{whom} is refused: {reason}"),
            None => format!("a display is refused: {reason}{whom}"),
        });
        self.report.refused += 1;
    }

    /// Where a process is, for the log.
    pub(super) fn at(&self, number: u64) -> String {
        lines::at(self.lines, number)
    }

    /// A display left, or its line broke.
    pub(super) fn is_gone(&mut self, number: u64) {
        self.there.remove(&number);
        if let Some(name) = self.names.remove(&number) {
            self.log.push(Words::Info(format!("display `{name}` is gone")));
        }
        self.outlets.neighbours.close(number);
        self.step(ApplicationEvent::Gone(DisplayId(number)));
    }

    /// A display that cannot draw this frame is not waited for; it comes back as any other.
    pub(super) fn excuse(&mut self, number: u64) {
        self.step(ApplicationEvent::Excused(DisplayId(number)));
    }

    /// Another display of this name.
    pub(super) fn twin(&self, number: u64, name: &str) -> Option<u64> {
        self.names.iter().find(|(other, known)| **other != number && *known == name).map(|(other, _)| *other)
    }

    fn step(&mut self, event: ApplicationEvent) {
        let before = (self.staged.is_some(), self.lock.waits());
        self.act(event);
        self.publish();
        // A release and the frame after it wake a display once.
        self.outlets.neighbours.send();
        if self.is_awaited && before != (self.staged.is_some(), self.lock.waits()) {
            (self.wake)();
        }
    }

    fn publish(&mut self) {
        while !self.lock.waits()
            && let Some(Staged { frame, hash, parcel, is_last }) = self.staged.take()
        {
            self.hashes.insert(frame, hash);
            self.hashes.remove(&frame.wrapping_sub(256));
            self.report.frames = frame;
            self.report.bytes += parcel.length();
            self.is_last = is_last;
            self.published = Instant::now();
            self.outlets.send(frame, parcel);
            self.act(ApplicationEvent::Published(frame));
        }
    }

    fn act(&mut self, event: ApplicationEvent) {
        let now_us = self.started.elapsed().as_micros() as u64;
        for action in self.lock.step(now_us, event) {
            match action {
                ApplicationAction::Release(frame, may_show) => {
                    let may_show = may_show.into_iter().map(|id| id.0).collect();
                    let is_here = |(display, _): &(&u64, &Inbox<Event>)| self.names.contains_key(display);
                    let heard = self.inboxes.iter().filter(is_here).map(|(display, inbox)| (*display, inbox.taken())).collect();
                    self.outlets.release(&Release { epoch: self.epoch, frame, may_show, heard, is_last: self.is_last });
                    self.report.waits.note(self.published.elapsed());
                }
                ApplicationAction::Admitted(id) => {
                    let name = self.names.get(&id.0).map_or("?", String::as_str);
                    self.log.push(Words::Info(format!("display `{name}` is in the lock from frame {} on", self.lock.frame())));
                }
                ApplicationAction::Dropped(id, frame) => {
                    let name = self.names.get(&id.0).cloned().unwrap_or_else(|| "?".into());
                    let words = format!("display `{name}` was late for frame {frame}: the others go on without it");
                    self.log.push(Words::Warn(words));
                    self.report.dropped += 1;
                }
                ApplicationAction::TooSlow { display, times, within_us, took_us } => {
                    let name = self.names.get(&display.0).map_or("?", String::as_str);
                    let (within_s, took_ms) = (within_us as f64 / 1e6, took_us / 1000);
                    let [timeout_ms, fast_ms] = [self.lock.timeout_us(), self.lock.fast_us()].map(|time_us| time_us / 1000);
                    self.log.push(Words::Warn(format!(
                        "display `{name}` was late {times} times in {within_s:.1} s: it needs {took_ms} ms for a frame, and {timeout_ms} ms are \
                         waited; it is waited for again once it needs less than {fast_ms} ms, and less and less often; meanwhile it shows \
                         late what it draws"
                    )));
                }
            }
        }
    }
}
