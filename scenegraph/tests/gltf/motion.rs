//! Animations, driven by their clocks, against the formulas of the glTF 2.0 specification (appendix C), computed here
//! from the bytes of the file.

use crate::samples::{json_of, samples};
use crate::tiny::{Tiny, get, load_new, of_type};
use glam::{Quat, Vec3, Vec4};
use serde_json::{Value, json};
use std::sync::Arc;
use umbriel_fields::{Graph, NoHost, NodeId, Time};

/// The floats of an accessor of a .glb whose accessors are packed.
fn floats(json: &Value, binary: &[u8], accessor: &Value) -> Vec<f32> {
    let a = &json["accessors"][accessor.as_u64().unwrap() as usize];
    let view = &json["bufferViews"][a["bufferView"].as_u64().unwrap() as usize];
    let lanes = match a["type"].as_str().unwrap() {
        "SCALAR" => 1,
        "VEC3" => 3,
        _ => 4,
    };
    let start = (view["byteOffset"].as_u64().unwrap_or(0) + a["byteOffset"].as_u64().unwrap_or(0)) as usize;
    let count = a["count"].as_u64().unwrap() as usize * lanes;
    binary[start..start + 4 * count].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

/// The value at a time, by the specification.
fn sample(kind: &str, path: &str, times: &[f32], values: &[f32], lanes: usize, t: f32) -> Vec<f32> {
    let cubic = kind == "CUBICSPLINE";
    let value = |key: usize, part: usize| {
        let i = if cubic { 3 * key + part } else { key };
        &values[i * lanes..(i + 1) * lanes]
    };
    let last = times.len() - 1;
    let t = t.clamp(times[0], times[last]);
    let k = times.iter().rposition(|key| *key <= t).unwrap().min(last.max(1) - 1);
    let td = times[k + 1] - times[k];
    let s = (t - times[k]) / td;
    if kind == "STEP" {
        return value(if s >= 1.0 { k + 1 } else { k }, 1).to_vec();
    }
    let (a, b) = (value(k, 1), value(k + 1, 1));
    if !cubic && path == "rotation" {
        let quat = |v: &[f32]| Quat::from_slice(v);
        return quat(a).slerp(quat(b), s).to_array().to_vec();
    }
    let mix = |i: usize| {
        if !cubic {
            return a[i] + (b[i] - a[i]) * s;
        }
        let (s2, s3) = (s * s, s * s * s);
        (2.0 * s3 - 3.0 * s2 + 1.0) * a[i]
            + td * (s3 - 2.0 * s2 + s) * value(k, 2)[i]
            + (3.0 * s2 - 2.0 * s3) * b[i]
            + td * (s3 - s2) * value(k + 1, 0)[i]
    };
    let mixed: Vec<f32> = (0..lanes).map(mix).collect();
    if path == "rotation" { Vec4::from_slice(&mixed).normalize().to_array().to_vec() } else { mixed }
}

/// What the graph has in a Transform.
fn moved(graph: &Graph, transform: NodeId, path: &str) -> Vec<f32> {
    match path {
        "rotation" => get::<Quat>(graph, transform, path).to_array().to_vec(),
        _ => get::<Vec3>(graph, transform, path).to_array().to_vec(),
    }
}

/// Starts only this clock at time 0.
fn play(graph: &mut Graph, clocks: &[NodeId], only: NodeId) {
    for clock in clocks {
        graph.set_named(*clock, "enabled", *clock == only).unwrap();
    }
    graph.set_named(only, "start_time", Time(0.0)).unwrap();
}

#[test]
fn interpolation_test_follows_the_specification() {
    let Some(folder) = samples() else { return };
    let file = folder.join("gltf/InterpolationTest/InterpolationTest.glb");
    let json = json_of(&file);
    let bytes = std::fs::read(&file).unwrap();
    let json_length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let binary = &bytes[20 + json_length + 8..];
    let mut kinds = Vec::new();
    for (a, animation) in json["animations"].as_array().unwrap().iter().enumerate() {
        let (mut graph, model) = load_new(&file);
        let clocks = model.unwrap().clocks;
        play(&mut graph, &clocks, clocks[a]);
        let transforms = of_type(&graph, "Transform");
        let channel = &animation["channels"][0];
        let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        let (node, path) = (channel["target"]["node"].as_u64().unwrap() as usize, channel["target"]["path"].as_str().unwrap());
        let kind = sampler["interpolation"].as_str().unwrap_or("LINEAR");
        let (times, values) = (floats(&json, binary, &sampler["input"]), floats(&json, binary, &sampler["output"]));
        let duration = *times.last().unwrap();
        assert_eq!(get::<Time>(&graph, clocks[a], "cycle_interval").0 as f32, duration);
        let lanes = if path == "rotation" { 4 } else { 3 };
        for step in 1..40 {
            let t = duration * step as f32 / 40.0;
            // On a key, rounding decides which side of a jump is seen.
            if kind == "STEP" && times.iter().any(|key| (key - t).abs() < 1e-3) {
                continue;
            }
            graph.evaluate(t.into(), &mut NoHost);
            let (is, should) = (moved(&graph, transforms[node], path), sample(kind, path, &times, &values, lanes, t));
            let sign = if path == "rotation" && Vec4::from_slice(&is).dot(Vec4::from_slice(&should)) < 0.0 { -1.0 } else { 1.0 };
            let off = is.iter().zip(&should).map(|(a, b)| (a - b * sign).abs()).fold(0.0, f32::max);
            assert!(off < 2e-4, "animation {a}, {kind} {path} at {t}: {is:?} instead of {should:?}");
        }
        kinds.push((kind.to_owned(), path.to_owned()));
    }
    kinds.sort();
    kinds.dedup();
    assert_eq!(kinds.len(), 9, "three kinds of interpolation times three properties");
}

#[test]
fn only_the_first_animation_plays() {
    let Some(folder) = samples() else { return };
    let (mut graph, model) = load_new(&folder.join("gltf/Fox/Fox.glb"));
    let model = model.unwrap();
    assert_eq!(model.clocks.iter().map(|c| graph.name(*c).unwrap()).collect::<Vec<_>>(), ["Fox/Survey", "Fox/Walk", "Fox/Run"]);
    assert_eq!(model.clocks.iter().map(|c| get::<bool>(&graph, *c, "enabled")).collect::<Vec<_>>(), [true, false, false]);
    let at = |graph: &mut Graph, t: f64| {
        graph.evaluate(t, &mut NoHost);
        of_type(graph, "Transform").iter().map(|n| get::<Quat>(graph, *n, "rotation")).collect::<Vec<_>>()
    };
    let (survey, later) = (at(&mut graph, 0.5), at(&mut graph, 1.5));
    assert_ne!(survey, later);
    play(&mut graph, &model.clocks, model.clocks[2]);
    let running = at(&mut graph, 1.75);
    assert_ne!(running, later);
    assert!(running.iter().all(|q| q.is_normalized()));
}

#[test]
fn a_model_at_rest_looks_as_its_file_says() {
    // Animations that do not play must not touch what they could move.
    let mut tiny = Tiny::new();
    tiny.json["animations"][0]["channels"][0]["target"]["node"] = 1.into();
    let second = json!({"name": "other", "samplers": [{"input": 3, "output": 4}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}, {"sampler": 0, "target": {"node": 0, "path": "scale"}}]});
    tiny.json["animations"].as_array_mut().unwrap().push(second);
    let (mut graph, model) = tiny.load();
    let model = model.unwrap();
    let (top, triangle) = (graph.find("top").unwrap(), graph.find("triangle").unwrap());
    for t in [0.0, 0.5, 2.5] {
        graph.evaluate(t, &mut NoHost);
        assert_eq!((get::<Vec3>(&graph, top, "translation"), get::<Vec3>(&graph, top, "scale")), (Vec3::Y, Vec3::ONE));
    }
    assert_eq!(get::<Vec3>(&graph, triangle, "translation"), Vec3::new(2.0, 3.0, 0.0), "half way between 1 and 4 seconds");
    play(&mut graph, &model.clocks, model.clocks[1]);
    graph.evaluate(4.5, &mut NoHost);
    assert_eq!(get::<Vec3>(&graph, top, "translation"), Vec3::new(1.0, 1.0, 0.0), "the clock loops after 4 seconds");
}

