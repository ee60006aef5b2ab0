//! What displays and other applications tell, whatever the line does.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use glam::Vec3;
use umbriel_displays::cluster::{Desk, Event, Guest, Host, LEASE, News, Proxy, Security};
use umbriel_displays::navigation::Input as Motion;
use umbriel_scenegraph::new_graph;

use crate::support::{Seen, follow, free_port, host_options, join, serve};

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
