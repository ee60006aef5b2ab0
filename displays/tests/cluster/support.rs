//! An application that publishes frames, and a display that remembers them.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use glam::Vec3;
use umbriel_displays::cluster::{
    ClusterError, Event, Follower, FollowerOptions, Host, HostOptions, LEASE, Screen, Security, make_certificates,
};
use umbriel_displays::navigation::Input as Motion;
use umbriel_fields::Graph;
use umbriel_scenegraph::{new_graph, node_types};

/// Remembers where the world stood in each frame that was shown.
#[derive(Default)]
pub(crate) struct Seen {
    pub(crate) drawn: f32,
    pub(crate) shown: Vec<(u64, f32)>,
}

impl Screen for Seen {
    type Error = ClusterError;
    fn draw(&mut self, graph: &Graph, _frame: u64, _is_new: bool) -> Result<(), ClusterError> {
        let world = graph.find("turner").expect("the world has it");
        self.drawn = graph.get_named::<Vec3>(world, "translation").expect("a transform has it").x;
        Ok(())
    }
    fn show(&mut self, frame: u64) -> Result<(), ClusterError> {
        self.shown.push((frame, self.drawn));
        Ok(())
    }
}

pub(crate) fn join(endpoint: &str, security: Security, name: &str) -> Result<Follower, ClusterError> {
    Follower::connect(FollowerOptions { security, ..options(endpoint) }, name, types())
}

pub(crate) fn options(endpoint: &str) -> FollowerOptions {
    FollowerOptions {
        endpoint: endpoint.into(),
        security: Security::Loopback,
        lease: LEASE,
        ends_with_application: false,
        uses_memory: true,
        cache: None,
    }
}

pub(crate) fn types() -> Vec<umbriel_fields::NodeType> {
    node_types().into_iter().chain(umbriel_fields::builtin_types()).collect()
}

pub(crate) fn free_port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

pub(crate) fn certificates(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    assert_eq!(make_certificates(&folder).unwrap().len(), 7);
    assert!(make_certificates(&folder).is_err(), "certificates in use are not replaced");
    folder
}

/// Places in a long list of the world.
pub(crate) const LONG: usize = 10_000;

/// Publishes frames until told to end, the first transform at x = frame, scaled by the last turn of the wheel that a display told of.
pub(crate) fn serve(endpoint: &str, security: Security, end: &AtomicBool) -> Host {
    serve_with(endpoint, security, LEASE, end)
}

pub(crate) fn host_options(endpoint: &str) -> HostOptions {
    HostOptions {
        listen: endpoint.into(),
        security: Security::Loopback,
        timeout: Duration::from_millis(500),
        lease: LEASE,
        ahead: true,
        lines: None,
    }
}

/// On a busy machine greetings take long; for tests of something else than how long a line may be silent.
pub(crate) const LONG_LEASE: Duration = Duration::from_secs(20);

pub(crate) fn serve_with(endpoint: &str, security: Security, lease: Duration, end: &AtomicBool) -> Host {
    let mut graph = new_graph();
    let turner = graph.create("Transform").unwrap();
    graph.set_name(turner, "turner").unwrap();
    let path = graph.create("PositionInterpolator").unwrap();
    graph.set_named(path, "key_value", (0..LONG).map(|place| Vec3::splat(place as f32)).collect::<Vec<Vec3>>()).unwrap();
    let mut host = Host::listen(&HostOptions { security, lease, ..host_options(endpoint) }).unwrap();
    let mut frame = 0;
    while !end.load(Ordering::Relaxed) {
        frame += 1;
        for input in host.inputs() {
            let Event::Moved(motion) = input.event else { continue };
            motion.with(|motion| {
                let Motion::Wheel { notches, .. } = motion else { panic!("{motion:?}") };
                let scale = graph.get_named::<Vec3>(turner, "scale").unwrap().x;
                assert_eq!(notches, scale + 1.0, "each is taken once and in order");
                graph.set_named(turner, "scale", Vec3::splat(notches)).unwrap();
            });
        }
        graph.set_named(turner, "translation", Vec3::splat(frame as f32)).unwrap();
        host.frame(&graph, false);
        host.wait_until(&graph, Instant::now() + Duration::from_millis(5));
    }
    host
}

/// Follows until `done` or for half a minute.
pub(crate) fn follow(
    follower: &mut Follower,
    seen: &mut Seen,
    mut done: impl FnMut(&mut Seen) -> bool,
) -> Result<bool, ClusterError> {
    let started = Instant::now();
    while !done(seen) {
        if started.elapsed() > Duration::from_secs(30) {
            return Ok(false);
        }
        follower.run(seen, Duration::from_millis(10))?;
    }
    Ok(true)
}
