//! What drives the graph: a world with its script, or a recording.

use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use umbriel_fields::record::{Divergence, Options, RecordError, Recorder, Replayer, Summary, summary};
use umbriel_fields::{Graph, NodeId, NodeType, TypeRegistry, builtin_types};
use umbriel_scripts::World;

/// Why a recording cannot be made or used: the file, and the reason.
#[derive(Debug, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub(crate) struct RecordingError {
    path: PathBuf,
    reason: RecordError,
}

/// What makes the frames.
pub(crate) enum Source {
    /// A script and its graph.
    World(Box<World>),
    /// What was recorded.
    Replay(Box<Replay>),
}

impl Source {
    /// The graph.
    pub(crate) fn graph(&self) -> &Graph {
        match self {
            Source::World(world) => world.graph(),
            Source::Replay(replay) => &replay.graph,
        }
    }

    /// The graph, to be changed between frames.
    pub(crate) fn graph_mut(&mut self) -> &mut Graph {
        match self {
            Source::World(world) => world.graph_mut(),
            Source::Replay(replay) => &mut replay.graph,
        }
    }

    /// Where a script made a node: file, line and column.
    pub(crate) fn made_at(&self, node: NodeId) -> Option<(String, usize, usize)> {
        match self {
            Source::World(world) => world.made_at(node),
            Source::Replay(_) => None,
        }
    }

    /// Changes when the graph is another one than before.
    pub(crate) fn generation(&self) -> u64 {
        match self {
            Source::World(world) => world.generation(),
            Source::Replay(_) => 0,
        }
    }

    /// Runs one frame; gives what was reported. A replay takes the time from the recording, and stays at its last frame.
    pub(crate) fn step(&mut self, time_s: f64) -> Vec<String> {
        match self {
            Source::World(world) => {
                world.step(time_s);
                world.problems().iter().map(ToString::to_string).collect()
            }
            Source::Replay(replay) => match replay.step() {
                Ok(Some(divergence)) => vec![format!("the replay differs: {divergence}")],
                Ok(None) => Vec::new(),
                Err(error) => vec![error.to_string()],
            },
        }
    }
}

/// A recording that is played on a graph of its own.
pub(crate) struct Replay {
    path: PathBuf,
    graph: Graph,
    replayer: Replayer,
    last: bool,
}

impl Replay {
    /// Opens a recording at its beginning.
    pub(crate) fn open(path: &Path) -> Result<Replay, RecordingError> {
        let (replayer, graph) = in_file(path, || Replayer::open(BufReader::new(File::open(path)?), types()))?;
        Ok(Replay { path: path.to_path_buf(), graph, replayer, last: false })
    }

    /// Plays the next frame; gives the first difference from the recording, if there is one.
    pub(crate) fn step(&mut self) -> Result<Option<Divergence>, RecordingError> {
        let Replay { path, graph, replayer, .. } = self;
        let frame = in_file(path, || replayer.step(graph))?;
        self.last = frame.is_none();
        Ok(frame.and_then(|f| f.divergence))
    }

    /// Was the last frame played, and another one asked for?
    pub(crate) fn is_over(&self) -> bool {
        self.last
    }

    /// Goes to where so many frames were played.
    pub(crate) fn seek(&mut self, frame: u64) -> Result<(), RecordingError> {
        let Replay { path, graph, replayer, .. } = self;
        in_file(path, || replayer.seek(graph, frame))
    }

    /// Frames of the recording.
    pub(crate) fn frames(&self) -> u64 {
        self.replayer.frames()
    }

    /// Frames that were played.
    pub(crate) fn position(&self) -> u64 {
        self.replayer.position()
    }

    /// Why the recording ends early, where it does.
    pub(crate) fn truncated(&self) -> Option<String> {
        self.replayer.truncated()
    }

    /// The graph, to ask it why.
    pub(crate) fn graph_mut(&mut self) -> &mut Graph {
        &mut self.graph
    }
}

/// What is in a recording.
pub(crate) fn overview(path: &Path) -> Result<Summary, RecordingError> {
    in_file(path, || summary(BufReader::new(File::open(path)?)))
}

/// A recording that is being made.
pub(crate) struct Recording {
    path: PathBuf,
    recorder: Recorder<BufWriter<File>>,
}

impl Recording {
    /// Records `graph` from now on.
    pub(crate) fn start(graph: &mut Graph, path: &Path) -> Result<Recording, RecordingError> {
        let recorder = in_file(path, || Recorder::new(graph, BufWriter::new(File::create(path)?), Options::default()))?;
        Ok(Recording { path: path.to_path_buf(), recorder })
    }

    /// Writes the frame that was just evaluated.
    pub(crate) fn frame(&mut self, graph: &mut Graph) -> Result<(), RecordingError> {
        in_file(&self.path, || self.recorder.frame(graph))
    }

    /// Ends the file; gives the number of frames.
    pub(crate) fn finish(self, graph: &mut Graph) -> Result<u64, RecordingError> {
        let frames = self.recorder.frames();
        in_file(&self.path, || Ok(self.recorder.finish(graph)?.flush()?))?;
        Ok(frames)
    }
}

fn in_file<T>(path: &Path, work: impl FnOnce() -> Result<T, RecordError>) -> Result<T, RecordingError> {
    work().map_err(|reason| RecordingError { path: path.to_path_buf(), reason })
}

/// All types that worlds are made of.
fn types() -> TypeRegistry {
    let types: Vec<NodeType> = umbriel_scenegraph::node_types().into_iter().chain(builtin_types()).collect();
    types.into()
}
