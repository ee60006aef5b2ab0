//! Dampers, chasers, filters.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::{check, graph_of, row};
use crate::{NoHost, Time, Value};

#[test]
fn a_damper_takes_the_same_time_at_any_frame_rate() {
    let value_after = |order: i32, frames: u32| {
        let (mut graph, node) = graph_of("Damper");
        graph.set_named(node, "tau", 0.5f32).unwrap();
        graph.set_named(node, "order", order).unwrap();
        graph.set_named(node, "set_destination", 0.0f32).unwrap();
        graph.evaluate(0.0, &mut NoHost);
        graph.set_named(node, "set_destination", 1.0f32).unwrap();
        (0..=frames).for_each(|frame| drop(graph.evaluate(frame as f64 / frames as f64, &mut NoHost)));
        graph.get_named::<f32>(node, "value_changed").unwrap()
    };
    // The step response of low passes in a row: 1 - exp(-x) (1 + x + x^2 / 2 + ...), with x = 2.
    for (order, sum) in [(1, 1.0f32), (2, 3.0), (3, 5.0), (5, 7.0)] {
        let expected = 1.0 - (-2.0f32).exp() * sum;
        for frames in [1, 10, 60, 90] {
            let value = value_after(order, frames);
            assert!((value - expected).abs() < 1e-4, "order {order}, {frames} frames: {value} instead of {expected}");
        }
    }
    assert_eq!(value_after(0, 3), 1.0);
}

#[test]
fn dampers_and_chasers_start_and_jump_where_they_are_told() {
    for node_type in ["ScalarDamper", "ScalarChaser"] {
        check(
            node_type,
            vec![
                (
                    0.0,
                    vec![("initial_value", 2.0f32.into()), ("initial_destination", 4.0f32.into())],
                    ("value_changed", 2.0f32.into()),
                ),
                (50.0, vec![], ("value_changed", 4.0f32.into())),
                row(60.0, "set_destination", 6.0f32, "value_changed", 4.0f32),
                row(60.0, "set_value", 1.0f32, "value_changed", 1.0f32),
                (60.0, vec![], ("is_active", true.into())),
                (120.0, vec![], ("value_changed", 6.0f32.into())),
                (121.0, vec![], ("is_active", false.into())),
            ],
        );
    }
}

#[test]
fn a_chaser_arrives_when_its_duration_is_over() {
    let half = |x: f32| 0.5 - 0.5 * (std::f32::consts::PI * x).cos();
    check(
        "ScalarChaser",
        vec![
            row(0.0, "duration", Time(2.0), "value_changed", 0.0f32),
            row(0.0, "initial_value", 0.0f32, "value_changed", 0.0f32),
            row(0.0, "set_destination", 1.0f32, "value_changed", 0.0f32),
            (0.5, vec![], ("value_changed", half(0.25).into())),
            // A second step starts while the first is under way; each takes its own time.
            row(1.0, "set_destination", 3.0f32, "value_changed", half(0.5)),
            (1.5, vec![], ("value_changed", (half(0.75) + 2.0 * half(0.25)).into())),
            (2.5, vec![], ("value_changed", (1.0 + 2.0 * half(0.75)).into())),
            (3.0, vec![], ("value_changed", 3.0f32.into())),
            (3.0, vec![], ("is_active", false.into())),
        ],
    );
    let turn = |angle: f32| Quat::from_rotation_x(angle);
    check(
        "OrientationChaser",
        vec![
            row(0.0, "set_destination", turn(0.0), "value_changed", turn(0.0)),
            row(0.0, "set_destination", turn(1.0), "value_changed", turn(0.0)),
            (0.5, vec![], ("value_changed", turn(0.5).into())),
        ],
    );
}

#[test]
fn a_chaser_that_is_told_something_in_every_frame_stays_small() {
    let (mut graph, node) = graph_of("PositionChaser");
    for frame in 0..5000 {
        let time = frame as f64 / 1000.0;
        graph.set_named(node, "set_destination", Vec3::splat(time as f32)).unwrap();
        graph.evaluate(time, &mut NoHost);
    }
    assert!(graph.get_named::<Arc<[Time]>>(node, "step_times").unwrap().len() <= 65);
    // At even speed it follows half a duration behind.
    let value: Vec3 = graph.get_named(node, "value_changed").unwrap();
    assert!((value.x - 4.5).abs() < 0.02, "{value}");
}

