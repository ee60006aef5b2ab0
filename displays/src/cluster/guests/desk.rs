//! The host's end: does what guests did, and tells them what became of it.

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};
use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, unbounded};
use umbriel_fields::replica::{Bulk, Deed, node_numbered, number_of, own_key};
use umbriel_fields::{Graph, NodeId, Value};
use zenoh::Wait;
use zenoh::pubsub::{Publisher as ZenohPublisher, Subscriber};
use zenoh::qos::CongestionControl;
use zenoh::query::{Query, Queryable};
use zenoh::sample::SampleKind;

use super::ownership::{GuestId, Ownership, OwnershipAction, OwnershipEvent};
use crate::cluster::message::{
    DEEDS, GUEST, GUEST_SNAPSHOT, GuestJoin, GuestMessage, GuestRequest, PROTOCOL, WORD, Word, bytes_of, message_of,
};
use crate::cluster::transport::network;
use crate::cluster::{ClusterError, Host, Quiet, Words};

/// How long a guest that cannot be reached keeps its nodes and locks.
const GRACE: Duration = Duration::from_secs(2);
/// So many of the deeds that were refused to a guest last are told once more with the world.
const MOST_REFUSED: usize = 64;
/// Guests make no more nodes once the world has so many.
const MOST_NODES: usize = 1_000_000;

enum Arrived {
    Message(Vec<u8>),
    Join(Query),
    Token(u64, bool),
}

/// Who asks to be let in.
fn join_in(query: &Query) -> Result<GuestJoin, String> {
    let payload = query.payload().ok_or("it does not say who it is")?;
    message_of(&payload.to_bytes()).map_err(|error| error.to_string())
}

/// Where guests are served.
pub struct Desk {
    name: String,
    arrived: Receiver<Arrived>,
    words: ZenohPublisher<'static>,
    ownership: Ownership,
    started: Instant,
    /// Messages that wait for one before them.
    early: BTreeMap<(GuestId, u64), GuestMessage>,
    /// Who asks to be let in, and the question.
    joins: Vec<(Result<GuestJoin, String>, Query)>,
    /// How often a guest had begun anew when it was let in.
    runs: HashMap<GuestId, u64>,
    /// The nodes of a guest by its own keys.
    made: HashMap<GuestId, HashMap<u32, u64>>,
    /// Nodes in whose lists a guest has put its own, by field.
    lists: HashMap<GuestId, BTreeSet<(u64, String)>>,
    /// What a guest was last answered about a node, for whom the frame with the answer does not reach.
    answers: BTreeMap<(GuestId, u64), Result<(), String>>,
    /// What was refused to a guest last, by its messages, for the same.
    refused: HashMap<GuestId, VecDeque<(u64, String)>>,
    bulk: Bulk,
    changed: BTreeSet<u64>,
    word: Word,
    quiet: Quiet,
    _held: (Vec<Subscriber<()>>, Queryable<()>),
}

impl Desk {
    /// Lets guests come to a host; `name` is what they call it.
    pub fn open(host: &Host, name: &str) -> Result<Desk, ClusterError> {
        let session = host.session();
        let (sender, arrived) = unbounded();
        let messages = sender.clone();
        let take = move |sample: zenoh::sample::Sample| {
            let _ = messages.send(Arrived::Message(sample.payload().to_bytes().into_owned()));
        };
        let mut subscribers = vec![session.declare_subscriber(DEEDS).callback(take).wait().map_err(network)?];
        let gone = sender.clone();
        let alive = session.liveliness().declare_subscriber(format!("{GUEST}/*")).history(true).callback(move |sample| {
            let number = sample.key_expr().as_str().rsplit('/').next().and_then(|number| number.parse().ok());
            if let Some(number) = number {
                let _ = gone.send(Arrived::Token(number, sample.kind() == SampleKind::Put));
            }
        });
        subscribers.push(alive.wait().map_err(network)?);
        let joins = session.declare_queryable(GUEST_SNAPSHOT).callback(move |query| drop(sender.send(Arrived::Join(query))));
        let queryable = joins.wait().map_err(network)?;
        let words = session.declare_publisher(WORD).congestion_control(CongestionControl::Drop).wait().map_err(network)?;
        Ok(Desk {
            name: name.into(),
            arrived,
            words,
            ownership: Ownership::new(GRACE.as_micros() as u64),
            started: Instant::now(),
            early: BTreeMap::new(),
            joins: Vec::new(),
            runs: HashMap::new(),
            made: HashMap::new(),
            lists: HashMap::new(),
            answers: BTreeMap::new(),
            refused: HashMap::new(),
            bulk: Bulk::new(),
            changed: BTreeSet::new(),
            word: Word::default(),
            quiet: Quiet::default(),
            _held: (subscribers, queryable),
        })
    }

