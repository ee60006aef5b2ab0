//! The frame lock: no display shows a frame before all live displays have drawn it, and nobody waits longer than the timeout for one that is
//! dead, frozen or cut off.
//!
//! Both ends are pure state machines: events and the time go in, actions come out. They know nothing of packets' contents, sockets or
//! threads, so that a simulation can delay, drop, repeat and reorder every message, and crash either end.
//!
//! The application publishes frame n and waits until every live display is ready with it; then it releases n and names those who may
//! show it. A display stops being live when it keeps the others waiting for longer than the timeout. It becomes live once it is in step:
//! its first drawing after a snapshot, which may take seconds, is not waited for; then it passes over what was released meanwhile, and draws
//! the next frame that comes. It is waited for once it idles when a frame is published and either had the one before or draws well within
//! the timeout. Who was late with a frame shows it late, as soon as a later one is there: that is never published before the release.
//! Frames are numbered without gaps within an epoch, which is one run of the application; a display that misses a frame fetches a snapshot.

mod application;
mod display;
#[cfg(test)]
mod simulation;

pub use application::{ApplicationAction, ApplicationEvent, ApplicationLock};
pub use display::{DisplayAction, DisplayEvent, DisplayLock};

/// One run of a display process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct DisplayId(pub u64);

/// Microseconds of a clock that only goes forward.
pub type TimeUs = u64;

/// How long the application waits for a display, unless told otherwise.
pub const TIMEOUT_US: TimeUs = 200_000;
