//! One application, many display processes, all on the same frame.
//!
//! The application evaluates and publishes one packet per frame ([`umbriel_fields::replica`]); displays apply it to replicas, draw, report
//! ready, and show on release. The frame lock ([`lock`]) is two state machines without sockets or clocks; the rest of this module moves
//! their messages, on zenoh, and exists with the cargo feature `cluster`.

pub mod guests;
pub mod lock;

#[cfg(feature = "cluster")]
mod backlog;
#[cfg(feature = "cluster")]
mod cache;
#[cfg(feature = "cluster")]
mod certificates;
#[cfg(feature = "cluster")]
mod event;
#[cfg(feature = "cluster")]
mod follower;
#[cfg(feature = "cluster")]
mod frames;
#[cfg(feature = "cluster")]
mod gate;
#[cfg(feature = "cluster")]
mod host;
#[cfg(feature = "cluster")]
mod line;
#[cfg(feature = "cluster")]
mod lines;
#[cfg(feature = "cluster")]
mod memory;
#[cfg(feature = "cluster")]
mod message;
#[cfg(feature = "cluster")]
mod near;
#[cfg(feature = "cluster")]
mod neighbours;
#[cfg(feature = "cluster")]
mod ordered;
#[cfg(feature = "cluster")]
mod outlets;
#[cfg(feature = "cluster")]
mod proxy;
#[cfg(any(feature = "cluster", test))]
mod queue;
#[cfg(feature = "cluster")]
mod quiet;
#[cfg(feature = "cluster")]
mod rights;
#[cfg(feature = "cluster")]
mod short;
#[cfg(feature = "cluster")]
mod transport;
#[cfg(feature = "cluster")]
mod waits;
#[cfg(feature = "cluster")]
mod world;

#[cfg(feature = "cluster")]
pub use self::{
    cache::CacheOptions,
    certificates::make as make_certificates,
    event::{Event, Input, Motion, Pointing},
    follower::{Follower, FollowerOptions, FollowerReport, Progress, Screen},
    gate::HostReport,
    host::{Host, HostOptions},
    lines::{Lines, number_of_process},
    proxy::Proxy,
    quiet::{Quiet, Words},
    transport::{ClusterError, LEASE, Security},
    waits::Waits,
};
#[cfg(feature = "cluster")]
pub use guests::{Desk, Guest, News, Whose, Wish};
