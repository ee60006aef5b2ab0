//! Ctrl-C: the first one ends a command in good order, the second one at once.

use super::Failure;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the user wants the command to end.
pub(super) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Takes notice from now on. Once in a process.
    pub(super) fn watch() -> Result<Interrupt, Failure> {
        let came = Arc::new(AtomicBool::new(false));
        let noticed = came.clone();
        ctrlc::set_handler(move || {
            if noticed.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        })?;
        Ok(Interrupt(came))
    }

    /// True once it came.
    pub(super) fn came(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
