//! What went wrong in a script, and where.

use std::fmt;
use std::path::PathBuf;

use rhai::{Dynamic, EvalAltResult, ParseErrorType, Position};
use umbriel_fields::nearest;

use crate::source::Source;

/// Why a world could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum ScriptError {
    /// The file of the world, or one that it includes, cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// The file is no saved world, or none that can be read.
    #[error("{}: {reason}", path.display())]
    Save {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The script is wrong, or went wrong while it ran.
    #[error("{0}")]
    Script(Problem),
}

impl ScriptError {
    /// The place in the script, if the file could be read at all.
    pub fn problem(&self) -> Option<&Problem> {
        match self {
            ScriptError::Script(problem) => Some(problem),
            ScriptError::Unreadable { .. } | ScriptError::Save { .. } => None,
        }
    }
}

impl From<Problem> for ScriptError {
    fn from(problem: Problem) -> Self {
        ScriptError::Script(problem)
    }
}

/// One mistake in a script, with all that is known of its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// What is wrong, in one or two sentences, with the nearest right name where a name was wrong.
    pub message: String,
    /// The file, relative to the world's folder.
    pub file: String,
    /// The line, from 1; 0 where no place is known.
    pub line: usize,
    /// The column, from 1; 0 where no place is known.
    pub column: usize,
    /// The node that was worked on, as `Type "name"`.
    pub node: Option<String>,
    /// The field that was worked on.
    pub field: Option<String>,
    /// The calls that led there, innermost first, as `function, called in file:line`.
    pub calls: Vec<String>,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}: {}", self.file, self.message)?,
            _ => write!(f, "{}:{}:{}: {}", self.file, self.line, self.column, self.message)?,
        }
        if let Some(field) = self.field.as_ref().filter(|f| !self.message.contains(f.as_str())) {
            write!(f, " (field `{field}`)")?;
        }
        if let Some(node) = self.node.as_ref().filter(|n| !self.message.contains(n.as_str())) {
            write!(f, " (node {node})")?;
        }
        self.calls.iter().try_for_each(|call| write!(f, "\n  in {call}"))
    }
}

/// What a function of ours throws: the text, and the node and field it is about.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fault {
    pub(crate) message: String,
    pub(crate) node: Option<String>,
    pub(crate) field: Option<String>,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// What functions that scripts call return.
pub(crate) type Outcome<T> = Result<T, Box<EvalAltResult>>;

impl Fault {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), ..Self::default() }
    }

    pub(crate) fn throw<T>(self) -> Outcome<T> {
        Err(self.into())
    }
}

impl From<Fault> for Box<EvalAltResult> {
    fn from(fault: Fault) -> Self {
        Box::new(EvalAltResult::ErrorRuntime(Dynamic::from(fault), Position::NONE))
    }
}

/// Throws a plain text.
pub(crate) fn fail<T>(message: impl Into<String>) -> Outcome<T> {
    Fault::new(message).throw()
}

/// Reads an error of the script engine: the innermost place, the calls around it, the words of [`Fault`] where it is ours.
pub(crate) fn problem_from(error: &EvalAltResult, source: &Source, known: &dyn Known) -> Problem {
    let mut calls = Vec::new();
    let mut inner = error;
    let mut place = Position::NONE;
    while let EvalAltResult::ErrorInFunctionCall(name, _, deeper, position) = inner {
        let name = if name.starts_with("anon$") { "a closure" } else { name.as_str() };
        let (file, line, _) = source.place(*position);
        calls.insert(0, if line == 0 { name.to_string() } else { format!("{name}, called in {file}:{line}") });
        (inner, place) = (deeper, *position);
    }
    let mut position = inner.position();
    if position.is_none() && matches!(inner, EvalAltResult::ErrorTerminated(..)) {
        position = known.endless_loop();
    }
    let position = position.or_else(place);
    let (file, line, column) = source.place(position);
    let fault = match inner {
        EvalAltResult::ErrorRuntime(thrown, _) => thrown_text(thrown),
        EvalAltResult::ErrorTerminated(reason, _) => Fault::new(reason.to_string()),
        EvalAltResult::ErrorFunctionNotFound(signature, _) => Fault::new(known.no_function(signature)),
        EvalAltResult::ErrorVariableNotFound(name, _) => Fault::new(known.no_variable(name)),
        EvalAltResult::ErrorDataRace(..) => Fault::new(
            "a function of a node cannot be given a handler that uses the same variable: write `on_change(node, \"field\", handler)` \
             instead of `node.on_change(\"field\", handler)`",
        ),
        EvalAltResult::ErrorStackOverflow(_) => Fault::new("functions call each other too deeply"),
        EvalAltResult::ErrorDotExpr(text, _) => Fault::new(no_part(text)),
        EvalAltResult::ErrorParsing(ParseErrorType::AssignmentToInvalidLHS(_), _) => Fault::new(
            "only a variable and its fields can be assigned to: write `let lamp = find(\"lamp\"); lamp.on = true` instead of \
             `find(\"lamp\").on = true`",
        ),
        other => Fault::new(text_without_place(other)),
    };
    Problem { message: fault.message, file, line, column, node: fault.node, field: fault.field, calls }
}

pub(crate) fn thrown_text(thrown: &Dynamic) -> Fault {
    match thrown.read_lock::<Fault>() {
        Some(fault) => fault.clone(),
        None => Fault::new(thrown.to_string()),
    }
}

/// rhai's words for a part that a value does not have: `No writable property 'w' - a setter is not registered for type 'vec3' to handle 'i64'`.
fn no_part(text: &str) -> String {
    let quoted: Vec<&str> = text.split('\'').skip(1).step_by(2).collect();
    match quoted[..] {
        [part, owner] => format!("a value of type {owner} has no part `{part}`"),
        [part, owner, given] => format!("a value of type {owner} has no part `{part}` that takes a value of type {given}"),
        _ => text.to_string(),
    }
}

/// rhai ends its messages with the place in its own numbering; ours comes from the line table.
pub(crate) fn text_without_place(error: &EvalAltResult) -> String {
    let text = error.to_string();
    match (error.position().is_none(), text.rfind(" (line ")) {
        (false, Some(end)) => text[..end].to_string(),
        _ => text,
    }
}

/// The error without the calls around it.
pub(crate) fn inner_of(error: &EvalAltResult) -> &EvalAltResult {
    let mut inner = error;
    while let EvalAltResult::ErrorInFunctionCall(_, _, deeper, _) = inner {
        inner = deeper;
    }
    inner
}

/// What names exist, for messages about names that do not.
pub(crate) trait Known {
    /// A message for a call that matches no function; `signature` as rhai writes it, `name (type, type)`.
    fn no_function(&self, signature: &str) -> String;
    /// The place of a loop that does nothing and never ends: there the engine knows no place of its own.
    fn endless_loop(&self) -> Position;
    /// A message for a variable that does not exist.
    fn no_variable(&self, name: &str) -> String;
}

/// `; did you mean ...?`, if one of the names is near enough to be meant.
pub(crate) fn hint<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, names).map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}