    /// Names of the guests that are there.
    pub fn guests(&self) -> Vec<String> {
        self.ownership.members().map(|(_, name, _)| name.to_string()).collect()
    }

    /// Does what guests did since the last frame. To be called at the beginning of one.
    pub fn begin(&mut self, graph: &mut Graph) {
        while let Ok(arrived) = self.arrived.try_recv() {
            match arrived {
                Arrived::Message(bytes) => match message_of::<GuestMessage>(&bytes) {
                    Ok(message) => {
                        let (guest, number) = (GuestId(message.guest), message.number);
                        if self.ownership.has(guest) && self.runs.get(&guest) == Some(&message.run) {
                            self.early.insert((guest, number), message);
                            self.step(OwnershipEvent::Arrived(guest, number), graph);
                        }
                    }
                    Err(error) => {
                        self.quiet.say(Words::Warn(format!("what an application did, {} bytes: {error}", bytes.len())));
                    }
                },
                Arrived::Join(query) => {
                    let join = join_in(&query);
                    join.iter().for_each(|join| self.begins(join, graph));
                    self.joins.push((join, query));
                }
                Arrived::Token(guest, true) => self.step(OwnershipEvent::Found(GuestId(guest)), graph),
                Arrived::Token(guest, false) => self.step(OwnershipEvent::Lost(GuestId(guest)), graph),
            }
        }
        self.step(OwnershipEvent::Tick, graph);
        let taken: BTreeMap<GuestId, u64> = self.ownership.members().map(|(guest, _, taken)| (guest, taken)).collect();
        self.early.retain(|(guest, number), _| taken.get(guest).is_some_and(|taken| number > taken));
    }

    /// A guest that lost sight of its world and begins anew leaves first, whether it was missed here or not.
    fn begins(&mut self, join: &GuestJoin, graph: &mut Graph) {
        let guest = GuestId(join.guest);
        if self.ownership.has(guest) && self.runs.get(&guest).is_some_and(|run| *run < join.run) {
            self.early.retain(|(of, _), _| *of != guest);
            self.step(OwnershipEvent::Leaves(guest), graph);
        }
    }

    /// Tells guests what belongs to the next frame. To be called after evaluation, before the frame is published.
    pub fn publish(&mut self, host: &Host, graph: &Graph) {
        let gone: Vec<u64> = self.ownership.nodes().filter(|node| !graph.contains(node_numbered(*node))).collect();
        for node in gone {
            // A node that is gone has no owner; nothing else follows from it.
            self.ownership.step(0, OwnershipEvent::Deleted(node));
            self.answers.retain(|(_, of), _| *of != node);
            self.changed.insert(node);
        }
        if self.ownership.members().next().is_none() && self.changed.is_empty() {
            return;
        }
        let mut word = std::mem::take(&mut self.word);
        word.whose = std::mem::take(&mut self.changed).into_iter().map(|node| self.whose(node)).collect();
        self.head(&mut word, host.epoch(), host.last_frame() + 1);
        if let Err(error) = self.words.put(bytes_of(&word)).wait() {
            tracing::debug!("guests cannot be told: {error}");
        }
    }

    fn head(&self, word: &mut Word, epoch: u64, frame: u64) {
        (word.epoch, word.frame, word.host) = (epoch, frame, self.name.clone());
        word.guests = self.ownership.members().map(|(guest, name, taken)| (guest.0, name.into(), taken)).collect();
    }

    fn whose(&self, node: u64) -> (u64, Option<u64>, Option<u64>) {
        (node, self.ownership.owner(node).map(|guest| guest.0), self.ownership.holder(node).map(|guest| guest.0))
    }

    /// Lets in who asked for it. To be called after a frame was published, before the graph is written again.
    pub fn welcome(&mut self, host: &mut Host, graph: &Graph) {
        for (join, query) in std::mem::take(&mut self.joins) {
            let at = join.as_ref().map_or_else(|_| String::new(), |join| host.at(join.guest));
            let answer = join.and_then(|join| self.joins(host, graph, join));
            let key = query.key_expr().clone();
            let sent = match answer {
                Ok(bytes) => query.reply(key, bytes).wait(),
                Err(reason) => {
                    self.quiet.say(Words::Warn(format!("an application{at} is refused: {reason}")));
                    query.reply_err(reason).wait()
                }
            };
            if let Err(error) = sent {
                tracing::debug!("an answer could not be sent: {error}");
            }
        }
    }

