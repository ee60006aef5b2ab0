//! What the manual, editors and messages know of the functions.

use rhai::Engine;

use crate::limits::Limits;
use crate::stage::Stage;
use crate::words;

/// A function that worlds can call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FunctionDoc {
    /// The chapter of the manual.
    pub chapter: &'static str,
    /// `name(parameter: type, ...) -> type`
    pub signature: &'static str,
    /// What it does, in a sentence or two.
    pub doc: &'static str,
}

impl FunctionDoc {
    /// The name alone.
    pub fn name(&self) -> &'static str {
        self.signature.split('(').next().unwrap_or(self.signature)
    }
}

/// All functions of ours, in the order of the manual; rhai's own for numbers, strings, arrays and maps come on top.
pub fn functions() -> Vec<FunctionDoc> {
    words::teach(&mut Engine::new_raw(), &Stage::new(Limits::default(), Vec::new()))
}
