//! Field containers, routes and their evaluation.
