//! The link to the application, as displays and guests hold it: what comes in stands in one queue.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crossbeam::channel::{TryRecvError, bounded};
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

use super::backlog::MOST_BYTES;
use super::cache::Cache;
use super::frames::{Frames, Memory};
use super::lines::number_of_process;
use super::message::{APPLICATION, BULK};
use super::near::{Bell, Word};
use super::queue::{Flood, Queue};
use super::short::Short;
use super::transport::{ClusterError, End, Security, network, open, port_of};

/// How long an answer may take.
const ANSWER: Duration = Duration::from_secs(5);

/// How often who listens meanwhile looks whether that is over, where nothing wakes it.
const LOOK: Duration = Duration::from_millis(50);

/// An answer, or why there is none.
pub(super) type Answer = Result<Vec<u8>, String>;

/// What the application's messages arrive as.
#[derive(Clone, Copy)]
pub(super) struct Kinds<A> {
    pub(super) frame: fn(Vec<u8>) -> A,
    /// Frames were dropped.
    pub(super) flood: fn(Flood) -> A,
    /// What else it publishes.
    pub(super) subject: (&'static str, fn(Vec<u8>) -> A),
    /// It came or went.
    pub(super) application: fn(bool) -> A,
}

/// What a line is made of.
pub(super) struct Link<'a> {
    pub(super) end: End,
    pub(super) endpoint: &'a str,
    pub(super) security: &'a Security,
    pub(super) lease: Duration,
    /// Frames may be read out of the application's memory.
    pub(super) uses_memory: bool,
    /// Where long values are kept.
    pub(super) cache: Option<Cache>,
}

/// Where things arrive; rings for who waits at the short line.
struct Post<A>(Arc<(Mutex<Queue<A>>, Condvar, Bell)>);

impl<A> Clone for Post<A> {
    fn clone(&self) -> Post<A> {
        Post(self.0.clone())
    }
}

impl<A> Post<A> {
    fn new(flood: fn(Flood) -> A) -> Post<A> {
        Post(Arc::new((Mutex::new(Queue::new(MOST_BYTES, flood)), Condvar::new(), Bell::new())))
    }

    fn enter(&self) -> MutexGuard<'_, Queue<A>> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn send(&self, arrived: A) {
        self.enter().push(arrived);
        self.ring();
    }

    fn send_frame(&self, bytes: Vec<u8>, kind: fn(Vec<u8>) -> A) {
        let length = bytes.len();
        self.enter().push_frame(kind(bytes), length);
        self.ring();
    }

    fn ring(&self) {
        self.0.1.notify_one();
        self.bell().ring();
    }

    fn bell(&self) -> &Bell {
        &self.0.2
    }

    /// What comes next within some time.
    fn wait(&self, patience: Duration) -> Option<A> {
        let waited = self.0.1.wait_timeout_while(self.enter(), patience, |queue| queue.is_empty());
        waited.unwrap_or_else(PoisonError::into_inner).0.pop()
    }
}

/// A question that is dropped once nobody is left who could answer it.
struct Asked<A, F: Fn(Answer) -> A> {
    post: Post<A>,
    arrived: F,
    is_answered: AtomicBool,
}

impl<A, F: Fn(Answer) -> A> Drop for Asked<A, F> {
    fn drop(&mut self) {
        if !self.is_answered.load(Ordering::Relaxed) {
            self.post.send((self.arrived)(Err("nobody answers".into())));
        }
    }
}

/// Who listens to the short line.
struct Ear<'a, A> {
    short: &'a mut Short,
    /// What is said there to lie in it.
    memory: Option<&'a Memory>,
    post: &'a Post<A>,
    kind: fn(Vec<u8>) -> A,
}

impl<A> Ear<'_, A> {
    /// Takes what comes within some time; false at once where there is no short line.
    fn hear(&mut self, patience: Duration) -> bool {
        let Ear { short, memory, post, kind } = self;
        short.wait(post.bell(), patience, |word, message| match (word, *memory) {
            (Word::Here, Some(memory)) => memory.read(message),
            (Word::Release, _) => post.send(kind(message.to_vec())),
            _ => {}
        })
    }
}

