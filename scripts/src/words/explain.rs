//! Why fields hold what they hold, what nodes cost, and the graph as a picture.

use std::rc::Rc;

use rhai::{Array, Dynamic, Map};

use super::Words;
use crate::error::Outcome;
use crate::stage::{Node, Stage};

pub(super) fn teach(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "explain(on: bool)",
        "From now on, or no longer, the world notes why its fields are written; that makes each write slower.",
        move |on: bool| -> Outcome<()> {
            stage.may_change()?;
            stage.write(|graph| graph.explain(on));
            Ok(())
        },
    );
    let stage = words.stage.clone();
    words.word(
        "why(node: Node, field: string) -> array",
        "Lines that say why a field holds what it holds: its last write, and what that came from, back to the roots, with frame, value \
         and place in the script. Begins to note it if nobody asked before.",
        move |node: Node, field: &str| why(&stage, node, field),
    );
    let stage = words.stage.clone();
    words.word(
        "costs() -> array",
        "How often nodes were evaluated, as maps with `node` and `evaluations`; at the console, while the world explains itself, with \
         `seconds` too. The most expensive come first.",
        move || -> Outcome<Array> { costs(&stage) },
    );
    let stage = words.stage.clone();
    words.word("dot() -> string", "All nodes and routes in the language of Graphviz.", move || -> Outcome<String> {
        stage.may_change()?;
        Ok(stage.read(umbriel_fields::Graph::dot))
    });
}

fn why(stage: &Rc<Stage>, node: Node, field: &str) -> Outcome<Array> {
    let field = stage.field(node, field)?;
    stage.write(|graph| graph.explain(true));
    Ok(stage.read(|graph| graph.why(field)).iter().map(|cause| cause.to_string().into()).collect())
}

/// Times differ from run to run, and worlds do not: only the console sees them.
fn costs(stage: &Rc<Stage>) -> Outcome<Array> {
    stage.may_change()?;
    let mut costs = stage.read(umbriel_fields::Graph::costs);
    let timed = stage.at_console.get();
    if !timed {
        costs.sort_by(|a, b| (b.evaluations, a.node).cmp(&(a.evaluations, b.node)));
    }
    let entry = |cost: umbriel_fields::Cost| {
        let mut map = Map::from([
            ("node".into(), Dynamic::from(Node(cost.node))),
            ("evaluations".into(), i64::from(cost.evaluations).into()),
        ]);
        if timed {
            map.insert("seconds".into(), cost.time.as_secs_f64().into());
        }
        map.into()
    };
    Ok(costs.into_iter().map(entry).collect())
}
