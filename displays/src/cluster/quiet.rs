//! Words for the log that are said once, and not again for a while: who is refused, or sends what cannot be read, does so again and again.

use std::time::{Duration, Instant};

/// How long the same words are not said again.
const QUIET: Duration = Duration::from_secs(10);
/// So many different ones are said in that time: garbage is different each time.
const MOST: usize = 32;

/// Words for the log.
#[derive(Clone, Debug, PartialEq)]
pub enum Words {
    /// How things are.
    Info(String),
    /// What goes on nevertheless.
    Warn(String),
    /// What is wrong.
    Error(String),
}

impl Words {
    fn text(&self) -> &str {
        match self {
            Words::Info(words) | Words::Warn(words) | Words::Error(words) => words,
        }
    }

    /// Into the log.
    pub fn say(self) {
        match self {
            Words::Info(words) => tracing::info!("{words}"),
            Words::Warn(words) => tracing::warn!("{words}"),
            Words::Error(words) => tracing::error!("{words}"),
        }
    }
}

/// What was said lately.
#[derive(Debug, Default)]
pub struct Quiet {
    said: Vec<(String, Instant)>,
}

impl Quiet {
    /// The words, if they are to be said now.
    pub fn news(&mut self, words: Words) -> Option<Words> {
        self.said.retain(|(_, when)| when.elapsed() < QUIET);
        let is_news = self.said.len() < MOST && self.said.iter().all(|(known, _)| known != words.text());
        is_news.then(|| {
            self.said.push((words.text().into(), Instant::now()));
            words
        })
    }

    /// Says the words, if they are to be said now.
    pub fn say(&mut self, words: Words) {
        self.news(words).into_iter().for_each(Words::say);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_said_twice_and_not_too_much() {
        let mut quiet = Quiet::default();
        let mut is_news = |words: &str| quiet.news(Words::Warn(words.into())).is_some();
        assert!(is_news("a") && is_news("b") && !is_news("a"));
        let said = (0..1000).filter(|number| is_news(&number.to_string())).count();
        assert_eq!(said, MOST - 2);
        quiet.said.iter_mut().for_each(|(_, when)| *when -= QUIET);
        assert_eq!(quiet.news(Words::Info("a".into())), Some(Words::Info("a".into())));
    }
}
