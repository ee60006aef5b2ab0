//! The application's end: publishes frames, waits for displays, releases.

use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crossbeam::channel::{Receiver, Sender, unbounded};
use umbriel_fields::Graph;
use umbriel_fields::replica::Publisher;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::query::{Query, Queryable};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

use super::event::Input;
use super::gate::{Gate, HostReport, SharedGate, Staged, enter};
use super::lines::Lines;
use super::memory::Shelf;
use super::message::{APPLICATION, BULK, DISPLAY, INPUT, Join, PROTOCOL, READY, SNAPSHOT, message_of, stamped};
use super::neighbours::Listening;
use super::outlets::{Outlets, Parcel};
use super::transport::{ClusterError, End, Security, network, open, port_of};

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
    /// The application may make a frame while displays draw the one before: who then fetches everything misses that one. If not, each frame
    /// is released before the application goes on.
    pub ahead: bool,
    /// What tells whom lines lead to, for the log.
    pub lines: Option<Lines>,
}

enum Arrived {
    Snapshot(Query),
    Bulk(Query),
    /// The gate is through.
    Turn,
}

/// A question, and what is said to it.
type Answer = (Query, Result<Arc<[u8]>, String>);

/// An application that displays can join.
pub struct Host {
    arrived: Receiver<Arrived>,
    replies: Sender<Answer>,
    outlets: Arc<Outlets>,
    /// None where nobody can read it.
    shelf: Option<Shelf>,
    gate: SharedGate,
    publisher: Publisher,
    /// This run: later ones have greater numbers.
    epoch: u64,
    /// Requests that came while the graph was being written.
    deferred: Vec<Query>,
    snapshot: Option<(u64, Arc<[u8]>)>,
    _held: (Vec<Subscriber<()>>, Vec<Queryable<()>>, LivelinessToken),
    _listening: Option<Listening>,
    session: Session,
}

/// Sends answers: long ones to slow displays must not hold up frames.
fn replies() -> Sender<Answer> {
    let (replies, to_reply) = unbounded::<Answer>();
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
    replies
}

/// What displays say goes to the gate, on the threads of the network.
fn subscribe(session: &Session, gate: &SharedGate) -> Result<Vec<Subscriber<()>>, ClusterError> {
    let mut subscribers = Vec::new();
    for (key, take) in [(READY, Gate::is_ready as fn(&mut Gate, &[u8])), (INPUT, Gate::is_told)] {
        let gate = gate.clone();
        let take = move |sample: Sample| take(&mut enter(&gate), &sample.payload().to_bytes());
        subscribers.push(session.declare_subscriber(key).callback(take).wait().map_err(network)?);
    }
    let gate = gate.clone();
    let alive = session.liveliness().declare_subscriber(format!("{DISPLAY}/*")).history(true).callback(move |sample| {
        let Some(number) = sample.key_expr().as_str().rsplit('/').next().and_then(|number| number.parse().ok()) else { return };
        match sample.kind() {
            SampleKind::Put => enter(&gate).is_there(number),
            SampleKind::Delete => enter(&gate).is_gone(number),
        }
    });
    subscribers.push(alive.wait().map_err(network)?);
    Ok(subscribers)
}