#[test]
fn lists_glide_and_take_another_length_at_once() {
    let list = |values: &[f32]| Value::from(values.iter().map(|x| Vec3::splat(*x)).collect::<Vec<_>>());
    for node_type in ["CoordinateDamper", "CoordinateChaser"] {
        check(
            node_type,
            vec![
                (0.0, vec![("set_destination", list(&[0.0, 1.0]))], ("value_changed", list(&[0.0, 1.0]))),
                (0.0, vec![("set_destination", list(&[2.0, 3.0]))], ("value_changed", list(&[0.0, 1.0]))),
                (100.0, vec![], ("value_changed", list(&[2.0, 3.0]))),
                (100.0, vec![("set_destination", list(&[5.0]))], ("value_changed", list(&[5.0]))),
                (100.0, vec![("set_destination", list(&[]))], ("value_changed", list(&[]))),
            ],
        );
    }
}

#[test]
fn a_filter_is_steady_at_rest_and_quick_in_motion() {
    let worst = |speed: f32, jitter: f32| {
        let (mut graph, node) = graph_of("PositionFilter");
        graph.set_named(node, "beta", 10.0f32).unwrap();
        let mut worst = 0.0f32;
        for frame in 0..240 {
            let time = frame as f64 / 60.0;
            let truth = Vec3::X * speed * time as f32;
            let noise = jitter * if frame % 2 == 0 { 1.0 } else { -1.0 };
            graph.set_named(node, "set_value", truth + Vec3::Y * noise).unwrap();
            graph.evaluate(time, &mut NoHost);
            let found: Vec3 = graph.get_named(node, "value_changed").unwrap();
            worst = if frame > 120 { worst.max(found.distance(truth)) } else { 0.0 };
        }
        let velocity: Vec3 = graph.get_named(node, "velocity").unwrap();
        assert!((velocity.x - speed).abs() < 1e-2, "{velocity} at {speed} m/s");
        worst
    };
    // A head at rest with 1 mm of jitter, and one that moves at 1 m/s: a low pass of 1 Hz alone would lag by 16 cm.
    assert!(worst(0.0, 0.001) < 0.0003, "{}", worst(0.0, 0.001));
    assert!(worst(1.0, 0.001) < 0.02, "{}", worst(1.0, 0.001));
    // By hand: two measurements 1 s apart, cutoffs 1 Hz: share 2 pi / (1 + 2 pi) of the speed; beta 0 leaves the share of the value.
    let share = std::f32::consts::TAU / (1.0 + std::f32::consts::TAU);
    check(
        "ScalarFilter",
        vec![
            row(1.0, "beta", 0.0f32, "value_changed", 0.0f32),
            row(1.0, "set_value", 10.0f32, "value_changed", 10.0f32),
            row(2.0, "set_value", 11.0f32, "value_changed", 10.0 + share),
            row(2.0, "set_value", 99.0f32, "velocity", share),
        ],
    );
    // What is not finite is left out, and what comes after it counts.
    let (mut graph, node) = graph_of("ScalarFilter");
    for (time, measured, faults) in [(0.0, 1.0f32, 0), (1.0, f32::NAN, 1), (2.0, f32::INFINITY, 1), (3.0, 1.0, 0)] {
        graph.set_named(node, "set_value", measured).unwrap();
        assert_eq!(graph.evaluate(time, &mut NoHost).problems.len(), faults, "{measured}");
        assert_eq!(graph.get_named::<f32>(node, "value_changed").unwrap(), 1.0, "{measured}");
    }
}

#[test]
fn no_way_leads_to_infinity_or_back() {
    let frame = |time, to: f32| row(time, "set_destination", to, "value_changed", to);
    check(
        "ScalarDamper",
        vec![frame(0.0, 1.0), frame(0.1, f32::INFINITY), frame(0.2, 2.0), (0.2, vec![], ("is_active", false.into()))],
    );
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
