//! What a packet is made of, and its bytes.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::bulk::Bulk;
use super::runs::{RunWriter, Runs};
use super::{ReplicaError, damaged};
use crate::FieldType;
use crate::codec::{PlainField, field_type_named};

const MAGIC: [u8; 4] = *b"UMBf";
const VERSION: u16 = 3;
/// The checksum is behind magic and version, and before all that it checks.
const CHECKSUM: Range<usize> = 6..CHECKED;
const CHECKED: usize = 6 + 8;
/// The checksum of a packet that does not leave the machine on which it was made.
const UNSEALED: u64 = 0;
/// The length of the head follows, and then the values; the head comes last, since it tells of all of them.
const VALUES: usize = CHECKED + 4;

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
    /// Short ones, in the order in which they lie in the packet.
    pub(super) groups: Vec<GroupRecord>,
}

/// Values of one field of many nodes, side by side, and then the runs of those nodes.
#[derive(Serialize, Deserialize)]
pub(super) struct GroupRecord {
    field_type: String,
    pub(super) field: FieldOf,
    value_bytes: u32,
    run_bytes: u32,
}

/// Which field of its nodes a group holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) enum FieldOf {
    /// One that all nodes of a type have, by its index there.
    Type(u16),
    /// One that single nodes have beside it.
    Node(u16),
}

/// Values that come one by one, side by side.
#[derive(Default)]
pub(super) struct Group {
    pub(super) values: Vec<u8>,
    pub(super) runs: RunWriter,
}

/// A packet in the making.
pub(super) struct Draft {
    pub(super) head: Head,
    pub(super) groups: BTreeMap<(FieldType, FieldOf), Group>,
    bytes: Vec<u8>,
}

impl Draft {
    /// An empty one, in memory that may have been another's, for so many bytes as a rule.
    pub(super) fn new(mut bytes: Vec<u8>, usual_length: usize) -> Draft {
        bytes.clear();
        bytes.reserve(usual_length + usual_length / 8 + 256);
        bytes.resize(VALUES, 0);
        Draft { head: Head::default(), groups: BTreeMap::new(), bytes }
    }

    /// Appends a group whose values a function writes.
    pub(super) fn group(&mut self, field_type: FieldType, field: FieldOf, write: impl FnOnce(&mut Vec<u8>, &mut RunWriter)) {
        let start = self.bytes.len();
        let mut runs = RunWriter::default();
        write(&mut self.bytes, &mut runs);
        self.end_group(field_type, field, start, &runs);
    }

    fn end_group(&mut self, field_type: FieldType, field: FieldOf, start: usize, runs: &RunWriter) {
        if runs.is_empty() {
            return;
        }
        let end = self.bytes.len();
        runs.write(&mut self.bytes);
        let (value_bytes, run_bytes) = ((end - start) as u32, (self.bytes.len() - end) as u32);
        self.head.groups.push(GroupRecord { field_type: field_type.to_string(), field, value_bytes, run_bytes });
    }

    /// All of it as bytes.
    pub(super) fn finish(mut self) -> Vec<u8> {
        for ((field_type, field), group) in std::mem::take(&mut self.groups) {
            let start = self.bytes.len();
            self.bytes.extend_from_slice(&group.values);
            self.end_group(field_type, field, start, &group.runs);
        }
        let head = postcard::to_stdvec(&self.head).unwrap_or_default();
        let mut bytes = self.bytes;
        bytes.extend_from_slice(&head);
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4..6].copy_from_slice(&VERSION.to_le_bytes());
        bytes[CHECKED..VALUES].copy_from_slice(&(head.len() as u32).to_le_bytes());
        bytes[CHECKSUM].copy_from_slice(&UNSEALED.to_le_bytes());
        bytes
    }
}

fn checksum(bytes: &[u8]) -> u64 {
    xxh3_64_with_seed(&bytes[CHECKED..], VERSION as u64).max(UNSEALED + 1)
}

/// Writes the checksum into a packet that is to leave this machine.
pub fn seal(packet: &mut [u8]) {
    if packet.len() >= VALUES {
        let checksum = checksum(packet);
        packet[CHECKSUM].copy_from_slice(&checksum.to_le_bytes());
    }
}

/// A packet that was read.
pub struct Packet<'a> {
    pub(super) head: Head,
    bytes: Cow<'a, [u8]>,
    groups: Vec<GroupAt>,
}

/// Where a group lies in the bytes.
struct GroupAt {
    field_type: FieldType,
    field: FieldOf,
    values: Range<usize>,
    runs: Range<usize>,
}

/// A group that was read.
#[derive(Clone, Copy)]
pub(super) struct GroupRead<'a> {
    pub(super) field_type: FieldType,
    pub(super) field: FieldOf,
    pub(super) values: &'a [u8],
    pub(super) runs: Runs<'a>,
}

impl<'a> Packet<'a> {
    /// Reads a packet and checks it, its checksum only where it was [sealed](seal). Takes its bytes, or borrows them.
    pub fn read(bytes: impl Into<Cow<'a, [u8]>>) -> Result<Packet<'a>, ReplicaError> {
        let bytes = bytes.into();
        if bytes.len() < VALUES || bytes[..4] != MAGIC {
            return Err(ReplicaError::NotAPacket);
        }
        let found = u16::from_le_bytes([bytes[4], bytes[5]]);
        if found != VERSION {
            return Err(ReplicaError::WrongVersion { found, ours: VERSION });
        }
        let sealed = u64::from_le_bytes(std::array::from_fn(|place| bytes[CHECKSUM.start + place]));
        if sealed != UNSEALED && sealed != checksum(&bytes) {
            return Err(damaged("its checksum is wrong"));
        }
        let length = u32::from_le_bytes(std::array::from_fn(|place| bytes[CHECKED + place])) as usize;
        let start = bytes.len().checked_sub(length).filter(|start| *start >= VALUES).ok_or_else(|| damaged("it is cut off"))?;
        let head: Head = postcard::from_bytes(&bytes[start..]).map_err(|error| damaged(error.to_string()))?;
        let mut groups = Vec::with_capacity(head.groups.len());
        let mut at = VALUES;
        for record in &head.groups {
            let name = &record.field_type;
            let field_type = field_type_named(name).ok_or_else(|| damaged(format!("there is no field type `{name}`")))?;
            let values = at..at.saturating_add(record.value_bytes as usize);
            let runs = values.end..values.end.saturating_add(record.run_bytes as usize);
            at = runs.end;
            groups.push(GroupAt { field_type, field: record.field, values, runs });
        }
        if at != start {
            return Err(damaged("its values are cut off, or too many"));
        }
        Ok(Packet { head, bytes, groups })
    }

    pub(super) fn groups(&self) -> impl Iterator<Item = Result<GroupRead<'_>, ReplicaError>> {
        self.groups.iter().map(|GroupAt { field_type, field, values, runs }| {
            let runs = Runs::read(&self.bytes[runs.clone()])?;
            Ok(GroupRead { field_type: *field_type, field: *field, values: &self.bytes[values.clone()], runs })
        })
    }

    /// The memory of its bytes, to be used again.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes.into_owned()
    }

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
