//! Routes from field to field.

use umbriel_fields::{Evaluator, Mode, Strength};

use super::Words;
use crate::error::{Outcome, fail, hint};
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
    let stage = words.stage.clone();
    words.word(
        "evaluate_when(node: Node, mode: string)",
        "When a node is evaluated: `\"on_change\"`, in frames in which a field was written; `\"always\"`, in every frame; `\"pull\"`, only in frames \
         in which another node depends on it by `depend_for_this_frame`.",
        move |node: Node, mode: &str| evaluate_when(&stage, node, mode),
    );
    let stage = words.stage.clone();
    words.word(
        "depend_for_this_frame(node: Node, on: Node)",
        "In this frame, `node` is evaluated after `on`, though no route leads from the one to the other.",
        move |node: Node, on: Node| {
            stage.may_change()?;
            stage.may_write(node, "", None)?;
            let ordered = stage.write(|graph| graph.depend_for_this_frame(node.0, on.0));
            ordered.map_err(|error| stage.fault_at(node, "", error.to_string()).into()) as Outcome<()>
        },
    );
}

const MODES: [(&str, Mode); 3] = [("on_change", Mode::OnChange), ("always", Mode::Always), ("pull", Mode::Pull)];

fn evaluate_when(stage: &Stage, node: Node, given: &str) -> Outcome<()> {
    stage.may_change()?;
    stage.may_write(node, "", None)?;
    let Some((_, mode)) = MODES.into_iter().find(|(name, _)| *name == given) else {
        let names = MODES.map(|(name, _)| name);
        return fail(format!("a node is evaluated {}; there is no `{given}`{}", names.join(", "), hint(given, names)));
    };
    let is_evaluated = stage.read(|graph| graph.contains(node.0) && !matches!(graph.type_of(node.0).evaluator, Evaluator::None));
    if !is_evaluated {
        return stage.fault_at(node, "", format!("{} has no evaluate of its own", stage.label(node))).throw();
    }
    stage.write(|graph| graph.set_mode(node.0, mode)).map_err(|error| stage.fault_at(node, "", error.to_string()).into())
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
