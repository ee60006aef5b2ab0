//! Saves: a graph as text to read, compare and edit, or as bytes.
//!
//! A save holds every node with its name, dynamic fields and values, every route, and what waits for the next frame. It does not hold who
//! observes, how often nodes were evaluated, or references to nodes that do not exist any more: those load as empty.
//!
//! Nodes stand in the order in which they were created and fields in the order of their declaration, so one graph gives one file. Types
//! are named, not described: what a type is, the reader knows. What a reader does not know is reported and kept out, the rest loads.

mod binary;
mod binary_read;
mod build;
mod outline;
mod parsed;
mod report;
mod text;
mod text_read;

pub use report::{Report, SaveError};

use crate::{Graph, NodeId, TypeRegistry};

/// Files of this major version can be read.
pub const MAJOR: u16 = 1;
/// Files of a later minor version can be read but for what was added since.
pub const MINOR: u16 = 0;

/// What to do with names that are taken when a file is loaded into a graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TakenNames {
    /// Refuse the file, and change nothing.
    #[default]
    Refuse,
    /// Append a number to the name, and report it.
    Number,
}

/// What was loaded.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// The new nodes, in the order of the file.
    pub nodes: Vec<NodeId>,
    /// What was kept out, and why.
    pub reports: Vec<Report>,
}

/// The graph as text: RON, a block for each node. One graph always gives the same text.
pub fn to_text(graph: &Graph) -> String {
    text::write(graph)
}

/// The graph as bytes: magic, version, checksum, sections.
pub fn to_binary(graph: &Graph) -> Vec<u8> {
    binary::write(graph)
}

/// Reads a graph from either form, with what was kept out. Types that scripts define must be registered before.
pub fn load(data: impl AsRef<[u8]>, types: impl Into<TypeRegistry>) -> Result<(Graph, Vec<Report>), SaveError> {
    let mut graph = Graph::new(types);
    let loaded = load_into(&mut graph, data, TakenNames::Refuse)?;
    Ok((graph, loaded.reports))
}

/// Adds what a file of either form holds to a graph. After an error the graph is as it was.
pub fn load_into(graph: &mut Graph, data: impl AsRef<[u8]>, taken: TakenNames) -> Result<Loaded, SaveError> {
    let data = data.as_ref();
    if graph.schedule.running {
        return Err(SaveError::Evaluating);
    }
    let parsed = if data.starts_with(&binary::MAGIC[..4]) {
        binary_read::read(data)?
    } else {
        let text = std::str::from_utf8(data).map_err(|error| SaveError::NotASave {
            fault: format!("byte {} is neither text nor the start of a binary save", error.valid_up_to()),
        })?;
        text_read::read(text)?
    };
    build::build(graph, &parsed, taken)
}
