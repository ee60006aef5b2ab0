//! Several applications in one world.
//!
//! One application evaluates the world, the *host*. Others, *guests*, hold a copy of it, see the nodes of all, and tell the host what they do
//! to it in numbered messages, which it does at the beginning of a frame, in order and once. Who may do what is decided in one place,
//! [`Ownership`], a state machine without sockets and clocks; displays do not notice.

mod ownership;
#[cfg(test)]
mod simulation;

#[cfg(feature = "cluster")]
mod desk;
#[cfg(feature = "cluster")]
mod guest;

pub use ownership::{GuestId, Ownership, OwnershipAction, OwnershipEvent};

#[cfg(feature = "cluster")]
pub use self::{
    desk::Desk,
    guest::{Guest, News, Whose, Wish},
};
