//! What a packet is made of, and its bytes.

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::bulk::Bulk;
use super::{ReplicaError, damaged};
use crate::FieldType;
use crate::codec::{PlainField, field_type_named};

const MAGIC: [u8; 4] = *b"UMBf";
const VERSION: u16 = 1;
/// Magic, version, checksum, length of the head.
const HEAD: usize = 4 + 2 + 8 + 4;

/// A field: the node's number in the application, and the field's index there.
pub(super) type Place = (u64, u16);

/// A node type by its name, with the fields that replicas learn of.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct TypeRecord {
    pub(super) name: String,
    pub(super) fields: Vec<(u16, PlainField)>,
}

/// All of a packet but values. The order of the members is that of applying them.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Head {
    pub(super) frame: u64,
    pub(super) time_s: f64,
    /// Of everything, after this frame.
    pub(super) hash: u64,
    pub(super) is_snapshot: bool,
    pub(super) types: Vec<(u32, TypeRecord)>,
    /// Long values and images that this packet refers to.
    pub(super) needs: Vec<u64>,
    pub(super) unrouted: Vec<(Place, Place)>,
    pub(super) fields_removed: Vec<Place>,
    pub(super) removed: Vec<u64>,
    pub(super) created: Vec<(u64, u32)>,
    pub(super) fields_added: Vec<(Place, PlainField)>,
    pub(super) names: Vec<(u64, String)>,
    pub(super) routes: Vec<(Place, Place, bool)>,
    /// Long values, by their hash.
    pub(super) long: Vec<(Place, u64)>,
}

/// Values of one field type, side by side.
#[derive(Default)]
pub(super) struct Group {
    /// The node's slot in the application, and the field's index there.
    pub(super) places: Vec<(u32, u16)>,
    pub(super) bytes: Vec<u8>,
}

/// A packet that was read; it borrows the bytes of the values.
pub struct Packet<'a> {
    pub(super) head: Head,
    pub(super) groups: Vec<(FieldType, &'a [u8], &'a [u8])>,
}

impl Packet<'_> {
    /// The number of the frame.
    pub fn frame(&self) -> u64 {
        self.head.frame
    }

    /// True if it holds everything, not only what changed.
    pub fn is_snapshot(&self) -> bool {
        self.head.is_snapshot
    }

    /// Hashes of long values that must be learned before the packet can be applied.
    pub fn missing(&self, bulk: &Bulk) -> Vec<u64> {
        self.head.needs.iter().copied().filter(|hash| !bulk.has(*hash)).collect()
    }
}

pub(super) fn write(head: &Head, groups: &std::collections::BTreeMap<FieldType, Group>) -> Vec<u8> {
    let mut bytes =
        Vec::with_capacity(256 + groups.values().map(|group| group.bytes.len() + 6 * group.places.len()).sum::<usize>());
    bytes.resize(HEAD, 0);
    bytes = postcard::to_extend(head, bytes).unwrap_or_default();
    let length = (bytes.len() - HEAD) as u32;
    for (field_type, group) in groups.iter().filter(|(_, group)| !group.places.is_empty()) {
        let name = field_type.to_string();
        bytes.push(name.len() as u8);
        bytes.extend_from_slice(name.as_bytes());
        bytes.extend_from_slice(&(group.places.len() as u32).to_le_bytes());
        bytes.extend_from_slice(&(group.bytes.len() as u32).to_le_bytes());
        for (slot, index) in &group.places {
            bytes.extend_from_slice(&slot.to_le_bytes());
            bytes.extend_from_slice(&index.to_le_bytes());
        }
        bytes.extend_from_slice(&group.bytes);
    }
    bytes[..4].copy_from_slice(&MAGIC);
    bytes[4..6].copy_from_slice(&VERSION.to_le_bytes());
    bytes[14..18].copy_from_slice(&length.to_le_bytes());
    let checksum = xxh3_64_with_seed(&bytes[14..], VERSION as u64);
    bytes[6..14].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

/// The places of a group.
pub(super) fn places(bytes: &[u8]) -> impl Iterator<Item = (u32, u16)> {
    bytes
        .chunks_exact(6)
        .map(|place| (u32::from_le_bytes([place[0], place[1], place[2], place[3]]), u16::from_le_bytes([place[4], place[5]])))
}

/// Takes bytes off the front.
fn take<'a>(rest: &mut &'a [u8], count: usize) -> Result<&'a [u8], ReplicaError> {
    let (taken, after) = rest.split_at_checked(count).ok_or_else(|| damaged("it is cut off"))?;
    *rest = after;
    Ok(taken)
}

fn number(rest: &mut &[u8]) -> Result<usize, ReplicaError> {
    let bytes = take(rest, 4)?;
    Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize)
}

impl<'a> Packet<'a> {
    /// Reads a packet and checks it.
    pub fn read(bytes: &'a [u8]) -> Result<Packet<'a>, ReplicaError> {
        let mut rest = bytes;
        if bytes.len() < HEAD || take(&mut rest, 4)? != MAGIC {
            return Err(ReplicaError::NotAPacket);
        }
        let found = u16::from_le_bytes([bytes[4], bytes[5]]);
        if found != VERSION {
            return Err(ReplicaError::WrongVersion { found, ours: VERSION });
        }
        if xxh3_64_with_seed(&bytes[14..], VERSION as u64).to_le_bytes() != bytes[6..14] {
            return Err(damaged("its checksum is wrong"));
        }
        rest = &bytes[14..];
        let length = number(&mut rest)?;
        let head = postcard::from_bytes(take(&mut rest, length)?).map_err(|error| damaged(error.to_string()))?;
        let mut groups = Vec::new();
        while !rest.is_empty() {
            let length = take(&mut rest, 1)?[0] as usize;
            let name = String::from_utf8_lossy(take(&mut rest, length)?);
            let field_type = field_type_named(&name).ok_or_else(|| damaged(format!("there is no field type `{name}`")))?;
            let (count, length) = (number(&mut rest)?, number(&mut rest)?);
            let places = take(&mut rest, count.saturating_mul(6))?;
            groups.push((field_type, places, take(&mut rest, length)?));
        }
        Ok(Packet { head, groups })
    }
}
