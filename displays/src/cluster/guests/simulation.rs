//! Guests that come, work, crash and go over a line that is late, repeats, loses and mixes up, from a seed.

use std::collections::{BTreeMap, BTreeSet};

use super::ownership::{GuestId, Ownership, OwnershipAction, OwnershipEvent};

const GRACE_US: u64 = 2_000_000;
const STEP_US: u64 = 10_000;
/// How long a message takes at most.
const LATE_US: u64 = 200_000;
const RESEND_US: u64 = 300_000;

struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % bound
    }

    fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }
}

/// What stands in a message.
#[derive(Clone, Debug)]
enum Work {
    Make,
    Write(u64),
    Delete(u64),
    Lock(u64),
    Unlock(u64),
    Leave,
}

/// The guest's end: numbers its messages, and sends again what is not confirmed.
struct Model {
    keeps: bool,
    sent: u64,
    unconfirmed: BTreeMap<u64, (Work, u64)>,
    is_alive: bool,
    asked: u64,
    answered: u64,
}

struct Simulation {
    random: Random,
    now_us: u64,
    host: Ownership,
    guests: BTreeMap<GuestId, Model>,
    line: Vec<(u64, GuestId, u64)>,
    nodes: BTreeSet<u64>,
    next_node: u64,
    next_guest: u64,
    taken: BTreeMap<GuestId, u64>,
    /// When a guest was last heard of while it was alive.
    tokens_lost: BTreeMap<GuestId, u64>,
    writes: usize,
    refusals: usize,
    removed: usize,
    kept: usize,
}

impl Simulation {
    fn new(seed: u64) -> Simulation {
        Simulation {
            random: Random(seed | 1),
            now_us: 0,
            host: Ownership::new(GRACE_US),
            guests: BTreeMap::new(),
            line: Vec::new(),
            nodes: (1..=5).collect(),
            next_node: 100,
            next_guest: 0,
            taken: BTreeMap::new(),
            tokens_lost: BTreeMap::new(),
            writes: 0,
            refusals: 0,
            removed: 0,
            kept: 0,
        }
    }

    fn event(&mut self, event: OwnershipEvent) {
        let leaving = match &event {
            OwnershipEvent::Leaves(guest) => Some(*guest),
            _ => None,
        };
        for action in self.host.step(self.now_us, event) {
            match action {
                OwnershipAction::Take(guest, number) => {
                    let last = self.taken.entry(guest).or_insert(0);
                    assert_eq!(number, *last + 1, "{guest:?}: messages are taken in order, each once");
                    *last = number;
                    let work = self.guests[&guest].unconfirmed[&number].0.clone();
                    self.work(guest, work);
                }
                OwnershipAction::Answer(guest, node, answer) => {
                    assert_eq!(answer.is_ok(), self.host.holder(node) == Some(guest));
                    self.guests.get_mut(&guest).unwrap().answered += 1;
                }
                OwnershipAction::Changed(_) => {}
                OwnershipAction::Remove(node) => {
                    assert!(self.nodes.remove(&node), "node {node} is removed once");
                    self.removed += 1;
                }
                OwnershipAction::Departed(guest, _) => {
                    let lost = self.tokens_lost.remove(&guest);
                    let is_due = lost.is_some_and(|since| self.now_us >= since + GRACE_US);
                    assert!(is_due || leaving == Some(guest), "{guest:?} departs before its time");
                    self.kept += self.guests[&guest].keeps as usize;
                    self.guests.get_mut(&guest).unwrap().is_alive = false;
                }
            }
        }
    }

    fn work(&mut self, guest: GuestId, work: Work) {
        match work {
            Work::Make => {
                self.next_node += 1;
                self.nodes.insert(self.next_node);
                self.event(OwnershipEvent::Made(guest, self.next_node));
            }
            Work::Write(node) => {
                let may = self.host.may_write(guest, node);
                let (owner, holder) = (self.host.owner(node), self.host.holder(node));
                let expected = holder == Some(guest) || (holder.is_none() && owner == Some(guest));
                assert_eq!(may.is_ok(), expected, "{may:?}");
                self.writes += may.is_ok() as usize;
                self.refusals += may.is_err() as usize;
            }
            Work::Delete(node) => {
                if self.nodes.contains(&node) && self.host.may_write(guest, node).is_ok() {
                    self.nodes.remove(&node);
                    self.event(OwnershipEvent::Deleted(node));
                }
            }
            // The host knows which nodes there are, and answers itself.
            Work::Lock(node) if !self.nodes.contains(&node) => self.guests.get_mut(&guest).unwrap().answered += 1,
            Work::Lock(node) => self.event(OwnershipEvent::Lock(guest, node)),
            Work::Unlock(node) => self.event(OwnershipEvent::Unlock(guest, node)),
            Work::Leave => self.event(OwnershipEvent::Leaves(guest)),
        }
    }

    fn any_node(&mut self) -> u64 {
        let place = self.random.below(self.nodes.len() as u64) as usize;
        *self.nodes.iter().nth(place).unwrap()
    }