impl Host {
    /// Listens.
    pub fn listen(options: &HostOptions) -> Result<Host, ClusterError> {
        let session = open(&options.listen, &options.security, End::Application, options.lease)?;
        let (sender, arrived) = unbounded();
        let outlets = Arc::new(Outlets::open(&session)?);
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_micros() as u64;
        let turns = sender.clone();
        let wake = move || drop(turns.send(Arrived::Turn));
        let gate = Gate::open(options.timeout, options.ahead, epoch, outlets.clone(), options.lines, wake);
        let subscribers = subscribe(&session, &gate)?;
        let mut queryables = Vec::new();
        for (key, kind) in
            [(SNAPSHOT.to_string(), Arrived::Snapshot as fn(Query) -> Arrived), (format!("{BULK}/*"), Arrived::Bulk)]
        {
            let sender = sender.clone();
            let queryable = session.declare_queryable(key).callback(move |query| drop(sender.send(kind(query))));
            queryables.push(queryable.wait().map_err(network)?);
        }
        let token = session.liveliness().declare_token(APPLICATION).wait().map_err(network)?;
        let shelf = Shelf::make().inspect_err(|error| tracing::debug!("no memory for displays of this machine: {error}")).ok();
        let listening = shelf.as_ref().zip(port_of(&options.listen)).and_then(|(shelf, port)| {
            let started = Listening::start(port, shelf.token(), outlets.neighbours.clone(), gate.clone());
            started.inspect_err(|error| tracing::debug!("no short line for displays of this machine: {error}")).ok()
        });
        Ok(Host {
            arrived,
            replies: replies(),
            outlets,
            shelf,
            gate,
            publisher: Publisher::new(),
            epoch,
            deferred: Vec::new(),
            snapshot: None,
            _held: (subscribers, queryables, token),
            _listening: listening,
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
        let gate = enter(&self.gate);
        gate.lock().live().filter_map(|id| gate.names.get(&id.0).cloned()).collect()
    }

    /// Is there a display of this name, in the lock or not?
    pub fn knows(&self, name: &str) -> bool {
        enter(&self.gate).names.values().any(|known| known == name)
    }

    /// How many displays have drawn the last frame, waited for or not.
    pub fn in_time(&self) -> usize {
        enter(&self.gate).lock().in_time()
    }

    /// What happened so far.
    pub fn report(&self) -> HostReport {
        enter(&self.gate).report.clone()
    }

    /// What displays told since this was last called, in the order of each display.
    pub fn inputs(&mut self) -> Vec<Input> {
        std::mem::take(&mut enter(&self.gate).inputs)
    }

    /// Publishes what was written to the graph as the next frame, once every live display has drawn the one before. Waits until they have
    /// drawn this one too, where the host does not run ahead or where it is the last one, after which displays that want to end do. Waits
    /// for nobody longer than the timeout.
    pub fn frame(&mut self, graph: &Graph, is_last: bool) {
        // All that can be done before the displays are.
        let packet = stamped(self.epoch, self.publisher.unsealed_frame(graph));
        let (frame, hash) = (self.publisher.last_frame(), self.publisher.hash());
        let (parcel, spare) = Parcel::new(packet, &mut self.shelf, &self.outlets);
        spare.into_iter().for_each(|spare| self.publisher.reuse(spare));
        enter(&self.gate).stage(Staged { frame, hash, parcel, is_last });
        loop {
            let (is_staged, is_through) = enter(&self.gate).progress();
            if !is_staged {
                for query in std::mem::take(&mut self.deferred) {
                    self.joins(graph, query);
                }
            }
            if is_through {
                return;
            }
            self.receive((!is_staged).then_some(graph), Duration::from_millis(20));
        }
    }

    /// Serves displays until a time; the graph must not have been written since the frame, or who joins waits for the next one.
    pub fn wait_until(&mut self, graph: &Graph, until: Instant) {
        loop {
            let left = until.saturating_duration_since(Instant::now());
            // Who comes is let in also where the application has no time to spare.
            self.receive(Some(graph), left);
            if left.is_zero() {
                return;
            }
        }
    }

    /// Who wants to join while the graph is ahead of what is published waits for that.
    fn receive(&mut self, graph: Option<&Graph>, patience: Duration) {
        let mut next = self.arrived.recv_timeout(patience).ok();
        while let Some(arrived) = next {
            match (arrived, graph) {
                (Arrived::Turn, _) => {}
                (Arrived::Snapshot(query), None) => {
                    // The frame that it lacks is gone from here: the others do not wait for it.
                    let join = query.payload().and_then(|payload| message_of::<Join>(&payload.to_bytes()).ok());
                    join.into_iter().for_each(|join| enter(&self.gate).excuse(join.display));
                    self.deferred.push(query);
                }
                (Arrived::Snapshot(query), Some(graph)) => self.joins(graph, query),
                (Arrived::Bulk(query), _) => self.gives_bulk(query),
            }
            next = self.arrived.try_recv().ok();
        }
    }

    fn gives_bulk(&mut self, query: Query) {
        let hash = query.key_expr().as_str().rsplit('/').next().and_then(|hash| u64::from_str_radix(hash, 16).ok());
        let answer = hash.and_then(|hash| self.publisher.bulk(hash)).ok_or_else(|| "there is no such value any more".to_string());
        let _ = self.replies.send((query, answer));
    }

    fn joins(&mut self, graph: &Graph, query: Query) {
        let (number, answer) = match query.payload().map(|payload| message_of::<Join>(&payload.to_bytes())) {
            Some(Ok(join)) => (Some(join.display), self.lets_in(join)),
            Some(Err(error)) => (None, Err(error.to_string())),
            None => (None, Err("it does not say who it is".into())),
        };
        let answer = match answer {
            Err(reason) => {
                enter(&self.gate).refuses(number, &reason);
                Err(reason)
            }
            Ok(join) => {
                if self.publisher.last_frame() == 0 {
                    return self.deferred.push(query);
                }
                let Some(snapshot) = self.snapshot(graph) else { return self.deferred.push(query) };
                let mut gate = enter(&self.gate);
                let at = gate.joins(join.display, &join.name).then(|| gate.at(join.display));
                drop(gate);
                if let Some(at) = at {
                    tracing::info!("display `{}`{at} joins at frame {}", join.name, self.publisher.last_frame());
                }
                Ok(snapshot)
            }
        };
        let _ = self.replies.send((query, answer));
    }

    /// Who may not come in, and why.
    fn lets_in(&self, join: Join) -> Result<Join, String> {
        if join.protocol != PROTOCOL {
            return Err(format!(
                "it speaks version {} of the protocol, the application speaks {PROTOCOL} (display `{}`)",
                join.protocol, join.name
            ));
        }
        match enter(&self.gate).twin(join.display, &join.name) {
            Some(_) => Err(format!("there is a display `{}` already", join.name)),
            None => Ok(join),
        }
    }

    /// Where a process is, for the log.
    pub(super) fn at(&self, number: u64) -> String {
        enter(&self.gate).at(number)
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
}
