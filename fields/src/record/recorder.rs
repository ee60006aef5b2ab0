//! Writes a recording.

use std::io::Write;

use super::blocks::{BlockKind, EventRecord, FrameRecord, ImageRecord, ValueRecord, write_block, write_head};
use super::hashes::Hashes;
use super::numbers::{Definition, Numbers, mode_number};
use super::{Event, Journal, RecordError, state};
use crate::codec::PlainField;
use crate::{Graph, Strength, Value};

/// How to record.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Frames between keyframes, which hold the whole graph: fewer make seeking faster and the file larger. Zero for none but the first.
    pub keyframe_every: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { keyframe_every: 600 }
    }
}

/// Records a graph from now on.
///
/// A frame costs time and bytes in proportion to the fields written in it, whatever the size of the graph; a keyframe in proportion to
/// the graph. Lists and images that do not change are kept once for the whole file.
pub struct Recorder<W: Write> {
    writer: W,
    options: Options,
    numbers: Numbers,
    hashes: Hashes,
    frames: u64,
    bytes: u64,
}

impl<W: Write> Recorder<W> {
    /// Starts: writes the graph as it is, and has it note what happens to it.
    pub fn new(graph: &mut Graph, mut writer: W, options: Options) -> Result<Self, RecordError> {
        if graph.journal.is_some() {
            return Err(RecordError::Recording);
        }
        if graph.schedule.running {
            return Err(RecordError::Evaluating);
        }
        let mut numbers = Numbers::new();
        // The order of places makes the same graph the same file.
        for node in graph.nodes() {
            numbers.nodes.number(node);
        }
        let hashes = Hashes::of(graph, &mut numbers);
        let bytes = write_head(&mut writer)?;
        let mut recorder = Self { writer, options, numbers, hashes, frames: 0, bytes };
        recorder.keyframe(graph)?;
        graph.journal = Some(Journal::default());
        Ok(recorder)
    }

    /// To be called after each evaluation of the graph: writes what happened since the last call.
    pub fn frame(&mut self, graph: &mut Graph) -> Result<(), RecordError> {
        if graph.schedule.running {
            return Err(RecordError::Evaluating);
        }
        let events = graph.journal.as_mut().map(|journal| std::mem::take(&mut journal.events)).unwrap_or_default();
        let events = events.iter().map(|event| self.event(event)).collect();
        let changed = self.hashes.update(graph, &mut self.numbers);
        let changed = changed.into_iter().map(|changed| (changed.place, changed.seen)).collect();
        let record = FrameRecord { events, changed, hash: self.hashes.hash(graph) };
        self.define()?;
        self.bytes += write_block(&mut self.writer, BlockKind::Frame, &record)?;
        self.frames += 1;
        if self.options.keyframe_every > 0 && self.frames.is_multiple_of(self.options.keyframe_every) {
            self.keyframe(graph)?;
        }
        Ok(())
    }

    /// Ends the recording: what happened since the last frame is not in it. Gives the writer back.
    pub fn finish(mut self, graph: &mut Graph) -> Result<W, RecordError> {
        graph.journal = None;
        write_block(&mut self.writer, BlockKind::End, &self.frames)?;
        self.writer.flush()?;
        Ok(self.writer)
    }

    /// Frames written.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Bytes written.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    fn keyframe(&mut self, graph: &mut Graph) -> Result<(), RecordError> {
        let state = state::record(graph, &mut self.numbers, self.frames, self.hashes.hash(graph));
        self.define()?;
        self.bytes += write_block(&mut self.writer, BlockKind::Keyframe, &state)?;
        Ok(())
    }

    /// Writes what got a number since.
    fn define(&mut self) -> Result<(), RecordError> {
        for definition in std::mem::take(&mut self.numbers.definitions) {
            self.bytes += match definition {
                Definition::Type(record) => write_block(&mut self.writer, BlockKind::Type, &record)?,
                Definition::Blob(bytes) => write_block(&mut self.writer, BlockKind::Blob, &bytes)?,
                Definition::Image(image) => {
                    let record = ImageRecord { width: image.width, height: image.height, rgba: image.rgba.to_vec() };
                    write_block(&mut self.writer, BlockKind::Image, &record)?
                }
            };
        }
        Ok(())
    }

    fn value(&mut self, value: &Value) -> ValueRecord {
        self.numbers.record(value)
    }

    fn event(&mut self, event: &Event) -> EventRecord {
        let mut node = |id: &_| self.numbers.nodes.number(*id);
        match event {
            Event::Created(id, node_type) => {
                EventRecord::Created { node: node(id), node_type: self.numbers.node_type(node_type) }
            }
            Event::Deleted(id) => EventRecord::Deleted(node(id)),
            Event::Named(id, name) => EventRecord::Named(node(id), name.as_deref().unwrap_or_default().into()),
            Event::FieldAdded(field, added) => {
                EventRecord::FieldAdded(self.numbers.place(*field), Box::new(PlainField::of(added, &mut self.numbers)))
            }
            Event::FieldRemoved(field) => EventRecord::FieldRemoved(self.numbers.place(*field)),
            Event::Wrote { field, value, silent } => {
                EventRecord::Wrote { field: self.numbers.place(*field), silent: *silent, value: self.value(value) }
            }
            Event::Touched(field) => EventRecord::Touched(self.numbers.place(*field)),
            Event::Connected { route, from, to, strength, .. } | Event::Linked { route, from, to, strength } => {
                EventRecord::Connected {
                    route: self.numbers.routes.number(*route),
                    from: self.numbers.place(*from),
                    to: self.numbers.place(*to),
                    weak: *strength == Strength::Weak,
                    delivers: matches!(event, Event::Connected { .. }),
                }
            }
            Event::Disconnected(route) => {
                let number = self.numbers.routes.number(*route);
                self.numbers.routes.forget(*route);
                EventRecord::Disconnected(number)
            }
            Event::Rested(nodes) => EventRecord::Rested(nodes.iter().map(node).collect()),
            Event::Carries(route, value) => EventRecord::Carries {
                route: self.numbers.routes.number(*route),
                field_type: value.field_type().to_string(),
                value: self.value(value),
            },
            Event::Observed { observer, field, token } => EventRecord::Observed {
                observer: self.numbers.observers.number(*observer),
                field: self.numbers.place(*field),
                token: *token,
            },
            Event::Unobserved(observer) => {
                let number = self.numbers.observers.number(*observer);
                self.numbers.observers.forget(*observer);
                EventRecord::Unobserved(number)
            }
            Event::ModeSet(id, mode) => EventRecord::ModeSet(node(id), mode_number(*mode)),
            Event::Woken(id) => EventRecord::Woken(node(id)),
            Event::Pulled(id) => EventRecord::Pulled(node(id)),
            Event::Depends(id, on) => EventRecord::Depends(node(id), node(on)),
            Event::Frame(time_s) => EventRecord::Frame(*time_s),
            Event::Told(field, token) => EventRecord::Told(self.numbers.place(*field), *token),
            Event::HostEvaluates(id) => EventRecord::HostEvaluates(node(id)),
            Event::Leave => EventRecord::Leave,
        }
    }
}
