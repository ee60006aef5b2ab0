//! Functions that the world calls: in each frame, and when a field changed.

use rhai::{FnPtr, NativeCallContext};

use super::Words;
use crate::error::Outcome;
use crate::stage::{Handler, Node};

/// What `on_frame` and `on_change` return.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Watch(u64);

pub(super) fn teach(words: &mut Words<'_>) {
    words.engine.register_type_with_name::<Watch>("Handler");
    let stage = words.stage.clone();
    words.word(
        "on_frame(handler: |time, dt|) -> Handler",
        "Calls the handler in each frame, before routes and nodes are evaluated, with the time and what passed since the last frame, in seconds.",
        move |context: NativeCallContext<'_>, call: FnPtr| -> Outcome<Watch> {
            let id = stage.handler_id()?;
            stage.on_frame.borrow_mut().insert(id, Handler { call, place: context.call_position() });
            Ok(Watch(id))
        },
    );
    let stage = words.stage.clone();
    words.word(
        "on_change(node: Node, field: string, handler: |value|) -> Handler",
        "Calls the handler in each frame in which the field was written, with its new value.",
        move |context: NativeCallContext<'_>, node: Node, field: &str, call: FnPtr| -> Outcome<Watch> {
            stage.observe(node, field, Handler { call, place: context.call_position() }, None).map(Watch)
        },
    );
    let stage = words.stage.clone();
    words.word("stop(handler: Handler)", "Ends a handler; it may end itself: `watch.stop()`.", move |handler: Watch| {
        stage.stop(handler.0);
    });
    let stage = words.stage.clone();
    words.word("time() -> number", "Seconds since the world began, the same during a whole frame.", move || stage.time_s.get());
    words.form("to_string", |_: &mut Watch| "Handler");
    words.form("to_debug", |_: &mut Watch| "Handler");
}
