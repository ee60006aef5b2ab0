//! The world at a display: the replica, packets that wait for their turn, and what is said of those that cannot be used.

use umbriel_fields::TypeRegistry;
use umbriel_fields::replica::{Bulk, Packet, Replica};

use super::backlog::{Backlog, MOST_BYTES};
use super::queue::Flood;
use super::quiet::{Quiet, Words};
use super::transport::ClusterError;

/// See above.
pub(super) struct World {
    /// Where all of it comes from.
    endpoint: String,
    types: TypeRegistry,
    pub(super) bulk: Bulk,
    pub(super) packets: Backlog<Packet<'static>>,
    pub(super) snapshot: Option<Packet<'static>>,
    pub(super) replica: Option<Replica>,
    /// One that differs from the application, until it is known where.
    doubted: Option<Replica>,
    /// The graph is another one than that which was drawn last.
    pub(super) is_new: bool,
    quiet: Quiet,
}

impl World {
    /// Nothing of it yet; `types` are those that can be drawn.
    pub(super) fn of(endpoint: String, types: TypeRegistry) -> World {
        World {
            endpoint,
            types,
            bulk: Bulk::new(),
            packets: Backlog::new(MOST_BYTES),
            snapshot: None,
            replica: None,
            doubted: None,
            is_new: true,
            quiet: Quiet::default(),
        }
    }

    /// Says what came and cannot be used, from where, and where this display stands.
    pub(super) fn complain(&mut self, what: &str, error: &ClusterError) {
        let frame = self
            .replica
            .as_ref()
            .map_or_else(|| "there is no world here yet".into(), |replica| format!("the last frame here is {}", replica.frame()));
        let words = format!("{what} from {} cannot be used: {error}; {frame}", self.endpoint);
        self.quiet.say(Words::Error(words));
    }

    /// Keeps a packet of so many bytes until it is its turn.
    pub(super) fn keep(&mut self, packet: Packet<'static>, bytes: usize) {
        if !self.packets.keep(packet.frame(), packet, bytes) {
            let words = format!("the world of {} takes long to come: frames that wait for it are dropped", self.endpoint);
            self.quiet.say(Words::Warn(words));
        }
    }

    /// Frames were dropped before anybody looked at them.
    pub(super) fn flooded(&mut self, flood: Flood) {
        tracing::warn!("{flood} came from {} while this display was busy, and are dropped: it fetches the world", self.endpoint);
    }

    fn tell_unknown(&mut self, types: Vec<String>) {
        for name in types {
            let words = format!(
                "the application's node type `{name}` is not known here: its nodes are held, and nothing is drawn for them"
            );
            self.quiet.say(Words::Info(words));
        }
    }

    /// Makes the replica anew of the snapshot. Where the old one was doubted, gives what differed.
    pub(super) fn restore(&mut self) -> Result<Option<String>, ClusterError> {
        let packet = self.snapshot.take().ok_or_else(|| ClusterError::Message("there is no snapshot".into()))?;
        let mut fresh = Replica::new(&packet, self.types.clone(), &self.bulk)?;
        self.tell_unknown(fresh.unknown_types());
        let doubted = self.doubted.take().filter(|doubted| doubted.frame() == fresh.frame());
        let difference = doubted.and_then(|doubted| Some(doubted.difference(&fresh)?.to_string()));
        difference.iter().for_each(|difference| tracing::error!("the world differed, {difference}"));
        if !fresh.agrees() {
            return Err(ClusterError::Message(format!("the world of frame {} is not what its hash says", fresh.frame())));
        }
        self.replica = Some(fresh);
        self.is_new = true;
        Ok(difference)
    }

    /// Applies a packet that waits. Gives whether the replica agrees with the application then, and the packet's memory.
    pub(super) fn apply(&mut self, frame: u64) -> (bool, Vec<u8>) {
        let (Some(packet), Some(replica)) = (self.packets.take(frame), &mut self.replica) else {
            return (false, Vec::new());
        };
        let applied = replica.apply(&packet, &self.bulk);
        let spare = packet.into_bytes();
        match applied {
            Ok(()) if replica.agrees() => {
                let unknown = replica.unknown_types();
                self.tell_unknown(unknown);
                return (true, spare);
            }
            Ok(()) => {
                tracing::warn!("frame {frame}: the world here is not that of the application; fetching it");
                self.doubted = self.replica.take();
            }
            Err(error) => {
                self.complain(&format!("frame {frame}"), &error.into());
                self.replica = None;
            }
        }
        (false, spare)
    }
}
