//! Interpolators, sequencers, easing.

use glam::{Quat, Vec2, Vec3};

use super::{check, graph_of};
use crate::{Color, NoHost, Same, Value};

fn keys(fractions: &[f32], values: impl Into<Value>, interpolation: &'static str) -> Vec<(&'static str, Value)> {
    vec![("key", fractions.into()), ("key_value", values.into()), ("interpolation", interpolation.into())]
}

fn spline<V: Into<Value>>(fractions: &[f32], values: V, velocities: V, closed: bool) -> Vec<(&'static str, Value)> {
    vec![("key", fractions.into()), ("key_value", values.into()), ("key_velocity", velocities.into()), ("closed", closed.into())]
}

#[test]
fn easing_leaves_and_arrives_slowly() {
    for (fraction, expected) in
        [(0.0, 0.0), (0.25, 0.125), (0.5, 0.5), (0.75, 0.875), (1.0, 1.0), (1.5, 1.5), (2.0, 2.0), (7.0, 2.0)]
    {
        let mut writes = vec![("key", Value::from(vec![0.0f32, 1.0, 2.0]))];
        writes.push(("ease_in_ease_out", vec![Vec2::new(0.0, 0.5), Vec2::new(0.5, 0.0), Vec2::ZERO].into()));
        writes.push(("set_fraction", Value::F32(fraction)));
        check("EaseInEaseOut", vec![(0.0, writes, ("modified_fraction_changed", Value::F32(expected)))]);
    }
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
        (
            "CoordinateInterpolator2D",
            keys(&[0.0, 1.0], vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::X], "linear"),
            0.5,
            vec![Vec2::Y / 2.0, Vec2::X].into(),
        ),
        ("PositionInterpolator2D", keys(&[0.0, 1.0], vec![Vec2::ZERO, Vec2::ONE], "linear"), 0.25, Vec2::splat(0.25).into()),
        // Half way on the sphere, not on the chord.
        (
            "NormalInterpolator",
            keys(&[0.0, 1.0], vec![Vec3::X, Vec3::Y], "linear"),
            0.5,
            vec![Vec3::new(1.0, 1.0, 0.0).normalize()].into(),
        ),
        // A spline through equal steps is a straight line, if its ends are told how fast.
        (
            "SplineScalarInterpolator",
            spline(&[0.0, 1.0, 2.0], vec![0.0f32, 1.0, 2.0], vec![1.0f32, 1.0], false),
            0.25,
            0.25f32.into(),
        ),
        // By hand: from rest, t = 1/2 with tangents 0 and 1 (Catmull, Rom): 1/2 - 1/8.
        ("SplineScalarInterpolator", spline(&[0.0, 1.0, 2.0], vec![0.0f32, 1.0, 2.0], vec![], false), 0.5, 0.375f32.into()),
        // Uneven keys: the tangent at 1 is 2/3 of (4 - 0) / 2 before it: (1/2) 1 - (1/8) (4/3).
        (
            "SplineScalarInterpolator",
            spline(&[0.0, 1.0, 3.0], vec![0.0f32, 1.0, 4.0], vec![], false),
            0.5,
            (0.5f32 - 4.0 / 24.0).into(),
        ),
        // A closed one leaves its start as it arrives at its end: tangents (1 - (-1)) / 2 and 0.
        (
            "SplineScalarInterpolator",
            spline(&[0.0, 1.0, 2.0, 3.0, 4.0], vec![0.0f32, 1.0, 0.0, -1.0, 0.0], vec![], true),
            0.5,
            0.625f32.into(),
        ),
        // Speeds of the way's length, 2: (1/2) 2 + (1/8) (2 - 2).
        (
            "SplinePositionInterpolator",
            [
                spline(&[0.0, 1.0], vec![Vec3::ZERO, Vec3::X * 2.0], vec![Vec3::X, Vec3::X * 9.0], false),
                vec![("normalize_velocity", true.into())],
            ]
            .concat(),
            0.5,
            Vec3::X.into(),
        ),
        (
            "SplinePositionInterpolator2D",
            spline(&[0.0, 1.0], vec![Vec2::ZERO, Vec2::Y], vec![], false),
            0.5,
            Vec2::new(0.0, 0.5).into(),
        ),
        (
            "SquadOrientationInterpolator",
            keys(&[0.0, 1.0, 2.0], vec![turn(0.0), turn(1.0), -turn(2.0)], "")[..2].to_vec(),
            1.0,
            turn(1.0).into(),
        ),
        // About one axis and at even steps it turns evenly in the middle.
        (
            "SquadOrientationInterpolator",
            keys(&[0.0, 1.0, 2.0, 3.0], vec![turn(0.0), turn(0.5), turn(1.0), turn(1.5)], "")[..2].to_vec(),
            1.25,
            turn(0.625).into(),
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
        (
            "SplineScalarInterpolator",
            spline(&[0.0, 1.0, 2.0], vec![0.0f32; 3], vec![1.0f32], false),
            "there are 1 velocities for 3 keys",
        ),
        ("SquadOrientationInterpolator", keys(&[0.0, 1.0], vec![Quat::IDENTITY], "")[..2].to_vec(), "2 keys need 2"),
        ("EaseInEaseOut", vec![("key", vec![0.0f32, 1.0].into())], "2 keys need 2 eases"),
        ("BooleanSequencer", keys(&[0.0, 1.0], vec![true], "")[..2].to_vec(), "2 keys need 2"),
        ("IntegerSequencer", keys(&[1.0, 0.0], vec![7i32, 8], "")[..2].to_vec(), "descend"),
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
        let outputs = ["value_changed", "modified_fraction_changed"];
        let output = outputs.into_iter().find_map(|name| graph.field(node, name).ok()).unwrap();
        let untouched = graph.declaration(output).unwrap().default.clone();
        assert!(graph.value(output).unwrap().same(&untouched), "{node_type}, {words}: {:?}", graph.value(output));
    }
}
