//! Recording and replay of a session at the level of fields.

mod journal;

pub(crate) use journal::{Event, Journal};
