//! Frames out of the application's memory, and the short line.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use umbriel_displays::cluster::{Follower, FollowerOptions, LEASE, Proxy, Security};

use crate::support::{Seen, follow, free_port, join, options, serve, types};

#[test]
fn frames_come_out_of_memory_only_while_the_line_stands() {
    let port = free_port();
    let proxy = Proxy::start(std::net::SocketAddr::from(([127, 0, 0, 1], port))).unwrap();
    let end = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let host = scope.spawn(|| serve(&format!("tcp/127.0.0.1:{port}"), Security::Loopback, &end));
        let through = |uses_memory: bool, name: &str| {
            let options = FollowerOptions { uses_memory, ..options(&format!("tcp/127.0.0.1:{}", proxy.port())) };
            Follower::connect(options, name, types()).unwrap()
        };
        let (mut near, mut far) = (through(true, "near"), through(false, "far"));
        let (mut seen, mut seen_far) = (Seen::default(), Seen::default());
        let mut both = |lasts: Duration| {
            let started = Instant::now();
            while started.elapsed() < lasts {
                near.run(&mut seen, Duration::from_millis(2)).unwrap();
                far.run(&mut seen_far, Duration::from_millis(2)).unwrap();
            }
            let replica = |display: &Follower| display.replica().map_or(0, |replica| replica.frame());
            let ways = [near.reads_memory(), near.is_beside(), far.reads_memory(), far.is_beside()];
            ([replica(&near), replica(&far)], ways, [seen.shown.len(), seen_far.shown.len()])
        };
        let mut found = both(Duration::from_millis(100));
        let started = Instant::now();
        while found.2.iter().any(|shown| *shown < 5) && started.elapsed() < Duration::from_secs(10) {
            found = both(Duration::from_millis(50));
        }
        proxy.cut(LEASE - Duration::from_millis(200));
        // What was on its way.
        let before = both(Duration::from_millis(50)).0;
        let during = both(Duration::from_millis(600)).0;
        let after = both(Duration::from_millis(900));
        end.store(true, Ordering::Relaxed);
        let host = host.join().unwrap();
        let is_here = cfg!(target_os = "linux");
        assert_eq!(found.1, [is_here, is_here, false, false]);
        assert_eq!(before, during, "the application went on without them, to frame {}", host.last_frame());
        assert!(after.0.iter().all(|frame| *frame > during[0]), "{after:?}");
        assert_eq!(after.1, found.1);
        assert!(seen.shown.iter().chain(&seen_far.shown).all(|(frame, x)| *x == *frame as f32));
        assert_eq!(host.report().disagreed, 0);
    });
}

/// What strangers say on the short line, before any display is there.
#[cfg(target_os = "linux")]
#[test]
fn the_short_line_is_for_who_knows_the_application() {
    use std::io::{Read, Write};
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};

    let (port, taken) = (free_port(), free_port());
    let name = |port: u16| SocketAddr::from_abstract_name(format!("umbriel/{port}")).unwrap();
    let squatter = UnixListener::bind_addr(&name(taken)).unwrap();
    let end = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let hosts = [port, taken].map(|port| {
            let end = &end;
            scope.spawn(move || serve(&format!("tcp/127.0.0.1:{port}"), Security::Loopback, end))
        });
        let [mut display, mut other] =
            [port, taken].map(|port| join(&format!("tcp/127.0.0.1:{port}"), Security::Loopback, "wall").unwrap());
        let (mut seen, mut seen_other) = (Seen::default(), Seen::default());
        let is_in = follow(&mut display, &mut seen, |seen| seen.shown.len() > 5).unwrap();
        let is_in_too = follow(&mut other, &mut seen_other, |seen| seen.shown.len() > 5).unwrap();
        let ways = [display.reads_memory(), display.is_beside(), other.reads_memory(), other.is_beside()];
        // A hello with a token that is none, being ready without a hello, and no word at all.
        let rows: [&[u8]; 3] = [&[2, 0, 1, 7, 7], &[1, 0, 4, 0], &[0, 0, 99]];
        let answers = rows.map(|row| {
            let mut stranger = UnixStream::connect_addr(&name(port)).unwrap();
            stranger.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
            stranger.write_all(row).unwrap();
            stranger.read(&mut [0; 100]).ok()
        });
        let before = seen.shown.len();
        let goes_on = follow(&mut display, &mut seen, |seen| seen.shown.len() > before + 5).unwrap();
        end.store(true, Ordering::Relaxed);
        let reports = hosts.map(|host| host.join().unwrap().report());
        // Where the name is another's, frames are told of over the network.
        assert_eq!(ways, [true, true, true, false]);
        assert!(is_in && is_in_too && goes_on);
        assert_eq!(answers, [Some(0); 3], "nothing is told to them, and they are shown out");
        assert!(reports.iter().all(|report| report.disagreed == 0));
    });
    drop(squatter);
}
