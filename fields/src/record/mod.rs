//! Recording and replay of a session at the level of fields: a replay is a regression test.
//!
//! A recording holds what came from outside, in order: what applications and scripts wrote, made, connected and removed, and when frames
//! were evaluated. What routes and native evaluation make of it is not recorded but computed again, and compared after each frame: a hash of
//! all values, and for each field that was written its value, or its hash if that is shorter.
//! Script types are evaluated by the host, so what they do comes from outside too: a replay needs no scripts.
//!
//! Keyframes hold the whole graph, also what decides over later frames without being a value; a replay starts at any of them.

mod blocks;
mod divergence;
mod hashes;
mod journal;
mod numbers;
mod playback;
mod recorder;
mod replayer;
mod restore;
mod state;
mod summary;
mod types;

pub use divergence::Divergence;
pub use recorder::{Options, Recorder};
pub use replayer::{Replayed, Replayer};
pub use summary::{Summary, summary};

pub(crate) use journal::{Event, Journal};

/// What can go wrong with a recording as a whole. That a replay differs is no error: see [`Divergence`].
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// Reading or writing failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// Somebody records this graph already.
    #[error("this graph is being recorded already")]
    Recording,
    /// Begun or ended in the middle of a frame.
    #[error("a recording begins and ends between frames")]
    Evaluating,
    /// A value that cannot be written.
    #[error("the recording cannot be written: {fault}")]
    Encoding {
        /// Why.
        fault: String,
    },
    /// The file is something else.
    #[error("this is no recording")]
    NotARecording,
    /// Written by a later version that changed the format.
    #[error(
        "the recording has format version {major}.{minor}; versions from {}.0 on up to the next major one can be read",
        blocks::MAJOR
    )]
    WrongVersion {
        /// Of the file.
        major: u16,
        /// Of the file.
        minor: u16,
    },
    /// What was read is not what was written, though checksums fit.
    #[error("the recording is damaged: {fault}")]
    Damaged {
        /// How it shows.
        fault: String,
    },
    /// A node type that only this program can evaluate is not known.
    #[error("the recording has nodes of type `{name}`, which is not known{hint}")]
    MissingType {
        /// Its name.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// A node type changed since.
    #[error("the type `{name}` is not what it was when this was recorded: {difference}")]
    OtherType {
        /// Its name.
        name: String,
        /// What changed.
        difference: String,
    },
    /// A frame that is not in the file.
    #[error("there is no frame {frame}: the recording has {frames}")]
    NoSuchFrame {
        /// Asked for.
        frame: u64,
        /// How many there are.
        frames: u64,
    },
}
