//! Replicas: whatever happens to a graph, its replicas are equal after each frame, and say where they are not.

#[path = "../shared/dice.rs"]
mod dice;
#[path = "../persistence/support.rs"]
mod support;

mod guests;
mod packets;
mod random_worlds;
