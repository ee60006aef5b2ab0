//! The node types at work: rows of what goes in in each frame and what comes out.

mod clock;
mod events;
mod followers;
mod interpolators;

use crate::nodes::builtin_types;
use crate::{Graph, NoHost, NodeId, Same, TypeRegistry, Value};

/// One frame: its time, what is written before it, what a field holds after it.
type Frame<'a> = (f64, Vec<(&'a str, Value)>, (&'a str, Value));

fn graph_of(node_type: &str) -> (Graph, NodeId) {
    let mut graph = Graph::new(builtin_types());
    let node = graph.create(node_type).unwrap();
    (graph, node)
}

fn check(node_type: &str, frames: Vec<Frame<'_>>) {
    let (mut graph, node) = graph_of(node_type);
    for (number, (time, writes, (field, expected))) in frames.into_iter().enumerate() {
        for (name, value) in writes {
            graph.set_named(node, name, value).unwrap();
        }
        let report = graph.evaluate(time, &mut NoHost);
        assert_eq!(report.problems, [], "{node_type}, frame {number}");
        let found = graph.value_named(node, field).unwrap();
        assert!(near(&found, &expected), "{node_type}.{field}, frame {number}: {found:?} instead of {expected:?}");
    }
}

/// Equal but for rounding.
fn near(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::F32(a), Value::F32(b)) => a == b || (a - b).abs() < 1e-5,
        (Value::F64(a), Value::F64(b)) => (a - b).abs() < 1e-5,
        (Value::Vec3(a), Value::Vec3(b)) => a.abs_diff_eq(*b, 1e-5),
        (Value::Vec2(a), Value::Vec2(b)) => a.abs_diff_eq(*b, 1e-5),
        (Value::Vec3s(a), Value::Vec3s(b)) => a.len() == b.len() && a.iter().zip(&b[..]).all(|(a, b)| a.abs_diff_eq(*b, 1e-5)),
        (Value::Time(a), Value::Time(b)) => (a.0 - b.0).abs() < 1e-9,
        (Value::Color(a), Value::Color(b)) => a.0.abs_diff_eq(b.0, 1e-5),
        (Value::Quat(a), Value::Quat(b)) => a.dot(*b).abs() > 1.0 - 1e-5,
        (a, b) => a.same(b),
    }
}

fn row<'a>(time: f64, field: &'a str, value: impl Into<Value>, read: &'a str, expected: impl Into<Value>) -> Frame<'a> {
    (time, vec![(field, value.into())], (read, expected.into()))
}

#[test]
fn all_types_register_without_clashes_and_are_documented() {
    let registry = TypeRegistry::new();
    for node_type in builtin_types() {
        let name = node_type.name.clone();
        assert!(!node_type.doc.is_empty() && node_type.fields.iter().all(|field| !field.doc.is_empty()), "{name} lacks a doc");
        registry.register(node_type).unwrap_or_else(|error| panic!("{error}"));
    }
}