    /// Guests come, do something, crash.
    fn live(&mut self) {
        if self.guests.values().filter(|guest| guest.is_alive).count() < 4 && self.random.one_in(20) {
            self.next_guest += 1;
            let (guest, keeps) = (GuestId(self.next_guest), self.random.one_in(2));
            // Some die while they ask to be let in.
            let is_alive = !self.random.one_in(8);
            let fresh = Model { keeps, sent: 0, unconfirmed: BTreeMap::new(), is_alive, asked: 0, answered: 0 };
            self.guests.insert(guest, fresh);
            self.event(OwnershipEvent::Found(guest));
            if !is_alive {
                self.tokens_lost.insert(guest, self.now_us);
                self.event(OwnershipEvent::Lost(guest));
            }
            self.event(OwnershipEvent::Joins { guest, name: format!("guest {}", guest.0), keeps });
        }
        let alive: Vec<GuestId> = self.guests.iter().filter(|(_, model)| model.is_alive).map(|(guest, _)| *guest).collect();
        for guest in alive {
            if self.random.one_in(400) {
                self.guests.get_mut(&guest).unwrap().is_alive = false;
                self.tokens_lost.insert(guest, self.now_us);
                self.event(OwnershipEvent::Lost(guest));
            } else if self.random.one_in(4) {
                let node = self.any_node();
                let work = match self.random.below(100) {
                    0..25 => Work::Make,
                    25..60 => Work::Write(node),
                    60..68 => Work::Delete(node),
                    68..85 => Work::Lock(node),
                    85..99 => Work::Unlock(node),
                    _ => Work::Leave,
                };
                let model = self.guests.get_mut(&guest).unwrap();
                model.sent += 1;
                model.asked += matches!(work, Work::Lock(_)) as u64;
                model.unconfirmed.insert(model.sent, (work, 0));
            }
        }
    }

    /// Messages go out, again if they are not confirmed; some are lost, late, or come twice.
    fn send(&mut self) {
        let now_us = self.now_us;
        for (guest, model) in self.guests.iter_mut().filter(|(_, model)| model.is_alive) {
            for (number, (_, last_us)) in &mut model.unconfirmed {
                if *last_us == 0 || now_us >= *last_us + RESEND_US {
                    *last_us = now_us;
                    let copies = [1, 1, 1, 0, 2][self.random.below(5) as usize];
                    for _ in 0..copies {
                        self.line.push((now_us + self.random.below(LATE_US), *guest, *number));
                    }
                }
            }
        }
    }

    fn deliver(&mut self) {
        let due: Vec<_> = self.line.iter().copied().filter(|(at, ..)| *at <= self.now_us).collect();
        self.line.retain(|(at, ..)| *at > self.now_us);
        for (_, guest, number) in due {
            self.event(OwnershipEvent::Arrived(guest, number));
            let members: BTreeMap<GuestId, u64> = self.host.members().map(|(guest, _, taken)| (guest, taken)).collect();
            for (guest, taken) in members {
                self.guests.get_mut(&guest).unwrap().unconfirmed.retain(|number, _| *number > taken);
            }
        }
    }

    fn verify(&self) {
        for node in self.host.nodes() {
            for guest in [self.host.owner(node), self.host.holder(node)].into_iter().flatten() {
                assert!(self.host.has(guest), "node {node} is held by {guest:?}, who is gone");
            }
            assert!(self.nodes.contains(&node), "node {node} is gone, but somebody's");
        }
        let lost = self.tokens_lost.iter().filter(|(guest, _)| self.host.has(**guest));
        for (guest, since) in lost {
            assert!(self.now_us <= since + GRACE_US + LATE_US + STEP_US, "{guest:?} is dead and still there");
        }
    }

    fn step(&mut self, is_quiet: bool) {
        self.now_us += STEP_US;
        if !is_quiet {
            self.live();
        }
        self.send();
        self.deliver();
        self.event(OwnershipEvent::Tick);
        self.verify();
    }
}

#[test]
fn every_message_is_taken_once_and_nothing_belongs_to_the_dead() {
    let (mut writes, mut refusals, mut removed, mut kept) = (0, 0, 0, 0);
    for seed in 1..=40 {
        let mut simulation = Simulation::new(0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(seed));
        (0..4000).for_each(|_| simulation.step(false));
        (0..1000).for_each(|_| simulation.step(true));
        for (guest, model) in simulation.guests.iter().filter(|(_, model)| model.is_alive) {
            assert!(model.unconfirmed.is_empty(), "seed {seed}, {guest:?}: everything is taken in the end");
            assert_eq!(model.asked, model.answered, "seed {seed}, {guest:?}: every request is answered");
        }
        writes += simulation.writes;
        refusals += simulation.refusals;
        removed += simulation.removed;
        kept += simulation.kept;
    }
    assert!(writes > 1000 && refusals > 1000 && removed > 1000 && kept > 50, "{writes} {refusals} {removed} {kept}");
}

#[test]
fn a_lock_is_one_guests_alone() {
    let [a, b] = [GuestId(1), GuestId(2)];
    let mut host = Ownership::new(GRACE_US);
    for (guest, name) in [(a, "a"), (b, "b")] {
        host.step(0, OwnershipEvent::Joins { guest, name: name.into(), keeps: false });
    }
    host.step(0, OwnershipEvent::Made(a, 7));
    let rows = [
        (OwnershipEvent::Lock(b, 7), [Some("`b` has locked it"), None]),
        (OwnershipEvent::Lock(a, 7), [Some("`b` has locked it"), None]),
        (OwnershipEvent::Unlock(a, 7), [Some("`b` has locked it"), None]),
        (OwnershipEvent::Unlock(b, 7), [None, Some("it belongs to `a` and is not locked")]),
        (OwnershipEvent::Lock(b, 7), [Some("`b` has locked it"), None]),
        (OwnershipEvent::Lost(b), [Some("`b` has locked it"), None]),
        (OwnershipEvent::Arrived(b, 1), [Some("`b` has locked it"), None]),
        (OwnershipEvent::Leaves(b), [None, Some("it belongs to `a` and is not locked")]),
        (OwnershipEvent::Leaves(a), [Some("it belongs to the host and is not locked"); 2]),
    ];
    for (event, expected) in rows {
        host.step(0, event.clone());
        assert_eq!([a, b].map(|guest| host.may_write(guest, 7).err()), expected.map(|why| why.map(String::from)), "{event:?}");
    }
}
