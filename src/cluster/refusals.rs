//! Connections and requests that the network library refuses, told to the operator in words, with whom they were from.

use super::strangers::strangers;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;
use umbriel_displays::cluster::{Quiet, Words, number_of_process};

/// What zenoh appends to whatever goes wrong while a connection is accepted.
const HINT: &str = ". Hint: increase the system open file limit.";

/// Where the network library tells of lines that are made and closed.
const MADE: &str = "zenoh_transport::unicast::establishment::accept";
const CLOSED: &str = "zenoh_transport::unicast::universal::transport";
/// Words that wait for a line to be told of are no more than so many.
const MOST_WAITING: usize = 64;

/// Hears of lines, and of refused connections and requests, and logs these anew.
#[derive(Default)]
pub(crate) struct Refusals {
    heard: Mutex<Heard>,
}

#[derive(Default)]
struct Heard {
    quiet: Quiet,
    /// Addresses of other ends, by the names of their sessions.
    lines: BTreeMap<String, SocketAddr>,
    /// What was refused to a session whose line is not told of yet: that comes a moment later.
    waiting: Vec<(String, Denied)>,
}

/// Where lines to this process lead, by the numbers of the processes at their other ends.
pub(super) fn lines() -> BTreeMap<u64, SocketAddr> {
    tracing::dispatcher::get_default(|dispatch| {
        let Some(refusals) = dispatch.downcast_ref::<Refusals>() else { return BTreeMap::new() };
        let numbered = |(session, address): (&String, &SocketAddr)| Some((number_of_process(session)?, *address));
        refusals.enter().lines.iter().filter_map(numbered).collect()
    })
}

impl Refusals {
    /// Where the network library reports them, and how loudly.
    pub(crate) const TARGETS: [(&str, Level); 4] = [
        ("zenoh_link_tls", Level::WARN),
        ("zenoh::net::routing::interceptor::access_control", Level::TRACE),
        (MADE, Level::DEBUG),
        (CLOSED, Level::DEBUG),
    ];

    fn enter(&self) -> MutexGuard<'_, Heard> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Logs what is news of these words.
    fn tell(&self, words: impl IntoIterator<Item = String>) {
        for text in words {
            // Not while the lock is held: what is logged comes by here.
            let news = self.enter().quiet.news(Words::Warn(text));
            news.into_iter().for_each(Words::say);
        }
    }
}

impl Heard {
    /// A line was made; gives what was refused at its other end before.
    fn made(&mut self, session: String, address: SocketAddr) -> Vec<String> {
        let now = self.waiting.extract_if(.., |(waiting, _)| *waiting == session).collect::<Vec<_>>();
        self.lines.insert(session, address);
        now.into_iter().map(|(_, denied)| denied.in_words(address)).collect()
    }

    /// Something is refused to a session: what is to be said, if it is known where that is.
    fn denied(&mut self, session: String, denied: Denied) -> Option<String> {
        let address = self.lines.get(&session).copied();
        if address.is_none() && self.waiting.len() < MOST_WAITING && !self.waiting.contains(&(session.clone(), denied.clone())) {
            self.waiting.push((session, denied.clone()));
        }
        address.map(|address| denied.in_words(address))
    }

    fn closed(&mut self, session: &str) {
        self.lines.remove(session);
        self.waiting.retain(|(waiting, _)| waiting != session);
    }
}

impl<S: Subscriber> Layer<S> for Refusals {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let is_theirs = Refusals::TARGETS.iter().any(|(target, _)| event.metadata().target().starts_with(target));
        let mut text = Text(String::new());
        if is_theirs {
            event.record(&mut text);
        }
        let text = text.0.as_str();
        match event.metadata().target() {
            MADE => {
                if let Some((session, address)) = line_made(text) {
                    let words = self.enter().made(session.into(), address);
                    self.tell(words);
                }
            }
            CLOSED => line_closed(text).into_iter().for_each(|session| self.enter().closed(session)),
            _ => {
                if let Some(reason) = text.strip_suffix(HINT) {
                    self.tell([refusal(reason, &strangers().into_iter().collect::<Vec<_>>())]);
                } else if let Some((session, denied)) = denied(text) {
                    let words = self.enter().denied(session.into(), denied);
                    self.tell(words);
                }
            }
        }
    }
}

/// A refused connection, with whom it was from if that is known.
fn refusal(reason: &str, from: &[IpAddr]) -> String {
    let from: Vec<String> = from.iter().map(ToString::to_string).collect();
    let from = if from.is_empty() { String::new() } else { format!(" from {}", from.join(" or ")) };
    format!("a connection{from} was refused: {}", in_words(reason))
}

/// What is refused to who is connected.
#[derive(Clone, Debug, PartialEq)]
enum Denied {
    /// Everything: its certificate is of no part.
    All,
    /// A kind of message on a subject.
    Message(String, String),
}

