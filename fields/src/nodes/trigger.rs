//! Triggers: one kind of event becomes another (X3D 4 section 30). Events are fields that pulse: being written is the message.

use crate::{Field, NodeType, SetRule, Time, Value};

fn event(name: &str, default: impl Into<Value>, doc: &str) -> Field {
    Field::new(name, default).on_set(SetRule::Pulse).doc(doc)
}

pub(super) fn types() -> Vec<NodeType> {
    vec![boolean_filter(), boolean_trigger(), boolean_toggle(), integer_trigger(), time_trigger(), edge_trigger()]
}

fn boolean_filter() -> NodeType {
    NodeType::new("BooleanFilter", "Tells true and false apart.")
        .field(event("set_boolean", false, "The event."))
        .field(event("input_true", false, "True, written for each true.").output())
        .field(event("input_false", false, "False, written for each false.").output())
        .field(event("input_negate", true, "The opposite, written for each event.").output())
        .evaluate(|evaluation| {
            if evaluation.changed(0) {
                let event: bool = evaluation.get(0);
                evaluation.set(if event { 1 } else { 2 }, event);
                evaluation.set(3, !event);
            }
        })
}

fn boolean_trigger() -> NodeType {
    NodeType::new("BooleanTrigger", "A time becomes a true.")
        .field(event("set_trigger_time", Time(0.0), "The event.").unit("s"))
        .field(event("trigger_true", false, "True, written for each event.").output())
        .evaluate(|evaluation| {
            if evaluation.changed(0) {
                evaluation.set(1, true);
            }
        })
}

fn boolean_toggle() -> NodeType {
    NodeType::new("BooleanToggle", "Every true turns `toggle` over.")
        .field(event("set_boolean", false, "The event; false does nothing."))
        .field(Field::new("toggle", false).doc("The state; may be set."))
        .evaluate(|evaluation| {
            if evaluation.changed(0) && evaluation.get::<bool>(0) {
                let toggle = !evaluation.get::<bool>(1);
                evaluation.set(1, toggle);
            }
        })
}

fn integer_trigger() -> NodeType {
    NodeType::new("IntegerTrigger", "A true becomes a number, such as a choice of a Switch.")
        .field(event("set_boolean", false, "The event; false does nothing."))
        .field(Field::new("integer_key", -1i32).doc("The number."))
        .field(event("trigger_value", 0i32, "The number, written for each event.").output())
        .evaluate(|evaluation| {
            if evaluation.changed(0) && evaluation.get::<bool>(0) {
                let key: i32 = evaluation.get(1);
                evaluation.set(2, key);
            }
        })
}

fn time_trigger() -> NodeType {
    NodeType::new("TimeTrigger", "Any write of a bool becomes the time of the frame.")
        .field(event("set_boolean", false, "The event, true or false."))
        .field(event("trigger_time", Time(0.0), "When the last event was.").unit("s").output())
        .evaluate(|evaluation| {
            if evaluation.changed(0) {
                let now = evaluation.time();
                evaluation.set(1, Time(now));
            }
        })
}

fn edge_trigger() -> NodeType {
    NodeType::new("EdgeTrigger", "Tells when a bool becomes true and when it becomes false, once for each change.")
        .field(Field::new("set_boolean", false).doc("What is watched."))
        .field(event("rising", false, "True, written when the bool became true.").output())
        .field(event("falling", false, "True, written when the bool became false.").output())
        .field(Field::new("rising_time", Time(0.0)).unit("s").output().doc("When it last became true."))
        .field(Field::new("falling_time", Time(0.0)).unit("s").output().doc("When it last became false."))
        .field(Field::new("state", false).output().doc("What it was in the last frame."))
        .evaluate(|evaluation| {
            let state: bool = evaluation.get(0);
            if state == evaluation.get::<bool>(5) {
                return;
            }
            let now = Time(evaluation.time());
            let (edge, when) = if state { (1, 3) } else { (2, 4) };
            evaluation.set(edge, true);
            evaluation.set(when, now);
            evaluation.set(5, state);
        })
}
