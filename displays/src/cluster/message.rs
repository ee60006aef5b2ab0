//! What goes over the network, besides packets of frames.

use serde::{Deserialize, Serialize};

use super::transport::ClusterError;

/// Spoken by both ends; another one is refused.
pub(super) const PROTOCOL: u16 = 1;

pub(super) const FRAME: &str = "umbriel/frame";
pub(super) const RELEASE: &str = "umbriel/release";
pub(super) const READY: &str = "umbriel/ready";
pub(super) const INPUT: &str = "umbriel/input";
pub(super) const SNAPSHOT: &str = "umbriel/snapshot";
pub(super) const BULK: &str = "umbriel/bulk";
/// Alive while the application is.
pub(super) const APPLICATION: &str = "umbriel/application";
/// Alive while a display is; its number follows.
pub(super) const DISPLAY: &str = "umbriel/display";

/// The application lets a frame be shown.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Release {
    pub(super) epoch: u64,
    pub(super) frame: u64,
    pub(super) may_show: Vec<u64>,
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

/// Something that happened at a display, for the application: a button, an axis, a picked node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Input {
    /// Name of the display.
    pub display: String,
    /// Counts from one for each run of the display, without gaps.
    pub number: u64,
    /// The node to write, by name.
    pub node: String,
    /// The field to write.
    pub field: String,
    /// The value, as RON: `true`, `0.5`, `(1.0, 0.0, 0.0)`.
    pub value: String,
}

pub(super) fn bytes_of(message: &impl Serialize) -> Vec<u8> {
    postcard::to_stdvec(message).unwrap_or_default()
}

pub(super) fn message_of<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, ClusterError> {
    postcard::from_bytes(bytes).map_err(|error| ClusterError::Message(error.to_string()))
}

/// A packet with the run of the application before it.
pub(super) fn stamped(epoch: u64, packet: &[u8]) -> Vec<u8> {
    [&epoch.to_le_bytes(), packet].concat()
}

pub(super) fn unstamped(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let (epoch, packet) = bytes.split_first_chunk::<8>()?;
    Some((u64::from_le_bytes(*epoch), packet))
}
