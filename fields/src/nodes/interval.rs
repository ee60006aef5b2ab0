//! From one interval to another.

use crate::{Evaluation, Field, NodeType};

const SET_VALUE: u16 = 0;
const FROM_MIN: u16 = 1;
const FROM_MAX: u16 = 2;
const TO_MIN: u16 = 3;
const TO_MAX: u16 = 4;
const CLAMP: u16 = 5;
const VALUE_CHANGED: u16 = 6;

pub(super) fn interval_map() -> NodeType {
    NodeType::new("IntervalMap", "Maps numbers of one interval to another, such as degrees of a lever to 0 to 1.")
        .field(Field::new("set_value", 0.0f64).doc("The number to map."))
        .field(Field::new("from_min", 0.0f64).doc("What becomes `to_min`."))
        .field(Field::new("from_max", 1.0f64).doc("What becomes `to_max`; may be less than `from_min`."))
        .field(Field::new("to_min", 0.0f64).doc("What `from_min` becomes."))
        .field(Field::new("to_max", 1.0f64).doc("What `from_max` becomes."))
        .field(Field::new("clamp", true).doc("Stay inside of the target interval."))
        .field(Field::new("value_changed", 0.0f64).output().doc("The mapped number."))
        .evaluate(evaluate)
}

fn evaluate(evaluation: &mut Evaluation<'_>) {
    let [value, from_min, from_max, to_min, to_max] =
        [SET_VALUE, FROM_MIN, FROM_MAX, TO_MIN, TO_MAX].map(|index| evaluation.get::<f64>(index));
    let length = from_max - from_min;
    let fault = if length == 0.0 || !length.is_finite() {
        Some((FROM_MAX, format!("cannot map from an interval between {from_min} and {from_max}")))
    } else if !to_min.is_finite() || !to_max.is_finite() {
        Some((TO_MAX, format!("cannot map to an interval between {to_min} and {to_max}")))
    } else {
        None
    };
    if let Some((field, fault)) = fault {
        if (FROM_MIN..=TO_MAX).any(|field| evaluation.changed(field)) {
            evaluation.report_field(field, fault);
        }
        return;
    }
    let share = (value - from_min) / length;
    let share = if evaluation.get(CLAMP) { share.clamp(0.0, 1.0) } else { share };
    evaluation.set(VALUE_CHANGED, to_min * (1.0 - share) + to_max * share);
}
