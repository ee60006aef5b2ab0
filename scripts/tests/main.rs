//! The tests of scripts, as one program: it links once.

mod docs;
mod explain;
mod limits;
mod paper;
mod rows;
mod running;
mod support;
mod types;
mod worlds;
