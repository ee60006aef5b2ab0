//! Nodes of other applications: whose they are, and locks on them.

use std::rc::Rc;

use rhai::{Dynamic, FnPtr, NativeCallContext};

use super::Words;
use crate::error::{Fault, Outcome, fail};
use crate::sharing::Request;
use crate::stage::{Handler, Node, Stage};

pub(super) fn teach(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "keep_local(node: Node)",
        "Keeps a node in this application: displays in other processes, and other applications, learn nothing of it.",
        move |node: Node| -> Outcome<()> {
            stage.may_change()?;
            Ok(stage.write(|graph| graph.set_local(node.0, true)).map_err(|e| Fault::new(e.to_string()))?)
        },
    );
    let stage = words.stage.clone();
    words.word(
        "lock(node: Node)",
        "Asks to be the only application that may write a node. Once it is granted, in one of the next frames, the node may be written \
         until `unlock`.",
        move |node: Node| ask(&stage, Request::Lock(node.0), node),
    );
    let stage = words.stage.clone();
    words.word(
        "lock(node: Node, handler: |granted, why|)",
        "The same, and calls the handler with the answer: true, or false and why not. In a world of one application it is always true.",
        move |context: NativeCallContext<'_>, node: Node, call: FnPtr| -> Outcome<()> {
            ask(&stage, Request::Lock(node.0), node)?;
            if stage.awaited.borrow().len() >= stage.limits.handlers {
                return fail(format!("{} locks are asked for already, and more are not allowed", stage.limits.handlers));
            }
            stage.awaited.borrow_mut().push((node, Handler { call, place: context.call_position() }));
            Ok(())
        },
    );
    let stage = words.stage.clone();
    words.word("unlock(node: Node)", "Gives a lock back.", move |node: Node| ask(&stage, Request::Unlock(node.0), node));
    let stage = words.stage.clone();
    words.word(
        "owner(node: Node) -> string",
        "The application that a node belongs to; `()` if it is this one.",
        move |node: &mut Node| of(&stage, |sharing| sharing.owners.get(&node.0).cloned()),
    );
    let stage = words.stage.clone();
    words.word(
        "locked_by(node: Node) -> string",
        "The application that holds a lock on a node, this one included; `()` if none does.",
        move |node: &mut Node| of(&stage, |sharing| sharing.locks.get(&node.0).cloned()),
    );
    let stage = words.stage.clone();
    words.word(
        "on_leave(what: string)",
        "What becomes of this application's nodes when it ends: `\"keep\"` gives them to the application that evaluates the world, \
         `\"remove\"` takes them out, which is what happens if nothing is said.",
        move |what: &str| -> Outcome<()> {
            stage.may_change()?;
            let keeps = match what {
                "keep" => true,
                "remove" => false,
                _ => return fail(format!("on_leave takes \"keep\" or \"remove\", not \"{what}\"")),
            };
            if let Some(sharing) = stage.sharing.borrow_mut().as_mut() {
                sharing.requests.push(Request::Keeps(keeps));
            }
            Ok(())
        },
    );
}

fn ask(stage: &Rc<Stage>, request: Request, node: Node) -> Outcome<()> {
    stage.may_change()?;
    if !stage.read(|graph| graph.contains(node.0)) {
        return fail(format!("{} cannot be locked: it is gone", stage.label(node)));
    }
    if let Some(sharing) = stage.sharing.borrow_mut().as_mut() {
        if request == Request::Unlock(node.0) && sharing.locks.get(&node.0) == Some(&sharing.me) {
            // What is written later in this frame comes too late.
            sharing.locks.remove(&node.0);
        }
        sharing.requests.push(request);
    }
    Ok(())
}

fn of(stage: &Rc<Stage>, name: impl FnOnce(&crate::sharing::Sharing) -> Option<std::sync::Arc<str>>) -> Dynamic {
    let name = stage.sharing.borrow().as_ref().and_then(name);
    name.map_or(Dynamic::UNIT, |name| name.to_string().into())
}
