//! The node types at work: rows of what goes in in each frame and what comes out.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::builtin_types;
use crate::{Color, Field, Graph, NoHost, NodeId, Same, Time, TypeRegistry, Value};

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
        (Value::F32(a), Value::F32(b)) => (a - b).abs() < 1e-5,
        (Value::F64(a), Value::F64(b)) => (a - b).abs() < 1e-5,
        (Value::Vec3(a), Value::Vec3(b)) => a.abs_diff_eq(*b, 1e-5),
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

#[test]
fn a_clock_that_loops() {
    check(
        "TimeSensor",
        vec![
            (0.0, vec![("loop", true.into()), ("cycle_interval", 2.0f64.into())], ("fraction_changed", 0.0f32.into())),
            (0.5, vec![], ("fraction_changed", 0.25f32.into())),
            (2.0, vec![], ("fraction_changed", 1.0f32.into())),
            (3.0, vec![], ("fraction_changed", 0.5f32.into())),
            (3.5, vec![], ("cycle_time", Time(2.0).into())),
            row(4.5, "enabled", false, "is_active", false),
            (5.0, vec![], ("fraction_changed", 0.75f32.into())),
            row(7.0, "enabled", true, "fraction_changed", 0.5f32),
        ],
    );
}

#[test]
fn a_clock_that_runs_once() {
    check(
        "TimeSensor",
        vec![
            row(9.0, "start_time", 10.0f64, "is_active", false),
            (10.0, vec![], ("is_active", true.into())),
            (10.75, vec![], ("fraction_changed", 0.75f32.into())),
            (11.5, vec![], ("fraction_changed", 1.0f32.into())),
            (12.0, vec![], ("is_active", false.into())),
            (13.0, vec![("start_time", 12.5f64.into()), ("stop_time", 12.75f64.into())], ("is_active", false.into())),
        ],
    );
}

#[test]
fn a_resting_clock_costs_nothing() {
    let (mut graph, _) = graph_of("TimeSensor");
    assert_eq!(graph.evaluate(5.0, &mut NoHost).evaluated, 1, "a new node is evaluated once");
    assert_eq!(graph.evaluate(6.0, &mut NoHost).evaluated, 0);
}

fn keys(fractions: &[f32], values: impl Into<Value>, interpolation: &'static str) -> Vec<(&'static str, Value)> {
    vec![("key", fractions.into()), ("key_value", values.into()), ("interpolation", interpolation.into())]
}

