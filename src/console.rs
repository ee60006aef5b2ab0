//! A console: lines of standard input, each run in the world between two frames.

use std::io::BufRead;
use std::sync::mpsc::{Receiver, channel};

/// Where the lines come from. A thread reads them, so that frames need not wait for somebody who types.
pub(crate) struct Console {
    lines: Receiver<String>,
}

impl Console {
    /// Reads standard input from now on, if anybody asked for it.
    pub(crate) fn open(asked: bool) -> Option<Console> {
        let (sender, lines) = channel();
        let read = move || std::io::stdin().lock().lines().map_while(Result::ok).try_for_each(|line| sender.send(line));
        asked.then(|| {
            std::thread::spawn(read);
            Console { lines }
        })
    }

    /// Runs the lines that have come; gives the number of those that failed.
    pub(crate) fn run_all(&self, run: &mut dyn FnMut(&str) -> Result<String, String>) -> usize {
        self.lines.try_iter().map(|line| answer(&line, run)).sum()
    }

    /// Waits for one line and runs it; nothing once the input has ended. The same input gives the same frames.
    pub(crate) fn run_next(&self, run: &mut dyn FnMut(&str) -> Result<String, String>) -> usize {
        self.lines.recv().map_or(0, |line| answer(&line, run))
    }
}

/// Prints the value of a line, or what is wrong with it; gives the number of problems.
fn answer(line: &str, run: &mut dyn FnMut(&str) -> Result<String, String>) -> usize {
    if line.trim().is_empty() {
        return 0;
    }
    match run(line) {
        Ok(value) if value.is_empty() => 0,
        Ok(value) => {
            say!("{value}");
            0
        }
        Err(error) => {
            tracing::error!("{error}");
            1
        }
    }
}
