//! A guest's end: follows the host's world, and tells what is done to the copy here.

mod arrivals;
mod copy;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::{Duration, Instant};

use umbriel_fields::replica::{Bulk, Mirror, Packet, Replica};
use umbriel_fields::{Graph, NodeId, TypeRegistry};
use zenoh::Wait;
use zenoh::pubsub::Publisher as ZenohPublisher;
use zenoh::qos::CongestionControl;

use crate::cluster::backlog::{Backlog, MOST_BYTES};
use crate::cluster::line::{Answer, Kinds, Line, Link};
use crate::cluster::message::{DEEDS, GUEST, WORD, Word};
use crate::cluster::ordered::Outbox;
use crate::cluster::queue::Flood;
use crate::cluster::transport::{End, network};
use crate::cluster::{ClusterError, Security};

/// What is not confirmed after so long is sent again.
const RESEND: Duration = Duration::from_millis(500);
/// How long a frame waits for one before it.
const GAP: Duration = Duration::from_millis(300);
/// How often who is not let in asks.
const ASK: Duration = Duration::from_millis(300);
/// A guest that crashed and comes back at once finds its own name taken until it is given up.
const NAME_IS_FREE_AFTER: Duration = Duration::from_secs(5);

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum News {
    /// Nothing yet.
    None,
    /// The world is here, from its beginning for this guest: whatever it made before is gone. [`Guest::enter`] follows.
    Begins,
    /// A later frame is here, at this time of the world in seconds. [`Guest::follow`] follows.
    Frame(f64),
    /// The host is gone; it may come back.
    HostGone,
}

/// What a script asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// To be the only one who may write a node.
    Lock(NodeId),
    /// No longer to be.
    Unlock(NodeId),
    /// Whether the nodes stay when it leaves.
    Keeps(bool),
}

enum Arrived {
    Frame(Vec<u8>),
    Flood(Flood),
    Word(Vec<u8>),
    World(Answer),
    Bulk(u64, Answer),
    Host(bool),
}

/// Whose nodes are whose, by name. Nodes that stand nowhere are the guest's own.
#[derive(Clone, Debug, Default)]
pub struct Whose {
    /// Owners of the nodes of others.
    pub owners: HashMap<NodeId, Arc<str>>,
    /// Who has locked a node.
    pub locks: HashMap<NodeId, Arc<str>>,
    /// Answers about locks that were asked for.
    pub answers: Vec<(NodeId, Result<(), String>)>,
    /// Why something was not done that was told.
    pub refused: Vec<String>,
}

/// An application in another one's world.
pub struct Guest {
    line: Line<Arrived>,
    name: Arc<str>,
    keeps: bool,
    deeds: ZenohPublisher<'static>,
    fresh: fn() -> Graph,
    /// The one that is entered next, and the types of the one that was entered.
    graph: Graph,
    types: TypeRegistry,
    bulk: Bulk,
    epoch: u64,
    /// How often it began anew.
    run: u64,
    replica: Option<Replica>,
    mirror: Option<Mirror>,
    /// A snapshot that waits for long values.
    world: Option<(Word, u64, Packet<'static>)>,
    packets: Backlog<Packet<'static>>,
    words: BTreeMap<u64, Word>,
    gap_since: Option<Instant>,
    /// Words of the frames that were taken over since the last `follow`.
    heard: Vec<Word>,
    names: BTreeMap<u64, Arc<str>>,
    host: Arc<str>,
    told: Outbox<Vec<u8>>,
    applied: u64,
    /// Locks that no answer came for, and the numbers of the messages that asked for them.
    locks_asked: BTreeMap<NodeId, u64>,
    asked: Option<Instant>,
    refused_since: Option<Instant>,
    is_leaving: bool,
}

impl Guest {
    /// Joins the host at an address, now or as soon as it is there. A link without a sign of life for `lease` is broken; `keeps` says whether its nodes stay when it leaves,
    /// `fresh` makes graphs for its world, with no nodes but a Group `world`.
    pub fn connect(
        endpoint: &str,
        security: &Security,
        lease: Duration,
        name: &str,
        keeps: bool,
        fresh: fn() -> Graph,
    ) -> Result<Guest, ClusterError> {
        let kinds =
            Kinds { frame: Arrived::Frame, flood: Arrived::Flood, subject: (WORD, Arrived::Word), application: Arrived::Host };
        let link = Link { end: End::Guest, endpoint, security, lease, uses_memory: true, cache: None };
        let mut line = Line::open(link, kinds)?;
        let deeds = line.session.declare_publisher(DEEDS).congestion_control(CongestionControl::Block).wait().map_err(network)?;
        line.announce(GUEST)?;
        Ok(Guest {
            line,
            name: name.into(),
            keeps,
            deeds,
            fresh,
            graph: fresh(),
            types: TypeRegistry::new(),
            bulk: Bulk::new(),
            epoch: 0,
            run: 0,
            replica: None,
            mirror: None,
            world: None,
            packets: Backlog::new(MOST_BYTES),
            words: BTreeMap::new(),
            gap_since: None,
            heard: Vec::new(),
            names: BTreeMap::new(),
            host: "".into(),
            told: Outbox::default(),
            applied: 0,
            locks_asked: BTreeMap::new(),
            asked: None,
            refused_since: None,
            is_leaving: false,
        })
    }

    /// True once the host was heard of.
    pub fn found_host(&self) -> bool {
        self.epoch > 0
    }

    /// The name of the application that evaluates.
    pub fn host(&self) -> &Arc<str> {
        &self.host
    }

    /// The number of the last frame that was taken over.
    pub fn frame(&self) -> u64 {
        self.replica.as_ref().map_or(0, Replica::frame)
    }

    /// Waits for the next frame, but not longer than `patience`.
    ///
    /// # Errors
    /// The host refuses this guest.
    pub fn next(&mut self, patience: Duration) -> Result<News, ClusterError> {
        let until = Instant::now() + patience;
        loop {
            self.line.settle();
            let left = until.saturating_duration_since(Instant::now());
            let mut news = News::None;
            let mut arrived = self.line.next(left.min(Duration::from_millis(5)));
            while let Some(next) = arrived {
                if let Some(found) = self.handle(next)? {
                    news = found;
                }
                arrived = self.line.next(Duration::ZERO);
            }
            self.ask_for_the_world();
            self.resend();
            if news == News::None {
                news = self.progress();
            }
            if news != News::None || left.is_zero() {
                return Ok(news);
            }
        }
    }
}
