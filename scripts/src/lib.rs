//! Worlds written in rhai.
