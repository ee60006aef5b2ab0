//! Saves: every value and every graph survives, and bad files are told what is wrong with them.

mod bad_input;
#[path = "../shared/dice.rs"]
mod dice;
mod random_graphs;
mod support;
mod world;
