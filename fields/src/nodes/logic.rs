//! Arithmetic and logic of any number of inputs: two are declared, and every field that is added to the node is another.

use crate::{Field, FieldValue, NodeType};

const VALUE: u16 = 2;

pub(super) fn types() -> Vec<NodeType> {
    vec![
        fold("Sum", "The sum of all inputs.", |a: f64, b| a + b),
        fold("Min", "The smallest of all inputs.", f64::min),
        fold("Max", "The largest of all inputs.", f64::max),
        fold("And", "True if all inputs are.", |a, b| a && b),
        fold("Or", "True if any input is.", |a, b| a || b),
        fold("Xor", "True if an odd number of inputs is.", |a: bool, b| a != b),
        not(),
    ]
}

fn fold<T: FieldValue>(name: &str, doc: &str, join: impl Fn(T, T) -> T + Send + Sync + 'static) -> NodeType {
    NodeType::new(name, format!("{doc} Add fields to the node for more than two inputs."))
        .field(Field::new("a", T::empty()).doc("An input."))
        .field(Field::new("b", T::empty()).doc("An input."))
        .field(Field::new("value", T::empty()).output().doc("The result."))
        .evaluate(move |evaluation| {
            let mut result = join(evaluation.get(0), evaluation.get(1));
            for added in VALUE + 1..evaluation.places() {
                if evaluation.has(added) {
                    result = join(result, evaluation.get(added));
                }
            }
            evaluation.set(VALUE, result);
        })
}

fn not() -> NodeType {
    NodeType::new("Not", "The opposite of its input.")
        .field(Field::new("a", false).doc("The input."))
        .field(Field::new("value", true).output().doc("The opposite."))
        .evaluate(|evaluation| {
            let value = !evaluation.get::<bool>(0);
            evaluation.set(1, value);
        })
}
