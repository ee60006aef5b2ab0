//! An application and displays in one process, over real links: joining, security, events, restarts.
#![cfg(feature = "cluster")]

mod certificates;
mod joining;
mod messages;
mod nearby;
mod slow;
mod support;
