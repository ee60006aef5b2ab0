//! Plays a recording, and compares.

use std::io::Read;

use super::blocks::{BlockKind, Blocks, FrameRecord, ImageRecord, Place, Seen};
use super::hashes::{Changed, Hashes, seen_now};
use super::numbers::Numbers;
use super::playback::Playback;
use super::types::Types;
use super::{Divergence, RecordError, restore, state};
use crate::{FieldId, Graph, TypeRegistry, Value};

/// One frame that was replayed.
#[derive(Clone, Debug, PartialEq)]
pub struct Replayed {
    /// The frame, from one.
    pub frame: u64,
    /// The time at which it was evaluated, in seconds; none if it was not.
    pub time_s: Option<f64>,
    /// Fields that were written in it.
    pub written: usize,
    /// The first difference, if there is one.
    pub divergence: Option<Divergence>,
}

/// Replays one recording on one graph.
pub struct Replayer {
    blocks: Blocks,
    frames: Vec<usize>,
    /// Frames before it, and block.
    keyframes: Vec<(u64, usize)>,
    ended: bool,
    numbers: Numbers,
    types: Types,
    hashes: Hashes,
    registry: TypeRegistry,
    position: u64,
}

impl Replayer {
    /// Reads a recording and makes the graph with which it begins. Types that were evaluated by scripts need not be registered.
    pub fn open(reader: impl Read, types: impl Into<TypeRegistry>) -> Result<(Self, Graph), RecordError> {
        let blocks = Blocks::read(reader)?;
        let of_kind =
            |kind| blocks.found.iter().enumerate().filter(move |(_, (other, _))| *other == kind).map(|(block, _)| block);
        let frames: Vec<usize> = of_kind(BlockKind::Frame).collect();
        let before = |block: usize| frames.partition_point(|frame| *frame < block) as u64;
        let keyframes = of_kind(BlockKind::Keyframe).map(|block| (before(block), block)).collect();
        let ended = of_kind(BlockKind::End).next().is_some();
        let (numbers, registry) = (Numbers::new(), types.into());
        let (types, hashes) = (Types::default(), Hashes::default());
        let mut replayer = Self { blocks, frames, keyframes, ended, numbers, types, hashes, registry, position: 0 };
        replayer.types.records = replayer.all(BlockKind::Type)?;
        let graph = replayer.keyframe(0)?;
        Ok((replayer, graph))
    }

    fn all<T: serde::de::DeserializeOwned>(&self, kind: BlockKind) -> Result<Vec<T>, RecordError> {
        let blocks = self.blocks.found.iter().enumerate().filter(|(_, (other, _))| *other == kind);
        blocks.map(|(block, _)| self.blocks.decode(block)).collect()
    }

    /// How many frames there are.
    pub fn frames(&self) -> u64 {
        self.frames.len() as u64
    }

    /// How many frames were played to come to where the graph is.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Why the recording ends early, if it was cut off or damaged.
    pub fn truncated(&self) -> Option<String> {
        let frames = self.frames();
        match &self.blocks.fault {
            Some(fault) => Some(format!("the recording is good up to frame {frames}; {fault}")),
            None if !self.ended => Some(format!("the recording was not ended; it is good up to frame {frames}")),
            None => None,
        }
    }

    /// Plays the next frame on the graph that this replayer made, and compares; none after the last.
    pub fn step(&mut self, graph: &mut Graph) -> Result<Option<Replayed>, RecordError> {
        let Some(block) = self.frames.get(self.position as usize) else { return Ok(None) };
        let record: FrameRecord = self.blocks.decode(*block)?;
        let mut playback = Playback {
            events: &record.events,
            at: 0,
            numbers: &mut self.numbers,
            types: &mut self.types,
            time_s: None,
            fault: None,
        };
        while playback.at < record.events.len() {
            playback.play(graph);
        }
        let (time_s, fault) = (playback.time_s, playback.fault);
        let changed = self.hashes.update(graph, &mut self.numbers);
        self.position += 1;
        let differs = fault.is_some() || self.hashes.hash(graph) != record.hash;
        let divergence = differs.then(|| self.divergence(graph, &record, &changed, fault));
        Ok(Some(Replayed { frame: self.position, time_s, written: changed.len(), divergence }))
    }