    fn joins(&mut self, host: &mut Host, graph: &Graph, join: GuestJoin) -> Result<Vec<u8>, String> {
        if join.protocol != PROTOCOL {
            return Err(format!("it speaks version {} of the protocol, the application speaks {PROTOCOL}", join.protocol));
        }
        let guest = GuestId(join.guest);
        if self.ownership.twin(guest, &join.name).is_some() || join.name == self.name {
            return Err(format!("there is an application `{}` already", join.name));
        }
        let snapshot = host.snapshot(graph).ok_or("the world is being written")?;
        if !self.ownership.has(guest) {
            tracing::info!("`{}` joins the world at frame {}", join.name, host.last_frame());
        }
        self.runs.insert(guest, join.run);
        self.ownership.step(self.now_us(), OwnershipEvent::Joins { guest, name: join.name, keeps: join.keeps });
        let made = self.made.entry(guest).or_default().iter().map(|(key, number)| (guest.0, *key, *number)).collect();
        let whose = self.ownership.nodes().map(|node| self.whose(node)).collect();
        let answers = self.answers.range((guest, 0)..=(guest, u64::MAX));
        let answers = answers.map(|((_, node), answer)| (guest.0, *node, answer.clone())).collect();
        let refused = self.refused.get(&guest).into_iter().flatten();
        let refused = refused.map(|(number, why)| (guest.0, *number, why.clone())).collect();
        let mut word = Word { made, whose, answers, refused, ..Word::default() };
        self.head(&mut word, host.epoch(), host.last_frame());
        Ok(bytes_of(&(word, &snapshot[..])))
    }

    fn now_us(&self) -> u64 {
        self.started.elapsed().as_micros() as u64
    }

    fn step(&mut self, event: OwnershipEvent, graph: &mut Graph) {
        for action in self.ownership.step(self.now_us(), event) {
            match action {
                OwnershipAction::Take(guest, number) => {
                    if let Some(message) = self.early.remove(&(guest, number)) {
                        self.take(guest, message, graph);
                    }
                }
                OwnershipAction::Answer(guest, node, answer) => self.answer(guest, node, answer),
                OwnershipAction::Changed(node) => drop(self.changed.insert(node)),
                OwnershipAction::Remove(node) => {
                    self.changed.insert(node);
                    let _ = graph.delete(node_numbered(node)); // the host may have deleted it before
                }
                OwnershipAction::Departed(guest, name) => {
                    tracing::info!("`{name}` has left the world");
                    self.made.remove(&guest);
                    self.runs.remove(&guest);
                    self.refused.remove(&guest);
                    self.answers.retain(|(of, _), _| *of != guest);
                    self.tidy(guest, graph);
                }
            }
        }
    }

    /// Takes nodes that are gone out of the lists that a guest had put its own into.
    fn tidy(&mut self, guest: GuestId, graph: &mut Graph) {
        for (node, field) in self.lists.remove(&guest).unwrap_or_default() {
            let Ok(field) = graph.field(node_numbered(node), &field) else { continue };
            let Ok(Value::Nodes(nodes)) = graph.value(field) else { continue };
            let alive = nodes.iter().copied().filter(|node| node.is_some_and(|node| graph.contains(node)));
            let alive: Vec<Option<NodeId>> = alive.collect();
            if alive.len() < nodes.len() {
                let _ = graph.set_value(field, Value::Nodes(alive.into())); // a list of nodes takes a list of nodes
            }
        }
    }

    fn take(&mut self, guest: GuestId, message: GuestMessage, graph: &mut Graph) {
        for (hash, image) in &message.images {
            if let Err(error) = self.bulk.learn(*hash, image) {
                tracing::warn!("from a guest: {error}");
            }
        }
        for deed in &message.deeds {
            if let Err(why) = self.deed(guest, deed, graph) {
                let kept = self.refused.entry(guest).or_default();
                kept.push_back((message.number, why.clone()));
                kept.drain(..kept.len().saturating_sub(MOST_REFUSED));
                self.word.refused.push((guest.0, message.number, why));
            }
        }
        for request in message.requests {
            let number = |node: u64| self.number(guest, node).filter(|node| graph.contains(node_numbered(*node)));
            match request {
                GuestRequest::Lock(node) => match number(node) {
                    Some(node) => self.step(OwnershipEvent::Lock(guest, node), graph),
                    None => self.answer(guest, node, Err("it is gone".into())),
                },
                GuestRequest::Unlock(node) => {
                    if let Some(node) = number(node) {
                        self.answers.remove(&(guest, node));
                        self.step(OwnershipEvent::Unlock(guest, node), graph);
                    }
                }
                GuestRequest::Keeps(keeps) => self.step(OwnershipEvent::Keeps(guest, keeps), graph),
                GuestRequest::Leave => self.step(OwnershipEvent::Leaves(guest), graph),
            }
        }
    }