#[test]
fn interpolators_follow_their_keys() {
    let turn = |angle: f32| Quat::from_rotation_y(angle);
    type Row = (&'static str, Vec<(&'static str, Value)>, f32, Value);
    let rows: Vec<Row> = vec![
        ("ScalarInterpolator", keys(&[0.0, 1.0, 3.0], vec![0.0f32, 10.0, 30.0], "linear"), 2.0, 20.0f32.into()),
        ("ScalarInterpolator", keys(&[0.0, 1.0, 3.0], vec![0.0f32, 10.0, 30.0], "linear"), -5.0, 0.0f32.into()),
        ("ScalarInterpolator", keys(&[0.0, 1.0, 3.0], vec![1.0f32, 10.0, 30.0], "linear"), 5.0, 30.0f32.into()),
        ("ScalarInterpolator", keys(&[0.0, 1.0, 3.0], vec![0.0f32, 10.0, 30.0], "step"), 2.9, 10.0f32.into()),
        ("ScalarInterpolator", keys(&[0.0, 1.0, 3.0], vec![0.0f32, 10.0, 30.0], "step"), 1.0, 10.0f32.into()),
        ("ScalarInterpolator", keys(&[0.0, 1.0, 1.0, 2.0], vec![0.0f32, 1.0, 5.0, 6.0], "linear"), 1.0, 5.0f32.into()),
        ("ScalarInterpolator", keys(&[0.5], vec![7.0f32], "linear"), 0.1, 7.0f32.into()),
        ("ScalarInterpolator", keys(&[0.0, 1.0], vec![7.0f32, 8.0], "linear"), 0.0, 7.0f32.into()),
        // Tangents are per unit of key: a slope of 1 over a distance of 2 is a straight line from 0 to 2.
        ("ScalarInterpolator", keys(&[0.0, 2.0], vec![0.0f32, 0.0, 1.0, 1.0, 2.0, 0.0], "cubic_spline"), 0.5, 0.5f32.into()),
        // glTF appendix C by hand: t = 1/2, td = 2: 2 (1/2) + 4 (1/2) + 2 (1/8) 1 + 2 (-1/8) 3.
        ("ScalarInterpolator", keys(&[0.0, 2.0], vec![9.0f32, 2.0, 1.0, 3.0, 4.0, 9.0], "cubic_spline"), 1.0, 2.5f32.into()),
        ("PositionInterpolator", keys(&[0.0, 1.0], vec![Vec3::ZERO, Vec3::ONE], "linear"), 0.25, Vec3::splat(0.25).into()),
        ("OrientationInterpolator", keys(&[0.0, 1.0], vec![turn(0.0), turn(2.0)], "linear"), 0.25, turn(0.5).into()),
        ("OrientationInterpolator", keys(&[0.0, 1.0], vec![turn(0.0), -turn(2.0)], "linear"), 0.25, turn(0.5).into()),
        (
            "ColorInterpolator",
            keys(&[0.0, 1.0], vec![Color(Vec3::X), Color(Vec3::Z)], "linear"),
            0.5,
            Color(Vec3::new(0.5, 0.0, 0.5)).into(),
        ),
        (
            "ScalarArrayInterpolator",
            keys(&[0.0, 1.0], vec![0.0f32, 1.0, 4.0, 5.0], "linear"),
            0.5,
            Value::from(vec![2.0f32, 3.0]),
        ),
        (
            "ScalarArrayInterpolator",
            keys(&[0.0, 1.0], vec![9.0f32, 9.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 4.0, 5.0, 9.0, 9.0], "cubic_spline"),
            0.5,
            Value::from(vec![2.0f32, 3.0]),
        ),
        (
            "CoordinateInterpolator",
            keys(&[0.0, 1.0], vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X], "linear"),
            0.5,
            vec![Vec3::Y / 2.0, Vec3::X].into(),
        ),
        ("BooleanSequencer", keys(&[0.0, 0.5], vec![false, true], "")[..2].to_vec(), 0.7, true.into()),
        ("IntegerSequencer", keys(&[0.0, 0.5], vec![3i32, 8], "")[..2].to_vec(), 0.4, 3i32.into()),
    ];
    for (node_type, mut writes, fraction, expected) in rows {
        writes.push(("set_fraction", fraction.into()));
        check(node_type, vec![(0.0, writes, ("value_changed", expected))]);
    }
}

#[test]
fn before_the_first_fraction_an_interpolator_is_silent() {
    check("ScalarInterpolator", vec![(0.0, keys(&[0.0, 1.0], vec![5.0f32, 6.0], "linear"), ("value_changed", 0.0f32.into()))]);
}

#[test]
fn bad_keys_are_reported_once_and_move_nothing() {
    for (node_type, writes, words) in [
        ("ScalarInterpolator", keys(&[0.0, 2.0, 1.0], vec![0.0f32, 1.0, 2.0], "linear"), "descend"),
        ("ScalarInterpolator", keys(&[0.0, f32::NAN], vec![0.0f32, 1.0], "linear"), "NaN"),
        ("ScalarInterpolator", keys(&[0.0, 1.0], vec![0.0f32, 1.0, 2.0], "linear"), "2 keys need 2 key_values, there are 3"),
        ("ScalarInterpolator", keys(&[0.0, 1.0], vec![0.0f32, 1.0], "cubic_spline"), "need 6"),
        ("ScalarInterpolator", keys(&[], vec![0.0f32], "linear"), "0 keys need 0"),
        ("ScalarArrayInterpolator", keys(&[0.0, 1.0], vec![0.0f32, 1.0, 2.0], "linear"), "a multiple of 2"),
        ("CoordinateInterpolator", keys(&[0.0, 1.0], Vec::<Vec3>::new(), "step"), "there are 0"),
        ("BooleanSequencer", keys(&[0.0, 1.0], vec![true], "")[..2].to_vec(), "2 keys need 2"),
    ] {
        let (mut graph, node) = graph_of(node_type);
        for (name, value) in writes {
            graph.set_named(node, name, value).unwrap();
        }
        graph.set_named(node, "set_fraction", 0.5f32).unwrap();
        let report = graph.evaluate(0.0, &mut NoHost);
        assert_eq!(report.problems.len(), 1, "{words}");
        assert!(report.problems[0].message.contains(words) && report.problems[0].node == node, "{:?}", report.problems);
        for fraction in [f32::NAN, 7.0, -1.0, f32::INFINITY, 0.75] {
            graph.set_named(node, "set_fraction", fraction).unwrap();
            assert_eq!(graph.evaluate(0.0, &mut NoHost).problems, [], "{words}");
        }
    }
}

