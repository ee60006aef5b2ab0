//! Connections that the network library refuses, told to the operator in words.

use std::fmt::Debug;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

/// What zenoh appends to whatever goes wrong while a connection is accepted.
const HINT: &str = ". Hint: increase the system open file limit.";

/// Hears of refused connections and logs them anew.
pub(crate) struct Refusals;

impl Refusals {
    /// Where the network library reports them.
    pub(crate) const TARGET: &str = "zenoh_link_tls";
}

impl<S: Subscriber> Layer<S> for Refusals {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let is_theirs = event.metadata().target().starts_with(Refusals::TARGET) && *event.metadata().level() == Level::WARN;
        let mut text = Text(String::new());
        if is_theirs {
            event.record(&mut text);
        }
        if let Some(reason) = text.0.strip_suffix(HINT) {
            tracing::warn!("a connection was refused: {}", in_words(reason));
        }
    }
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
