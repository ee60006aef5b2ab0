//! Entries that are found by the address of an `Arc`, which they hold so that the address stays theirs.

use std::collections::HashMap;
use std::sync::Arc;

/// Frames that an entry outlives its last use.
pub(crate) const KEEP_FRAMES: u64 = 120;

/// GPU copies of shared values.
pub(crate) struct Slab<K, V> {
    by_address: HashMap<usize, u32>,
    entries: Vec<Option<Entry<K, V>>>,
    free: Vec<u32>,
}

struct Entry<K, V> {
    key: Arc<K>,
    value: V,
    last_used: u64,
}

impl<K, V> Default for Slab<K, V> {
    fn default() -> Slab<K, V> {
        Slab { by_address: HashMap::new(), entries: Vec::new(), free: Vec::new() }
    }
}

impl<K, V> Slab<K, V> {
    /// The entry of `key`, made where there is none. `hint` is the answer of an earlier frame.
    pub(crate) fn get_or_make(&mut self, key: &Arc<K>, hint: u32, frame: u64, make: impl FnOnce() -> V) -> u32 {
        if let Some(Some(entry)) = self.entries.get_mut(hint as usize)
            && Arc::ptr_eq(&entry.key, key)
        {
            entry.last_used = frame;
            return hint;
        }
        let address = Arc::as_ptr(key) as usize;
        let id = match self.by_address.get(&address) {
            Some(&id) => id,
            None => {
                let id = self.free.pop().unwrap_or(self.entries.len() as u32);
                if id as usize == self.entries.len() {
                    self.entries.push(None);
                }
                self.entries[id as usize] = Some(Entry { key: key.clone(), value: make(), last_used: frame });
                self.by_address.insert(address, id);
                id
            }
        };
        if let Some(entry) = &mut self.entries[id as usize] {
            entry.last_used = frame;
        }
        id
    }

    pub(crate) fn get(&self, id: u32) -> Option<&V> {
        self.entries.get(id as usize)?.as_ref().map(|e| &e.value)
    }

    /// An entry is in use.
    pub(crate) fn touch(&mut self, id: u32, frame: u64) {
        if let Some(Some(entry)) = self.entries.get_mut(id as usize) {
            entry.last_used = frame;
        }
    }

    pub(crate) fn key(&self, id: u32) -> Option<&Arc<K>> {
        self.entries.get(id as usize)?.as_ref().map(|e| &e.key)
    }

    /// Drops what was not used for a while.
    pub(crate) fn drop_unused(&mut self, frame: u64) {
        for (id, place) in self.entries.iter_mut().enumerate() {
            if place.as_ref().is_some_and(|e| e.last_used + KEEP_FRAMES < frame)
                && let Some(entry) = place.take()
            {
                self.by_address.remove(&(Arc::as_ptr(&entry.key) as usize));
                self.free.push(id as u32);
            }
        }
    }

    /// Number of entries alive.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.by_address.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_follow_identity_and_age() {
        let mut slab = Slab::default();
        let (a, b) = (Arc::new(1), Arc::new(1));
        let ids = [slab.get_or_make(&a, 9, 0, || 'a'), slab.get_or_make(&b, 0, 0, || 'b')];
        assert_eq!(ids, [0, 1], "equal values with two identities are two entries");
        assert_eq!(slab.get_or_make(&a, ids[0], KEEP_FRAMES, || 'x'), 0);
        slab.drop_unused(KEEP_FRAMES + 1);
        assert_eq!((slab.get(0), slab.get(1), slab.len()), (Some(&'a'), None, 1));
        assert_eq!(slab.get_or_make(&b, ids[1], KEEP_FRAMES, || 'c'), 1, "a freed place is used again");
        assert_eq!(slab.get(1), Some(&'c'));
    }
}
