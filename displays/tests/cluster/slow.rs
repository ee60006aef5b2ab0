//! A display that draws too slowly.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use glam::Vec3;
use umbriel_displays::cluster::{ClusterError, Host, HostOptions, Screen, Security};
use umbriel_fields::Graph;
use umbriel_scenegraph::new_graph;

use crate::support::{Seen, free_port, host_options, join};

/// Draws until the application has published so many more frames.
struct Slow<'a> {
    seen: Seen,
    published: &'a AtomicU64,
    frames: u64,
}

impl Screen for Slow<'_> {
    type Error = ClusterError;
    fn draw(&mut self, graph: &Graph, frame: u64, is_new: bool) -> Result<(), ClusterError> {
        let end = self.published.load(Ordering::Relaxed) + self.frames;
        let until = Instant::now() + Duration::from_secs(30);
        while self.published.load(Ordering::Relaxed) < end && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.seen.draw(graph, frame, is_new)
    }
    fn show(&mut self, frame: u64) -> Result<(), ClusterError> {
        self.seen.show(frame)
    }
}

/// Many more frames come while it draws one than any line holds.
#[test]
fn a_display_that_is_always_too_slow_shows_late_what_it_draws_and_fetches_the_world_once() {
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let (end, published) = (AtomicBool::new(false), AtomicU64::new(0));
    std::thread::scope(|scope| {
        let host = scope.spawn(|| {
            let mut graph = new_graph();
            let turner = graph.create("Transform").unwrap();
            graph.set_name(turner, "turner").unwrap();
            let mut host = Host::listen(&HostOptions { timeout: Duration::from_millis(20), ..host_options(&endpoint) }).unwrap();
            while !end.load(Ordering::Relaxed) {
                graph.set_named(turner, "translation", Vec3::splat(host.last_frame() as f32 + 1.0)).unwrap();
                host.frame(&graph, false);
                published.store(host.last_frame(), Ordering::Relaxed);
                host.wait_until(&graph, Instant::now() + Duration::from_millis(1));
            }
            host
        });
        let mut display = join(&endpoint, Security::Loopback, "wall").unwrap();
        let mut slow = Slow { seen: Seen::default(), published: &published, frames: 700 };
        let started = Instant::now();
        while slow.seen.shown.len() < 4 && started.elapsed() < Duration::from_secs(60) {
            display.run(&mut slow, Duration::from_millis(10)).unwrap();
        }
        end.store(true, Ordering::Relaxed);
        let report = host.join().unwrap().report();
        let shown = &slow.seen.shown;
        assert!(shown.len() >= 4 && shown.iter().all(|(frame, x)| *x == *frame as f32), "{shown:?}");
        assert_eq!((display.report().snapshots, report.dropped, report.disagreed), (1, 0, 0));
    });
}
