//! Who is there, whose the nodes are, and who has locked them.

use std::collections::{BTreeMap, BTreeSet};

/// One run of a guest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GuestId(pub u64);

/// Messages that may be there before one that is missing.
const WINDOW: u64 = 4096;

/// What happens. Nodes go by numbers of the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OwnershipEvent {
    /// A guest is let in, or is there again. `keeps`: its nodes stay when it leaves.
    Joins {
        /// Who.
        guest: GuestId,
        /// What others call it.
        name: String,
        /// Do its nodes stay?
        keeps: bool,
    },
    /// A message of a guest arrived, in any order and perhaps not for the first time. They count from one.
    Arrived(GuestId, u64),
    /// A guest made a node.
    Made(GuestId, u64),
    /// A node is gone.
    Deleted(u64),
    /// Whether a guest's nodes stay is another matter now.
    Keeps(GuestId, bool),
    /// A guest asks for a lock.
    Lock(GuestId, u64),
    /// A guest gives a lock back.
    Unlock(GuestId, u64),
    /// A guest cannot be reached.
    Lost(GuestId),
    /// A guest can be reached, for the first time or again.
    Found(GuestId),
    /// A guest goes.
    Leaves(GuestId),
    /// Time went on.
    Tick,
}

/// What is to be done about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OwnershipAction {
    /// Do what a message says: it is the next one of its guest.
    Take(GuestId, u64),
    /// Tell a guest that it has a lock, or who else has it.
    Answer(GuestId, u64, Result<(), String>),
    /// Tell all that owner or lock of a node are others.
    Changed(u64),
    /// Take a node out of the world.
    Remove(u64),
    /// A guest is gone, with what it had locked.
    Departed(GuestId, String),
}

#[derive(Clone, Debug)]
struct Member {
    name: String,
    keeps: bool,
    /// The last message that was taken.
    taken: u64,
    /// Messages that came before one that is missing.
    early: BTreeSet<u64>,
    /// Since when it cannot be reached, microseconds.
    lost_us: Option<u64>,
}

/// The state.
#[derive(Clone, Debug)]
pub struct Ownership {
    /// How long a guest that cannot be reached keeps its nodes and locks, microseconds.
    grace_us: u64,
    /// Who can be reached, member or not yet.
    reachable: BTreeSet<GuestId>,
    members: BTreeMap<GuestId, Member>,
    owners: BTreeMap<u64, GuestId>,
    locks: BTreeMap<u64, GuestId>,
}

impl Ownership {
    /// Nobody is there. A guest that cannot be reached for `grace_us` is gone.
    pub fn new(grace_us: u64) -> Ownership {
        Ownership {
            grace_us,
            reachable: BTreeSet::new(),
            members: BTreeMap::new(),
            owners: BTreeMap::new(),
            locks: BTreeMap::new(),
        }
    }

    /// Who is there, by name, with the last message that was taken of each.
    pub fn members(&self) -> impl Iterator<Item = (GuestId, &str, u64)> {
        self.members.iter().map(|(id, member)| (*id, member.name.as_str(), member.taken))
    }

    /// True if the guest is there.
    pub fn has(&self, guest: GuestId) -> bool {
        self.members.contains_key(&guest)
    }

    /// Another guest of this name.
    pub fn twin(&self, guest: GuestId, name: &str) -> Option<GuestId> {
        self.members.iter().find(|(id, member)| **id != guest && member.name == name).map(|(id, _)| *id)
    }

    /// The owner of a node, if it is a guest.
    pub fn owner(&self, node: u64) -> Option<GuestId> {
        self.owners.get(&node).copied()
    }

    /// Who has locked a node.
    pub fn holder(&self, node: u64) -> Option<GuestId> {
        self.locks.get(&node).copied()
    }

    /// Nodes that are owned by guests or locked.
    pub fn nodes(&self) -> impl Iterator<Item = u64> {
        let locked = self.locks.keys().filter(|node| !self.owners.contains_key(node));
        self.owners.keys().chain(locked).copied()
    }

    /// Whether a guest may write a node; the error says why not.
    pub fn may_write(&self, guest: GuestId, node: u64) -> Result<(), String> {
        match (self.holder(node), self.owner(node)) {
            (Some(holder), _) if holder == guest => Ok(()),
            (Some(holder), _) => Err(format!("`{}` has locked it", self.name(holder))),
            (None, Some(owner)) if owner == guest => Ok(()),
            (None, Some(owner)) => Err(format!("it belongs to `{}` and is not locked", self.name(owner))),
            (None, None) => Err("it belongs to the host and is not locked".into()),
        }
    }

    /// Whether a guest may put a node of its own into lists of another node, or take it out.
    pub fn may_list(&self, guest: GuestId, list: u64, mut nodes: impl Iterator<Item = u64>) -> Result<(), String> {
        match self.holder(list) {
            Some(holder) if holder != guest => Err(format!("`{}` has locked it", self.name(holder))),
            Some(_) => Ok(()),
            None => match nodes.find(|node| self.owner(*node) != Some(guest)) {
                Some(_) => Err("only own nodes come and go in lists of others".into()),
                None => Ok(()),
            },
        }
    }

