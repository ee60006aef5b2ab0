//! Triggers, logic, intervals.

use super::{check, graph_of, row};
use crate::{Field, Graph, NoHost, Time, Value};

#[test]
fn triggers_turn_events_into_others() {
    check(
        "BooleanFilter",
        vec![
            row(1.0, "set_boolean", true, "input_true", true),
            (1.0, vec![], ("input_negate", false.into())),
            (1.0, vec![], ("input_false", false.into())),
            row(2.0, "set_boolean", false, "input_negate", true),
        ],
    );
    check("BooleanTrigger", vec![row(1.0, "set_trigger_time", 1.0f64, "trigger_true", true)]);
    check(
        "BooleanToggle",
        vec![
            row(1.0, "set_boolean", true, "toggle", true),
            row(2.0, "set_boolean", false, "toggle", true),
            row(3.0, "set_boolean", true, "toggle", false),
            row(4.0, "set_boolean", true, "toggle", true),
            (5.0, vec![], ("toggle", true.into())),
        ],
    );
    check(
        "IntegerTrigger",
        vec![row(0.0, "integer_key", 7i32, "trigger_value", 0i32), row(0.0, "set_boolean", true, "trigger_value", 7i32)],
    );
    check(
        "TimeTrigger",
        vec![row(3.5, "set_boolean", false, "trigger_time", Time(3.5)), (4.0, vec![], ("trigger_time", Time(3.5).into()))],
    );
    check(
        "EdgeTrigger",
        vec![
            row(1.0, "set_boolean", true, "rising_time", Time(1.0)),
            row(2.0, "set_boolean", true, "rising_time", Time(1.0)),
            row(3.0, "set_boolean", false, "falling_time", Time(3.0)),
            row(4.0, "set_boolean", true, "rising_time", Time(4.0)),
        ],
    );
}

#[test]
fn logic_joins_its_inputs() {
    for (node_type, a, b, expected) in [
        ("Sum", Value::F64(2.0), Value::F64(3.0), Value::F64(5.0)),
        ("Min", Value::F64(2.0), Value::F64(-3.0), Value::F64(-3.0)),
        ("Max", Value::F64(2.0), Value::F64(-3.0), Value::F64(2.0)),
        ("And", true.into(), true.into(), true.into()),
        ("And", true.into(), false.into(), false.into()),
        ("Or", true.into(), false.into(), true.into()),
        ("Or", false.into(), false.into(), false.into()),
        ("Xor", true.into(), true.into(), false.into()),
        ("Xor", true.into(), false.into(), true.into()),
    ] {
        check(node_type, vec![(0.0, vec![("a", a), ("b", b)], ("value", expected))]);
    }
    check("Not", vec![row(0.0, "a", false, "value", true), row(0.0, "a", true, "value", false)]);
}

#[test]
fn an_added_field_is_another_input() {
    let (mut graph, sum) = graph_of("Sum");
    let third = graph.add_field(sum, Field::new("c", 4i32)).unwrap();
    graph.set_named(sum, "a", 1.0f64).unwrap();
    graph.evaluate(0.0, &mut NoHost);
    assert_eq!(graph.get_named::<f64>(sum, "value").unwrap(), 5.0);
    graph.set(third, 10i32).unwrap();
    graph.evaluate(0.0, &mut NoHost);
    assert_eq!(graph.get_named::<f64>(sum, "value").unwrap(), 11.0);
    graph.add_field(sum, Field::new("what", "text")).unwrap();
    let report = graph.evaluate(0.0, &mut NoHost);
    assert!(
        report.problems[0].message.contains("`what` is of type string, which cannot be read as f64"),
        "{:?}",
        report.problems
    );
}

#[test]
fn intervals_map_and_clamp() {
    let lever =
        |value: f64| vec![("from_min", Value::F64(-90.0)), ("from_max", Value::F64(90.0)), ("set_value", Value::F64(value))];
    check(
        "IntervalMap",
        vec![
            (0.0, lever(0.0), ("value_changed", 0.5f64.into())),
            (0.0, lever(180.0), ("value_changed", 1.0f64.into())),
            row(0.0, "clamp", false, "value_changed", 1.5f64),
        ],
    );
    let (mut graph, map) = graph_of("IntervalMap");
    for (field, wrong, right) in [("from_max", 0.0f64, 1.0f64), ("to_min", f64::NEG_INFINITY, 0.0)] {
        graph.set_named(map, field, wrong).unwrap();
        assert_eq!(graph.evaluate(0.0, &mut NoHost).problems.len(), 1, "{field}");
        graph.set_named(map, "set_value", wrong.min(0.5)).unwrap();
        assert_eq!(graph.evaluate(0.0, &mut NoHost).problems.len(), 0, "{field}");
        graph.set_named(map, field, right).unwrap();
    }
}

#[test]
fn a_boolean_filter_tells_true_and_false_apart() {
    let (mut graph, filter) = graph_of("BooleanFilter");
    let revisions = |graph: &Graph| {
        ["input_true", "input_false", "input_negate"].map(|name| graph.field_revision(graph.field(filter, name).unwrap()))
    };
    graph.evaluate(0.0, &mut NoHost);
    for (event, written) in [(true, [true, false, true]), (false, [false, true, true]), (false, [false, true, true])] {
        let before = revisions(&graph);
        graph.set_named(filter, "set_boolean", event).unwrap();
        graph.evaluate(0.0, &mut NoHost);
        let after = revisions(&graph);
        assert_eq!([0, 1, 2].map(|at| after[at] > before[at]), written, "{event}");
    }
}
