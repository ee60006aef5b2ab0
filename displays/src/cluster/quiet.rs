//! Words for the log that are said once, and not again for a while: who is refused, or sends what cannot be read, does so again and again.

use std::time::{Duration, Instant};

/// How long the same words are not said again.
const QUIET: Duration = Duration::from_secs(10);
/// So many different ones are said in that time: garbage is different each time.
const MOST: usize = 32;

/// What was said lately.
#[derive(Debug, Default)]
pub struct Quiet {
    said: Vec<(String, Instant)>,
}

impl Quiet {
    /// True if these words are to be said now.
    pub fn is_news(&mut self, words: &str) -> bool {
        self.said.retain(|(_, when)| when.elapsed() < QUIET);
        let is_news = self.said.len() < MOST && self.said.iter().all(|(known, _)| known != words);
        if is_news {
            self.said.push((words.into(), Instant::now()));
        }
        is_news
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_said_twice_and_not_too_much() {
        let mut quiet = Quiet::default();
        assert!(quiet.is_news("a") && quiet.is_news("b") && !quiet.is_news("a"));
        let said = (0..1000).filter(|number| quiet.is_news(&number.to_string())).count();
        assert_eq!(said, MOST - 2);
        quiet.said.iter_mut().for_each(|(_, when)| *when -= QUIET);
        assert!(quiet.is_news("a"));
    }
}
