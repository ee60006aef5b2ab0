//! A display's end of a short line ([`super::near`]): looks for it, is told, and says it is ready.

use std::time::{Duration, Instant};

use super::message::bytes_of;
use super::near::{Bell, Heard, Hello, Pipe, Word, append};

/// How often it is looked for, where the application's memory can be read but this line is not there.
const LOOKS_EVERY: Duration = Duration::from_secs(1);

/// The line, open or not.
#[derive(Default)]
pub(super) struct Short {
    /// Of the application's endpoint; none where there is no line to look for.
    port: Option<u16>,
    pipe: Option<Pipe>,
    heard: Heard,
    /// The application has said something, so that nothing more is to be heard over the network.
    is_told: bool,
    looked: Option<Instant>,
}

impl Short {
    /// None yet.
    pub(super) fn at(port: Option<u16>) -> Short {
        Short { port, ..Short::default() }
    }

    /// Closes it, and lets it be looked for at once.
    pub(super) fn begin(&mut self) {
        self.close();
        self.looked = None;
    }

    fn close(&mut self) {
        // It may have been cloned for nobody, but the other end must see it now.
        self.pipe.take().iter().for_each(Pipe::shut);
        (self.heard, self.is_told) = (Heard::default(), false);
    }

    /// Opens it for a display, with the token of the application's memory.
    pub(super) fn look(&mut self, token: u64, display: u64) {
        let Some(port) = self.port else { return };
        if self.pipe.is_some() || self.looked.is_some_and(|looked| looked.elapsed() < LOOKS_EVERY) {
            return;
        }
        self.looked = Some(Instant::now());
        let opened = Pipe::connect(port);
        self.pipe = opened.inspect_err(|error| tracing::debug!("no short line to the application: {error}")).ok();
        self.say(Word::Hello, &bytes_of(&Hello { token, display }));
    }

    /// True while the application tells everything down this line.
    pub(super) fn is_told(&self) -> bool {
        self.is_told
    }

    /// Says something; false if it is to be said over the network.
    pub(super) fn say(&mut self, word: Word, message: &[u8]) -> bool {
        let Some(pipe) = &self.pipe else { return false };
        let mut words = Vec::with_capacity(message.len() + 8);
        let is_said = append(&mut words, word, message) && pipe.send(&words).is_ok();
        if !is_said {
            self.close();
        }
        is_said
    }

    /// Waits until the bell rings or words come, which `take` gets; false at once where there is no line.
    pub(super) fn wait(&mut self, bell: &Bell, patience: Duration, mut take: impl FnMut(Word, &[u8])) -> bool {
        let Some(pipe) = &self.pipe else { return false };
        if bell.wait(pipe, patience) {
            self.hear(&mut take);
        }
        true
    }

    /// Takes the words that have come already, also those before the end of a line that is closed.
    pub(super) fn drain(&mut self, bell: &Bell, mut take: impl FnMut(Word, &[u8])) {
        while self.pipe.as_ref().is_some_and(|pipe| bell.wait(pipe, Duration::ZERO)) {
            self.hear(&mut take);
        }
    }

    /// Takes what comes next; closes the line at its end.
    fn hear(&mut self, take: &mut impl FnMut(Word, &[u8])) {
        let Some(pipe) = &self.pipe else { return };
        let mut is_whole = self.heard.more(pipe);
        while let Some(word) = self.heard.next() {
            match word {
                Ok((word @ (Word::Here | Word::Release), message)) => {
                    self.is_told = true;
                    take(word, message);
                }
                _ => is_whole = false,
            }
        }
        if !is_whole {
            self.close();
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::super::near::Ear;
    use super::*;

    #[test]
    fn last_words_are_heard_after_the_line_was_closed() {
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let ear = Ear::open(port).unwrap();
        let mut short = Short::at(Some(port));
        short.look(1, 2);
        let application = ear.accept().unwrap().unwrap();
        let mut words = Vec::new();
        assert!(append(&mut words, Word::Here, b"a") && append(&mut words, Word::Release, b"b"));
        application.send(&words).unwrap();
        application.shut();
        let mut heard = Vec::new();
        short.drain(&Bell::new(), |word, message| heard.push((word, message.to_vec())));
        assert_eq!(heard, [(Word::Here, b"a".to_vec()), (Word::Release, b"b".to_vec())]);
        assert!(!short.is_told(), "the line is closed");
    }
}
