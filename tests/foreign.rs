//! Programs of others at the other end: whatever they say, displays and applications go on, and say what it was and from whom.

use crate::support::foreign::{Application, session};
use crate::support::process::{PATIENCE, Process, prepare};
use crate::support::until;
use std::io::Write;
use std::process::Command;
use std::time::Duration;
use umbriel_displays::cluster::number_of_process;
use umbriel_fields::replica::Publisher;
use umbriel_fields::{Field, Graph, NodeType};
use xxhash_rust::xxh3::xxh3_64_with_seed;
use zenoh::Wait;

/// A world with one display.
const ROOM: &str = r#"
world.add(shape(make("Sphere")));
let visitor = make("User", #{ name: "visitor", position: vec3(0, 1.7, 2) });
let front = make("Screen", #{ lower_left: vec3(-2, 0, 0), lower_right: vec3(2, 0, 0), upper_left: vec3(-2, 2.5, 0) });
make("Display", #{ name: "wall", user: visitor, screens: [front], size: vec2(32, 20) });"#;

/// Has a packet that was changed pass for what was sent.
fn with_checksum(mut packet: Vec<u8>) -> Vec<u8> {
    let version = u16::from_le_bytes([packet[4], packet[5]]);
    let checksum = xxh3_64_with_seed(&packet[14..], version as u64);
    packet[6..14].copy_from_slice(&checksum.to_le_bytes());
    packet
}

fn with(mut packet: Vec<u8>, place: usize, bytes: &[u8]) -> Vec<u8> {
    packet[place..place + bytes.len()].copy_from_slice(bytes);
    packet
}

fn place_of(packet: &[u8], text: &str) -> usize {
    packet.windows(text.len()).position(|window| window == text.as_bytes()).unwrap()
}

/// The next frame of another world, in which transforms are something else.
fn of_another_release(frame: u64) -> Vec<u8> {
    let mut graph = Graph::new(vec![NodeType::new("Group", "").field(Field::new("children", 1i32))]);
    let mut publisher = Publisher::new();
    while publisher.last_frame() + 1 < frame {
        publisher.frame(&graph);
    }
    graph.create("Group").unwrap();
    publisher.frame(&graph)
}

/// A frame is lost, and who asks for the world then gets this.
fn answers(application: &mut Application, answer: Vec<u8>) {
    *application.wrong_answer.lock().unwrap() = Some(answer);
    application.frame(|_| Vec::new());
}

/// What is wrong, how it is made, what the display says, and whether it must fetch the world.
type Row = (&'static str, fn(&mut Application), &'static str, bool);

const OF_AN_APPLICATION: &[Row] = &[
    (
        "a bit",
        |a| a.frame(|p| with(p, 20, &[!0])),
        "a frame from ADDRESS cannot be used: the packet is damaged: its checksum is wrong; the last frame here is ",
        true,
    ),
    ("cut short", |a| a.frame(|p| p[..p.len() / 2].to_vec()), "the packet is damaged: its checksum is wrong", true),
    ("empty", |a| a.frame(|_| Vec::new()), "a frame from ADDRESS cannot be used: this is no packet of a frame", true),
    ("nothing at all", |a| a.says("umbriel/frame", Vec::new()), "this is no packet of a frame", false),
    ("a huge length", |a| a.frame(|p| with_checksum(with(p, 14, &[255; 4]))), "the packet is damaged: it is cut off", true),
    (
        "another version",
        |a| a.frame(|p| with(p, 4, &[99, 0])),
        "the packet has version 99, this program reads version 3: both ends must be of one release",
        true,
    ),
    (
        "a field type",
        |a| {
            a.frame(|p| {
                let at = place_of(&p, "vec3");
                with_checksum(with(p, at, b"vec9"))
            })
        },
        "the packet is damaged: there is no field type `vec9`",
        true,
    ),
    (
        "a field of another type",
        |a| {
            let other = of_another_release(a.last_frame() + 1);
            a.frame(|_| other)
        },
        " from ADDRESS cannot be used: field `children` of node type `Group` is a i32 in the application and a ",
        true,
    ),
    (
        "a node type",
        |a| {
            a.graph().types().register(NodeType::new("Whirligig", "").field(Field::new("speed", 1.0f32))).unwrap();
            a.graph().create("Whirligig").unwrap();
        },
        "the application's node type `Whirligig` is not known here: its nodes are held, and nothing is drawn for them",
        false,
    ),
    (
        "garbage for the world",
        |a| answers(a, vec![7; 1000]),
        "the world from ADDRESS cannot be used: this is no packet of a frame",
        true,
    ),
    (
        "nothing for the world",
        |a| answers(a, Vec::new()),
        "the world from ADDRESS cannot be used: this is no packet of a frame",
        true,
    ),
    (
        "half of the world",
        |a| {
            let half = a.snapshot();
            answers(a, half[half.len() / 2..].to_vec())
        },
        "the world from ADDRESS cannot be used: ",
        true,
    ),
    (
        "a frame for the world",
        |a| {
            let mut frame = of_another_release(3);
            frame.extend([0; 8]);
            frame.extend([255; 8]);
            answers(a, frame)
        },
        "the world from ADDRESS cannot be used: ",
        true,
    ),
    (
        "a release",
        |a| a.says("umbriel/release", vec![255; 30]),
        "a release from ADDRESS cannot be used: a message is damaged: ",
        false,
    ),
    ("a release with more behind it", |a| a.says("umbriel/release", vec![0; 300]), "295 bytes are left over", false),
    ("a release of a frame that never was", |a| a.releases(1_700_000_000_000_000, u64::MAX, &[], false), "", false),
    ("a release of a run that never was", |a| a.releases(u64::MAX, 1, &[], false), "", true),
    ("where a frame lies", |a| a.says("umbriel/here", vec![255; 9]), "where a frame lies: a message is damaged: ", false),
];

#[test]
fn a_display_survives_whatever_an_application_says() {
    let (folder, address) = prepare("foreign application", &[("room.rhai", ROOM)]);
    let mut application = Application::listen(&address, &folder.join("room.rhai"));
    let mut display =
        Process::start(&["display", "--headless", "--once", "--cache", "none", "--show", "wall", "--connect", &address]);
    application.goes_on(false);
    assert_eq!(application.asked(), 1, "the world is fetched once at the start");
    for (what, does, says, fetches) in OF_AN_APPLICATION {
        let (asked, said) = (application.asked(), display.said().len());
        does(&mut application);
        application.goes_on(false);
        let says = says.replace("ADDRESS", &address);
        let found = until(PATIENCE, || display.said()[said..].contains(&says).then_some(()));
        assert!(found.is_some(), "{what}: it did not say `{says}`, but:\n{}", &display.said()[said..]);
        assert_eq!(application.asked() > asked, *fetches, "{what}: asked {} times", application.asked() - asked);
    }
    application.goes_on(true);
    assert_eq!(display.ends(), 0, "{}", display.said());
    display.says("differences=0");
}

/// Who speaks to an application, and what it knows of it.
struct Stranger {
    session: zenoh::Session,
    number: u64,
    epoch: u64,
}

impl Stranger {
    fn says(&self, subject: &str, bytes: Vec<u8>) {
        self.session.put(subject.to_string(), bytes).wait().unwrap();
    }

    /// Asks, and waits for the answer.
    fn asks(&self, subject: &str, bytes: Vec<u8>) -> Result<Vec<u8>, String> {
        let answers = self.session.get(subject).payload(bytes).timeout(PATIENCE).wait().unwrap();
        match answers.recv_timeout(PATIENCE).unwrap().unwrap().into_result() {
            Ok(sample) => Ok(sample.payload().to_bytes().into_owned()),
            Err(error) => Err(String::from_utf8_lossy(&error.payload().to_bytes()).into_owned()),
        }
    }

    /// Says that a display is ready.
    fn ready(&self, display: u64, name: &str, frame: u64) {
        self.says("umbriel/ready", postcard::to_stdvec(&(display, name, self.epoch, frame, 1u64, 1u64)).unwrap());
    }

    fn joins(&self, protocol: u16, name: &str) -> Result<Vec<u8>, String> {
        self.asks("umbriel/snapshot", postcard::to_stdvec(&(protocol, self.number, name)).unwrap())
    }
}

/// What both ends speak.
const PROTOCOL: u16 = 7;

/// What is said, and what the application says of it. `HERE` is where the stranger is.
type Said = (fn(&Stranger), &'static str);

const TO_AN_APPLICATION: &[Said] = &[
    (|s| s.says("umbriel/ready", vec![255; 5]), "a report, 5 bytes, at frame "),
    (|s| s.says("umbriel/ready", vec![255; 6]), "; connected, and no display that has joined: HERE"),
    (|s| s.says("umbriel/ready", Vec::new()), "a report, 0 bytes, at frame "),
    (|s| s.ready(1, "nobody", 3), "somebody who is no display says that `nobody` is ready with frame 3; it is not listened to"),
    (
        |s| s.ready(s.number, "ghost", 1 << 40),
        "display `ghost` at HERE says that it is ready with frame 1099511627776, and the last one is ",
    ),
    (
        |s| s.ready(s.number, "wall", 3),
        "another process at HERE says that it is display `wall`, ready with frame 3; it is not listened to",
    ),
    (|s| s.says("umbriel/input", vec![255; 4]), "what happened at a display, 4 bytes, at frame "),
    (|s| s.says("umbriel/guests/deeds", vec![255; 3]), "what an application did, 3 bytes: a message is damaged: "),
    (|s| drop(s.asks("umbriel/snapshot", vec![255; 3]).unwrap_err()), "a display is refused: a message is damaged: "),
    (
        |s| drop(s.joins(4, "old").unwrap_err()),
        "a display at HERE is refused: it speaks version 4 of the protocol, the application speaks 7 (display `old`)",
    ),
    (|s| drop(s.joins(PROTOCOL, "wall").unwrap_err()), "a display at HERE is refused: there is a display `wall` already"),
    (|s| drop(s.asks("umbriel/guests/snapshot", vec![255; 3]).unwrap_err()), "an application is refused: a message is damaged: "),
    (
        |s| {
            drop(
                s.asks("umbriel/guests/snapshot", postcard::to_stdvec(&(PROTOCOL, s.number, 0u64, "room", false)).unwrap())
                    .unwrap_err(),
            )
        },
        "an application at HERE is refused: there is an application `room` already",
    ),
    (|s| drop(s.asks("umbriel/bulk/nonsense", Vec::new()).unwrap_err()), ""),
    // What only an application says: whoever says it to displays, they hear their own.
    (|s| ["frame", "release", "here"].iter().for_each(|word| s.says(&format!("umbriel/{word}"), vec![1; 40])), ""),
];

#[test]
fn an_application_and_its_displays_survive_whatever_others_say() {
    let (folder, address) = prepare("foreign peer", &[("room.rhai", ROOM)]);
    let room = folder.join("room.rhai");
    // Long enough that only what never comes is late.
    let mut host = Process::start(&["serve", room.to_str().unwrap(), "--listen", &address, "--timeout-ms", "15000"]);
    host.says("is served at");
    let mut display =
        Process::start(&["display", "--headless", "--once", "--cache", "none", "--show", "wall", "--connect", &address]);
    host.says("display `wall` is in the lock");
    let session = session("client", "connect", &address);
    let number = number_of_process(&session.zid().to_string()).unwrap();
    let mut stranger = Stranger { session, number, epoch: 0 };
    let world = stranger.joins(PROTOCOL, "guest").unwrap();
    stranger.epoch = u64::from_le_bytes(*world.last_chunk().unwrap());
    let token = stranger.session.liveliness().declare_token(format!("umbriel/display/{number}")).wait().unwrap();
    for (does, says) in TO_AN_APPLICATION {
        does(&stranger);
        let (before, after) = says.split_once("HERE").unwrap_or((says, ""));
        let found = until(PATIENCE, || {
            host.said()
                .lines()
                .any(|line| {
                    line.split_once(before).is_some_and(|(_, rest)| {
                        let rest = if says.contains("HERE") {
                            rest.strip_prefix("127.0.0.1:").map(|rest| rest.trim_start_matches(char::is_numeric))
                        } else {
                            Some(rest)
                        };
                        rest.is_some_and(|rest| rest.starts_with(after))
                    })
                })
                .then_some(())
        });
        assert!(found.is_some(), "it did not say `{says}`, but:\n{}", host.said());
    }
    // What is no line of the network library at all, with a length that is never met.
    let mut raw = std::net::TcpStream::connect(address.trim_start_matches("tcp/")).unwrap();
    raw.write_all(&[255; 70_000])
        .or_else(|error| if error.kind() == std::io::ErrorKind::ConnectionReset { Ok(()) } else { Err(error) })
        .unwrap();
    std::thread::sleep(Duration::from_millis(100));
    drop(token);
    let interrupted = Command::new("kill").args(["-INT", &host.child.id().to_string()]).status().unwrap();
    assert!(interrupted.success());
    assert_eq!((host.ends(), display.ends()), (0, 0), "{}\n{}", host.said(), display.said());
    // The display missed nothing, and nobody waited for it.
    host.says("dropped=0");
    host.says("disagreed=0");
    display.says("snapshots=1 ");
}
