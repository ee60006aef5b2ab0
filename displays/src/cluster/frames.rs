//! Frames on their way to a display or a guest: out of the application's memory where it runs on the same machine, over the network elsewhere.

use std::sync::atomic::{AtomicU8, Ordering};
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

/// Who follows an application subscribes to both at first, and keeps what works.
pub(super) struct Frames {
    session: Session,
    take: Take,
    uses_memory: bool,
    way: Arc<AtomicU8>,
    reader: Arc<Mutex<Reader>>,
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
        let mut frames = Frames {
            session: session.clone(),
            take: Arc::new(take),
            uses_memory,
            way: Arc::new(AtomicU8::new(if uses_memory { UNKNOWN } else { FAR })),
            reader: Arc::default(),
            over_network: None,
            in_memory: None,
        };
        frames.settle()?;
        Ok(frames)
    }

    /// Subscribes to what is needed, and to nothing else. To be called in each turn.
    pub(super) fn settle(&mut self) -> Result<(), ClusterError> {
        let way = self.way.load(Ordering::Relaxed);
        if way == NEAR {
            self.over_network = None;
        } else if self.over_network.is_none() {
            let take = self.take.clone();
            let subscriber = self.session.declare_subscriber(FRAME).callback(move |sample| take(bytes_of(&sample)));
            self.over_network = Some(subscriber.wait().map_err(network)?);
        }
        if way == FAR {
            self.in_memory = None;
        } else if self.in_memory.is_none() {
            let (take, way, reader) = (self.take.clone(), self.way.clone(), self.reader.clone());
            let subscriber = self.session.declare_subscriber(HERE).callback(move |sample| {
                let found = match message_of::<Whereabouts>(&bytes_of(&sample)) {
                    Ok(whereabouts) => reader.lock().unwrap_or_else(PoisonError::into_inner).read(&whereabouts),
                    Err(error) => return tracing::error!("{error}"),
                };
                way.store(if found == Found::Elsewhere { FAR } else { NEAR }, Ordering::Relaxed);
                if let Found::Packet(bytes) = found {
                    take(bytes);
                }
            });
            self.in_memory = Some(subscriber.wait().map_err(network)?);
        }
        Ok(())
    }

    /// True if frames come out of the application's memory.
    pub(super) fn is_near(&self) -> bool {
        self.way.load(Ordering::Relaxed) == NEAR
    }

    /// Takes the memory of a packet that is not needed any more.
    pub(super) fn reuse(&self, bytes: Vec<u8>) {
        if self.is_near() {
            self.reader.lock().unwrap_or_else(PoisonError::into_inner).reuse(bytes);
        }
    }

    /// An application came: whether its memory can be read is to be seen.
    pub(super) fn begin(&mut self) {
        if self.uses_memory {
            self.way.store(UNKNOWN, Ordering::Relaxed);
        }
    }
}

fn bytes_of(sample: &Sample) -> Vec<u8> {
    sample.payload().to_bytes().into_owned()
}
