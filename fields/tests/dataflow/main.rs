//! What the dataflow promises: each behaviour by name, and random operations against a naive model.

mod behaviours;
mod book;
mod chaos;
mod copies;
mod declarations;
mod explain;
mod model;
mod support;
mod threads;
