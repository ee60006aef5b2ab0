//! Several applications in one world: processes that make, lock, refuse, die and leave.

use crate::support::foreign::session_of;
use crate::support::process::{PATIENCE, Process, prepare};
use crate::support::until;
use std::process::Command;
use zenoh::Wait;

const HOST: &str = r#"
world.add(transform(#{ name: "ball" }, []));
let clock = make("TimeSensor", #{ name: "clock", cycle_interval: 1.0, loop: true });
let count = make("Group", #{ name: "count" }); count.add_field("n", 0);
on_frame(|t, dt| { count.n += 1; if count.n % 20 == 0 {
    let names = []; for child in world.children { names.push(child.name); }
    let box = find("second_box");
    print(`world ${names} ball ${find("ball").translation.x}${if box == () { "" } else { ` box ${box.translation.x}` }}`);
} });"#;

/// Locks the ball and holds it until it is killed.
const FIRST: &str = r#"
on_leave("keep");
world.add(transform(#{ name: "first_box" }, []));
let ball = find("ball");
lock(ball, |granted, why| { print(`first: ${granted}`); if granted { ball.translation = vec3(1, 0, 0); } });"#;

/// Wants the ball too, and may neither write it nor what the first one made.
const SECOND: &str = r#"
let box = transform(#{ name: "second_box" }, []);
world.add(box);
let path = make("PositionInterpolator", #{ key: [0.0, 1.0], key_value: [vec3(3, 0, 0), vec3(3, 0, 0)] });
route(find("clock"), "fraction_changed", path, "set_fraction");
route(path, "value_changed", box, "translation");
let ball = find("ball");
let state = make("Group", #{ name: "state" }); state.add_field("told", false); state.add_field("waits", false); state.add_field("has", false);
let other = find("first_box");
try { other.translation = vec3(0, 1, 0); } catch (e) { print(`not written: ${e}`); }
try { ball.children = [ball]; } catch (e) { print(`not put: ${e}`); }
on_frame(|t, dt| {
    if state.has || state.waits { return; }
    state.waits = true;
    lock(ball, |granted, why| {
        state.waits = false; state.has = granted;
        if granted { print("second has it"); ball.translation = vec3(2, 0, 0); } else if !state.told { state.told = true; print(`second: ${why}`); }
    });
});"#;

#[test]
fn applications_share_a_world_and_locks_of_the_dead_expire() {
    let (folder, address) = prepare("applications", &[("host.rhai", HOST), ("first.rhai", FIRST), ("second.rhai", SECOND)]);
    let path = |file: &str| folder.join(file).to_string_lossy().into_owned();
    // Who is dead is known by its line, which the system closes; a busy machine alone gives nobody up.
    let [lease, most] = ["--lease-ms", "60000"];
    let host = Process::start(&["serve", &path("host.rhai"), "--listen", &address, lease, most]);
    let joins = |script: &str| Process::start(&["join", &path(script), "--connect", &address, lease, most]);
    let mut first = joins("first.rhai");
    first.says("first: true");
    host.says(r#"world ["ball", "first_box"] ball 1"#);
    let mut second = joins("second.rhai");
    second.says("not written: `translation` of `first_box` (Transform): it belongs to `first`");
    second.says("not put: `children` of `ball` (Transform): `first` has locked it");
    second.says("second: `first` has locked it");
    // Its name is taken.
    let mut twin = joins("second.rhai");
    first.child.kill().unwrap();
    second.says("second has it");
    host.says(r#"world ["ball", "first_box", "second_box"] ball 2.0 box 3.0"#);
    assert_eq!(twin.ends(), 1, "{}", twin.said());
    twin.says("the host refuses this application: there is an application `second` already");
    // What the second one made goes, what it did to others stays.
    let interrupted = Command::new("kill").args(["-INT", &second.child.id().to_string()]).status().unwrap();
    assert!(interrupted.success());
    assert_eq!(second.ends(), 0, "{}", second.said());
    host.says("`second` has left the world");
    let before = host.said().len();
    let after = until(PATIENCE, || host.said()[before..].contains(r#"world ["ball", "first_box"] ball 2"#).then_some(()));
    assert!(after.is_some(), "{}", host.said());
}

/// A world with one display.
const ROOM: &str = r#"
world.add(shape(make("Sphere")));
let visitor = make("User", #{ position: vec3(0, 1.7, 2) });
let front = make("Screen", #{ lower_left: vec3(-2, 0, 0), lower_right: vec3(2, 0, 0), upper_left: vec3(-2, 2.5, 0) });
make("Display", #{ name: "wall", user: visitor, screens: [front], size: vec2(64, 40) });"#;

#[test]
fn bad_input_is_named() {
    let (folder, address) = prepare("bad", &[("room.rhai", ROOM), ("authority.pem", "garbage")]);
    let folder = folder.to_string_lossy().into_owned();
    let room = format!("{folder}/room.rhai");
    let host = Process::start(&["serve", &room, "--listen", &address]);
    host.says("is served at");
    let rows: &[(&[&str], &str)] = &[
        (&["serve", "nowhere.rhai"], "cannot read nowhere.rhai: No such file or directory"),
        (&["serve", &room, "--listen", &address], &format!("cannot listen on {address}: Address already in use")),
        (&["serve", &room, "--listen", "tcp/0.0.0.0:0"], "can be reached from other machines without encryption"),
        (&["serve", &room, "--listen", "tls/127.0.0.1:1"], "tls needs --certificates"),
        (&["serve", &room, "--listen", "tls/127.0.0.1:1", "--certificates", "nowhere"], "nowhere/authority.pem: No such file"),
        (&["serve", &room, "--listen", "tls/127.0.0.1:1", "--certificates", &folder], "authority.pem: this is no certificate"),
        (&["join", "nowhere.rhai"], "cannot read nowhere.rhai"),
        (&["join", &room, "--connect", "tcp/10.0.0.1:7447"], "can be reached from other machines without encryption"),
        (
            &["display", "--headless", "--once", "--show", "wal", "--connect", &address],
            "there is no display or viewpoint `wal`; did you mean `wall`?; there are: wall",
        ),
    ];
    for (args, expected) in rows {
        let mut process = Process::start(args);
        assert_eq!(process.ends(), 1, "{args:?}: {}", process.said());
        process.says(expected);
    }
    let lonely = Process::start(&["join", &room, "--connect", "tcp/127.0.0.1:9"]);
    lonely.says("no application answers at tcp/127.0.0.1:9 yet; waiting for it");
}

#[test]
fn strangers_are_refused_and_told_of() {
    let (folder, address) = prepare("strangers", &[("room.rhai", ROOM), ("guest.rhai", "world.add(group([]));")]);
    let [ours, theirs] = ["ours", "theirs"].map(|name| folder.join(name).to_string_lossy().into_owned());
    let [room, guest] = ["room.rhai", "guest.rhai"].map(|name| folder.join(name).to_string_lossy().into_owned());
    for made in [&ours, &theirs] {
        let _ = std::fs::remove_dir_all(made);
        assert_eq!(Process::start(&["certs", made]).ends(), 0);
    }
    let address = address.replace("tcp/", "tls/");
    let host = Process::start(&["serve", &room, "--listen", &address, "--certificates", &ours]);
    host.says("is served at");
    let friend = Process::start(&["join", &guest, "--name", "friend", "--connect", &address, "--certificates", &ours]);
    friend.says("is in the world of `room`");
    // The system tells whom it was from, on Linux.
    let refused = match cfg!(target_os = "linux") {
        true => "a connection from 127.0.0.1 was refused: it does not know the authority of our certificate",
        false => "a connection was refused: it does not know the authority of our certificate",
    };
    let stranger = Process::start(&["join", &guest, "--name", "stranger", "--connect", &address, "--certificates", &theirs]);
    host.says(refused);
    let mut plain = std::net::TcpStream::connect(address.trim_start_matches("tls/")).unwrap();
    std::io::Write::write_all(&mut plain, b"GET / HTTP/1.0\r\n\r\n").unwrap();
    host.says("was refused: it does not speak TLS");
    assert!(!stranger.said().contains("is in the world"), "{}", stranger.said());
    // Who has a certificate of ours, but for another part.
    let display = session_of("display", &folder.join("ours"), &address);
    let asked = display.get("umbriel/guests/snapshot").timeout(std::time::Duration::from_secs(1)).wait().unwrap();
    host.says("a peer at 127.0.0.1:");
    host.says(" wants to work on the world, which its certificate is not for, and is refused (query, umbriel/guests/snapshot)");
    drop(asked);
}
