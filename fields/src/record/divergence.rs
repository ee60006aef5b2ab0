//! Where a replay differs from what was recorded.

use std::fmt;

/// The first difference of a frame, in the order of writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Divergence {
    /// The frame, from one.
    pub frame: u64,
    /// Name and type of the node, or the empty text.
    pub node: String,
    /// The field, if it is about one.
    pub field: String,
    /// What was recorded, if that is known: long values are recorded as hashes.
    pub recorded: String,
    /// What the replay has.
    pub replayed: String,
    /// What differs, if it is not a value.
    pub message: String,
}

impl fmt::Display for Divergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "frame {}: ", self.frame)?;
        if !self.field.is_empty() {
            write!(f, "{} was {}, is now {}", self.field, self.recorded, self.replayed)?;
        }
        if !self.message.is_empty() {
            let gap = if self.field.is_empty() { "" } else { "; " };
            write!(f, "{gap}{}", self.message)?;
        }
        Ok(())
    }
}
