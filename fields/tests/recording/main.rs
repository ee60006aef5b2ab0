//! Recordings: what is replayed is what was, bit by bit, and what differs is named.

mod files;
mod random_sessions;
mod sessions;
mod support;
