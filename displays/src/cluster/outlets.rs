//! What an application tells all: frames and releases.

use std::sync::{Mutex, MutexGuard, PoisonError};

use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

use super::backlog::MOST_BYTES;
use super::memory::{Shelf, Whereabouts};
use super::message::{FRAME, HERE, RELEASE, Release, bytes_of, seal_stamped};
use super::near::Word;
use super::neighbours::Neighbours;
use super::queue::{Flood, Queue};
use super::transport::{ClusterError, network};

/// Where frames and releases go out. All may be dropped: a gap is repaired by a snapshot.
pub(super) struct Outlets {
    /// Packets, for who is far.
    frames: Publisher<'static>,
    /// Where they lie, for who is near.
    here: Publisher<'static>,
    releases: Publisher<'static>,
    /// Who hears of both down a short line.
    pub(super) neighbours: Neighbours,
    /// What is still to go over the network, in order.
    queue: Mutex<Queue<Far>>,
    /// Held by who sends it.
    sending: Mutex<()>,
}

/// Something for who is far.
enum Far {
    Here(u64, Vec<u8>),
    Frame(u64, Vec<u8>),
    Release(u64, Vec<u8>),
    /// Frames that were not sent in time.
    Dropped(Flood),
}

/// A packet that is ready to go: itself, where somebody wants it over the network, and where it lies.
pub(super) struct Parcel {
    packet: Vec<u8>,
    whereabouts: Option<Whereabouts>,
    length: u64,
}

impl Parcel {
    /// Puts a packet into memory where somebody reads it there. Gives the packet back if nobody wants it otherwise.
    pub(super) fn new(mut packet: Vec<u8>, shelf: &mut Option<Shelf>, outlets: &Outlets) -> (Parcel, Option<Vec<u8>>) {
        let length = packet.len() as u64;
        let put =
            shelf.as_mut().filter(|_| outlets.neighbours.listen() || is_heard(&outlets.here)).map(|shelf| shelf.put(&packet));
        let whereabouts = put.map(|put| {
            put.unwrap_or_else(|error| {
                tracing::warn!("no memory for displays of this machine: {error}; they are served over the network");
                *shelf = None;
                // Nowhere: they see that they cannot read it.
                Whereabouts::default()
            })
        });
        match is_heard(&outlets.frames) {
            true => {
                seal_stamped(&mut packet);
                (Parcel { packet, whereabouts, length }, None)
            }
            false => (Parcel { packet: Vec::new(), whereabouts, length }, Some(packet)),
        }
    }

    /// Bytes of the packet.
    pub(super) fn length(&self) -> u64 {
        self.length
    }
}

impl Outlets {
    pub(super) fn open(session: &Session) -> Result<Outlets, ClusterError> {
        // Express: the last piece of a frame does not wait for company.
        let declare = |key, priority| {
            let publisher = session.declare_publisher(key).congestion_control(CongestionControl::Drop);
            publisher.priority(priority).express(true).wait().map_err(network)
        };
        Ok(Outlets {
            frames: declare(FRAME, Priority::DEFAULT)?,
            // Of one priority, so that a frame does not overtake the release of the one before.
            here: declare(HERE, Priority::RealTime)?,
            releases: declare(RELEASE, Priority::RealTime)?,
            neighbours: Neighbours::default(),
            queue: Mutex::new(Queue::new(MOST_BYTES, Far::Dropped)),
            sending: Mutex::default(),
        })
    }

    fn queue(&self) -> MutexGuard<'_, Queue<Far>> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A frame, for the next [`Outlets::flush`]; who is near hears of it sooner.
    pub(super) fn send(&self, frame: u64, parcel: Parcel) {
        let mut queue = self.queue();
        if let Some(whereabouts) = &parcel.whereabouts {
            let bytes = bytes_of(whereabouts);
            self.neighbours.tell(Word::Here, &bytes);
            queue.push(Far::Here(frame, bytes));
        }
        if !parcel.packet.is_empty() {
            let length = parcel.packet.len();
            queue.push_frame(Far::Frame(frame, parcel.packet), length);
        }
    }

    /// A release, for the next [`Outlets::flush`]; who is near hears of it sooner.
    pub(super) fn release(&self, release: &Release) {
        let bytes = bytes_of(release);
        self.neighbours.tell(Word::Release, &bytes);
        self.queue().push(Far::Release(release.frame, bytes));
    }

    /// Sends what is to go over the network, which may take a while on a busy machine. Where another thread does that already, it sends all.
    pub(super) fn flush(&self) {
        while !self.queue().is_empty()
            && let Ok(_sending) = self.sending.try_lock()
        {
            loop {
                // Not held while it is sent.
                let next = self.queue().pop();
                match next {
                    Some(Far::Here(frame, bytes)) => warn(self.here.put(bytes).wait(), "frame", frame),
                    Some(Far::Frame(frame, bytes)) => warn(self.frames.put(bytes).wait(), "frame", frame),
                    Some(Far::Release(frame, bytes)) => warn(self.releases.put(bytes).wait(), "release of frame", frame),
                    Some(Far::Dropped(flood)) => {
                        tracing::warn!("a line is too slow: {flood} were not sent, and displays that lack them fetch the world");
                    }
                    None => break,
                }
            }
        }
    }
}

fn is_heard(publisher: &Publisher<'_>) -> bool {
    publisher.matching_status().wait().is_ok_and(|status| status.matching())
}

fn warn(sent: zenoh::Result<()>, what: &str, frame: u64) {
    if let Err(error) = sent {
        tracing::warn!("the {what} {frame} could not be sent: {error}");
    }
}
