//! Frames on their way to a display or a guest: out of the application's memory where it runs on the same machine, over the network elsewhere.

use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

use super::memory::{Found, Reader, Whereabouts};
use super::message::{FRAME, HERE, message_of};
use super::transport::{ClusterError, network};

/// Nothing was sent yet that would tell.
const UNKNOWN: u8 = 0;
/// The application's memory can be read.
const NEAR: u8 = 1;
/// It cannot.
const FAR: u8 = 2;

type Take = Arc<dyn Fn(Vec<u8>) + Send + Sync>;

/// The application's memory, as far as it can be read from here.
#[derive(Clone)]
pub(super) struct Memory {
    take: Take,
    way: Arc<AtomicU8>,
    /// Of the memory that was read last.
    token: Arc<AtomicU64>,
    reader: Arc<Mutex<Reader>>,
}

impl Memory {
    /// Reads a packet, by a message that says where it lies.
    pub(super) fn read(&self, message: &[u8]) {
        let whereabouts = match message_of::<Whereabouts>(message) {
            Ok(whereabouts) => whereabouts,
            Err(error) => return tracing::error!("where a frame lies: {error}"),
        };
        let found = self.reader.lock().unwrap_or_else(PoisonError::into_inner).read(&whereabouts);
        self.token.store(whereabouts.token, Ordering::Relaxed);
        self.way.store(if found == Found::Elsewhere { FAR } else { NEAR }, Ordering::Release);
        if let Found::Packet(bytes) = found {
            (self.take)(bytes);
        }
    }

    fn way(&self) -> u8 {
        self.way.load(Ordering::Acquire)
    }
}

/// Who follows an application subscribes to both at first, and keeps what works.
pub(super) struct Frames {
    session: Session,
    memory: Memory,
    uses_memory: bool,
    over_network: Option<Subscriber<()>>,
    in_memory: Option<Subscriber<()>>,
}

impl Frames {
    /// `take` gets the packets. Memory is left alone unless `uses_memory`.
    pub(super) fn follow(
        session: &Session,
        uses_memory: bool,
        take: impl Fn(Vec<u8>) + Send + Sync + 'static,
    ) -> Result<Frames, ClusterError> {
        let way = Arc::new(AtomicU8::new(if uses_memory { UNKNOWN } else { FAR }));
        let memory = Memory { take: Arc::new(take), way, token: Arc::default(), reader: Arc::default() };
        let mut frames = Frames { session: session.clone(), memory, uses_memory, over_network: None, in_memory: None };
        frames.settle(false)?;
        Ok(frames)
    }

    /// Subscribes to what is needed, and to nothing else. `is_told` that it is told otherwise where frames lie. To be called in each turn.
    pub(super) fn settle(&mut self, is_told: bool) -> Result<(), ClusterError> {
        let way = self.memory.way();
        if way == NEAR {
            self.over_network = None;
        } else if self.over_network.is_none() {
            let take = self.memory.take.clone();
            let subscriber = self.session.declare_subscriber(FRAME).callback(move |sample| take(bytes_of(&sample)));
            self.over_network = Some(subscriber.wait().map_err(network)?);
        }
        if way == FAR || is_told {
            self.in_memory = None;
        } else if self.in_memory.is_none() {
            let memory = self.memory.clone();
            let subscriber = self.session.declare_subscriber(HERE).callback(move |sample| memory.read(&bytes_of(&sample)));
            self.in_memory = Some(subscriber.wait().map_err(network)?);
        }
        Ok(())
    }

    /// True if frames come out of the application's memory.
    pub(super) fn is_near(&self) -> bool {
        self.memory.way() == NEAR
    }

    /// The memory, and what tells it from others, once something was read there.
    pub(super) fn memory(&self) -> Option<(&Memory, u64)> {
        self.is_near().then(|| (&self.memory, self.memory.token.load(Ordering::Relaxed)))
    }

    /// Takes the memory of a packet that is not needed any more.
    pub(super) fn reuse(&self, bytes: Vec<u8>) {
        if self.is_near() {
            self.memory.reader.lock().unwrap_or_else(PoisonError::into_inner).reuse(bytes);
        }
    }

    /// An application came: whether its memory can be read is to be seen.
    pub(super) fn begin(&mut self) {
        if self.uses_memory {
            self.memory.way.store(UNKNOWN, Ordering::Release);
        }
    }
}

fn bytes_of(sample: &Sample) -> Vec<u8> {
    sample.payload().to_bytes().into_owned()
}
