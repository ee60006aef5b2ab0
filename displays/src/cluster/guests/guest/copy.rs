//! The guest's copy of the world: what is new is taken over into it, and what is done to it is told.

use std::time::{Duration, Instant};

use umbriel_fields::replica::{Deed, Mirror};
use umbriel_fields::{Graph, NodeId};
use zenoh::Wait;

use super::{Guest, Whose, Wish};
use crate::cluster::message::{GuestMessage, GuestRequest, bytes_of};

impl Guest {
    /// A graph of the world, and whose its nodes are; after [`News::Begins`](super::News::Begins). What is done to it from then on is told.
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

    fn send(&mut self, deeds: Vec<Deed>, images: Vec<(u64, Vec<u8>)>, requests: Vec<GuestRequest>) {
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
    use super::super::{Arrived, News};
    use super::*;
    use crate::cluster::message::{Word, stamped};
    use crate::cluster::{LEASE, Security};
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
