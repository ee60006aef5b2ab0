//! Routes from field to field.

use umbriel_fields::Strength;

use super::Words;
use crate::error::{Outcome, fail};
use crate::stage::{Node, Stage};

pub(super) fn teach(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "route(from: Node, field: string, to: Node, field: string)",
        "What is written into the first field goes on into the second, in the same frame.",
        move |from: Node, out: &str, to: Node, into: &str| route(&stage, (from, out), (to, into), Strength::Strong),
    );
    let stage = words.stage.clone();
    words.word(
        "weak_route(from: Node, field: string, to: Node, field: string)",
        "A route that does not order evaluation, so that a loop can be closed: the value may arrive a frame later.",
        move |from: Node, out: &str, to: Node, into: &str| route(&stage, (from, out), (to, into), Strength::Weak),
    );
    let stage = words.stage.clone();
    words.word(
        "unroute(from: Node, field: string, to: Node, field: string)",
        "Ends a route.",
        move |from: Node, out: &str, to: Node, into: &str| unroute(&stage, (from, out), (to, into)),
    );
}

fn route(stage: &Stage, from: (Node, &str), to: (Node, &str), strength: Strength) -> Outcome<()> {
    let (out, into) = (stage.field(from.0, from.1)?, stage.field(to.0, to.1)?);
    stage.may_write(to.0, to.1, None)?;
    let made = stage.write(|graph| graph.connect(out, into, strength));
    made.map(drop).map_err(|e| stage.fault_at(to.0, to.1, e.to_string()).into())
}

fn unroute(stage: &Stage, from: (Node, &str), to: (Node, &str)) -> Outcome<()> {
    let (out, into) = (stage.field(from.0, from.1)?, stage.field(to.0, to.1)?);
    stage.may_write(to.0, to.1, None)?;
    match stage.read(|graph| graph.route_between(out, into)) {
        Some(route) => {
            stage.write(|graph| graph.disconnect(route));
            Ok(())
        }
        None => {
            let (from_label, to_label) = (stage.label(from.0), stage.label(to.0));
            fail(format!("there is no route from `{}` of {from_label} to `{}` of {to_label}", from.1, to.1))
        }
    }
}
