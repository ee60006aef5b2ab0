//! The application's ends of short lines ([`super::near`]): what displays of this machine are told, and what they say.

use std::io::ErrorKind;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::gate::{SharedGate, enter};
use super::message::{Ready, message_of};
use super::near::{Ear, Heard, Hello, Pipe, Word, append};

/// Before somebody is let in again whom the system had no room for.
const PAUSE: Duration = Duration::from_millis(10);

/// One line.
struct Open {
    /// Of the line, unlike any other's.
    number: u64,
    /// Whose it is, once it said so.
    display: Option<u64>,
    pipe: Pipe,
}

#[derive(Default)]
struct All {
    last_number: u64,
    open: Vec<Open>,
    /// What was not sent yet.
    words: Vec<u8>,
}

/// All lines. What is told is sent at once by [`Neighbours::send`], so that a display wakes up once for it.
#[derive(Clone, Default)]
pub(super) struct Neighbours {
    all: Arc<Mutex<All>>,
}

impl Neighbours {
    fn enter(&self) -> MutexGuard<'_, All> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Is there any?
    pub(super) fn listen(&self) -> bool {
        self.enter().open.iter().any(|line| line.display.is_some())
    }

    /// Has all be told something.
    pub(super) fn tell(&self, word: Word, message: &[u8]) {
        let mut all = self.enter();
        if !all.open.is_empty() && !append(&mut all.words, word, message) {
            // They hear it over the network.
            all.open.drain(..).for_each(|line| line.pipe.shut());
        }
    }

    /// Sends all that was told.
    pub(super) fn send(&self) {
        let mut all = self.enter();
        let All { open, words, .. } = &mut *all;
        if !words.is_empty() {
            let is_broken = |line: &mut Open| line.display.is_some() && line.pipe.send(words).is_err();
            open.extract_if(.., is_broken).for_each(|line| line.pipe.shut());
        }
        words.clear();
    }

    /// A display is gone: what it said last is not heard any more.
    pub(super) fn close(&self, display: u64) {
        let closed = self.enter().open.extract_if(.., |line| line.display == Some(display)).collect::<Vec<_>>();
        closed.iter().for_each(|line| line.pipe.shut());
    }

    fn add(&self, pipe: Pipe) -> u64 {
        let mut all = self.enter();
        all.last_number += 1;
        let number = all.last_number;
        all.open.push(Open { number, display: None, pipe });
        number
    }

    fn remove(&self, number: u64) {
        self.enter().open.retain(|line| line.number != number);
    }

    /// A line is a display's from now on; an earlier one of it is closed.
    fn introduce(&self, number: u64, display: u64) {
        self.close(display);
        if let Some(line) = self.enter().open.iter_mut().find(|line| line.number == number) {
            line.display = Some(display);
        }
    }

    fn is_of(&self, number: u64, display: u64) -> bool {
        self.enter().open.iter().any(|line| line.number == number && line.display == Some(display))
    }
}

/// Listens until it is dropped.
pub(super) struct Listening {
    ear: Arc<Ear>,
    thread: Option<JoinHandle<()>>,
    neighbours: Neighbours,
}

impl Listening {
    /// Lets displays come to the name of a port that know a token; what they say goes to the gate, on one thread for all: with one for
    /// each, the system would change threads more often.
    ///
    /// # Errors
    /// The name is taken, or the system has no such lines.
    pub(super) fn start(port: u16, token: u64, neighbours: Neighbours, gate: SharedGate) -> std::io::Result<Listening> {
        let ear = Arc::new(Ear::open(port)?);
        let mut listener = Listener { ear: ear.clone(), token, neighbours: neighbours.clone(), gate, lines: Vec::new() };
        let thread = std::thread::spawn(move || while listener.listen() {});
        Ok(Listening { ear, thread: Some(thread), neighbours })
    }
}

impl Drop for Listening {
    fn drop(&mut self) {
        self.ear.close();
        // The name is free for the next run.
        let _ = self.thread.take().map(JoinHandle::join);
        self.neighbours.enter().open.drain(..).for_each(|line| line.pipe.shut());
    }
}

/// Of a line, the end that hears.
struct Line {
    number: u64,
    pipe: Pipe,
    heard: Heard,
    /// Whose it is, once it said so.
    display: Option<u64>,
}

struct Listener {
    ear: Arc<Ear>,
    token: u64,
    neighbours: Neighbours,
    gate: SharedGate,
    lines: Vec<Line>,
}

impl Listener {
    /// Takes what comes next; false once nobody can come any more.
    fn listen(&mut self) -> bool {
        let (somebody, said) = self.ear.wait(self.lines.iter().map(|line| &line.pipe));
        let mut said = said.into_iter();
        let Listener { token, neighbours, gate, lines, .. } = self;
        let is_over = |line: &mut Line| said.next() == Some(true) && !line.hear(*token, neighbours, gate);
        for line in lines.extract_if(.., is_over) {
            line.pipe.shut();
            neighbours.remove(line.number);
        }
        if !somebody {
            return true;
        }
        match self.ear.accept() {
            Ok(came) => {
                self.lines.extend(came.and_then(|pipe| {
                    let number = self.neighbours.add(pipe.try_clone().ok()?);
                    Some(Line { number, pipe, heard: Heard::default(), display: None })
                }));
                true
            }
            Err(error) if error.kind() == ErrorKind::InvalidInput => false,
            Err(error) => {
                // Who comes waits, and those who are there are heard.
                tracing::debug!("on the short line: {error}");
                std::thread::sleep(PAUSE);
                true
            }
        }
    }
}

impl Line {
    /// Takes what a display said; false if the line is closed, or if it said what it should not.
    fn hear(&mut self, token: u64, neighbours: &Neighbours, gate: &SharedGate) -> bool {
        let is_whole = self.heard.more(&self.pipe);
        while let Some(word) = self.heard.next() {
            match (word, self.display) {
                (Ok((Word::Hello, message)), None) => match message_of::<Hello>(message) {
                    Ok(hello) if hello.token == token => {
                        neighbours.introduce(self.number, hello.display);
                        self.display = Some(hello.display);
                    }
                    _ => {
                        tracing::warn!("somebody on the short line does not know this application");
                        return false;
                    }
                },
                (Ok((Word::Ready, message)), Some(display)) => {
                    let is_its_own = message_of::<Ready>(message).is_ok_and(|ready| ready.display == display);
                    let mut gate = enter(gate);
                    // Who was given up meanwhile is not heard here: nobody would give it up again.
                    if !is_its_own || !neighbours.is_of(self.number, display) || !gate.names.contains_key(&display) {
                        return false;
                    }
                    gate.is_ready(message);
                }
                _ => {
                    tracing::warn!("on the short line: words that make no sense");
                    return false;
                }
            }
        }
        is_whole
    }
}
