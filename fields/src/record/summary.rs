//! What is in a recording, without playing it.

use std::collections::HashMap;
use std::fmt;
use std::io::Read;

use super::RecordError;
use super::blocks::{BlockKind, Blocks, EventRecord, FrameRecord, Place, TypeRecord};
use super::state::StateRecord;

/// How many of the most written fields are listed.
const MOST_WRITTEN: usize = 10;

/// What is in a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Frames.
    pub frames: u64,
    /// Times of the first and the last evaluation, in seconds.
    pub times_s: Option<(f64, f64)>,
    /// Bytes of the whole file.
    pub bytes: u64,
    /// Bytes of all frames, without keyframes and what is kept once.
    pub frame_bytes: u64,
    /// Keyframes, and their bytes.
    pub keyframes: (u64, u64),
    /// Images and long lists that are kept once, and their bytes.
    pub kept_once: (u64, u64),
    /// Nodes at the beginning.
    pub nodes_at_start: usize,
    /// Nodes created and deleted while it was recorded.
    pub created_deleted: (u64, u64),
    /// Writes from outside.
    pub writes: u64,
    /// Fields written in all frames together, by whomever.
    pub fields_written: u64,
    /// The fields most often written from outside: node, field, times.
    pub most_written: Vec<(String, String, u64)>,
    /// Node types.
    pub types: Vec<String>,
    /// Why it ends early, if it was cut off or damaged.
    pub truncated: Option<String>,
}

/// Reads a recording from beginning to end.
pub fn summary(reader: impl Read) -> Result<Summary, RecordError> {
    let blocks = Blocks::read(reader)?;
    let mut summary = Summary { bytes: blocks.data.len() as u64, ..Summary::default() };
    let mut names = Names::default();
    let mut writes: HashMap<Place, u64> = HashMap::new();
    let mut ended = false;
    for (block, (kind, range)) in blocks.found.iter().enumerate() {
        let length = range.len() as u64;
        match kind {
            BlockKind::Type => {
                let record: TypeRecord = blocks.decode(block)?;
                summary.types.push(record.name.clone());
                names.types.push(record);
            }
            BlockKind::Image | BlockKind::Blob => {
                summary.kept_once = (summary.kept_once.0 + 1, summary.kept_once.1 + length);
            }
            BlockKind::Keyframe => {
                if summary.keyframes.0 == 0 {
                    let state: StateRecord = blocks.decode(block)?;
                    summary.nodes_at_start = names.learn(&state);
                }
                summary.keyframes = (summary.keyframes.0 + 1, summary.keyframes.1 + length);
            }
            BlockKind::Frame => {
                let record: FrameRecord = blocks.decode(block)?;
                summary.frames += 1;
                summary.frame_bytes += length;
                summary.fields_written += record.changed.len() as u64;
                record.events.iter().for_each(|event| summary.count(event, &mut names, &mut writes));
            }
            BlockKind::End => ended = true,
        }
    }
    let mut most: Vec<_> = writes.into_iter().collect();
    most.sort_unstable_by_key(|(place, times)| (std::cmp::Reverse(*times), *place));
    let named = |(place, times): &(Place, u64)| {
        let (node, field) = names.of(*place);
        (node, field, *times)
    };
    summary.most_written = most.iter().take(MOST_WRITTEN).map(named).collect();
    summary.truncated = blocks.fault.or_else(|| (!ended).then(|| "the recording was not ended".into()));
    Ok(summary)
}

/// What nodes and fields are called.
#[derive(Default)]
struct Names {
    types: Vec<TypeRecord>,
    nodes: HashMap<u64, (u32, String)>,
    dynamic: HashMap<Place, String>,
}

impl Names {
    fn learn(&mut self, state: &StateRecord) -> usize {
        for (number, node_type, name, dynamic) in state.named_nodes() {
            self.nodes.insert(number, (node_type, name.into()));
            let declared = self.types.get(node_type as usize).map_or(0, |record| record.fields.len());
            for (place, field) in dynamic {
                self.dynamic.insert((number, (declared + place) as u16), field.into());
            }
        }
        self.nodes.len()
    }

    fn of(&self, (node, index): Place) -> (String, String) {
        let unknown = (u32::MAX, String::new());
        let (node_type, name) = self.nodes.get(&node).unwrap_or(&unknown);
        let record = self.types.get(*node_type as usize);
        let type_name = record.map_or("?", |record| &record.name);
        let field = record.and_then(|record| record.fields.get(index as usize)).map(|field| field.name.clone());
        let field = field.or_else(|| self.dynamic.get(&(node, index)).cloned()).unwrap_or_else(|| format!("#{index}"));
        (if name.is_empty() { format!("{type_name} #{node}") } else { name.clone() }, field)
    }
}

impl Summary {
    fn count(&mut self, event: &EventRecord, names: &mut Names, writes: &mut HashMap<Place, u64>) {
        match event {
            EventRecord::Frame(time_s) => self.times_s = Some((self.times_s.map_or(*time_s, |(first, _)| first), *time_s)),
            EventRecord::Created { node, node_type } => {
                self.created_deleted.0 += 1;
                names.nodes.insert(*node, (*node_type, String::new()));
            }
            EventRecord::Deleted(_) => self.created_deleted.1 += 1,
            EventRecord::Named(node, name) => {
                names.nodes.entry(*node).and_modify(|(_, old)| old.clone_from(name));
            }
            EventRecord::FieldAdded(place, field) => {
                names.dynamic.insert(*place, field.name.clone());
            }
            EventRecord::Wrote { field, .. } => {
                self.writes += 1;
                *writes.entry(*field).or_default() += 1;
            }
            _ => {}
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let each = |bytes: u64, count: u64| bytes as f64 / count.max(1) as f64;
        write!(f, "{} frames", self.frames)?;
        if let Some((first, last)) = self.times_s {
            write!(f, ", {first:.3} s to {last:.3} s")?;
        }
        writeln!(f, "; {} bytes, {:.1} a frame", self.bytes, each(self.frame_bytes, self.frames))?;
        let ((keyframes, bytes), (kept, kept_bytes)) = (self.keyframes, self.kept_once);
        writeln!(
            f,
            "{keyframes} keyframes of {:.0} bytes; {kept} images and long lists, {kept_bytes} bytes",
            each(bytes, keyframes)
        )?;
        let (created, deleted) = self.created_deleted;
        writeln!(f, "{} nodes at the start, {created} created, {deleted} deleted", self.nodes_at_start)?;
        writeln!(f, "{} writes from outside, {} fields written in all", self.writes, self.fields_written)?;
        for (node, field, times) in &self.most_written {
            writeln!(f, "  {times:>8}  {node}.{field}")?;
        }
        if let Some(fault) = &self.truncated {
            writeln!(f, "ends early: {fault}")?;
        }
        Ok(())
    }
}
