//! Who comes when: late, again, and to an application that has no time.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use glam::Vec3;
use umbriel_displays::cluster::{CacheOptions, ClusterError, Follower, FollowerOptions, Host, Screen, Security};
use umbriel_fields::Graph;
use umbriel_scenegraph::new_graph;

use crate::support::{LONG, Seen, follow, free_port, host_options, join, options, serve, types};

#[test]
fn displays_join_an_application_that_is_too_slow_for_its_frame_rate() {
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let end = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let (graph, late) = (new_graph(), Instant::now());
        let mut host = Host::listen(&host_options(&endpoint)).unwrap();
        let end = &end;
        scope.spawn(move || {
            while !end.load(Ordering::Relaxed) {
                host.frame(&graph, false);
                host.wait_until(&graph, late);
                std::thread::sleep(Duration::from_millis(2));
            }
        });
        let mut follower = join(&endpoint, Security::Loopback, "left").unwrap();
        let started = Instant::now();
        while follower.replica().is_none() && started.elapsed() < Duration::from_secs(20) {
            follower.run(&mut Blind, Duration::from_millis(10)).unwrap();
        }
        end.store(true, Ordering::Relaxed);
        assert!(follower.replica().is_some());
    });
}

/// Draws nothing.
struct Blind;

impl Screen for Blind {
    type Error = ClusterError;
    fn draw(&mut self, _graph: &Graph, _frame: u64, _is_new: bool) -> Result<(), ClusterError> {
        Ok(())
    }
    fn show(&mut self, _frame: u64) -> Result<(), ClusterError> {
        Ok(())
    }
}

#[test]
fn displays_follow_come_late_and_outlive_the_application() {
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let (first_end, second_end) = (AtomicBool::new(false), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let mut early = join(&endpoint, Security::Loopback, "early").unwrap();
        let first = scope.spawn(|| serve(&endpoint, Security::Loopback, &first_end));
        let mut seen = Seen::default();
        assert!(follow(&mut early, &mut seen, |seen| seen.shown.len() > 5).unwrap());
        let mut late = join(&endpoint, Security::Loopback, "late").unwrap();
        let mut seen_late = Seen::default();
        let both = Instant::now();
        while seen_late.shown.len() < 5 && both.elapsed() < Duration::from_secs(10) {
            early.run(&mut seen, Duration::from_millis(2)).unwrap();
            late.run(&mut seen_late, Duration::from_millis(2)).unwrap();
        }
        assert!(seen_late.shown.len() >= 5);
        assert!(seen.shown.iter().chain(&seen_late.shown).all(|(frame, x)| *x == *frame as f32), "{:?}", seen.shown);
        // Its name is taken.
        let mut twin = join(&endpoint, Security::Loopback, "late").unwrap();
        let refused = follow(&mut twin, &mut Seen::default(), |_| false);
        assert!(matches!(&refused, Err(ClusterError::Refused(why)) if why.contains("`late`")), "{refused:?}");
        first_end.store(true, Ordering::Relaxed);
        let host = first.join().unwrap();
        assert_eq!((host.report().disagreed, host.report().refused > 0), (0, true));
        drop(host);
        // Another run of the application, from frame 1 on.
        let second = scope.spawn(|| serve(&endpoint, Security::Loopback, &second_end));
        let before = seen.shown.len();
        assert!(follow(&mut early, &mut seen, |seen| seen.shown.len() > before + 5).unwrap());
        assert!(seen.shown[before..].iter().all(|(frame, x)| *x == *frame as f32), "{:?}", &seen.shown[before..]);
        second_end.store(true, Ordering::Relaxed);
        second.join().unwrap();
    });
}

#[test]
fn long_values_are_fetched_once_for_all_starts() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("long values");
    let _ = std::fs::remove_dir_all(&folder);
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    let end = AtomicBool::new(false);
    let start = |folder: &std::path::Path| {
        let cache = Some(CacheOptions { folder: folder.into(), room: 1 << 30 });
        let mut display = Follower::connect(FollowerOptions { cache, ..options(&endpoint) }, "wall", types()).unwrap();
        assert!(follow(&mut display, &mut Seen::default(), |seen| seen.shown.len() > 2).unwrap());
        let graph = display.replica().unwrap().graph();
        let path = graph.nodes().find(|node| graph.get_named::<Arc<[Vec3]>>(*node, "key_value").is_ok()).unwrap();
        assert_eq!(graph.get_named::<Arc<[Vec3]>>(path, "key_value").unwrap().len(), LONG);
        (display.report().fetched, display.report().kept)
    };
    let files = || std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    std::thread::scope(|scope| {
        let host = scope.spawn(|| serve(&endpoint, Security::Loopback, &end));
        let first = start(&folder);
        let kept = files();
        let second = start(&folder);
        kept.iter().for_each(|file| std::fs::write(file, "garbage").unwrap());
        let damaged = start(&folder);
        let mended = start(&folder);
        // A folder that cannot be made.
        std::fs::write(folder.join("file"), "").unwrap();
        let without = [start(&folder.join("file")), start(&folder.join("file"))];
        end.store(true, Ordering::Relaxed);
        host.join().unwrap();
        let bytes = first.0;
        assert!(bytes >= 12 * LONG as u64, "{bytes}");
        assert_eq!((first.1, kept.len(), second), (0, 1, (0, bytes)));
        assert_eq!((damaged, mended, without), ((bytes, 0), (0, bytes), [(bytes, 0); 2]));
    });
}
