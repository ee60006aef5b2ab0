//! A display process.

use super::interrupt::Interrupt;
use super::join::SILENCE;
use super::screen::Canvas;
use super::{Failure, security};
use crate::cli;
use std::time::{Duration, Instant};
use umbriel_displays::cluster::{ClusterError, Follower, FollowerOptions};
use umbriel_fields::{NodeType, TypeRegistry, builtin_types};

/// How long a display that ends with its application waits for the first word of it.
const PATIENCE_S: u64 = 60;

/// Follows an application until it ends, or for ever.
pub(crate) fn display(args: &cli::Display) -> Result<usize, Failure> {
    let types: Vec<NodeType> = umbriel_scenegraph::node_types().into_iter().chain(builtin_types()).collect();
    let mut canvas = Canvas::new(&args.show, args.out.as_deref())?;
    let options = FollowerOptions {
        endpoint: args.connect.clone(),
        security: security(&args.link),
        lease: args.link.lease(),
        ends_with_application: args.once,
    };
    let mut follower = Follower::connect(options, &args.show, TypeRegistry::from(types))?;
    let started = Instant::now();
    let mut corrupt_after = args.corrupt;
    // What is corrupted shows in a frame that comes after it.
    let patience = Duration::from_millis(if args.corrupt.is_some() { 1 } else { 50 });
    let mut is_told = false;
    let interrupt = Interrupt::watch()?;
    while !follower.is_over() && !interrupt.came() {
        follower.run(&mut canvas, patience).inspect_err(|_| println!("{}", summary(&follower)))?;
        if !follower.found_application() && started.elapsed() > SILENCE && !std::mem::replace(&mut is_told, true) {
            tracing::warn!("no application answers at {} yet; waiting for it", args.connect);
        }
        if args.once && !follower.found_application() && started.elapsed() > Duration::from_secs(PATIENCE_S) {
            return Err(ClusterError::silent(&args.connect, PATIENCE_S, args.link.certificates.is_some()).into());
        }
        if corrupt_after.is_some_and(|frame| corrupt(&mut follower, frame)) {
            corrupt_after = None;
        }
    }
    println!("{}", summary(&follower));
    Ok(0)
}

fn summary(follower: &Follower) -> String {
    let report = follower.report();
    let differences: Vec<String> = report.differences.iter().map(|difference| format!("; differed: {difference}")).collect();
    format!(
        "shown={} snapshots={} longest_gap_ms={:.1} differences={}{}",
        report.shown,
        report.snapshots,
        report.longest_gap_ms,
        report.differences.len(),
        differences.concat()
    )
}

/// Changes a value behind the application's back, once a frame was drawn: the next one is the first that may be wrong.
fn corrupt(follower: &mut Follower, frame: u64) -> bool {
    let drawn = follower.drawn_frame();
    let Some(replica) = follower.replica_mut().filter(|replica| replica.frame() >= frame && replica.frame() == drawn) else {
        return false;
    };
    let graph = replica.graph_mut();
    // What the application writes in each frame is right again with the next one, so the one that was left alone for longest is taken.
    let fields = ["translation", "direction", "position", "lower_left"];
    let places = graph.nodes().flat_map(|node| fields.map(|field| (node, field)));
    let places = places.filter(|(node, field)| graph.get_named::<glam::Vec3>(*node, field).is_ok());
    let victim = places.min_by_key(|(node, _)| graph.node_revision(*node));
    victim.is_some_and(|(node, field)| graph.set_named(node, field, glam::Vec3::splat(0.25)).is_ok())
}
