//! The short line: a Unix socket between the application and a display of the same machine, for the few words that a frame takes.
//!
//! A display looks for it once it has read a frame out of the application's memory, by the port that it connects to: a proxy before the
//! application has its own, and breaks it as it breaks the other line. Names of such sockets belong to a network namespace; who lives in
//! another one finds none, and goes on over the network. It is used by processes of one user only, and the first word of a display is the
//! token of the memory, which it has from the application over a line that was let in.

use std::io::Result;
use std::time::Duration;

use serde::{Deserialize, Serialize};

#[cfg(not(target_os = "linux"))]
pub(super) use self::nowhere::{Bell, Ear, Pipe};
#[cfg(target_os = "linux")]
pub(super) use self::unix::{Bell, Ear, Pipe};

/// What a word is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Word {
    /// A display says who it is: [`Hello`].
    Hello = 1,
    /// Where a frame lies in the application's memory.
    Here = 2,
    /// A frame may be shown.
    Release = 3,
    /// A display has drawn a frame.
    Ready = 4,
}

/// The first word of a display.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Hello {
    /// Of the application's memory.
    pub(super) token: u64,
    pub(super) display: u64,
}

/// Before each message: its length, and what it is.
const HEAD: usize = 3;

/// Appends a word to others; false if it is too long for this line.
pub(super) fn append(bytes: &mut Vec<u8>, word: Word, message: &[u8]) -> bool {
    let Ok(length) = u16::try_from(message.len()) else { return false };
    bytes.extend_from_slice(&length.to_le_bytes());
    bytes.push(word as u8);
    bytes.extend_from_slice(message);
    true
}

/// What came and was not taken yet.
#[derive(Debug, Default)]
pub(super) struct Heard {
    bytes: Vec<u8>,
    taken: usize,
}

impl Heard {
    /// Waits for more. False if the line is closed.
    pub(super) fn more(&mut self, pipe: &Pipe) -> bool {
        self.bytes.drain(..std::mem::take(&mut self.taken));
        pipe.receive(&mut self.bytes).is_ok_and(|count| count > 0)
    }

    /// The next word that is complete; none until more came, and an error for what is no word.
    pub(super) fn next(&mut self) -> Option<std::result::Result<(Word, &[u8]), ()>> {
        let rest = &self.bytes[self.taken..];
        let (head, rest) = rest.split_first_chunk::<HEAD>()?;
        let message = rest.get(..u16::from_le_bytes([head[0], head[1]]) as usize)?;
        self.taken += HEAD + message.len();
        let word = [Word::Hello, Word::Here, Word::Release, Word::Ready].into_iter().find(|word| *word as u8 == head[2]);
        Some(word.map(|word| (word, message)).ok_or(()))
    }
}

