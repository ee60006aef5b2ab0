//! Replicas: copies of a graph in other processes, kept equal frame by frame.
//!
//! The [`Publisher`] turns what was written since the last frame into one packet: removals, creations, routes and values, in an order in
//! which each only needs what came before; values lie together by field type. A [`Replica`] applies packets to a graph of its own and never
//! evaluates it. Both keep a hash of all values, so that a replica knows after each frame whether it is what it should be, and where not
//! ([`Replica::difference`]).
//!
//! Types and fields go by name: a replica may know them in another order, and need not know a type at all. Long lists and images go by a
//! hash of their content, once ([`Publisher::bulk`], [`Packet::missing`]). What is declared `local` stays with its process.
//!
//! Who wants to change a world that another process evaluates works on a copy ([`Mirror`]), and tells what it did ([`Deed`]).
//!
//! How packets travel is not known here.

mod apply;
mod bulk;
mod deeds;
mod difference;
mod flat;
mod gather;
mod herd;
mod learn;
mod local;
mod mirror;
mod packet;
mod publisher;
mod routes;
mod runs;
mod scatter;
mod shares;

pub use apply::Replica;
pub use bulk::{Bulk, hash_of_long_value};
pub use deeds::{Deed, node_numbered, number_of, own_key};
pub use difference::Difference;
pub use mirror::{Deeds, Mirror};
pub use packet::{Packet, seal};
pub use publisher::Publisher;

/// Why a packet cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReplicaError {
    /// Something else.
    #[error("this is no packet of a frame")]
    NotAPacket,
    /// Of a program that speaks otherwise.
    #[error("the packet has version {found}, this program reads version {ours}: both ends must be of one release")]
    WrongVersion {
        /// In the packet.
        found: u16,
        /// Of this program.
        ours: u16,
    },
    /// Not what was sent.
    #[error("the packet is damaged: {fault}")]
    Damaged {
        /// How it shows.
        fault: String,
    },
    /// A frame is missing in between.
    #[error("frame {found} does not follow frame {last}")]
    Gap {
        /// The last frame that was applied.
        last: u64,
        /// Of the packet.
        found: u64,
    },
    /// A snapshot where a frame was expected, or the other way round.
    #[error("a {expected} was expected")]
    OtherKind {
        /// Which one.
        expected: &'static str,
    },
    /// Long values that are not here.
    #[error("{count} long values are missing")]
    MissingBulk {
        /// How many.
        count: usize,
    },
    /// The same name means two things.
    #[error(
        "field `{field}` of node type `{node_type}` is a {theirs} in the application and a {ours} here: both ends must be of one release"
    )]
    OtherField {
        /// The node type.
        node_type: String,
        /// The field.
        field: String,
        /// Its type in the application.
        theirs: String,
        /// Its type here.
        ours: String,
    },
}

fn damaged(fault: impl Into<String>) -> ReplicaError {
    ReplicaError::Damaged { fault: fault.into() }
}
