//! What comes to a guest: packets and words of frames, the world, long values; and what is taken over of it.

use std::time::Instant;

use umbriel_fields::replica::Replica;
use zenoh::Wait;

use super::{ASK, Arrived, GAP, Guest, NAME_IS_FREE_AFTER, News, RESEND};
use crate::cluster::ClusterError;
use crate::cluster::message::{GUEST_SNAPSHOT, GuestJoin, PROTOCOL, Word, bytes_of, message_of, stamped_packet};
use crate::cluster::ordered::Outbox;

impl Guest {
    pub(super) fn handle(&mut self, arrived: Arrived) -> Result<Option<News>, ClusterError> {
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

    pub(super) fn fetch_again(&mut self) {
        self.world = None;
        self.replica = None;
        self.gap_since = None;
    }

    pub(super) fn ask_for_the_world(&mut self) {
        let waits = self.replica.is_none() && self.world.is_none() && !self.is_leaving;
        if waits && self.asked.is_none_or(|asked| asked.elapsed() > ASK) {
            self.asked = Some(Instant::now());
            let (guest, run, name) = (self.line.id, self.run, self.name.to_string());
            let join = GuestJoin { protocol: PROTOCOL, guest, run, name, keeps: self.keeps };
            self.line.get(GUEST_SNAPSHOT.into(), bytes_of(&join), Arrived::World);
        }
    }

    pub(super) fn resend(&mut self) {
        for bytes in self.told.overdue(RESEND) {
            if let Err(error) = self.deeds.put(bytes.clone()).wait() {
                tracing::debug!("cannot tell: {error}");
            }
        }
    }

    /// Takes over what is complete.
    pub(super) fn progress(&mut self) -> News {
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
}
