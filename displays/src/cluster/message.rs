//! What goes over the network, besides packets of frames.

use serde::{Deserialize, Serialize};

use umbriel_fields::replica::{Deed, Packet, ReplicaError, seal};

use super::event::Event;
use super::transport::ClusterError;

/// Spoken by both ends; another one is refused.
pub(super) const PROTOCOL: u16 = 7;

pub(super) const FRAME: &str = "umbriel/frame";
/// Where a frame's packet lies in the application's memory.
pub(super) const HERE: &str = "umbriel/here";
pub(super) const RELEASE: &str = "umbriel/release";
pub(super) const READY: &str = "umbriel/ready";
pub(super) const INPUT: &str = "umbriel/input";
pub(super) const SNAPSHOT: &str = "umbriel/snapshot";
pub(super) const BULK: &str = "umbriel/bulk";
/// Alive while the application is.
pub(super) const APPLICATION: &str = "umbriel/application";
/// Alive while a display is; its number follows.
pub(super) const DISPLAY: &str = "umbriel/display";

/// A guest asks for everything, for itself and the world.
pub(super) const GUEST_SNAPSHOT: &str = "umbriel/guests/snapshot";
/// What guests did.
pub(super) const DEEDS: &str = "umbriel/guests/deeds";
/// What became of it.
pub(super) const WORD: &str = "umbriel/guests/word";
/// Alive while a guest is; its number follows.
pub(super) const GUEST: &str = "umbriel/guest";

/// A guest asks to be let in, or asks again after a gap.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct GuestJoin {
    pub(super) protocol: u16,
    pub(super) guest: u64,
    /// How often it began anew: what it did before is not its own any more.
    pub(super) run: u64,
    pub(super) name: String,
    pub(super) keeps: bool,
}

/// What a guest did in a frame of its own.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct GuestMessage {
    pub(super) guest: u64,
    pub(super) run: u64,
    /// Counts from one in each run.
    pub(super) number: u64,
    pub(super) deeds: Vec<Deed>,
    pub(super) images: Vec<(u64, Vec<u8>)>,
    pub(super) requests: Vec<GuestRequest>,
}

/// What a guest asks for, after what it did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum GuestRequest {
    Lock(u64),
    Unlock(u64),
    Keeps(bool),
    Leave,
}

/// What guests learn with a frame; all of it in the answer to who joins.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Word {
    pub(super) epoch: u64,
    pub(super) frame: u64,
    /// The name of the application that evaluates.
    pub(super) host: String,
    /// Who is there, and the last message that was done of each.
    pub(super) guests: Vec<(u64, String, u64)>,
    /// Guest, its own key of a node, and the node's number.
    pub(super) made: Vec<(u64, u32, u64)>,
    /// Owner and holder of a lock of nodes.
    pub(super) whose: Vec<(u64, Option<u64>, Option<u64>)>,
    /// Guest, a message of it, and what of that was not done.
    pub(super) refused: Vec<(u64, u64, String)>,
    /// Guest, node, and whether it has the lock.
    pub(super) answers: Vec<(u64, u64, Result<(), String>)>,
}

impl Word {
    /// The last message of a guest that was done; none for who is not there.
    pub(super) fn done_of(&self, guest: u64) -> Option<u64> {
        self.guests.iter().find(|(id, ..)| *id == guest).map(|(.., done)| *done)
    }
}

/// The application lets a frame be shown.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Release {
    pub(super) epoch: u64,
    pub(super) frame: u64,
    pub(super) may_show: Vec<u64>,
    /// Displays, and the last input that was taken of each.
    pub(super) heard: Vec<(u64, u64)>,
    /// The application ends after this frame.
    pub(super) is_last: bool,
}

/// A display has drawn a frame.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Ready {
    pub(super) display: u64,
    pub(super) name: String,
    pub(super) epoch: u64,
    pub(super) frame: u64,
    /// How long it took to draw it.
    pub(super) took_us: u64,
    /// Of its replica.
    pub(super) hash: u64,
}

/// A display asks for everything.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Join {
    pub(super) protocol: u16,
    pub(super) display: u64,
    pub(super) name: String,
}

/// Something happened at a display.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Told {
    pub(super) display: u64,
    /// The run of the application that it is for.
    pub(super) epoch: u64,
    /// Counts from one in each run of the application.
    pub(super) number: u64,
    pub(super) event: Event,
}

pub(super) fn bytes_of(message: &impl Serialize) -> Vec<u8> {
    postcard::to_stdvec(message).unwrap_or_default()
}

/// A message, and nothing behind it.
pub(super) fn message_of<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, ClusterError> {
    match postcard::take_from_bytes(bytes) {
        Ok((message, [])) => Ok(message),
        Ok((_, rest)) => Err(ClusterError::Message(format!("{} bytes are left over", rest.len()))),
        Err(error) => Err(ClusterError::Message(error.to_string())),
    }
}

/// A packet with the run of the application behind it.
pub(super) fn stamped(epoch: u64, mut packet: Vec<u8>) -> Vec<u8> {
    packet.extend_from_slice(&epoch.to_le_bytes());
    packet
}

/// Writes the checksum into such a packet, which is to go over the network.
pub(super) fn seal_stamped(bytes: &mut [u8]) {
    let length = bytes.len().saturating_sub(size_of::<u64>());
    seal(&mut bytes[..length]);
}

/// The run of the application, and its packet.
pub(super) fn stamped_packet(mut bytes: Vec<u8>) -> Result<(u64, Packet<'static>), ReplicaError> {
    let (_, stamp) = bytes.split_last_chunk::<8>().ok_or(ReplicaError::NotAPacket)?;
    let epoch = u64::from_le_bytes(*stamp);
    bytes.truncate(bytes.len() - stamp.len());
    Ok((epoch, Packet::read(bytes)?))
}
