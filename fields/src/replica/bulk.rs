//! Long values, by a hash of their content: sent once, kept on both sides.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Weak};

use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

use super::{ReplicaError, damaged};
use crate::Image;

/// Values of more bytes go by their content.
pub(super) const LONG: usize = 4096;
/// Bytes of long values that are kept beyond their use, for who comes back.
const KEPT_BYTES: usize = 512 << 20;

const VALUE: u8 = 0;
const IMAGE: u8 = 1;

/// A hash of what an image shows.
pub(super) fn hash_of_image(image: &Image) -> u64 {
    hash_of_pixels([image.width, image.height], &image.rgba)
}

fn hash_of_pixels([width, height]: [u32; 2], rgba: &[u8]) -> u64 {
    xxh3_64_with_seed(rgba, u64::from(width) << 32 | u64::from(height))
}

/// A hash of a long value.
pub(super) fn hash_of_value(bytes: &[u8]) -> u64 {
    xxh3_64(bytes)
}

pub(super) fn message_of_image(image: &Image) -> Arc<[u8]> {
    let head = std::iter::once(IMAGE).chain(image.width.to_le_bytes()).chain(image.height.to_le_bytes());
    head.chain(image.rgba.iter().copied()).collect()
}

pub(super) fn message_of_value(bytes: &[u8]) -> Arc<[u8]> {
    std::iter::once(VALUE).chain(bytes.iter().copied()).collect()
}

/// A long value in the message that it goes by.
enum Long<'a> {
    Value(&'a [u8]),
    /// Its size, and RGBA.
    Image([u32; 2], &'a [u8]),
}

impl Long<'_> {
    fn hash(&self) -> u64 {
        match self {
            Long::Value(bytes) => hash_of_value(bytes),
            Long::Image(size, rgba) => hash_of_pixels(*size, rgba),
        }
    }
}

fn read(message: &[u8]) -> Option<Long<'_>> {
    match message.split_first()? {
        (&VALUE, bytes) => Some(Long::Value(bytes)),
        (&IMAGE, bytes) => {
            let (head, rgba) = bytes.split_at_checked(8)?;
            let size = [0, 4].map(|at| u32::from_le_bytes(std::array::from_fn(|byte| head[at + byte])));
            let is_whole = u64::from(size[0]) * u64::from(size[1]) * 4 == rgba.len() as u64;
            is_whole.then_some(Long::Image(size, rgba))
        }
        _ => None,
    }
}

fn wrong(hash: u64) -> ReplicaError {
    damaged(format!("a long value is not what its hash {hash:016x} says"))
}

/// The hash of what a message of [`super::Publisher::bulk`] holds; none where it is no such message.
pub fn hash_of_long_value(message: &[u8]) -> Option<u64> {
    read(message).map(|long| long.hash())
}

/// Hashes of images, kept as long as the images live.
#[derive(Default)]
pub(super) struct ImageHashes {
    /// By address; the weak reference keeps it from being used again.
    known: HashMap<usize, (Weak<Image>, u64)>,
}

impl ImageHashes {
    pub(super) fn of(&mut self, image: &Arc<Image>) -> u64 {
        if self.known.len() > 256 && self.known.len().is_power_of_two() {
            self.known.retain(|_, (image, _)| image.strong_count() > 0);
        }
        self.known.entry(Arc::as_ptr(image) as usize).or_insert_with(|| (Arc::downgrade(image), hash_of_image(image))).1
    }
}

/// Long values that a replica has seen. Outlives it: who rejoins needs only what is new.
#[derive(Default)]
pub struct Bulk {
    values: HashMap<u64, Arc<[u8]>>,
    images: HashMap<u64, Arc<Image>>,
    /// In the order in which they came, with their sizes.
    ages: VecDeque<(u64, usize)>,
    bytes: usize,
}

impl Bulk {
    /// Nothing seen yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes what [`super::Publisher::bulk`] gave for a hash. An error if it is not what the hash says.
    pub fn learn(&mut self, hash: u64, message: &[u8]) -> Result<(), ReplicaError> {
        if self.has(hash) {
            return Ok(());
        }
        match read(message) {
            Some(long) if long.hash() != hash => return Err(wrong(hash)),
            Some(Long::Value(bytes)) => drop(self.values.insert(hash, bytes.into())),
            Some(Long::Image([width, height], rgba)) => {
                drop(self.images.insert(hash, Arc::new(Image { width, height, rgba: rgba.into() })));
            }
            None => return Err(wrong(hash)),
        }
        self.ages.push_back((hash, message.len()));
        self.bytes += message.len();
        while self.bytes > KEPT_BYTES && self.ages.len() > 1 {
            let Some((oldest, bytes)) = self.ages.pop_front() else { break };
            self.forget(oldest);
            self.bytes -= bytes;
        }
        Ok(())
    }

    fn forget(&mut self, hash: u64) {
        self.values.remove(&hash);
        self.images.remove(&hash);
    }

    pub(super) fn has(&self, hash: u64) -> bool {
        self.values.contains_key(&hash) || self.images.contains_key(&hash)
    }

    pub(super) fn value(&self, hash: u64) -> Option<Arc<[u8]>> {
        self.values.get(&hash).cloned()
    }

    pub(super) fn image(&self, hash: u64) -> Option<Arc<Image>> {
        self.images.get(&hash).cloned()
    }
}

/// Long values that a publisher offers: those that fields hold, and the last that they held.
#[derive(Default)]
pub(super) struct Offered {
    values: HashMap<u64, (Arc<[u8]>, u32)>,
    idle: VecDeque<u64>,
}

/// Long values that nobody holds any more, but that somebody may still ask for.
const IDLE: usize = 64;

impl Offered {
    pub(super) fn hold(&mut self, hash: u64, message: impl FnOnce() -> Arc<[u8]>) {
        self.values.entry(hash).or_insert_with(|| (message(), 0)).1 += 1;
    }

    pub(super) fn has(&self, hash: u64) -> bool {
        self.values.contains_key(&hash)
    }

    pub(super) fn release(&mut self, hash: u64) {
        let Some((_, uses)) = self.values.get_mut(&hash) else { return };
        *uses -= 1;
        if *uses > 0 {
            return;
        }
        self.idle.push_back(hash);
        if self.idle.len() > IDLE
            && let Some(oldest) = self.idle.pop_front()
            && self.values.get(&oldest).is_some_and(|(_, uses)| *uses == 0)
        {
            self.values.remove(&oldest);
        }
    }

    pub(super) fn get(&self, hash: u64) -> Option<Arc<[u8]>> {
        self.values.get(&hash).map(|(message, _)| message.clone())
    }
}
