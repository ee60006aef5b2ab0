//! Connections that the network library refuses, told to the operator in words.

use super::strangers::strangers;
use std::fmt::Debug;
use std::net::IpAddr;
use std::sync::Mutex;
use std::time::{Duration, Instant};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

/// What zenoh appends to whatever goes wrong while a connection is accepted.
const HINT: &str = ". Hint: increase the system open file limit.";

/// How long the same refusal is not told again.
const QUIET: Duration = Duration::from_secs(10);

/// Hears of refused connections and requests, and logs them anew.
#[derive(Default)]
pub(crate) struct Refusals {
    told: Mutex<Vec<(String, Instant)>>,
}

impl Refusals {
    /// Where the network library reports them, and how loudly.
    pub(crate) const TARGETS: [(&str, Level); 2] =
        [("zenoh_link_tls", Level::WARN), ("zenoh::net::routing::interceptor::access_control", Level::TRACE)];

    fn tell(&self, text: String) {
        let Ok(mut told) = self.told.lock() else { return };
        told.retain(|(_, when)| when.elapsed() < QUIET);
        if !told.iter().any(|(known, _)| *known == text) {
            tracing::warn!("{text}");
            told.push((text, Instant::now()));
        }
    }
}

impl<S: Subscriber> Layer<S> for Refusals {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let is_theirs = Refusals::TARGETS.iter().any(|(target, _)| event.metadata().target().starts_with(target));
        let mut text = Text(String::new());
        if is_theirs {
            event.record(&mut text);
        }
        if let Some(reason) = text.0.strip_suffix(HINT) {
            self.tell(refusal(reason, &strangers().into_iter().collect::<Vec<_>>()));
        } else if let Some(text) = denied(&text.0) {
            self.tell(text);
        }
    }
}

/// A refused connection, with whom it was from if that is known.
fn refusal(reason: &str, from: &[IpAddr]) -> String {
    let from: Vec<String> = from.iter().map(ToString::to_string).collect();
    let from = if from.is_empty() { String::new() } else { format!(" from {}", from.join(" or ")) };
    format!("a connection{from} was refused: {}", in_words(reason))
}

/// What access control says of messages that it does not let in.
fn denied(text: &str) -> Option<String> {
    if text.contains("did not match any configured ACL subject") {
        return Some("a peer may do nothing here: its certificate is neither of a `display` nor of a `guest`".into());
    }
    // Without these words it is a rule that is looked up beforehand, and nobody has asked for anything.
    let (_, what) = text.strip_prefix("Using cached result: ")?.split_once(" is unauthorized to ")?;
    let (kind, subject) = what.split_once(" (ingress) on ")?;
    let wants = if subject.starts_with("umbriel/guest") { "work on the world" } else { "do what is not its part" };
    let kind = kind.to_lowercase();
    Some(format!("a peer wants to {wants}, which its certificate is not for, and is refused ({kind}, {subject})"))
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
                Some("work on the world, which its certificate is not for, and is refused (query, umbriel/guests/snapshot)"),
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
            assert_eq!(found.is_some(), expected.is_some(), "{text}");
            assert!(found.unwrap_or_default().contains(expected.unwrap_or_default()), "{text}");
        }
    }
}
