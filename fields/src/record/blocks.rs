//! The file: a head, then blocks with a kind, a length and a checksum, each written as a whole, so that a recording that was cut off is good
//! up to its last whole block.

use std::io::Write;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::RecordError;
use crate::codec::PlainField;

pub(super) const MAGIC: [u8; 8] = *b"\x89UMBREC\n";
pub(super) const MAJOR: u16 = 1;
pub(super) const MINOR: u16 = 0;
const HEAD: usize = 12;
/// Kind, length, checksum.
const BLOCK_HEAD: usize = 1 + 4 + 8;

/// What a block holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum BlockKind {
    Type = 1,
    Image = 2,
    /// A long value that fields held.
    Blob = 3,
    Keyframe = 4,
    Frame = 5,
    /// The recording was ended, not cut off.
    End = 6,
}

impl BlockKind {
    fn of(byte: u8) -> Option<Self> {
        use BlockKind::{Blob, End, Frame, Image, Keyframe, Type};
        [Type, Image, Blob, Keyframe, Frame, End].into_iter().find(|kind| *kind as u8 == byte)
    }
}

/// A field by its node's number and its index.
pub(super) type Place = (u64, u16);

/// A value in the encoding of values, or the number of the blob that holds it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum ValueRecord {
    Here(Vec<u8>),
    Blob(u32),
}

/// A type of nodes, as it was when the first node of it was recorded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct TypeRecord {
    pub(super) name: String,
    pub(super) fields: Vec<PlainField>,
    /// 0 nothing, 1 a function of the crate's, 2 the host.
    pub(super) evaluator: u8,
    pub(super) mode: u8,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct ImageRecord {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) rgba: Vec<u8>,
}

/// What happened; see `Event`. Nodes, routes and observers go by numbers that the recorder gave them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum EventRecord {
    Created { node: u64, node_type: u32 },
    Deleted(u64),
    Named(u64, String),
    FieldAdded(Place, Box<PlainField>),
    FieldRemoved(Place),
    Wrote { field: Place, silent: bool, value: ValueRecord },
    Touched(Place),
    Connected { route: u64, from: Place, to: Place, weak: bool, delivers: bool },
    Disconnected(u64),
    Rested(Vec<u64>),
    Carries { route: u64, field_type: String, value: ValueRecord },
    Observed { observer: u64, field: Place, token: u64 },
    Unobserved(u64),
    ModeSet(u64, u8),
    Woken(u64),
    Pulled(u64),
    Depends(u64, u64),
    Frame(f64),
    Told(Place, u64),
    HostEvaluates(u64),
    Leave,
}

/// What a field held after a frame: the value itself if it is short, or its hash.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Seen {
    Value(Vec<u8>),
    Hash(u64),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct FrameRecord {
    pub(super) events: Vec<EventRecord>,
    /// Every field that was written, in the order of its last write.
    pub(super) changed: Vec<(Place, Seen)>,
    /// Of all values after the frame.
    pub(super) hash: u64,
}

pub(super) fn write_head(writer: &mut impl Write) -> std::io::Result<u64> {
    writer.write_all(&MAGIC)?;
    writer.write_all(&MAJOR.to_le_bytes())?;
    writer.write_all(&MINOR.to_le_bytes())?;
    Ok(HEAD as u64)
}

/// Gives how many bytes were written.
pub(super) fn write_block(writer: &mut impl Write, kind: BlockKind, record: &impl Serialize) -> Result<u64, RecordError> {
    let payload = postcard::to_stdvec(record).map_err(|error| RecordError::Encoding { fault: error.to_string() })?;
    let length = u32::try_from(payload.len())
        .map_err(|_| RecordError::Encoding { fault: format!("a block of {} bytes is too long", payload.len()) })?;
    let mut block = Vec::with_capacity(BLOCK_HEAD + payload.len());
    block.push(kind as u8);
    block.extend(length.to_le_bytes());
    block.extend(xxh3_64_with_seed(&payload, kind as u64).to_le_bytes());
    block.extend(payload);
    writer.write_all(&block)?;
    Ok(block.len() as u64)
}

/// Where the blocks of a file are.
pub(super) struct Blocks {
    pub(super) data: Vec<u8>,
    pub(super) found: Vec<(BlockKind, std::ops::Range<usize>)>,
    /// Blocks of kinds that a later version added.
    pub(super) unknown: usize,
    /// Why what follows the last block found cannot be read.
    pub(super) fault: Option<String>,
}

impl Blocks {
    pub(super) fn read(mut reader: impl std::io::Read) -> Result<Self, RecordError> {
        let mut data = Vec::new();
        reader.read_to_end(&mut data)?;
        if data.len() < HEAD || data[..8] != MAGIC {
            return Err(RecordError::NotARecording);
        }
        let (major, minor) = (u16::from_le_bytes([data[8], data[9]]), u16::from_le_bytes([data[10], data[11]]));
        if major != MAJOR {
            return Err(RecordError::WrongVersion { major, minor });
        }
        let mut blocks = Self { data, found: Vec::new(), unknown: 0, fault: None };
        let mut at = HEAD;
        while at < blocks.data.len() {
            match blocks.check(at) {
                Ok((kind, payload)) => {
                    at = payload.end;
                    match kind {
                        Some(kind) => blocks.found.push((kind, payload)),
                        None => blocks.unknown += 1,
                    }
                }
                Err(fault) => {
                    blocks.fault = Some(format!("byte {at}: {fault}"));
                    break;
                }
            }
        }
        Ok(blocks)
    }

    fn check(&self, at: usize) -> Result<(Option<BlockKind>, std::ops::Range<usize>), String> {
        let rest = &self.data[at..];
        let Some((head, rest)) = rest.split_at_checked(BLOCK_HEAD) else {
            return Err("the file ends within the head of a block".into());
        };
        let length = u32::from_le_bytes([head[1], head[2], head[3], head[4]]) as usize;
        let Some(payload) = rest.get(..length) else {
            return Err(format!("the file ends within a block: {} of {length} bytes are there", rest.len()));
        };
        if xxh3_64_with_seed(payload, head[0] as u64).to_le_bytes() != head[5..] {
            return Err("the checksum of a block does not fit".into());
        }
        let start = at + BLOCK_HEAD;
        Ok((BlockKind::of(head[0]), start..start + length))
    }

    pub(super) fn decode<T: DeserializeOwned>(&self, block: usize) -> Result<T, RecordError> {
        let (kind, range) = &self.found[block];
        postcard::from_bytes(&self.data[range.clone()]).map_err(|error| RecordError::Damaged {
            fault: format!("byte {}: a block of kind {kind:?} cannot be read: {error}", range.start),
        })
    }
}