/// A link; `A` is what arrives.
pub(super) struct Line<A> {
    pub(super) session: Session,
    /// Of this process, unlike any other's.
    pub(super) id: u64,
    post: Post<A>,
    /// Long values that were asked for and have not come.
    asked: BTreeSet<u64>,
    cache: Option<Cache>,
    /// Bytes of long values that were fetched, and of those that were here.
    pub(super) fetched: [u64; 2],
    frames: Frames,
    kinds: Kinds<A>,
    /// Told of the subject, unless it is the short line that tells.
    over_network: Option<Subscriber<()>>,
    short: Short,
    _token: Option<LivelinessToken>,
    _alive: Subscriber<()>,
}

impl<A: Send + 'static> Line<A> {
    /// Links to an application, now or as soon as it is there.
    pub(super) fn open(
        Link { end, endpoint, security, lease, uses_memory, cache }: Link<'_>,
        kinds: Kinds<A>,
    ) -> Result<Line<A>, ClusterError> {
        let session = open(endpoint, security, end, lease)?;
        let id = number_of_process(&session.zid().to_string()).unwrap_or_default();
        let Kinds { frame, flood, application, .. } = kinds;
        let post = Post::new(flood);
        let framed = post.clone();
        let frames = Frames::follow(&session, uses_memory, move |bytes| framed.send_frame(bytes, frame))?;
        let told = post.clone();
        let alive = session.liveliness().declare_subscriber(APPLICATION).history(true);
        let alive = alive.callback(move |sample| told.send(application(sample.kind() == SampleKind::Put)));
        let _alive = alive.wait().map_err(network)?;
        let short = Short::at(port_of(endpoint).filter(|_| end == End::Display && uses_memory));
        let (asked, over_network) = (BTreeSet::new(), None);
        let mut line =
            Line { session, id, post, asked, cache, fetched: [0; 2], frames, kinds, over_network, short, _token: None, _alive };
        line.follow()?;
        Ok(line)
    }

    /// Keeps the one way of frames that works. To be called in each turn.
    pub(super) fn settle(&mut self) {
        if let Some((_, token)) = self.frames.memory() {
            self.short.look(token, self.id);
        }
        if let Err(error) = self.follow() {
            tracing::debug!("cannot follow: {error}");
        }
    }

    fn follow(&mut self) -> Result<(), ClusterError> {
        let is_told = self.short.is_told() && self.frames.is_near();
        self.frames.settle(is_told)?;
        if is_told {
            self.over_network = None;
        } else if self.over_network.is_none() {
            let ((key, kind), post) = (self.kinds.subject, self.post.clone());
            let take = move |sample: Sample| post.send(kind(sample.payload().to_bytes().into_owned()));
            self.over_network = Some(self.session.declare_subscriber(key).callback(take).wait().map_err(network)?);
        }
        Ok(())
    }

    /// What arrives next within some time.
    pub(super) fn next(&mut self, patience: Duration) -> Option<A> {
        let arrived = self.post.enter().pop();
        if arrived.is_some() || patience.is_zero() {
            return arrived;
        }
        let waited = self.ear().hear(patience);
        if waited { self.post.enter().pop() } else { self.post.wait(patience) }
    }

    fn ear(&mut self) -> Ear<'_, A> {
        let memory = self.frames.memory().map(|(memory, _)| memory);
        Ear { short: &mut self.short, memory, post: &self.post, kind: self.kinds.subject.1 }
    }

    /// Does what may take long, and takes meanwhile what comes down the short line: neither that nor the application's memory holds much.
    pub(super) fn meanwhile<R>(&mut self, work: impl FnOnce() -> R) -> R {
        let mut ear = self.ear();
        let post = ear.post;
        let (at_work, is_done) = bounded::<()>(0);
        std::thread::scope(|scope| {
            scope.spawn(move || while is_done.try_recv() == Err(TryRecvError::Empty) && ear.hear(LOOK) {});
            let done = work();
            drop(at_work);
            post.bell().ring();
            done
        })
    }

    /// What the application said last down the short line of the subject; that it went may be known sooner.
    pub(super) fn last_words(&mut self) -> Vec<A> {
        let (mut words, kind) = (Vec::new(), self.kinds.subject.1);
        self.short.drain(self.post.bell(), |word, message| {
            if word == Word::Release {
                words.push(kind(message.to_vec()));
            }
        });
        words
    }

    /// Says down the short line that a frame is drawn; false if it is to be said over the network.
    pub(super) fn say_ready(&mut self, message: &[u8]) -> bool {
        self.short.is_told() && self.short.say(Word::Ready, message)
    }

    /// True if frames come out of the application's memory.
    pub(super) fn is_near(&self) -> bool {
        self.frames.is_near()
    }

    /// True if the application tells of frames down the short line.
    pub(super) fn is_short(&self) -> bool {
        self.short.is_told()
    }

    /// Takes the memory of a frame's packet that is not needed any more.
    pub(super) fn reuse(&self, bytes: Vec<u8>) {
        self.frames.reuse(bytes);
    }

    /// An application came, or went.
    pub(super) fn begin(&mut self) {
        self.short.begin();
        self.frames.begin();
    }

    /// Says that this process is there, until the line is dropped.
    pub(super) fn announce(&mut self, prefix: &str) -> Result<(), ClusterError> {
        let token = self.session.liveliness().declare_token(format!("{prefix}/{}", self.id)).wait().map_err(network)?;
        self._token = Some(token);
        Ok(())
    }

    /// Asks the application; the answer arrives, or that there is none.
    pub(super) fn get(&self, key: String, payload: Vec<u8>, arrived: impl Fn(Answer) -> A + Send + Sync + 'static) {
        let asked = Asked { post: self.post.clone(), arrived, is_answered: AtomicBool::new(false) };
        let sent = self.session.get(key).payload(payload).timeout(ANSWER).callback(move |reply| {
            let answer = match reply.into_result() {
                Ok(sample) => Ok(sample.payload().to_bytes().into_owned()),
                Err(error) => Err(String::from_utf8_lossy(&error.payload().to_bytes()).into_owned()),
            };
            asked.is_answered.store(true, Ordering::Relaxed);
            asked.post.send((asked.arrived)(answer));
        });
        if let Err(error) = sent.wait() {
            tracing::debug!("cannot ask: {error}");
        }
    }

    /// Asks for long values, each once until its answer came; what is in the cache arrives from there.
    pub(super) fn ask_for_bulk(&mut self, missing: Vec<u64>, arrived: fn(u64, Answer) -> A) {
        for hash in missing {
            if !self.asked.insert(hash) {
                continue;
            }
            if let Some(message) = self.cache.as_mut().and_then(|cache| cache.get(hash)) {
                self.fetched[1] += message.len() as u64;
                self.post.send(arrived(hash, Ok(message)));
            } else {
                self.get(format!("{BULK}/{hash:016x}"), Vec::new(), move |answer| arrived(hash, answer));
            }
        }
    }

    /// The answer about a long value came.
    pub(super) fn bulk_answered(&mut self, hash: u64) {
        self.asked.remove(&hash);
    }

    /// Keeps a long value that came, for the next start.
    pub(super) fn keep_bulk(&mut self, hash: u64, message: Vec<u8>) {
        match &mut self.cache {
            // It came from there.
            Some(cache) if cache.has(hash) => {}
            cache => {
                self.fetched[0] += message.len() as u64;
                if let Some(cache) = cache {
                    cache.put(hash, message);
                }
            }
        }
    }

    /// True while answers about long values are awaited.
    pub(super) fn awaits_bulk(&self) -> bool {
        !self.asked.is_empty()
    }
}