impl Denied {
    fn in_words(&self, address: SocketAddr) -> String {
        match self {
            Denied::All => {
                format!("a peer at {address} may do nothing here: its certificate is neither of a `display` nor of a `guest`")
            }
            Denied::Message(kind, subject) => {
                let wants = if subject.starts_with("umbriel/guest") { "work on the world" } else { "do what is not its part" };
                format!(
                    "a peer at {address} wants to {wants}, which its certificate is not for, and is refused ({kind}, {subject})"
                )
            }
        }
    }
}

/// What access control says of messages that it does not let in: the session, and what.
fn denied(text: &str) -> Option<(&str, Denied)> {
    if let Some((session, _)) = text.split_once(" did not match any configured ACL subject") {
        return Some((session, Denied::All));
    }
    // Without these words it is a rule that is looked up beforehand, and nobody has asked for anything.
    let (session, what) = text.strip_prefix("Using cached result: ")?.split_once(" is unauthorized to ")?;
    let (kind, subject) = what.split_once(" (ingress) on ")?;
    Some((session, Denied::Message(kind.to_lowercase(), subject.into())))
}

/// The session at the other end of a line that was made to this process, and its address.
fn line_made(text: &str) -> Option<(&str, SocketAddr)> {
    let (session, line) = text.strip_prefix("New transport link accepted from ")?.split_once(" to ")?;
    let (_, there) = line.split_once(" dst: ")?;
    let (_, address) = there.split_once('/')?;
    Some((session, address.split_once(',')?.0.parse().ok()?))
}

/// The session at the other end of a line that is closed.
fn line_closed(text: &str) -> Option<&str> {
    text.split_once("Closing transport with peer: ").map(|(_, session)| session)
}

struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

/// What TLS says, as an operator would.
fn in_words(reason: &str) -> String {
    let rows = [
        ("peer sent no certificates", "it shows no certificate"),
        ("UnknownIssuer", "its certificate is of another authority"),
        ("BadSignature", "its certificate is of another authority"),
        ("UnknownCA", "it does not know the authority of our certificate"),
        // Authorities that we made have one name; what tells them apart is the signature.
        ("DecryptError", "it does not know the authority of our certificate"),
        ("InvalidContentType", "it does not speak TLS"),
        ("expired", "its certificate is out of date"),
        ("not valid yet", "its certificate is not valid yet"),
        ("eof", "it hung up during the handshake"),
    ];
    rows.iter().find(|(known, _)| reason.contains(known)).map_or_else(|| reason.to_string(), |(_, words)| words.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_access_control_says() {
        let rows = [
            (
                "Using cached result: a1b2 is unauthorized to Query (ingress) on umbriel/guests/snapshot",
                Some(
                    "a peer at 10.0.0.7:4 wants to work on the world, which its certificate is not for, and is refused (query, umbriel/guests/snapshot)",
                ),
            ),
            (
                "Using cached result: a1b2 is unauthorized to Put (ingress) on umbriel/ready",
                Some("do what is not its part, which its certificate is not for, and is refused (put, umbriel/ready)"),
            ),
            ("a1b2 did not match any configured ACL subject. Default permission `Deny`", Some("neither of a `display` nor")),
            ("a1b2 on lo+display is unauthorized to Put (ingress) on umbriel/guests/deeds", None),
            ("Using cached result: a1b2 is authorized to Put (ingress) on umbriel/ready", None),
        ];
        for (text, expected) in rows {
            let found = denied(text);
            assert!(
                found.is_none() == expected.is_none() && found.as_ref().is_none_or(|(session, _)| *session == "a1b2"),
                "{text}"
            );
            let words = found.map(|(_, denied)| denied.in_words("10.0.0.7:4".parse().unwrap())).unwrap_or_default();
            assert!(words.contains(expected.unwrap_or_default()), "{text}");
        }
    }

    #[test]
    fn who_is_refused_is_named_once_its_line_is_told_of() {
        let made = "New transport link accepted from a1b2 to c3: TransportLinkUnicast { link: Link { src: tls/10.0.0.1:7447, \
                    dst: tls/10.0.0.7:40112, mtu: 49152 } } ";
        let (session, address) = line_made(made).unwrap();
        assert_eq!((session, address.to_string()), ("a1b2", "10.0.0.7:40112".to_string()));
        let made_6 = made.replace("10.0.0.7", "[fe80::7%2]").replace("%2", "");
        assert_eq!(line_made(&made_6).unwrap().1.to_string(), "[fe80::7]:40112");
        assert_eq!(line_made("New transport link accepted from nowhere"), None);
        let mut heard = Heard::default();
        assert_eq!(heard.denied("a1b2".into(), Denied::All), None);
        assert_eq!(heard.denied("a1b2".into(), Denied::All), None);
        assert_eq!(heard.made("other".into(), address), Vec::<String>::new());
        assert_eq!(heard.made(session.into(), address), [Denied::All.in_words(address)]);
        assert!(heard.denied("a1b2".into(), Denied::All).is_some());
        heard.closed(line_closed("[c3] Closing transport with peer: a1b2").unwrap());
        assert_eq!((heard.lines.len(), heard.denied("a1b2".into(), Denied::All)), (1, None));
    }
}