    fn answer(&mut self, guest: GuestId, node: u64, answer: Result<(), String>) {
        self.answers.insert((guest, node), answer.clone());
        self.word.answers.push((guest.0, node, answer));
    }

    /// The host's number of a node that a guest names.
    fn number(&self, guest: GuestId, node: u64) -> Option<u64> {
        match own_key(node) {
            Some(key) => self.made.get(&guest)?.get(&key).copied(),
            None => Some(node).filter(|node| *node != 0),
        }
    }

    fn deed(&mut self, guest: GuestId, deed: &Deed, graph: &mut Graph) -> Result<(), String> {
        let target = deed.changes().map(|node| self.number(guest, node).ok_or("its node is gone".to_string())).transpose()?;
        if let Some(node) = target {
            let may = match deed.lists() {
                Some(nodes) => {
                    // Who may write the node may do that to its lists as well.
                    let nodes: Vec<u64> = nodes.filter_map(|node| self.number(guest, node)).collect();
                    self.ownership.may_write(guest, node).or_else(|_| self.ownership.may_list(guest, node, nodes.into_iter()))
                }
                None => self.ownership.may_write(guest, node),
            };
            let what = |why: String| match deed.field() {
                Some(field) => format!("`{field}` of {}: {why}", graph.describe(node_numbered(node))),
                None => format!("{}: {why}", graph.describe(node_numbered(node))),
            };
            may.map_err(what)?;
        }
        if deed.makes().is_some() && graph.node_count() >= MOST_NODES {
            return Err(format!("the world has {MOST_NODES} nodes already, and more are not allowed"));
        }
        let made = self.made.get(&guest);
        let found = |number: u64| match own_key(number) {
            Some(key) => made.and_then(|made| made.get(&key)).map(|number| node_numbered(*number)),
            None => Some(number).filter(|number| *number != 0).map(node_numbered),
        };
        let new = deed.apply(graph, &self.bulk, &found)?;
        if let (Some(node), Some(key)) = (new.map(number_of), deed.makes().and_then(own_key)) {
            self.made.entry(guest).or_default().insert(key, node);
            self.word.made.push((guest.0, key, node));
            self.step(OwnershipEvent::Made(guest, node), graph);
        }
        if let (true, Some(node), Some(field)) = (deed.lists().is_some(), target, deed.field()) {
            self.lists.entry(guest).or_default().insert((node, field.into()));
        }
        if let (Some(_), Some(node)) = (deed.deletes(), target) {
            self.step(OwnershipEvent::Deleted(node), graph);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::{HostOptions, LEASE, Security};
    use umbriel_fields::{Field, NodeType};

    /// Who missed the frame that says it fetches the world.
    #[test]
    fn what_was_refused_is_told_with_the_world() {
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let options = HostOptions {
            listen: format!("tcp/127.0.0.1:{port}"),
            security: Security::Loopback,
            timeout: Duration::from_secs(1),
            lease: LEASE,
            ahead: true,
            lines: None,
        };
        let mut host = Host::listen(&options).unwrap();
        let mut desk = Desk::open(&host, "host").unwrap();
        let mut graph = Graph::new(vec![NodeType::new("Box", "").field(Field::new("size", 1.0f32))]);
        let node = number_of(graph.create("Box").unwrap());
        host.frame(&graph, false);
        let guest = GuestId(7);
        let refused = |desk: &mut Desk, host: &mut Host, graph: &Graph| {
            let join = GuestJoin { protocol: PROTOCOL, guest: guest.0, run: 0, name: "guest".into(), keeps: false };
            let world = desk.joins(host, graph, join).unwrap();
            let (word, _) = message_of::<(Word, Vec<u8>)>(&world).unwrap();
            word.refused.iter().map(|(guest, number, _)| (*guest, *number)).collect::<Vec<_>>()
        };
        assert_eq!(refused(&mut desk, &mut host, &graph), []);
        // Deletes a node of the host's, as it stands in a message.
        let deletes = || message_of::<Deed>(&bytes_of(&(1u8, node))).unwrap();
        let last = MOST_REFUSED as u64 + 2;
        for number in 1..=last {
            let message =
                GuestMessage { guest: guest.0, run: 0, number, deeds: vec![deletes()], images: vec![], requests: vec![] };
            desk.early.insert((guest, number), message);
            desk.step(OwnershipEvent::Arrived(guest, number), &mut graph);
        }
        desk.publish(&host, &graph);
        assert_eq!(refused(&mut desk, &mut host, &graph), (3..=last).map(|number| (guest.0, number)).collect::<Vec<_>>());
        desk.step(OwnershipEvent::Leaves(guest), &mut graph);
        assert_eq!(refused(&mut desk, &mut host, &graph), []);
    }
}
