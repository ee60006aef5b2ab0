//! How much memory one model may take.

use super::error::{Cause, Fault};
use std::cell::Cell;

/// Bytes that are left to a model: its file, buffers, vertices and pictures all take from it, so that a small file
/// that names the same large data many times cannot fill the memory.
pub(crate) struct Budget {
    limit: u64,
    left: Cell<u64>,
}

impl Budget {
    pub(crate) fn new(limit: u64) -> Budget {
        Budget { limit, left: Cell::new(limit) }
    }

    pub(crate) fn left(&self) -> u64 {
        self.left.get()
    }

    /// Takes `bytes` for `object`, or says that it is too large.
    pub(crate) fn take(&self, bytes: u64, object: &str) -> Result<(), Fault> {
        match self.left.get().checked_sub(bytes) {
            Some(left) => {
                self.left.set(left);
                Ok(())
            }
            None => {
                let message = format!("needs {bytes} bytes, but {} of the model's {} are left", self.left.get(), self.limit);
                Err(Fault::new(object, Cause::Limit(message)))
            }
        }
    }
}
