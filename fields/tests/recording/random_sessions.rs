//! Random operations, in callbacks too, are recorded and replayed bit-equal.

use umbriel_fields::Graph;
use umbriel_fields::record::Replayer;

use crate::support::{native_types, play, random_recording};

/// What both graphs must agree on: how often anything was written, evaluations, values in the order of nodes' places.
fn fingerprint(graph: &Graph) -> Vec<String> {
    let mut nodes: Vec<_> = graph.nodes().collect();
    nodes.sort_by_key(|node| {
        use slotmap::Key;
        node.data().as_ffi() as u32
    });
    let mut lines = vec![format!("{} writes, {} routes", graph.revision(), graph.routes().count())];
    for node in nodes {
        lines.push(format!("{} evaluated {} times", graph.describe(node), graph.evaluation_count(node)));
        for (field, declared) in graph.field_ids(node).filter(|(_, declared)| &*declared.name != "friend") {
            let value = graph.value(field).unwrap();
            lines.push(format!("{} = {value:?} at {}", declared.name, graph.field_revision(field)));
        }
    }
    lines
}

#[test]
fn random_sessions_are_replayed_bit_by_bit() {
    let (mut frames, mut callbacks) = (0, 0);
    for seed in 0..40 {
        let (bytes, recorded, calls) = random_recording(seed, (seed as usize % 5) * 13, 150, 37);
        let (mut replayer, mut graph) = Replayer::open(&bytes[..], native_types(1)).unwrap();
        assert_eq!(play(&mut replayer, &mut graph), None, "seed {seed}");
        graph.verify_invariants().unwrap();
        assert_eq!(fingerprint(&graph), fingerprint(&recorded), "seed {seed}");
        assert_eq!(replayer.truncated(), None);
        frames += replayer.position();
        callbacks += calls;
    }
    println!("{frames} frames, {callbacks} callbacks");
    assert!(frames == 6000 && callbacks > 3000, "{callbacks} callbacks: the test tests too little");
}

#[test]
fn seeking_leads_to_where_playing_leads() {
    for seed in 100..115 {
        let (bytes, recorded, _) = random_recording(seed, 20, 120, 3);
        let (mut replayer, mut graph) = Replayer::open(&bytes[..], native_types(1)).unwrap();
        let mut prints = vec![fingerprint(&graph)];
        while let Some(replayed) = replayer.step(&mut graph).unwrap() {
            assert_eq!(replayed.divergence, None, "seed {seed}");
            prints.push(fingerprint(&graph));
        }
        // Backwards, so that each starts at its keyframe; then on from there, where what a keyframe forgot would show.
        for frame in (0..=120).rev().step_by(4) {
            replayer.seek(&mut graph, frame).unwrap();
            assert_eq!(replayer.position(), frame);
            for on in 0..7 {
                let at = (frame + on).min(120);
                assert_eq!(fingerprint(&graph), prints[at as usize], "seed {seed}, frame {frame} and {on} on");
                if let Some(replayed) = replayer.step(&mut graph).unwrap() {
                    assert_eq!(replayed.divergence, None, "seed {seed}, frame {frame} and {on} on");
                }
            }
        }
        assert_eq!(play(&mut replayer, &mut graph), None, "seed {seed}");
        assert_eq!(fingerprint(&graph), fingerprint(&recorded));
        let error = replayer.seek(&mut graph, 121).unwrap_err();
        assert_eq!(error.to_string(), "there is no frame 121: the recording has 120");
    }
}
