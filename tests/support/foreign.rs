//! A program of somebody else in the place of an application. It knows the network and what packets look like, and none of our code there.

use super::process::PATIENCE;
use super::until;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use umbriel_fields::Graph;
use umbriel_fields::replica::Publisher;
use umbriel_scripts::World;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::query::Queryable;
use zenoh::{Config, Session, Wait};

/// A session that connects to, or listens at, an address.
pub(crate) fn session(mode: &str, how: &str, address: &str) -> Session {
    session_with(mode, how, address, "{}")
}

/// One that connects with a certificate of a part.
pub(crate) fn session_of(part: &str, certificates: &Path, address: &str) -> Session {
    let path = |name: String| format!("{:?}", certificates.join(name));
    let (certificate, key) = (path(format!("{part}.pem")), path(format!("{part}.key.pem")));
    let tls = format!(
        "{{ root_ca_certificate: {}, connect_certificate: {certificate}, connect_private_key: {key}, enable_mtls: true, \
         verify_name_on_connect: false }}",
        path("authority.pem".into())
    );
    session_with("peer", "connect", address, &tls)
}

fn session_with(mode: &str, how: &str, address: &str, tls: &str) -> Session {
    let mut config = Config::default();
    let rows = [
        ("mode", format!("{mode:?}")),
        ("scouting/multicast/enabled", "false".into()),
        ("listen/endpoints", "[]".into()),
        (&format!("{how}/endpoints"), format!("[{address:?}]")),
        ("transport/link/tls", tls.into()),
    ];
    rows.iter().for_each(|(key, value)| config.insert_json5(key, value).unwrap());
    zenoh::open(config).wait().unwrap()
}

/// An application with a world of its own, which says what it is told to.
pub(crate) struct Application {
    session: Session,
    world: World,
    publisher: Publisher,
    /// Displays that are ready, and with which frame.
    ready: Receiver<(u64, u64)>,
    snapshot: Arc<Mutex<Vec<u8>>>,
    /// What the next one who asks for the world gets instead.
    pub(crate) wrong_answer: Arc<Mutex<Option<Vec<u8>>>>,
    /// How often the world was asked for.
    asked: Arc<AtomicUsize>,
    _held: (LivelinessToken, Subscriber<()>, Queryable<()>),
}

/// Which run of the application it is.
const EPOCH: u64 = 1_700_000_000_000_000;

fn stamped(mut packet: Vec<u8>) -> Vec<u8> {
    packet.extend_from_slice(&EPOCH.to_le_bytes());
    packet
}

impl Application {
    /// Listens, with a world.
    pub(crate) fn listen(address: &str, world: &Path) -> Application {
        let session = session("peer", "listen", address);
        let (sender, ready) = channel();
        let subscriber = session.declare_subscriber("umbriel/ready").callback(move |sample| {
            let message = postcard::from_bytes::<(u64, String, u64, u64, u64, u64)>(&sample.payload().to_bytes());
            let (display, _, epoch, frame, ..) = message.unwrap();
            if epoch == EPOCH {
                let _ = sender.send((display, frame));
            }
        });
        let subscriber = subscriber.wait().unwrap();
        let (snapshot, wrong_answer) = (Arc::new(Mutex::new(Vec::new())), Arc::new(Mutex::new(None)));
        let asked = Arc::new(AtomicUsize::new(0));
        let (right, wrong, count) = (snapshot.clone(), wrong_answer.clone(), asked.clone());
        let answers = session.declare_queryable("umbriel/snapshot").callback(move |query| {
            count.fetch_add(1, Ordering::Relaxed);
            let answer = wrong.lock().unwrap().take().unwrap_or_else(|| right.lock().unwrap().clone());
            query.reply(query.key_expr().clone(), answer).wait().unwrap();
        });
        let queryable = answers.wait().unwrap();
        let world = World::load_file(world).unwrap();
        let mut publisher = Publisher::new();
        publisher.frame(world.graph());
        *snapshot.lock().unwrap() = stamped(publisher.snapshot(world.graph()).unwrap());
        // Only now is there anything to ask for.
        let token = session.liveliness().declare_token("umbriel/application").wait().unwrap();
        let _held = (token, subscriber, queryable);
        Application { session, world, publisher, ready, snapshot, wrong_answer, asked, _held }
    }

    /// The world.
    pub(crate) fn graph(&mut self) -> &mut Graph {
        self.world.graph_mut()
    }

    /// How often it was asked for.
    pub(crate) fn asked(&self) -> usize {
        self.asked.load(Ordering::Relaxed)
    }

    /// The number of the last frame.
    pub(crate) fn last_frame(&self) -> u64 {
        self.publisher.last_frame()
    }

    /// The world as of the last frame, as who asks for it gets it.
    pub(crate) fn snapshot(&self) -> Vec<u8> {
        self.snapshot.lock().unwrap().clone()
    }

    /// Publishes a frame in which the visitor took a step, or what becomes of its packet.
    pub(crate) fn frame(&mut self, spoil: impl FnOnce(Vec<u8>) -> Vec<u8>) {
        let x = self.last_frame() as f32 * 1e-3;
        let graph = self.world.graph_mut();
        let visitor = graph.find("visitor").unwrap();
        graph.set_named(visitor, "position", glam::Vec3::new(x, 1.7, 2.0)).unwrap();
        let packet = self.publisher.frame(graph);
        *self.snapshot.lock().unwrap() = stamped(self.publisher.snapshot(graph).unwrap());
        self.says("umbriel/frame", stamped(spoil(packet)));
    }

    /// Says something to all displays.
    pub(crate) fn says(&self, subject: &str, bytes: Vec<u8>) {
        self.session.put(subject.to_string(), bytes).wait().unwrap();
    }

    /// Lets a frame be shown.
    pub(crate) fn releases(&self, epoch: u64, frame: u64, may_show: &[u64], is_last: bool) {
        let heard: [(u64, u64); 0] = [];
        self.says("umbriel/release", postcard::to_stdvec(&(epoch, frame, may_show, &heard[..], is_last)).unwrap());
    }

    /// Publishes frames until a display has drawn one of them, which it may show.
    pub(crate) fn goes_on(&mut self, is_last: bool) {
        let first = self.last_frame() + 1;
        let found = until(PATIENCE, || {
            self.frame(|packet| packet);
            let ready = std::iter::from_fn(|| self.ready.recv_timeout(Duration::from_millis(30)).ok());
            let ready = ready.into_iter().find(|(_, frame)| *frame >= first);
            ready.inspect(|(display, frame)| self.releases(EPOCH, *frame, &[*display], is_last))
        });
        assert!(found.is_some(), "the display does not come back");
    }
}
