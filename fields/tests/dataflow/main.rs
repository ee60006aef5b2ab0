//! What the dataflow promises: each behaviour by name, and random operations against a naive model.

mod behaviours;
mod chaos;
mod declarations;
mod model;
mod support;
