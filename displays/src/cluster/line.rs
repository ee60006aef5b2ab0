//! The link to the application, as displays and guests hold it: what comes in stands in one queue.

use std::collections::BTreeSet;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use crossbeam::channel::{Receiver, Sender, unbounded};
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

use super::frames::Frames;
use super::message::{APPLICATION, BULK};
use super::transport::{ClusterError, End, Security, network, open};

/// How long an answer may take.
const ANSWER: Duration = Duration::from_secs(5);

/// An answer, or why there is none.
pub(super) type Answer = Result<Vec<u8>, String>;

/// A subject, and what its messages arrive as.
pub(super) type Subject<A> = (&'static str, fn(Vec<u8>) -> A);

/// What a line is made of.
pub(super) struct Link<'a> {
    pub(super) end: End,
    pub(super) endpoint: &'a str,
    pub(super) security: &'a Security,
    pub(super) lease: Duration,
    /// Frames may be read out of the application's memory.
    pub(super) uses_memory: bool,
}

/// A link; `A` is what arrives.
pub(super) struct Line<A> {
    pub(super) session: Session,
    /// Of this process, unlike any other's.
    pub(super) id: u64,
    pub(super) arrived: Receiver<A>,
    sender: Sender<A>,
    /// Long values that were asked for and have not come.
    asked: BTreeSet<u64>,
    frames: Frames,
    _token: Option<LivelinessToken>,
    _subscribers: Vec<Subscriber<()>>,
}

impl<A: Send + 'static> Line<A> {
    /// Links to an application, now or as soon as it is there. `frame` and `subject` are what it publishes, `application` tells that it came
    /// or went.
    pub(super) fn open(
        Link { end, endpoint, security, lease, uses_memory }: Link<'_>,
        frame: fn(Vec<u8>) -> A,
        (key, kind): Subject<A>,
        application: fn(bool) -> A,
    ) -> Result<Line<A>, ClusterError> {
        let session = open(endpoint, security, end, lease)?;
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64;
        let id = since ^ (std::process::id() as u64) << 40;
        let (sender, arrived) = unbounded();
        let framed = sender.clone();
        let frames = Frames::follow(&session, uses_memory, move |bytes| drop(framed.send(frame(bytes))))?;
        let told = sender.clone();
        let take = move |sample: Sample| drop(told.send(kind(sample.payload().to_bytes().into_owned())));
        let mut subscribers = vec![session.declare_subscriber(key).callback(take).wait().map_err(network)?];
        let told = sender.clone();
        let alive = session.liveliness().declare_subscriber(APPLICATION).history(true).callback(move |sample| {
            let _ = told.send(application(sample.kind() == SampleKind::Put));
        });
        subscribers.push(alive.wait().map_err(network)?);
        Ok(Line { session, id, arrived, sender, asked: BTreeSet::new(), frames, _token: None, _subscribers: subscribers })
    }

    /// Keeps the one way of frames that works. To be called in each turn.
    pub(super) fn settle(&mut self) {
        if let Err(error) = self.frames.settle() {
            tracing::debug!("cannot follow: {error}");
        }
    }

    /// True if frames come out of the application's memory.
    pub(super) fn is_near(&self) -> bool {
        self.frames.is_near()
    }

    /// Takes the memory of a frame's packet that is not needed any more.
    pub(super) fn reuse(&self, bytes: Vec<u8>) {
        self.frames.reuse(bytes);
    }

    /// An application came.
    pub(super) fn begin(&mut self) {
        self.frames.begin();
    }

    /// Says that this process is there, until the line is dropped.
    pub(super) fn announce(&mut self, prefix: &str) -> Result<(), ClusterError> {
        let token = self.session.liveliness().declare_token(format!("{prefix}/{}", self.id)).wait().map_err(network)?;
        self._token = Some(token);
        Ok(())
    }

    /// Asks the application; the answer arrives.
    pub(super) fn get(&self, key: String, payload: Vec<u8>, arrived: impl Fn(Answer) -> A + Send + Sync + 'static) {
        let sender = self.sender.clone();
        let sent = self.session.get(key).payload(payload).timeout(ANSWER).callback(move |reply| {
            let answer = match reply.into_result() {
                Ok(sample) => Ok(sample.payload().to_bytes().into_owned()),
                Err(error) => Err(String::from_utf8_lossy(&error.payload().to_bytes()).into_owned()),
            };
            let _ = sender.send(arrived(answer));
        });
        if let Err(error) = sent.wait() {
            tracing::debug!("cannot ask: {error}");
        }
    }

    /// Asks for long values, each once until its answer came.
    pub(super) fn ask_for_bulk(&mut self, missing: Vec<u64>, arrived: fn(u64, Answer) -> A) {
        for hash in missing {
            if self.asked.insert(hash) {
                self.get(format!("{BULK}/{hash:016x}"), Vec::new(), move |answer| arrived(hash, answer));
            }
        }
    }

    /// The answer about a long value came.
    pub(super) fn bulk_answered(&mut self, hash: u64) {
        self.asked.remove(&hash);
    }

    /// True while answers about long values are awaited.
    pub(super) fn awaits_bulk(&self) -> bool {
        !self.asked.is_empty()
    }
}
