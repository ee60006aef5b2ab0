//! Rigs, windows and devices of an installation.