    fn name(&self, guest: GuestId) -> &str {
        self.members.get(&guest).map_or("?", |member| &member.name)
    }

    /// What is to be done about an event.
    pub fn step(&mut self, now_us: u64, event: OwnershipEvent) -> Vec<OwnershipAction> {
        let mut actions = Vec::new();
        match event {
            OwnershipEvent::Joins { guest, name, keeps } => {
                let fresh = Member { name, keeps, taken: 0, early: BTreeSet::new(), lost_us: None };
                // Who died while its question was on its way is not there for ever.
                let lost_us = (!self.reachable.contains(&guest)).then_some(now_us);
                self.members.entry(guest).or_insert(fresh).lost_us = lost_us;
            }
            OwnershipEvent::Arrived(guest, number) => self.arrived(now_us, guest, number, &mut actions),
            OwnershipEvent::Made(guest, node) => {
                if self.has(guest) {
                    self.owners.insert(node, guest);
                    actions.push(OwnershipAction::Changed(node));
                }
            }
            OwnershipEvent::Deleted(node) => {
                let was_owned = self.owners.remove(&node).is_some();
                if self.locks.remove(&node).is_some() || was_owned {
                    actions.push(OwnershipAction::Changed(node));
                }
            }
            OwnershipEvent::Keeps(guest, keeps) => {
                if let Some(member) = self.members.get_mut(&guest) {
                    member.keeps = keeps;
                }
            }
            OwnershipEvent::Lock(guest, node) => self.lock(guest, node, &mut actions),
            OwnershipEvent::Unlock(guest, node) => {
                if self.holder(node) == Some(guest) {
                    self.locks.remove(&node);
                    actions.push(OwnershipAction::Changed(node));
                }
            }
            OwnershipEvent::Lost(guest) => {
                self.reachable.remove(&guest);
                if let Some(member) = self.members.get_mut(&guest) {
                    member.lost_us.get_or_insert(now_us);
                }
            }
            OwnershipEvent::Found(guest) => {
                self.reachable.insert(guest);
                if let Some(member) = self.members.get_mut(&guest) {
                    member.lost_us = None;
                }
            }
            OwnershipEvent::Leaves(guest) => self.depart(guest, &mut actions),
            OwnershipEvent::Tick => {
                let is_gone = |member: &Member| member.lost_us.is_some_and(|since| now_us >= since + self.grace_us);
                let gone: Vec<GuestId> =
                    self.members.iter().filter(|(_, member)| is_gone(member)).map(|(guest, _)| *guest).collect();
                gone.into_iter().for_each(|guest| self.depart(guest, &mut actions));
            }
        }
        actions
    }

    fn arrived(&mut self, now_us: u64, guest: GuestId, number: u64, actions: &mut Vec<OwnershipAction>) {
        let Some(member) = self.members.get_mut(&guest) else { return };
        // A message that was on its way when its guest died is no sign of life for ever.
        member.lost_us = member.lost_us.map(|_| now_us);
        if number <= member.taken || number > member.taken + WINDOW {
            return;
        }
        member.early.insert(number);
        while member.early.remove(&(member.taken + 1)) {
            member.taken += 1;
            actions.push(OwnershipAction::Take(guest, member.taken));
        }
    }

    fn lock(&mut self, guest: GuestId, node: u64, actions: &mut Vec<OwnershipAction>) {
        if !self.has(guest) {
            return;
        }
        let answer = match self.holder(node) {
            Some(holder) if holder != guest => Err(format!("`{}` has locked it", self.name(holder))),
            Some(_) => Ok(()),
            None => {
                self.locks.insert(node, guest);
                actions.push(OwnershipAction::Changed(node));
                Ok(())
            }
        };
        actions.push(OwnershipAction::Answer(guest, node, answer));
    }

    fn depart(&mut self, guest: GuestId, actions: &mut Vec<OwnershipAction>) {
        let Some(member) = self.members.remove(&guest) else { return };
        let of = |held: &BTreeMap<u64, GuestId>| -> Vec<u64> {
            held.iter().filter(|(_, holder)| **holder == guest).map(|(node, _)| *node).collect()
        };
        let (owned, locked) = (of(&self.owners), of(&self.locks));
        for node in locked {
            self.locks.remove(&node);
            actions.push(OwnershipAction::Changed(node));
        }
        for node in owned {
            self.owners.remove(&node);
            if member.keeps {
                actions.push(OwnershipAction::Changed(node));
            } else {
                self.locks.remove(&node);
                actions.push(OwnershipAction::Remove(node));
            }
        }
        actions.push(OwnershipAction::Departed(guest, member.name));
    }
}