#[cfg(target_os = "linux")]
mod unix {
    use std::io::{Error, ErrorKind};
    use std::os::fd::{AsFd, OwnedFd};
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};

    use rustix::buffer::spare_capacity;
    use rustix::event::{EventfdFlags, PollFd, PollFlags, eventfd, poll};
    use rustix::net::{RecvFlags, SendFlags, Shutdown, recv, send, shutdown};

    use super::{Duration, Result};

    /// As much as is taken at once.
    const PIECE: usize = 16 << 10;

    fn name_of(port: u16) -> Result<SocketAddr> {
        SocketAddr::from_abstract_name(format!("umbriel/{port}"))
    }

    /// Others of this machine may take any name.
    fn is_ours(stream: &UnixStream) -> Result<()> {
        let is_ours = rustix::net::sockopt::socket_peercred(stream)?.uid == rustix::process::geteuid();
        if is_ours { Ok(()) } else { Err(Error::new(ErrorKind::PermissionDenied, "it is another user's")) }
    }

    /// Where displays of this machine come.
    #[derive(Debug)]
    pub(in crate::cluster) struct Ear(UnixListener);

    impl Ear {
        pub(in crate::cluster) fn open(port: u16) -> Result<Ear> {
            Ok(Ear(UnixListener::bind_addr(&name_of(port)?)?))
        }

        /// The next that comes; none for who is of another user and is not let in. `InvalidInput` once this is closed.
        pub(in crate::cluster) fn accept(&self) -> Result<Option<Pipe>> {
            let (stream, _) = self.0.accept()?;
            let let_in = is_ours(&stream).inspect_err(|error| tracing::warn!("on the short line: {error}"));
            Ok(let_in.is_ok().then_some(Pipe(stream)))
        }

        /// Waits until somebody comes, or something down one of these lines, or until one is closed. Says whether somebody came, and of
        /// each line whether there is something to be received.
        pub(in crate::cluster) fn wait<'a>(&self, lines: impl Iterator<Item = &'a Pipe>) -> (bool, Vec<bool>) {
            let fds = std::iter::once(self.0.as_fd()).chain(lines.map(|line| line.0.as_fd()));
            let mut all: Vec<PollFd<'_>> = fds.map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)).collect();
            if poll(&mut all, None).is_err() {
                // A signal came; nothing else did.
                return (false, vec![false; all.len() - 1]);
            }
            (!all[0].revents().is_empty(), all[1..].iter().map(|one| !one.revents().is_empty()).collect())
        }

        pub(in crate::cluster) fn close(&self) {
            let _ = shutdown(&self.0, Shutdown::Both);
        }
    }

    /// One end of a line.
    #[derive(Debug)]
    pub(in crate::cluster) struct Pipe(pub(in crate::cluster) UnixStream);

    impl Pipe {
        pub(in crate::cluster) fn connect(port: u16) -> Result<Pipe> {
            let stream = UnixStream::connect_addr(&name_of(port)?)?;
            is_ours(&stream)?;
            Ok(Pipe(stream))
        }

        pub(in crate::cluster) fn try_clone(&self) -> Result<Pipe> {
            Ok(Pipe(self.0.try_clone()?))
        }

        /// Sends at once, or not at all where the other end has not taken what was sent before.
        ///
        /// # Errors
        /// The line is broken.
        pub(in crate::cluster) fn send(&self, words: &[u8]) -> Result<()> {
            match send(&self.0, words, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
                Ok(sent) if sent == words.len() => Ok(()),
                Ok(_) => Err(ErrorKind::WriteZero.into()),
                Err(error) if error == rustix::io::Errno::AGAIN => {
                    tracing::debug!("a display is late to listen");
                    Ok(())
                }
                Err(error) => Err(error.into()),
            }
        }

        /// Appends what comes next; zero at the end.
        pub(in crate::cluster) fn receive(&self, bytes: &mut Vec<u8>) -> Result<usize> {
            bytes.reserve(PIECE);
            Ok(recv(&self.0, spare_capacity(bytes), RecvFlags::empty())?.0)
        }

        pub(in crate::cluster) fn shut(&self) {
            let _ = shutdown(&self.0, Shutdown::Both);
        }
    }

    /// Wakes who waits at a line for something else.
    #[derive(Debug)]
    pub(in crate::cluster) struct Bell(Option<OwnedFd>);

    impl Bell {
        pub(in crate::cluster) fn new() -> Bell {
            Bell(eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC).ok())
        }

        pub(in crate::cluster) fn ring(&self) {
            if let Some(bell) = &self.0 {
                let _ = rustix::io::write(bell, &1u64.to_ne_bytes());
            }
        }

        /// Waits until the bell rings, something comes down the line, or for so long. True if something came.
        pub(in crate::cluster) fn wait(&self, pipe: &Pipe, patience: Duration) -> bool {
            let bell = self.0.as_ref().map_or(pipe.0.as_fd(), AsFd::as_fd);
            let mut both =
                [PollFd::from_borrowed_fd(pipe.0.as_fd(), PollFlags::IN), PollFd::from_borrowed_fd(bell, PollFlags::IN)];
            if poll(&mut both, patience.try_into().ok().as_ref()).is_err() {
                return false;
            }
            if !both[1].revents().is_empty()
                && let Some(bell) = &self.0
            {
                let _ = rustix::io::read(bell, &mut [0; 8]);
            }
            !both[0].revents().is_empty()
        }
    }
}

/// Elsewhere than on Linux there is no such line.
#[cfg(not(target_os = "linux"))]
mod nowhere {
    use super::{Duration, Result};

    #[derive(Debug)]
    pub(in crate::cluster) enum Ear {}

