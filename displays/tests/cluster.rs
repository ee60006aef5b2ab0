//! An application and displays in one process, over real links: joining, security, events, restarts.
#![cfg(feature = "cluster")]

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use glam::Vec3;
use umbriel_displays::cluster::{
    CacheOptions, ClusterError, Desk, Event, Follower, FollowerOptions, Guest, Host, HostOptions, LEASE, News, Proxy, Screen,
    Security, make_certificates,
};
use umbriel_displays::navigation::Input as Motion;
use umbriel_fields::Graph;
use umbriel_scenegraph::{new_graph, node_types};
use zenoh::Wait;

/// Remembers where the world stood in each frame that was shown.
#[derive(Default)]
struct Seen {
    drawn: f32,
    shown: Vec<(u64, f32)>,
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

fn join(endpoint: &str, security: Security, name: &str) -> Result<Follower, ClusterError> {
    Follower::connect(FollowerOptions { security, ..options(endpoint) }, name, types())
}

fn options(endpoint: &str) -> FollowerOptions {
    FollowerOptions {
        endpoint: endpoint.into(),
        security: Security::Loopback,
        lease: LEASE,
        ends_with_application: false,
        uses_memory: true,
        cache: None,
    }
}

fn types() -> Vec<umbriel_fields::NodeType> {
    node_types().into_iter().chain(umbriel_fields::builtin_types()).collect()
}

fn free_port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

fn certificates(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    assert_eq!(make_certificates(&folder).unwrap().len(), 7);
    assert!(make_certificates(&folder).is_err(), "certificates in use are not replaced");
    folder
}

/// Places in a long list of the world.
const LONG: usize = 10_000;

/// Publishes frames until told to end, the first transform at x = frame, scaled by the last turn of the wheel that a display told of.
fn serve(endpoint: &str, security: Security, end: &AtomicBool) -> Host {
    serve_with(endpoint, security, LEASE, end)
}

fn host_options(endpoint: &str) -> HostOptions {
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
const LONG_LEASE: Duration = Duration::from_secs(20);

fn serve_with(endpoint: &str, security: Security, lease: Duration, end: &AtomicBool) -> Host {
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
fn follow(follower: &mut Follower, seen: &mut Seen, mut done: impl FnMut(&mut Seen) -> bool) -> Result<bool, ClusterError> {
    let started = Instant::now();
    while !done(seen) {
        if started.elapsed() > Duration::from_secs(30) {
            return Ok(false);
        }
        follower.run(seen, Duration::from_millis(10))?;
    }
    Ok(true)
}

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

/// Its line breaks for longer than it may be silent, and is back before it is given up.
#[test]
fn a_guest_that_begins_anew_is_heard_from_its_first_message_on() {
    const MESSAGES: u64 = 5;
    let port = free_port();
    let proxy = Proxy::start(std::net::SocketAddr::from(([127, 0, 0, 1], port))).unwrap();
    let (end, there) = (AtomicBool::new(false), [const { AtomicU64::new(0) }; 2]);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut graph = new_graph();
            let mut host = Host::listen(&host_options(&format!("tcp/127.0.0.1:{port}"))).unwrap();
            let mut desk = Desk::open(&host, "host").unwrap();
            while !end.load(Ordering::Relaxed) {
                desk.begin(&mut graph);
                desk.publish(&host, &graph);
                host.frame(&graph, false);
                desk.welcome(&mut host, &graph);
                for (run, count) in there.iter().enumerate() {
                    let found = (0..MESSAGES).filter(|number| graph.find(&format!("{run} {number}")).is_some()).count();
                    count.store(found as u64, Ordering::Relaxed);
                }
                host.wait_until(&graph, Instant::now() + Duration::from_millis(5));
            }
        });
        let endpoint = format!("tcp/127.0.0.1:{}", proxy.port());
        let mut guest = Guest::connect(&endpoint, &Security::Loopback, LEASE, "visitor", false, new_graph).unwrap();
        let mut follow_until = |run: usize, expected: [u64; 2]| {
            let (mut world, started) = (None, Instant::now());
            let counts = || there.each_ref().map(|count| count.load(Ordering::Relaxed));
            while (world.is_none() || counts() != expected) && started.elapsed() < Duration::from_secs(20) {
                match (guest.next(Duration::from_millis(10)).unwrap(), &mut world) {
                    (News::Begins, _) => {
                        let (mut graph, whose) = guest.enter();
                        for number in 0..MESSAGES {
                            let node = graph.create("Transform").unwrap();
                            graph.set_name(node, &format!("{run} {number}")).unwrap();
                            guest.tell(&mut graph, &whose, &[]);
                        }
                        world = Some((graph, whose));
                    }
                    (News::Frame(_), Some((graph, whose))) => guest.follow(graph, whose),
                    _ => {}
                }
            }
            counts()
        };
        let first = follow_until(0, [MESSAGES, 0]);
        proxy.cut(LEASE + Duration::from_millis(500));
        let second = follow_until(1, [0, MESSAGES]);
        end.store(true, Ordering::Relaxed);
        assert_eq!((first, second), ([MESSAGES, 0], [0, MESSAGES]));
    });
}

