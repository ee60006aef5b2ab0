//! The application's end: publishes frames, waits for displays, releases.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crossbeam::channel::{Receiver, Sender, unbounded};
use umbriel_fields::Graph;
use umbriel_fields::replica::Publisher;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher as ZenohPublisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{Query, Queryable};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

use super::event::{Event, Input};
use super::lock::{ApplicationAction, ApplicationEvent, ApplicationLock, DisplayId};
use super::message::{
    APPLICATION, BULK, DISPLAY, FRAME, INPUT, Join, PROTOCOL, READY, RELEASE, Ready, Release, SNAPSHOT, Told, bytes_of,
    message_of, stamped,
};
use super::ordered::Inbox;
use super::transport::{ClusterError, End, Security, network, open};
use super::waits::Waits;

/// How an application is reached.
#[derive(Clone, Debug)]
pub struct HostOptions {
    /// Such as `tcp/127.0.0.1:7447`.
    pub listen: String,
    /// How links are protected.
    pub security: Security,
    /// How long a frame waits for a display.
    pub timeout: Duration,
    /// A link without a sign of life for so long is broken: see [`LEASE`](super::LEASE).
    pub lease: Duration,
}

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

enum Arrived {
    Ready(Vec<u8>),
    Input(Vec<u8>),
    Snapshot(Query),
    Bulk(Query),
    Gone(u64),
}

/// A question, and what is said to it.
type Answer = (Query, Result<Arc<[u8]>, String>);

/// An application that displays can join.
pub struct Host {
    frames: ZenohPublisher<'static>,
    releases: ZenohPublisher<'static>,
    arrived: Receiver<Arrived>,
    replies: Sender<Answer>,
    lock: ApplicationLock,
    publisher: Publisher,
    /// This run: later ones have greater numbers.
    epoch: u64,
    started: Instant,
    names: BTreeMap<u64, String>,
    /// Requests that came while the graph was being written.
    deferred: Vec<Query>,
    snapshot: Option<(u64, Arc<[u8]>)>,
    hashes: HashMap<u64, u64>,
    inputs: Vec<Input>,
    /// By number of the display.
    inboxes: BTreeMap<u64, Inbox<Event>>,
    is_last: bool,
    refused_last: Option<String>,
    report: HostReport,
    _held: (Vec<Subscriber<()>>, Vec<Queryable<()>>, LivelinessToken),
    session: Session,
}