    impl Ear {
        pub(in crate::cluster) fn open(_: u16) -> Result<Ear> {
            Err(std::io::ErrorKind::Unsupported.into())
        }
        pub(in crate::cluster) fn accept(&self) -> Result<Option<Pipe>> {
            match *self {}
        }
        pub(in crate::cluster) fn wait<'a>(&self, _: impl Iterator<Item = &'a Pipe>) -> (bool, Vec<bool>) {
            match *self {}
        }
        pub(in crate::cluster) fn close(&self) {
            match *self {}
        }
    }

    #[derive(Debug)]
    pub(in crate::cluster) enum Pipe {}

    impl Pipe {
        pub(in crate::cluster) fn connect(_: u16) -> Result<Pipe> {
            Err(std::io::ErrorKind::Unsupported.into())
        }
        pub(in crate::cluster) fn try_clone(&self) -> Result<Pipe> {
            match *self {}
        }
        pub(in crate::cluster) fn send(&self, _: &[u8]) -> Result<()> {
            match *self {}
        }
        pub(in crate::cluster) fn receive(&self, _: &mut Vec<u8>) -> Result<usize> {
            match *self {}
        }
        pub(in crate::cluster) fn shut(&self) {
            match *self {}
        }
    }

    #[derive(Debug)]
    pub(in crate::cluster) struct Bell;

    impl Bell {
        pub(in crate::cluster) fn new() -> Bell {
            Bell
        }
        pub(in crate::cluster) fn ring(&self) {}
        pub(in crate::cluster) fn wait(&self, pipe: &Pipe, _: Duration) -> bool {
            match *pipe {}
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// A port of which nobody else takes the name.
    fn port() -> u16 {
        std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
    }

    #[test]
    fn words_come_whole_however_they_are_cut() {
        let ear_port = port();
        let ear = Ear::open(ear_port).unwrap();
        assert!(Ear::open(ear_port).is_err(), "the name is taken");
        let there = Pipe::connect(ear_port).unwrap();
        let here = ear.accept().unwrap().unwrap();
        let long = vec![7; 40_000];
        let words: [(Word, &[u8]); 4] = [(Word::Here, b"abc"), (Word::Release, b""), (Word::Here, &long), (Word::Ready, b"x")];
        let mut bytes = Vec::new();
        assert!(words.iter().all(|(word, message)| append(&mut bytes, *word, message)));
        assert!(!append(&mut bytes, Word::Here, &[0; 70_000]));
        bytes.extend_from_slice(&[0, 0, 99]);
        let mut heard = Heard::default();
        let mut found: Vec<(Word, Vec<u8>)> = Vec::new();
        let mut is_broken = false;
        for piece in bytes.chunks(17_001) {
            there.send(piece).unwrap();
            let mut came = 0;
            while came < piece.len() {
                let before = heard.bytes.len() - heard.taken;
                assert!(heard.more(&here));
                came += heard.bytes.len() - before;
                while let Some(word) = heard.next() {
                    match word {
                        Ok((word, message)) => found.push((word, message.to_vec())),
                        Err(()) => is_broken = true,
                    }
                }
            }
        }
        let expected: Vec<(Word, Vec<u8>)> = words.iter().map(|(word, message)| (*word, message.to_vec())).collect();
        assert!(found == expected && is_broken);
        there.shut();
        assert!(!heard.more(&here));
        ear.close();
        assert_eq!(ear.accept().unwrap_err().kind(), std::io::ErrorKind::InvalidInput);
    }

    #[test]
    fn who_does_not_listen_holds_up_nobody() {
        let ear_port = port();
        let ear = Ear::open(ear_port).unwrap();
        let there = Pipe::connect(ear_port).unwrap();
        let here = ear.accept().unwrap().unwrap();
        (0..100_000).for_each(|_| there.send(&[1; 64]).unwrap());
        drop(here);
        assert!(there.send(&[1; 64]).is_err());
    }

    #[test]
    fn the_bell_wakes_who_waits_at_the_line() {
        let ear_port = port();
        let ear = Ear::open(ear_port).unwrap();
        let there = Pipe::connect(ear_port).unwrap();
        let here = ear.accept().unwrap().unwrap();
        let bell = Bell::new();
        let started = std::time::Instant::now();
        bell.ring();
        assert!(!bell.wait(&here, Duration::from_secs(60)));
        assert!(!bell.wait(&here, Duration::ZERO), "it rang once");
        there.send(b"word").unwrap();
        assert!(bell.wait(&here, Duration::from_secs(60)));
        assert!(started.elapsed() < Duration::from_secs(30));
    }
}
