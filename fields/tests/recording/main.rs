//! Recordings: what is replayed is what was, bit by bit, and what differs is named.

#[path = "../shared/random.rs"]
mod random;

mod files;
mod random_sessions;
mod sessions;
mod support;
