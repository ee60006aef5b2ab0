//! Saves: every value and every graph survives, and bad files are told what is wrong with them.

mod bad_input;
mod dice;
mod random_graphs;
mod support;
mod world;
