//! A guest's end: follows the host's world, and tells what is done to the copy here.

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
use crate::cluster::message::{
    DEEDS, GUEST, GUEST_SNAPSHOT, GuestJoin, GuestMessage, GuestRequest, PROTOCOL, WORD, Word, bytes_of, message_of,
    stamped_packet,
};
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

    fn handle(&mut self, arrived: Arrived) -> Result<Option<News>, ClusterError> {
        match arrived {
            Arrived::Frame(bytes) => {
                let length = bytes.len();
                match stamped_packet(bytes) {
                    Ok((epoch, packet)) if epoch == self.epoch && packet.frame() > self.frame() => {
                        self.line.ask_for_bulk(packet.missing(&self.bulk), Arrived::Bulk);
                        self.packets.keep(packet.frame(), packet, length);
                    }
                    Ok(_) => {}
                    Err(error) => tracing::error!("a frame cannot be used: {error}"),
                }
            }
            Arrived::Flood(flood) => {
                tracing::warn!("{flood} came while this application was busy, and are dropped: it fetches the world");
                self.packets.clear();
                self.fetch_again();
            }
            Arrived::Word(bytes) => match message_of::<Word>(&bytes) {
                Ok(word) if word.epoch == self.epoch => {
                    if self.replica.is_some() && word.done_of(self.line.id).is_none() {
                        // It was given up: its nodes are gone, or the host's.
                        if !self.is_leaving {
                            tracing::warn!("this application was away for too long; it joins anew");
                        }
                        self.forget();
                    }
                    self.words.insert(word.frame, word);
                }
                Ok(_) => {}
                Err(error) => tracing::error!("{error}"),
            },
            Arrived::World(Ok(bytes)) => {
                self.refused_since = None;
                let read = message_of::<(Word, Vec<u8>)>(&bytes);
                let read = read.and_then(|(word, snapshot)| Ok((word, stamped_packet(snapshot)?)));
                match read {
                    Ok((word, (epoch, packet))) => self.world = Some((word, epoch, packet)),
                    // It is asked for again.
                    Err(error) => tracing::error!("the world cannot be used: {error}"),
                }
            }
            Arrived::World(Err(reason)) if reason.starts_with("there is an application") => {
                let since = *self.refused_since.get_or_insert_with(Instant::now);
                if since.elapsed() > NAME_IS_FREE_AFTER {
                    return Err(ClusterError::GuestRefused(reason));
                }
            }
            Arrived::World(Err(reason)) if reason.starts_with("it ") => return Err(ClusterError::GuestRefused(reason)),
            Arrived::World(Err(reason)) => tracing::debug!("no world: {reason}"),
            Arrived::Bulk(hash, answer) => {
                self.line.bulk_answered(hash);
                match answer {
                    Ok(bytes) => {
                        if let Err(error) = self.bulk.learn(hash, &bytes) {
                            tracing::error!("{error}");
                        }
                    }
                    // What waits for it is of the past: a new snapshot knows what is needed now.
                    Err(reason) => {
                        tracing::debug!("no long value {hash:016x}: {reason}");
                        self.fetch_again();
                    }
                }
            }
            Arrived::Host(true) => {
                self.asked = None;
                self.line.begin();
            }
            Arrived::Host(false) => {
                self.forget();
                return Ok(Some(News::HostGone));
            }
        }
        Ok(None)
    }

    /// What was here is another world's.
    fn forget(&mut self) {
        self.run += u64::from(self.mirror.is_some());
        (self.replica, self.mirror, self.world) = (None, None, None);
        self.packets.clear();
        self.words.clear();
        self.heard.clear();
        self.told = Outbox::default();
        self.locks_asked.clear();
        (self.epoch, self.applied, self.asked) = (0, 0, None);
    }

    fn fetch_again(&mut self) {
        self.world = None;
        self.replica = None;
        self.gap_since = None;
    }

    fn ask_for_the_world(&mut self) {
        let waits = self.replica.is_none() && self.world.is_none() && !self.is_leaving;
        if waits && self.asked.is_none_or(|asked| asked.elapsed() > ASK) {
            self.asked = Some(Instant::now());
            let (guest, run, name) = (self.line.id, self.run, self.name.to_string());
            let join = GuestJoin { protocol: PROTOCOL, guest, run, name, keeps: self.keeps };
            self.line.get(GUEST_SNAPSHOT.into(), bytes_of(&join), Arrived::World);
        }
    }

    fn resend(&mut self) {
        for bytes in self.told.overdue(RESEND) {
            if let Err(error) = self.deeds.put(bytes.clone()).wait() {
                tracing::debug!("cannot tell: {error}");
            }
        }
    }

    /// Takes over what is complete.
    fn progress(&mut self) -> News {
        if let Some(news) = self.take_world() {
            return news;
        }
        let mut news = News::None;
        while let Some(next) = self.replica.as_ref().map(|replica| replica.frame() + 1) {
            let packet = self.packets.get(next).filter(|packet| packet.missing(&self.bulk).is_empty());
            let (Some(packet), true) = (packet, self.words.contains_key(&next)) else { break };
            let Some(replica) = &mut self.replica else { break };
            match replica.apply(packet, &self.bulk) {
                Ok(()) if replica.agrees() => {
                    self.gap_since = None;
                    news = News::Frame(replica.time_s());
                    self.heard.extend(self.words.remove(&next));
                    self.packets.take(next);
                }
                other => {
                    tracing::error!(
                        "frame {next} cannot be used ({}); fetching the world",
                        other.err().map_or("it differs".into(), |e| e.to_string())
                    );
                    self.fetch_again();
                }
            }
        }
        if let (News::None, Some(replica)) = (news, &self.replica) {
            let last = replica.frame();
            let later = self.packets.last().max(self.words.keys().next_back().copied()).is_some_and(|frame| frame > last);
            match (later, self.gap_since) {
                (false, _) => self.gap_since = None,
                (true, None) => self.gap_since = Some(Instant::now()),
                (true, Some(since)) if since.elapsed() > GAP && !self.line.awaits_bulk() => self.fetch_again(),
                _ => {}
            }
        }
        news
    }

    fn take_world(&mut self) -> Option<News> {
        let missing = self.world.as_ref()?.2.missing(&self.bulk);
        if !missing.is_empty() {
            self.line.ask_for_bulk(missing, Arrived::Bulk);
            return None;
        }
        let (word, epoch, packet) = self.world.take()?;
        let applied = word.done_of(self.line.id).unwrap_or(0);
        let is_first = self.epoch != epoch || self.mirror.is_none() || applied < self.applied;
        if is_first {
            self.graph = (self.fresh)();
            self.types = self.graph.types().clone();
            (self.mirror, self.applied) = (None, 0);
            self.told = Outbox::default();
            self.locks_asked.clear();
        }
        let made = Replica::new(&packet, self.types.clone(), &self.bulk);
        let replica = made.inspect_err(|error| tracing::error!("the world cannot be used: {error}")).ok()?;
        let (frame, time_s) = (replica.frame(), replica.time_s());
        self.packets.forget_to(frame);
        self.words = self.words.split_off(&(frame + 1));
        self.epoch = epoch;
        self.replica = Some(replica);
        self.heard = vec![word];
        if let Some(mirror) = &mut self.mirror {
            mirror.restart();
        }
        Some(if is_first { News::Begins } else { News::Frame(time_s) })
    }

    /// A graph of the world, and whose its nodes are; after [`News::Begins`]. What is done to it from then on is told.
    pub fn enter(&mut self) -> (Graph, Whose) {
        let (mut graph, mut whose) = (std::mem::replace(&mut self.graph, (self.fresh)()), Whose::default());
        self.mirror = Some(Mirror::of(&mut graph));
        self.follow(&mut graph, &mut whose);
        (graph, whose)
    }

    /// Takes over into the graph what is new in the world.
    pub fn follow(&mut self, graph: &mut Graph, whose: &mut Whose) {
        let (Some(mirror), Some(replica)) = (&mut self.mirror, &self.replica) else { return };
        let heard = std::mem::take(&mut self.heard);
        for word in &heard {
            self.host = word.host.as_str().into();
            self.names = word.guests.iter().map(|(id, name, _)| (*id, name.as_str().into())).collect();
            for (_, key, number) in word.made.iter().filter(|(guest, ..)| *guest == self.line.id) {
                mirror.made(*key, *number);
            }
            // What comes with the world may have been told before.
            for (.., why) in word.refused.iter().filter(|(guest, number, _)| *guest == self.line.id && *number > self.applied) {
                whose.refused.push(why.clone());
            }
            self.applied = self.applied.max(word.done_of(self.line.id).unwrap_or(0));
        }
        self.told.confirm(self.applied);
        mirror.follow(replica, graph, self.applied);
        for (node, is_here) in mirror.foreign() {
            match is_here {
                true => drop(whose.owners.insert(node, self.host.clone())),
                false => {
                    whose.owners.remove(&node);
                    whose.locks.remove(&node);
                }
            }
        }
        for word in &heard {
            for (number, owner, holder) in &word.whose {
                let Some(node) = mirror.node(*number) else { continue };
                let name = |guest: &u64| self.names.get(guest).cloned().unwrap_or_else(|| "?".into());
                match owner {
                    Some(owner) if *owner == self.line.id => drop(whose.owners.remove(&node)),
                    Some(owner) => drop(whose.owners.insert(node, name(owner))),
                    None => drop(whose.owners.insert(node, self.host.clone())),
                }
                match holder {
                    Some(holder) => drop(whose.locks.insert(node, name(holder))),
                    None => drop(whose.locks.remove(&node)),
                }
            }
            // An answer that comes with the world may be to an earlier question.
            let done = word.done_of(self.line.id).unwrap_or(0);
            for (_, number, answer) in word.answers.iter().filter(|(guest, ..)| *guest == self.line.id) {
                let Some(node) = mirror.node(*number) else { continue };
                if self.locks_asked.get(&node).is_some_and(|asked| *asked <= done) {
                    self.locks_asked.remove(&node);
                    whose.answers.push((node, answer.clone()));
                }
            }
        }
    }

    /// Tells what was done to the graph since the last time, and what is wished for.
    pub fn tell(&mut self, graph: &mut Graph, whose: &Whose, wishes: &[Wish]) {
        let (Some(mirror), Some(replica)) = (&mut self.mirror, &self.replica) else { return };
        let is_ours = |node: NodeId| match whose.locks.get(&node) {
            Some(holder) => *holder == self.name,
            None => !whose.owners.contains_key(&node),
        };
        let told = mirror.deeds(graph, replica, self.told.next(), &is_ours);
        let mut requests = Vec::new();
        for wish in wishes {
            requests.extend(match wish {
                Wish::Lock(node) => {
                    self.locks_asked.insert(*node, self.told.next());
                    mirror.number(*node).map(GuestRequest::Lock)
                }
                Wish::Unlock(node) => mirror.number(*node).map(GuestRequest::Unlock),
                Wish::Keeps(keeps) => {
                    self.keeps = *keeps;
                    Some(GuestRequest::Keeps(*keeps))
                }
            });
        }
        if !told.deeds.is_empty() || !requests.is_empty() {
            self.send(told.deeds, told.images, requests);
        }
    }

    fn send(&mut self, deeds: Vec<umbriel_fields::replica::Deed>, images: Vec<(u64, Vec<u8>)>, requests: Vec<GuestRequest>) {
        let number = self.told.next();
        let bytes = bytes_of(&GuestMessage { guest: self.line.id, run: self.run, number, deeds, images, requests });
        if let Err(error) = self.deeds.put(bytes.clone()).wait() {
            tracing::debug!("cannot tell: {error}");
        }
        self.told.sent(bytes);
    }

    /// Says good-bye, and waits a moment until everything that was told is done.
    pub fn leave(mut self) {
        if self.replica.is_none() {
            return;
        }
        self.is_leaving = true;
        self.send(Vec::new(), Vec::new(), vec![GuestRequest::Leave]);
        let until = Instant::now() + Duration::from_secs(1);
        while Instant::now() < until && self.replica.is_some() && self.epoch > 0 {
            if self.next(Duration::from_millis(20)).is_err() {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::LEASE;
    use crate::cluster::message::stamped;
    use umbriel_fields::replica::Publisher;
    use umbriel_fields::{Field, NodeType};

    fn world() -> Graph {
        let mut graph = Graph::new(vec![NodeType::new("Box", "").field(Field::new("size", 1.0f32))]);
        graph.create("Box").unwrap();
        graph
    }

    /// The frames with the answers were lost on the way, and the world was fetched instead.
    #[test]
    fn answers_and_refusals_come_with_the_world() {
        let fresh = || Graph::new(vec![NodeType::new("Box", "").field(Field::new("size", 1.0f32))]);
        let mut guest = Guest::connect("tcp/127.0.0.1:1", &Security::Loopback, LEASE, "guest", false, fresh).unwrap();
        let (host, mut publisher) = (world(), Publisher::new());
        let number = umbriel_fields::replica::number_of(host.nodes().next().unwrap());
        let id = guest.line.id;
        let mut fetched = |guest: &mut Guest, applied: u64, answers: Vec<(u64, u64, Result<(), String>)>| {
            publisher.frame(&host);
            let guests = vec![(id, "guest".into(), applied)];
            // Of each of its messages something was refused.
            let refused =
                (1..=applied).flat_map(|number| [(id, number, format!("{number}")), (id + 1, number, "".into())]).collect();
            let (frame, name) = (publisher.last_frame(), "host".into());
            let word = Word { epoch: 1, frame, host: name, guests, answers, refused, ..Word::default() };
            let bytes = bytes_of(&(word, stamped(1, publisher.snapshot(&host).unwrap())));
            guest.fetch_again();
            guest.handle(Arrived::World(Ok(bytes))).unwrap();
            guest.progress()
        };
        assert_eq!(fetched(&mut guest, 0, vec![]), News::Begins);
        let (mut graph, mut whose) = guest.enter();
        let node = graph.nodes().next().unwrap();
        // What was asked, up to where the host had come, what it had said, and what is heard of that.
        let granted = (id, number, Ok(()));
        let refused = (id, number, Err("`other` has locked it".to_string()));
        let rows = [
            (true, 0, vec![], vec![]),
            (false, 1, vec![granted.clone()], vec![(node, Ok(()))]),
            (false, 1, vec![granted.clone()], vec![]),
            (true, 1, vec![granted.clone()], vec![]),
            (false, 2, vec![(id + 1, number, Ok(()))], vec![]),
            (false, 2, vec![refused.clone()], vec![(node, refused.2.clone())]),
        ];
        let mut told = 0;
        for (row, (asks, applied, answers, expected)) in rows.into_iter().enumerate() {
            if asks {
                guest.tell(&mut graph, &whose, &[Wish::Lock(node)]);
            }
            assert!(matches!(fetched(&mut guest, applied, answers), News::Frame(_)), "row {row}");
            guest.follow(&mut graph, &mut whose);
            assert_eq!(std::mem::take(&mut whose.answers), expected, "row {row}");
            let news = (told + 1..=applied).map(|number| format!("{number}")).collect::<Vec<_>>();
            assert_eq!(std::mem::take(&mut whose.refused), news, "row {row}");
            told = applied;
        }
    }
}
