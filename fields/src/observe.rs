//! Observers: who wants to be called when a field changes.

use std::collections::HashMap;

use slotmap::SlotMap;

use crate::changes::Revision;
use crate::graph::slot_of;
use crate::record::Event;
use crate::schedule::OBSERVED;
use crate::{Error, FieldId, Graph, NodeId};

slotmap::new_key_type! {
    /// An observer. Ids of removed observers are never valid again.
    pub struct ObserverId;
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Observer {
    pub(crate) field: FieldId,
    pub(crate) token: u64,
    /// Writes up to this revision were reported.
    pub(crate) seen: Revision,
}

/// All observers.
#[derive(Debug, Default)]
pub(crate) struct Observers {
    pub(crate) all: SlotMap<ObserverId, Observer>,
    /// By node slot, in the order in which they came.
    pub(crate) by_slot: HashMap<u32, Vec<ObserverId>>,
}

impl Observers {
    pub(crate) fn forget_node(&mut self, slot: u32) {
        for observer in self.by_slot.remove(&slot).unwrap_or_default() {
            self.all.remove(observer);
        }
    }

    pub(crate) fn of(&self, slot: u32) -> &[ObserverId] {
        self.by_slot.get(&slot).map_or(&[], |observers| observers)
    }
}

impl Graph {
    /// From now on [`crate::Host::field_changed`] is called with the token when the node of the field has its turn and the field was written.
    pub fn observe(&mut self, field: FieldId, token: u64) -> Result<ObserverId, Error> {
        self.declaration(field)?;
        let slot = slot_of(field.node);
        let observer = self.observers.all.insert(Observer { field, token, seen: self.changes.last() });
        self.observers.by_slot.entry(slot).or_default().push(observer);
        self.schedule.flags[slot as usize] |= OBSERVED;
        self.note(|| Event::Observed { observer, field, token });
        Ok(observer)
    }

    /// Ends an observation; false if it has ended.
    pub fn unobserve(&mut self, observer: ObserverId) -> bool {
        let Some(removed) = self.observers.all.remove(observer) else { return false };
        let slot = slot_of(removed.field.node);
        if let Some(observers) = self.observers.by_slot.get_mut(&slot) {
            observers.retain(|other| *other != observer);
            if observers.is_empty() {
                self.observers.by_slot.remove(&slot);
                self.schedule.flags[slot as usize] &= !OBSERVED;
            }
        }
        self.note(|| Event::Unobserved(observer));
        true
    }

    pub(crate) fn forget_observers_of(&mut self, field: FieldId) {
        let gone: Vec<ObserverId> = self.observers.of(slot_of(field.node)).to_vec();
        for observer in gone {
            if self.observers.all[observer].field == field {
                self.unobserve(observer);
            }
        }
    }

    /// The observers of a node whose fields were written since they last heard of it, each with what it is to be told.
    pub(crate) fn observers_due(&self, id: NodeId) -> Vec<ObserverId> {
        let due = |observer: &&ObserverId| {
            let observer = &self.observers.all[**observer];
            let revision = self.field_revision(observer.field);
            revision > observer.seen && self.silenced.get(&observer.field) != Some(&revision)
        };
        self.observers.of(slot_of(id)).iter().filter(due).copied().collect()
    }
}
