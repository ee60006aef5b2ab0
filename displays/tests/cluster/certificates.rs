//! Who is let in, and for what.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use umbriel_displays::cluster::{Follower, FollowerOptions, Guest, LEASE, Security};
use umbriel_scenegraph::new_graph;
use zenoh::Wait;

use crate::support::{LONG_LEASE, Seen, certificates, follow, free_port, join, options, serve, serve_with, types};

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