impl Host {
    /// Listens.
    pub fn listen(options: &HostOptions) -> Result<Host, ClusterError> {
        let session = open(&options.listen, &options.security, End::Application, options.lease)?;
        let (sender, arrived) = unbounded();
        let (replies, to_reply) = unbounded::<Answer>();
        // Long answers to slow displays must not hold up frames.
        std::thread::spawn(move || {
            for (query, answer) in to_reply {
                let key = query.key_expr().clone();
                let sent = match &answer {
                    Ok(bytes) => query.reply(key, &bytes[..]).wait(),
                    Err(reason) => query.reply_err(reason.as_str()).wait(),
                };
                if let Err(error) = sent {
                    tracing::debug!("an answer could not be sent: {error}");
                }
            }
        });
        // Express: the last piece of a frame does not wait for company.
        let frames = session.declare_publisher(FRAME).congestion_control(CongestionControl::Drop).express(true);
        let frames = frames.wait().map_err(network)?;
        let releases = session
            .declare_publisher(RELEASE)
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::RealTime)
            .express(true)
            .wait()
            .map_err(network)?;
        let mut subscribers = Vec::new();
        for (key, kind) in [(READY, Arrived::Ready as fn(Vec<u8>) -> Arrived), (INPUT, Arrived::Input)] {
            let sender = sender.clone();
            let take = move |sample: zenoh::sample::Sample| drop(sender.send(kind(sample.payload().to_bytes().into_owned())));
            subscribers.push(session.declare_subscriber(key).callback(take).wait().map_err(network)?);
        }
        let gone = sender.clone();
        let alive = session.liveliness().declare_subscriber(format!("{DISPLAY}/*")).callback(move |sample| {
            let number = sample.key_expr().as_str().rsplit('/').next().and_then(|number| number.parse().ok());
            if let (SampleKind::Delete, Some(number)) = (sample.kind(), number) {
                let _ = gone.send(Arrived::Gone(number));
            }
        });
        subscribers.push(alive.wait().map_err(network)?);
        let mut queryables = Vec::new();
        for (key, kind) in
            [(SNAPSHOT.to_string(), Arrived::Snapshot as fn(Query) -> Arrived), (format!("{BULK}/*"), Arrived::Bulk)]
        {
            let sender = sender.clone();
            let queryable = session.declare_queryable(key).callback(move |query| drop(sender.send(kind(query))));
            queryables.push(queryable.wait().map_err(network)?);
        }
        let token = session.liveliness().declare_token(APPLICATION).wait().map_err(network)?;
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_micros() as u64;
        Ok(Host {
            frames,
            releases,
            arrived,
            replies,
            lock: ApplicationLock::new(options.timeout.as_micros() as u64),
            publisher: Publisher::new(),
            epoch,
            started: Instant::now(),
            names: BTreeMap::new(),
            deferred: Vec::new(),
            snapshot: None,
            hashes: HashMap::new(),
            inputs: Vec::new(),
            inboxes: BTreeMap::new(),
            is_last: false,
            refused_last: None,
            report: HostReport::default(),
            _held: (subscribers, queryables, token),
            session,
        })
    }

    /// For others of this end.
    pub(super) fn session(&self) -> &Session {
        &self.session
    }

    /// This run.
    pub(super) fn epoch(&self) -> u64 {
        self.epoch
    }

    /// The number of the last frame that was published.
    pub fn last_frame(&self) -> u64 {
        self.publisher.last_frame()
    }

    /// Names of displays that frames wait for.
    pub fn live(&self) -> Vec<String> {
        self.lock.live().filter_map(|id| self.names.get(&id.0).cloned()).collect()
    }

    /// Is there a display of this name, in the lock or not?
    pub fn knows(&self, name: &str) -> bool {
        self.names.values().any(|known| known == name)
    }

    /// How many displays have drawn the last frame, waited for or not.
    pub fn in_time(&self) -> usize {
        self.lock.in_time()
    }

    /// What happened so far.
    pub fn report(&self) -> &HostReport {
        &self.report
    }

    /// What displays told since this was last called, in the order of each display.
    pub fn inputs(&mut self) -> Vec<Input> {
        std::mem::take(&mut self.inputs)
    }

    /// Publishes what was written to the graph as the next frame, and waits until every live display has drawn it, but not longer than
    /// the timeout. After the last one, displays that want to end do.
    pub fn frame(&mut self, graph: &Graph, is_last: bool) {
        self.is_last = is_last;
        let packet = self.publisher.frame(graph);
        let frame = self.publisher.last_frame();
        self.hashes.insert(frame, self.publisher.hash());
        self.hashes.remove(&frame.wrapping_sub(256));
        self.report.frames = frame;
        self.report.bytes += packet.len() as u64;
        if let Err(error) = self.frames.put(stamped(self.epoch, packet)).wait() {
            tracing::warn!("frame {frame} could not be sent: {error}");
        }
        let published = Instant::now();
        self.steps(ApplicationEvent::Published(frame));
        for query in std::mem::take(&mut self.deferred) {
            self.joins(graph, query);
        }
        while self.lock.waits() {
            self.receive(graph, Duration::from_millis(2));
            self.steps(ApplicationEvent::Tick);
        }
        self.report.waits.note(published.elapsed());
    }

    /// Serves displays until a time; the graph must not have been written since the frame, or who joins waits for the next one.
    pub fn wait_until(&mut self, graph: &Graph, until: Instant) {
        loop {
            let left = until.saturating_duration_since(Instant::now());
            self.receive(graph, left.min(Duration::from_millis(20)));
            if left.is_zero() {
                return self.steps(ApplicationEvent::Tick);
            }
        }
    }

    fn receive(&mut self, graph: &Graph, patience: Duration) {
        let Ok(first) = self.arrived.recv_timeout(patience) else { return };
        self.handle(graph, first);
        while let Ok(next) = self.arrived.try_recv() {
            self.handle(graph, next);
        }
    }

    fn handle(&mut self, graph: &Graph, arrived: Arrived) {
        match arrived {
            Arrived::Ready(bytes) => match message_of::<Ready>(&bytes) {
                Ok(ready) if ready.epoch == self.epoch && self.twin(ready.display, &ready.name).is_none() => {
                    self.is_ready(&ready)
                }
                Ok(_) => {}
                Err(error) => tracing::warn!("from a display: {error}"),
            },
            Arrived::Input(bytes) => match message_of::<Told>(&bytes) {
                Ok(told) if told.epoch == self.epoch => self.is_told(told),
                Ok(_) => {}
                Err(error) => tracing::warn!("from a display: {error}"),
            },
            Arrived::Gone(number) => {
                if let Some(name) = self.names.remove(&number) {
                    tracing::info!("display `{name}` is gone");
                }
                self.steps(ApplicationEvent::Gone(DisplayId(number)));
            }
            Arrived::Snapshot(query) => self.joins(graph, query),
            Arrived::Bulk(query) => {
                let hash = query.key_expr().as_str().rsplit('/').next().and_then(|hash| u64::from_str_radix(hash, 16).ok());
                let answer =
                    hash.and_then(|hash| self.publisher.bulk(hash)).ok_or_else(|| "there is no such value any more".to_string());
                let _ = self.replies.send((query, answer));
            }
        }
    }

    fn is_told(&mut self, told: Told) {
        // Who is not known by name says it again once it has joined.
        let Some(name) = self.names.get(&told.display) else { return };
        let inbox = self.inboxes.entry(told.display).or_default();
        let inputs = inbox.arrived(told.number, told.event).into_iter();
        self.inputs.extend(inputs.map(|event| Input { display: name.clone(), event }));
    }

    /// Another display of this name.
    fn twin(&self, number: u64, name: &str) -> Option<u64> {
        self.names.iter().find(|(other, known)| **other != number && *known == name).map(|(other, _)| *other)
    }

    fn is_ready(&mut self, ready: &Ready) {
        // Its link broke and came back before it missed a frame.
        self.names.entry(ready.display).or_insert_with(|| ready.name.clone());
        let is_known = self.hashes.get(&ready.frame);
        if is_known.is_some_and(|hash| *hash != ready.hash) {
            self.report.disagreed += 1;
            let name = self.names.get(&ready.display).cloned().unwrap_or_default();
            return tracing::error!("display `{name}` is ready with frame {}, but its values differ", ready.frame);
        }
        self.report.agreed += is_known.is_some() as u64;
        let display = DisplayId(ready.display);
        self.steps(ApplicationEvent::Ready { display, frame: ready.frame, took_us: ready.took_us });
    }

    fn joins(&mut self, graph: &Graph, query: Query) {
        let answer = match query.payload().map(|payload| message_of::<Join>(&payload.to_bytes())) {
            Some(Ok(join)) if join.protocol != PROTOCOL => {
                Err(format!("it speaks version {} of the protocol, the application speaks {PROTOCOL}", join.protocol))
            }
            Some(Ok(join)) => match self.twin(join.display, &join.name) {
                Some(_) => Err(format!("there is a display `{}` already", join.name)),
                None => Ok(join),
            },
            Some(Err(error)) => Err(error.to_string()),
            None => Err("it does not say who it is".into()),
        };
        let answer = match answer {
            Err(reason) => {
                // Who is refused asks again and again.
                if self.refused_last.as_deref() != Some(&*reason) {
                    tracing::warn!("a display is refused: {reason}");
                    self.refused_last = Some(reason.clone());
                }
                self.report.refused += 1;
                Err(reason)
            }
            Ok(join) => {
                if self.publisher.last_frame() == 0 {
                    return self.deferred.push(query);
                }
                let Some(snapshot) = self.snapshot(graph) else { return self.deferred.push(query) };
                self.refused_last = None;
                if self.names.insert(join.display, join.name.clone()).is_none() {
                    tracing::info!("display `{}` joins at frame {}", join.name, self.publisher.last_frame());
                }
                Ok(snapshot)
            }
        };
        let _ = self.replies.send((query, answer));
    }

    /// As of the last frame; made once per frame.
    pub(super) fn snapshot(&mut self, graph: &Graph) -> Option<Arc<[u8]>> {
        let frame = self.publisher.last_frame();
        if let Some((of, bytes)) = &self.snapshot
            && *of == frame
        {
            return Some(bytes.clone());
        }
        let bytes: Arc<[u8]> = stamped(self.epoch, self.publisher.snapshot(graph)?).into();
        self.snapshot = Some((frame, bytes.clone()));
        Some(bytes)
    }

    fn steps(&mut self, event: ApplicationEvent) {
        let now_us = self.started.elapsed().as_micros() as u64;
        for action in self.lock.step(now_us, event) {
            match action {
                ApplicationAction::Release(frame, may_show) => {
                    let may_show = may_show.into_iter().map(|id| id.0).collect();
                    let is_here = |(display, _): &(&u64, &Inbox<Event>)| self.names.contains_key(display);
                    let heard = self.inboxes.iter().filter(is_here).map(|(display, inbox)| (*display, inbox.taken())).collect();
                    let release = Release { epoch: self.epoch, frame, may_show, heard, is_last: self.is_last };
                    if let Err(error) = self.releases.put(bytes_of(&release)).wait() {
                        tracing::warn!("the release of frame {frame} could not be sent: {error}");
                    }
                }
                ApplicationAction::Admitted(id) => {
                    let name = self.names.get(&id.0).map_or("?", String::as_str);
                    tracing::info!("display `{name}` is in the lock from frame {} on", self.lock.frame());
                }
                ApplicationAction::Dropped(id, frame) => {
                    let name = self.names.get(&id.0).cloned().unwrap_or_else(|| "?".into());
                    tracing::warn!("display `{name}` was late for frame {frame}: the others go on without it");
                    self.report.dropped += 1;
                }
            }
        }
    }
}
