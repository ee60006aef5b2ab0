//! What can be wrong with a model file, and where.

use std::path::PathBuf;

/// Why a model was not loaded: the file, the glTF object in it, and the cause.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// The model file.
    pub file: PathBuf,
    /// The object of the file, such as `accessor 3 'positions'`; empty for the file as a whole.
    pub object: String,
    /// What is wrong with it.
    pub cause: Cause,
}

/// Kinds of causes; each carries its message.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Cause {
    /// A file cannot be opened or read.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// Neither a whole .glb nor a .gltf.
    #[error("{0}")]
    Container(String),
    /// Not JSON, or not the JSON of a glTF.
    #[error("its JSON is not right: {0}")]
    Json(String),
    /// The file needs an extension that is not supported.
    #[error("it requires the extension {0}, which is not supported")]
    Extension(String),
    /// A reference or value that glTF does not allow.
    #[error("{0}")]
    Invalid(String),
    /// A file or data that the model names cannot be had.
    #[error("uri '{uri}' {why}")]
    Uri {
        /// The uri, shortened.
        uri: String,
        /// What is wrong with it.
        why: String,
    },
    /// Bytes that are too few, or are not what they should be.
    #[error("{0}")]
    Data(String),
    /// Cycles, two parents, or nodes nested too deep.
    #[error("{0}")]
    Hierarchy(String),
    /// More than [`LoadOptions`](super::LoadOptions) lets in.
    #[error("{0}")]
    Limit(String),
    /// The graph refused a node or a field.
    #[error("the graph refused it: {0}")]
    Graph(String),
    /// A mistake in the importer.
    #[error("the importer failed: {0}")]
    Internal(String),
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: ", self.file.display())?;
        if !self.object.is_empty() {
            write!(f, "{}: ", self.object)?;
        }
        write!(f, "{}", self.cause)
    }
}

impl std::error::Error for Error {}

/// An [`Error`] that does not know its file yet.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fault {
    pub(crate) object: String,
    pub(crate) cause: Cause,
}

impl Fault {
    pub(crate) fn new(object: impl Into<String>, cause: Cause) -> Fault {
        Fault { object: object.into(), cause }
    }

    pub(crate) fn data(object: impl Into<String>, message: impl Into<String>) -> Fault {
        Fault::new(object, Cause::Data(message.into()))
    }

    pub(crate) fn invalid(object: impl Into<String>, message: impl Into<String>) -> Fault {
        Fault::new(object, Cause::Invalid(message.into()))
    }

    pub(crate) fn in_file(self, file: &std::path::Path) -> Error {
        Error { file: file.to_owned(), object: self.object, cause: self.cause }
    }
}

/// `mesh 3 'Cube'`: how messages call an object of the file.
pub(crate) fn label(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {index} '{}'", shorten(name)),
        _ => format!("{kind} {index}"),
    }
}

/// At most 60 characters of `text`, for messages.
pub(crate) fn shorten(text: &str) -> String {
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
