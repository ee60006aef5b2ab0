//! Clocks and schedulers.

use std::sync::Arc;

use glam::Vec3;

use super::{check, graph_of, row};
use crate::{Graph, NoHost, Time, Value, builtin_types};

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
fn a_clock_that_no_longer_loops_runs_to_the_end_of_its_cycle() {
    let start = || vec![("loop", true.into()), ("cycle_interval", Value::from(2.0f64))];
    check(
        "TimeSensor",
        vec![
            (0.0, start(), ("is_active", true.into())),
            (4.5, vec![], ("fraction_changed", 0.25f32.into())),
            row(5.0, "loop", false, "fraction_changed", 0.5f32),
            (5.5, vec![], ("is_active", true.into())),
            (6.5, vec![], ("fraction_changed", 1.0f32.into())),
            (7.0, vec![], ("elapsed_time", Time(6.0).into())),
            (7.5, vec![], ("is_active", false.into())),
        ],
    );
    // At the very end of a cycle nothing more is to come.
    check(
        "TimeSensor",
        vec![
            (0.0, start(), ("is_active", true.into())),
            (4.0, vec![], ("fraction_changed", 1.0f32.into())),
            row(4.5, "loop", false, "is_active", false),
            (5.0, vec![], ("elapsed_time", Time(4.0).into())),
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
fn a_clock_pauses_and_goes_on_where_it_was() {
    check(
        "TimeSensor",
        vec![
            (0.0, vec![("loop", true.into()), ("cycle_interval", 4.0f64.into())], ("is_active", true.into())),
            (1.0, vec![], ("fraction_changed", 0.25f32.into())),
            // What the frames miss is not lost: it paused at 1.5, and went on at 4.
            row(2.0, "pause_time", 1.5f64, "is_paused", true),
            (3.0, vec![], ("elapsed_time", Time(1.5).into())),
            row(3.5, "resume_time", 4.0f64, "fraction_changed", 0.25f32),
            (5.0, vec![], ("elapsed_time", Time(2.5).into())),
            (5.0, vec![], ("fraction_changed", 0.625f32.into())),
            (7.0, vec![], ("cycle_time", Time(6.5).into())),
            row(8.0, "pause_time", 8.0f64, "is_paused", true),
            row(9.0, "pause_time", 0.0f64, "paused_for", Time(3.5)),
            row(10.0, "stop_time", 10.0f64, "is_active", false),
        ],
    );
}

#[test]
fn a_clock_refuses_what_it_cannot_run_by() {
    for (field, value) in
        [("cycle_interval", 0.0f64), ("cycle_interval", -1.0), ("cycle_interval", f64::NAN), ("start_time", f64::INFINITY)]
    {
        let (mut graph, clock) = graph_of("TimeSensor");
        graph.set_named(clock, "loop", true).unwrap();
        graph.set_named(clock, field, value).unwrap();
        let problems = graph.evaluate(0.5, &mut NoHost).problems;
        assert!(problems.len() == 1 && problems[0].message.contains("cannot run"), "{field} {value}: {problems:?}");
        assert!(!graph.get_named::<bool>(clock, "is_active").unwrap());
        assert_eq!(graph.evaluate(0.6, &mut NoHost).evaluated, 0, "it rests");
    }
}

#[test]
fn a_clock_that_started_in_the_past_is_in_its_present_cycle() {
    let past =
        |looping: bool| vec![("loop", looping.into()), ("start_time", Value::from(10.0f64)), ("cycle_interval", 4.0f64.into())];
    check(
        "TimeSensor",
        vec![(21.0, past(true), ("fraction_changed", 0.75f32.into())), (21.0, vec![], ("cycle_time", Time(18.0).into()))],
    );
    check("TimeSensor", vec![(21.0, past(false), ("is_active", false.into()))]);
}

#[test]
fn a_resting_clock_costs_nothing() {
    let (mut graph, _) = graph_of("TimeSensor");
    assert_eq!(graph.evaluate(5.0, &mut NoHost).evaluated, 1, "a new node is evaluated once");
    assert_eq!(graph.evaluate(6.0, &mut NoHost).evaluated, 0);
}

#[test]
fn a_scheduler_tells_when_times_have_come() {
    let times = |list: &[f64]| Value::from(list.iter().map(|time| Time(*time)).collect::<Vec<_>>());
    check(
        "Scheduler",
        vec![
            (0.0, vec![("times", times(&[1.0, 2.0, 2.5])), ("start_time", 10.0f64.into())], ("index", (-1i32).into())),
            (10.9, vec![], ("index", (-1i32).into())),
            (11.0, vec![], ("index", 0i32.into())),
            // Two in one frame: the last one is told.
            (13.0, vec![], ("index", 2i32.into())),
            (13.0, vec![], ("event_time", Time(12.5).into())),
            row(20.0, "period", Time(4.0), "told", 8i64),
            (21.5, vec![], ("event_time", Time(20.5).into())),
            row(23.2, "enabled", false, "told", 9i64),
            row(23.2, "enabled", true, "told", 10i64),
            (23.2, vec![], ("event_time", Time(23.0).into())),
        ],
    );
    let endless = vec![("times", times(&[0.0])), ("period", Value::from(1e-300f64))];
    check("Scheduler", vec![(1e9, endless, ("index", 0i32.into()))]);
    for (list, period, words) in [
        (times(&[2.0, 1.0]), 0.0f64, "descend"),
        (times(&[-1.0]), 0.0, "times[0] is -1 s"),
        (times(&[5.0]), 4.0, "not within the period"),
    ] {
        let (mut graph, node) = graph_of("Scheduler");
        graph.set_named(node, "times", list).unwrap();
        graph.set_named(node, "period", period).unwrap();
        let problems = graph.evaluate(9.0, &mut NoHost).problems;
        assert!(problems.len() == 1 && problems[0].message.contains(words), "{words}: {problems:?}");
        assert_eq!(graph.evaluate(10.0, &mut NoHost).evaluated, 0);
    }
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