#[test]
fn triggers_turn_events_into_others() {
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
    assert!(report.problems[0].message.contains("cannot be read as f64"), "{:?}", report.problems);
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
    graph.set_named(map, "from_max", 0.0f64).unwrap();
    assert_eq!(graph.evaluate(0.0, &mut NoHost).problems.len(), 1);
    graph.set_named(map, "set_value", 0.5f64).unwrap();
    assert_eq!(graph.evaluate(0.0, &mut NoHost).problems.len(), 0);
}

#[test]
fn a_damper_takes_the_same_time_at_any_frame_rate() {
    let value_after = |frames: u32| {
        let (mut graph, node) = graph_of("Damper");
        graph.set_named(node, "tau", 0.5f32).unwrap();
        graph.set_named(node, "set_destination", 0.0f32).unwrap();
        graph.evaluate(0.0, &mut NoHost);
        graph.set_named(node, "set_destination", 1.0f32).unwrap();
        (0..=frames).for_each(|frame| drop(graph.evaluate(frame as f64 / frames as f64, &mut NoHost)));
        graph.get_named::<f32>(node, "value_changed").unwrap()
    };
    let expected = 1.0 - (-2.0f32).exp();
    for frames in [1, 10, 60, 90] {
        assert!((value_after(frames) - expected).abs() < 1e-4, "{frames} frames: {} instead of {expected}", value_after(frames));
    }
}

#[test]
fn a_damper_takes_its_first_destination_at_once_and_comes_to_rest() {
    let (mut graph, node) = graph_of("PositionDamper");
    graph.set_named(node, "set_destination", Vec3::ONE).unwrap();
    graph.evaluate(0.0, &mut NoHost);
    assert_eq!(graph.get_named::<Vec3>(node, "value_changed").unwrap(), Vec3::ONE);
    graph.set_named(node, "set_destination", Vec3::ZERO).unwrap();
    let frames = (1..1000).take_while(|frame| graph.evaluate(*frame as f64 / 60.0, &mut NoHost).evaluated > 0).count();
    assert_eq!(graph.get_named::<Vec3>(node, "value_changed").unwrap(), Vec3::ZERO);
    assert!((60..600).contains(&frames), "rested after {frames} frames");
}

#[test]
fn a_clock_moves_what_it_is_routed_to_in_the_same_frame() {
    let mut graph = Graph::new(builtin_types());
    let [clock, path] = ["TimeSensor", "PositionInterpolator"].map(|name| graph.create(name).unwrap());
    graph.set_named(path, "key", vec![0.0f32, 1.0]).unwrap();
    graph.set_named(path, "key_value", Arc::<[Vec3]>::from([Vec3::ZERO, Vec3::Y])).unwrap();
    let (from, to) = (graph.field(clock, "fractionChanged").unwrap(), graph.field(path, "set_fraction").unwrap());
    graph.connect(from, to, crate::Strength::Strong).unwrap();
    graph.set_named(clock, "loop", true).unwrap();
    let report = graph.evaluate(0.5, &mut NoHost);
    assert_eq!(graph.get_named::<Vec3>(path, "value_changed").unwrap(), Vec3::Y / 2.0);
    assert_eq!((report.evaluated, report.copied), (2, 1));
}