    /// Brings the graph to where so many frames were played: zero is the beginning.
    pub fn seek(&mut self, graph: &mut Graph, frame: u64) -> Result<(), RecordError> {
        if frame > self.frames() {
            return Err(RecordError::NoSuchFrame { frame, frames: self.frames() });
        }
        let nearest = self.keyframes.partition_point(|(before, _)| *before <= frame).saturating_sub(1);
        if self.position > frame || self.position < self.keyframes[nearest].0 {
            *graph = self.keyframe(nearest)?;
        }
        while self.position < frame {
            self.step(graph)?;
        }
        Ok(())
    }

    fn keyframe(&mut self, keyframe: usize) -> Result<Graph, RecordError> {
        let Some((before, block)) = self.keyframes.get(keyframe).copied() else {
            return Err(RecordError::Damaged { fault: "there is no keyframe".into() });
        };
        self.numbers = Numbers::new();
        self.types.reset();
        for record in self.all::<ImageRecord>(BlockKind::Image)? {
            let image = crate::Image { width: record.width, height: record.height, rgba: record.rgba.into() };
            if image.rgba.len() as u128 != 4 * image.width as u128 * image.height as u128 {
                return Err(RecordError::Damaged { fault: "a picture has not the size it says".into() });
            }
            self.numbers.learn_image(image.into());
        }
        self.numbers.known_blobs = self.all(BlockKind::Blob)?;
        let state: state::StateRecord = self.blocks.decode(block)?;
        let graph = restore::restore(Graph::new(self.registry.clone()), &state, &mut self.types, &mut self.numbers)?;
        self.hashes = Hashes::of(&graph, &mut self.numbers);
        if self.hashes.hash(&graph) != state.hash || state.frame != before {
            return Err(RecordError::Damaged { fault: format!("keyframe {before} does not have the values it had") });
        }
        self.position = before;
        Ok(graph)
    }

    /// Names the first field that differs.
    fn divergence(&mut self, graph: &Graph, record: &FrameRecord, changed: &[Changed], fault: Option<String>) -> Divergence {
        let mut divergence = Divergence {
            frame: self.position,
            node: String::new(),
            field: String::new(),
            recorded: String::new(),
            replayed: String::new(),
            message: fault.unwrap_or_default(),
        };
        for (place, seen) in &record.changed {
            let field = FieldId { node: self.numbers.nodes.keys.get(&place.0).copied().unwrap_or_default(), index: place.1 };
            let now = seen_now(graph, field, &mut self.numbers);
            if now.as_ref() != Some(seen) {
                if graph.contains(field.node) {
                    self.name_field(&mut divergence, graph, field, Some(seen));
                } else if divergence.message.is_empty() {
                    divergence.message = format!("field {} of node {} was written; there is no such node now", place.1, place.0);
                }
                return divergence;
            }
        }
        let listed = |place: &Place| record.changed.iter().any(|(other, _)| other == place);
        if let Some(unlisted) = changed.iter().find(|changed| !listed(&changed.place)) {
            self.name_field(&mut divergence, graph, unlisted.field, None);
        } else if divergence.message.is_empty() {
            divergence.message = "names, nodes or routes differ, or a field that differed before".into();
        }
        divergence
    }

    fn name_field(&mut self, divergence: &mut Divergence, graph: &Graph, field: FieldId, seen: Option<&Seen>) {
        divergence.node = graph.describe(field.node);
        divergence.field = graph.describe_field(field);
        let field_type = graph.declaration(field).ok().map(|declared| declared.field_type);
        let known = |bytes: &[u8], numbers: &mut Numbers| numbers.value_seen(bytes, field_type?);
        divergence.recorded = match seen {
            None => "not written".into(),
            Some(Seen::Hash(hash)) => format!("a value with hash {hash:016x}"),
            Some(Seen::Value(bytes)) => {
                known(bytes, &mut self.numbers).map_or_else(|| format!("{bytes:?}"), |value| show(&value))
            }
        };
        divergence.replayed = match graph.value(field) {
            Ok(value) => match seen_now(graph, field, &mut self.numbers) {
                Some(Seen::Hash(hash)) => format!("{} with hash {hash:016x}", shorten(&show(&value))),
                _ => show(&value),
            },
            Err(error) => error.to_string(),
        };
    }
}

fn show(value: &Value) -> String {
    format!("{value:?}")
}

fn shorten(text: &str) -> String {
    const SHOWN: usize = 80;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.into(),
    }
}
