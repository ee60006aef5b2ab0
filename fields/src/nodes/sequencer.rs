//! Sequencers: a value that jumps from key to key (X3D 4 section 30).

use std::sync::Arc;

use super::keys::{fault, span};
use crate::{Field, FieldValue, NodeType, SetRule};

const SET_FRACTION: u16 = 0;
const KEY: u16 = 1;
const KEY_VALUE: u16 = 2;
const VALUE_CHANGED: u16 = 3;

pub(super) fn types() -> Vec<NodeType> {
    vec![
        sequencer::<bool>("BooleanSequencer", "Truth that changes at keys."),
        sequencer::<i32>("IntegerSequencer", "A number, such as a choice, that changes at keys."),
    ]
}

fn sequencer<T: FieldValue + Copy>(name: &str, doc: &str) -> NodeType
where
    Arc<[T]>: FieldValue,
{
    NodeType::new(name, doc)
        .field(Field::new("set_fraction", 0.0f32).on_set(SetRule::Pulse).doc("Where between the keys."))
        .field(Field::many::<f32>("key").doc("Fractions or seconds, ascending."))
        .field(Field::many::<T>("key_value").doc("The value from each key on."))
        .field(Field::new("value_changed", T::empty()).output().doc("The value of the last key that was passed."))
        .evaluate(|evaluation| {
            let keys: Arc<[f32]> = evaluation.get(KEY);
            let values: Arc<[T]> = evaluation.get(KEY_VALUE);
            let new_keys = evaluation.changed(KEY) || evaluation.changed(KEY_VALUE);
            if let Some(fault) = fault(&keys, values.len(), Some(1), 1) {
                if new_keys {
                    evaluation.report_field(KEY, fault);
                }
                return;
            }
            if !evaluation.written(SET_FRACTION) || !(new_keys || evaluation.changed(SET_FRACTION)) {
                return;
            }
            if let Some(span) = span(&keys, evaluation.get(SET_FRACTION)) {
                evaluation.set(VALUE_CHANGED, values[span.from]);
            }
        })
}
