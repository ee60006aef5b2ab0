//! What the dataflow promises: each behaviour by name, and random operations against a naive model.

#[path = "../shared/random.rs"]
mod random;

mod book;
mod chaos;
mod copies;
mod declarations;
mod explain;
mod model;
mod routes;
mod support;
mod threads;
mod turns;