#[test]
fn only_certificates_of_the_same_authority_are_let_in() {
    let (ours, foreign) = (certificates("ours"), certificates("foreign"));
    let port = free_port();
    let endpoint = format!("tls/127.0.0.1:{port}");
    let end = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let host = scope.spawn(|| serve_with(&endpoint, Security::Mutual(ours.clone()), LONG_LEASE, &end));
        let security = Security::Mutual(ours.clone());
        let mut friend =
            Follower::connect(FollowerOptions { security, lease: LONG_LEASE, ..options(&endpoint) }, "friend", types()).unwrap();
        let mut seen = Seen::default();
        let is_in = follow(&mut friend, &mut seen, |seen| seen.shown.len() > 3).unwrap();
        let mut strangers = [
            join(&endpoint, Security::Mutual(foreign), "foreign").unwrap(),
            join(&format!("tcp/127.0.0.1:{port}"), Security::Loopback, "plain").unwrap(),
        ];
        for stranger in &mut strangers {
            stranger.run(&mut Seen::default(), Duration::from_millis(1500)).unwrap();
            assert!(!stranger.found_application());
        }
        end.store(true, Ordering::Relaxed);
        host.join().unwrap();
        assert!(is_in, "a display with a certificate must be let in");
    });
}

#[test]
fn events_of_displays_reach_the_application_once_and_in_order() {
    let port = free_port();
    let proxy = Proxy::start(std::net::SocketAddr::from(([127, 0, 0, 1], port))).unwrap();
    let end = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let host = scope.spawn(|| serve(&format!("tcp/127.0.0.1:{port}"), Security::Loopback, &end));
        let mut display = join(&format!("tcp/127.0.0.1:{}", proxy.port()), Security::Loopback, "wall").unwrap();
        let mut seen = Seen::default();
        assert!(follow(&mut display, &mut seen, |seen| seen.shown.len() > 3).unwrap());
        let frustum = umbriel_scene::Frustum::symmetric(1.0, 1.0, 0.1);
        let view = &umbriel_scene::View { name: String::new(), view_from_world: glam::Mat4::IDENTITY, frustum, size: [10, 10] };
        // The line breaks while they are told, for longer than it may be silent.
        for number in 0..60 {
            if number == 20 {
                proxy.cut(LEASE + Duration::from_millis(500));
            }
            display.tell(Event::Moved(Motion::Wheel { notches: (number + 2) as f32, view }.into()));
            display.run(&mut seen, Duration::from_millis(5)).unwrap();
        }
        let mut scale = 0.0;
        let started = Instant::now();
        while scale < 61.0 && started.elapsed() < Duration::from_secs(10) {
            display.run(&mut seen, Duration::from_millis(10)).unwrap();
            let Some(replica) = display.replica_mut() else { continue };
            let node = replica.graph().find("turner").unwrap();
            scale = replica.graph().get_named::<Vec3>(node, "scale").unwrap().x;
        }
        end.store(true, Ordering::Relaxed);
        host.join().unwrap();
        assert_eq!(scale, 61.0);
    });
}

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

/// A program of somebody else with a certificate of ours.
fn raw_session(endpoint: &str, folder: &std::path::Path, role: &str) -> zenoh::Session {
    let path = |name: String| format!("{:?}", folder.join(name));
    let rows = [
        ("mode", "\"peer\"".to_string()),
        ("scouting/multicast/enabled", "false".into()),
        ("listen/endpoints", "[]".into()),
        ("connect/endpoints", format!("[{endpoint:?}]")),
        (
            "transport/link/tls",
            format!(
                "{{ root_ca_certificate: {}, connect_certificate: {}, connect_private_key: {}, enable_mtls: true, verify_name_on_connect: false }}",
                path("authority.pem".into()),
                path(format!("{role}.pem")),
                path(format!("{role}.key.pem"))
            ),
        ),
    ];
    let mut config = zenoh::Config::default();
    rows.iter().for_each(|(key, value)| config.insert_json5(key, value).unwrap());
    zenoh::open(config).wait().unwrap()
}

#[test]
fn a_certificate_is_good_for_one_part_only() {
    let folder = certificates("roles");
    // The files of a display under a guest's names, and the other way round.
    let swapped = folder.join("swapped");
    std::fs::create_dir_all(&swapped).unwrap();
    std::fs::copy(folder.join("authority.pem"), swapped.join("authority.pem")).unwrap();
    for (from, to) in [("display", "guest"), ("guest", "display")] {
        for kind in ["pem", "key.pem"] {
            std::fs::copy(folder.join(format!("{from}.{kind}")), swapped.join(format!("{to}.{kind}"))).unwrap();
        }
    }
    let endpoint = format!("tls/127.0.0.1:{}", free_port());
    let told = join(&endpoint, Security::Mutual(swapped.clone()), "wall").map(drop);
    assert!(told.as_ref().is_err_and(|e| e.to_string().contains("certificate of `guest`")), "{told:?}");
    let told = Guest::connect(&endpoint, &Security::Mutual(swapped), LEASE, "visitor", false, new_graph).map(drop);
    assert!(told.as_ref().is_err_and(|e| e.to_string().contains("certificate of `display`")), "{told:?}");
    // Who leaves that check out of the program is not let in all the same.
    let end = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let host = scope.spawn(|| serve(&endpoint, Security::Mutual(folder.clone()), &end));
        let mut found = [("display", false), ("guest", false)];
        for (role, found) in &mut found {
            let session = raw_session(&endpoint, &folder, role);
            let started = Instant::now();
            // The application is seen by both, so that the line stands.
            while !*found && started.elapsed() < Duration::from_secs(5) {
                let tokens = session.liveliness().get("umbriel/application").wait().unwrap();
                *found = tokens.recv_timeout(Duration::from_millis(200)).is_ok_and(|token| token.is_some());
            }
            let asked = if *role == "display" { "umbriel/guests/snapshot" } else { "umbriel/snapshot" };
            let answers = session.get(asked).timeout(Duration::from_millis(700)).wait().unwrap();
            let answer = answers.recv().ok().map(|answer| answer.into_result().map(|_| ()).map_err(|_| ()));
            assert_ne!(answer, Some(Ok(())), "{role}");
        }
        end.store(true, Ordering::Relaxed);
        host.join().unwrap();
        assert_eq!(found, [("display", true), ("guest", true)]);
    });
}
