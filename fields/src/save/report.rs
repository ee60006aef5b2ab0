//! What a reader says about a file.

use std::fmt;

/// Something in a file that was kept out or changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The line of a text file, from one.
    pub line: Option<usize>,
    /// The node's name in the file; empty if it is about no node.
    pub node: String,
    /// The field, if it is about one.
    pub field: Option<String>,
    /// What is wrong, with the nearest valid name.
    pub message: String,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        match (self.node.as_str(), &self.field) {
            ("", None) => {}
            ("", Some(field)) => write!(f, "`{field}`: ")?,
            (node, None) => write!(f, "`{node}`: ")?,
            (node, Some(field)) => write!(f, "`{node}.{field}`: ")?,
        }
        f.write_str(&self.message)
    }
}

/// Why a file cannot be loaded at all.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SaveError {
    /// It is something else.
    #[error("this is no saved world: {fault}")]
    NotASave {
        /// What was found instead.
        fault: String,
    },
    /// The text is not well-formed.
    #[error("line {line}, column {column}: {fault}")]
    Syntax {
        /// From one.
        line: usize,
        /// From one.
        column: usize,
        /// What is wrong.
        fault: String,
    },
    /// The bytes are not what was written.
    #[error("the file is damaged: {fault}")]
    Damaged {
        /// How it shows.
        fault: String,
    },
    /// Written by a later version that changed the format.
    #[error(
        "the file has format version {major}.{minor}; versions from {}.0 on up to the next major one can be read",
        super::MAJOR
    )]
    WrongVersion {
        /// Of the file.
        major: u16,
        /// Of the file.
        minor: u16,
    },
    /// Loaded into a graph that has nodes of the same names.
    #[error("the names {names} are taken")]
    NamesTaken {
        /// Some of the names, quoted.
        names: String,
    },
    /// Asked for inside of an evaluation.
    #[error("nothing can be loaded while the graph is being evaluated")]
    Evaluating,
}