#[test]
fn morph_weights_move() {
    for (kind, weights, expected) in [
        ("LINEAR", vec![0., 0., 1., 2., 1., 6.], [1.0, 4.0]),
        ("STEP", vec![0., 0., 1., 2., 1., 6.], [1.0, 2.0]),
        // Values 0, 0, 1 and 0, 0, 3 with tangents that leave key 1 with 2 per second and arrive at key 2 with 0.
        (
            "CUBICSPLINE",
            vec![0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 2., 2., 0., 0., 1., 3., 0., 0.],
            [0.5 + 3.0 * 0.125 * 2.0, 1.5 + 3.0 * 0.125 * 2.0],
        ),
    ] {
        let mut tiny = Tiny::new();
        let values = tiny.floats("SCALAR", &weights);
        tiny.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 0}, {"POSITION": 0}]);
        tiny.json["animations"] = json!([{"samplers": [{"input": 3, "output": values, "interpolation": kind}],
            "channels": [{"sampler": 0, "target": {"node": 1, "path": "weights"}}]}]);
        let (mut graph, model) = tiny.load();
        model.unwrap();
        graph.evaluate(2.5, &mut NoHost); // half way between keys 1 and 2, at 1 and 4 seconds
        let shape = of_type(&graph, "Shape")[0];
        let is = get::<Arc<[f32]>>(&graph, shape, "morph_weights");
        assert!(
            is.len() == 2 && is.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5),
            "{kind}: {is:?} instead of {expected:?}"
        );
    }
}
