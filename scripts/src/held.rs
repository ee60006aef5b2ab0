//! What all handlers of a world hold together is bounded: the meter beside a running script sees only what that one can reach.

use std::time::Instant;

use rhai::FnPtr;

use crate::engine::report;
use crate::error::Fault;
use crate::stage::{Handler, Stage};
use crate::weigh::weight;

/// Whose handler it is.
#[derive(Clone)]
enum Owner {
    /// An `on_frame` or `on_change`, by its number.
    Numbered(u64),
    /// `evaluate` of a node type.
    Evaluate(String),
    /// A handler of a field of a node type.
    Changed(String, usize),
}

/// Switches off the handler that holds most while all together hold too much.
pub(crate) fn bound(stage: &Stage) {
    if !stage.meter.handlers_are_due() {
        return;
    }
    let start = Instant::now();
    if total(stage) > stage.held_limit.get()
        && let Some((owner, handler)) = heaviest(stage)
    {
        let megabytes = stage.limits.memory >> 20;
        let message = format!("all handlers together hold more than {megabytes} MB; this one, which holds most, is switched off");
        report(stage, Fault::new(message), handler.place);
        switch_off(stage, &owner);
        drop(handler);
        // Variables of the main script keep what closures gathered in them. From there on it must not grow.
        stage.held_limit.set(stage.limits.memory.max(total(stage)));
    }
    stage.meter.handlers_weighed(start.elapsed());
}

fn each(stage: &Stage, look: &mut dyn FnMut(Owner, &Handler)) {
    stage.on_frame.borrow().iter().for_each(|(id, handler)| look(Owner::Numbered(*id), handler));
    stage.on_change.borrow().iter().for_each(|(id, change)| look(Owner::Numbered(*id), &change.handler));
    for (name, definition) in &*stage.definitions.borrow() {
        definition.evaluate.iter().for_each(|handler| look(Owner::Evaluate(name.clone()), handler));
        let changed = definition.changed.iter().enumerate();
        changed.for_each(|(place, (_, handler))| look(Owner::Changed(name.clone(), place), handler));
    }
}

fn total(stage: &Stage) -> usize {
    let mut functions: Vec<FnPtr> = Vec::new();
    each(stage, &mut |_, handler| functions.push(handler.call.clone()));
    weight(functions.iter().flat_map(FnPtr::iter_curry))
}

fn heaviest(stage: &Stage) -> Option<(Owner, Handler)> {
    let mut found: Option<(usize, Owner, Handler)> = None;
    each(stage, &mut |owner, handler| {
        let held = weight(handler.call.iter_curry());
        if found.as_ref().is_none_or(|(most, ..)| held > *most) {
            found = Some((held, owner, handler.clone()));
        }
    });
    found.map(|(_, owner, handler)| (owner, handler))
}

fn switch_off(stage: &Stage, owner: &Owner) {
    match owner {
        // Observers of the graph that find no handler any more do nothing.
        Owner::Numbered(id) => {
            stage.on_frame.borrow_mut().remove(id);
            stage.on_change.borrow_mut().remove(id);
        }
        Owner::Evaluate(name) => {
            if let Some(definition) = stage.definitions.borrow_mut().get_mut(name) {
                definition.evaluate = None;
            }
        }
        Owner::Changed(name, place) => {
            if let Some(definition) = stage.definitions.borrow_mut().get_mut(name) {
                definition.changed.remove(*place);
            }
        }
    }
}
