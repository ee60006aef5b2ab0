//! Why does a field hold what it holds? The chain of writes, back to the roots.

use std::collections::HashSet;
use std::fmt;

use crate::changes::Revision;
use crate::explain::{By, Noted, WriteId};
use crate::{FieldId, Graph, Strength, Value};

/// A longer explanation is cut: nobody reads it.
const LONGEST: usize = 1000;

/// A write that led to another; its `Display` is one line of an explanation.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    /// 0 for the field asked about, 1 for what wrote it, and so on.
    pub depth: usize,
    /// The field.
    pub field: FieldId,
    /// Node and field, as messages call them.
    pub name: String,
    /// What was written.
    pub value: Value,
    /// The write.
    pub revision: Revision,
    /// The number of the frame, from 1 on; what is written between frames belongs to the next.
    pub frame: u64,
    /// The time of the frame in seconds; of the frame before, as long as the frame has not begun.
    pub time_s: f64,
    /// How it came about; the causes below, which are one deeper, are why.
    pub by: By,
    /// The same with the names of nodes and fields: "by the route from `clock.fraction`".
    pub by_text: String,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Cause { depth, name, value, by_text, .. } = self;
        let indent = 2 * depth;
        if self.by == By::Unknown {
            return write!(f, "{:indent$}{name} = {}, {by_text}", "", short(value));
        }
        write!(f, "{:indent$}{name} = {}, in frame {} ({:.3} s) {by_text}", "", short(value), self.frame, self.time_s)
    }
}

/// The value without its type, and not all of a long list.
fn short(value: &Value) -> String {
    let text = format!("{value:?}");
    let inner = text.split_once('(').and_then(|(_, rest)| rest.strip_suffix(')')).unwrap_or(&text);
    match inner.char_indices().nth(60) {
        Some((end, _)) => format!("{}... ({} values)", &inner[..end], value.len()),
        None => inner.to_string(),
    }
}

impl Graph {
    /// Why the field was last written: that write first, then what it came from, each followed by what that came from, back to writes from
    /// outside. Needs [`Graph::explain`]; what was written before that is [`By::Unknown`]. A write that two others came from is listed once.
    pub fn why(&self, field: FieldId) -> Vec<Cause> {
        let mut causes = Vec::new();
        let mut seen: HashSet<WriteId> = HashSet::new();
        let last = self.explain.as_ref().and_then(|explain| explain.last(field)).map_or(0, |noted| noted.id);
        let mut open = vec![(0, field, last)];
        while let Some((depth, field, id)) = open.pop() {
            if causes.len() == LONGEST {
                break;
            }
            if id != 0 && !seen.insert(id) {
                continue;
            }
            match self.explain.as_ref().and_then(|explain| explain.write(field, id)) {
                Some(noted) => {
                    causes.push(self.cause(depth, noted));
                    open.extend(noted.from.iter().rev().map(|(field, id)| (depth + 1, *field, *id)));
                }
                None => causes.extend(self.unknown_cause(depth, field)),
            }
        }
        causes
    }

    fn cause(&self, depth: usize, noted: &Noted) -> Cause {
        let Noted { field, revision, value, frame, time_s, by, .. } = noted.clone();
        let (name, by_text) = (self.describe_field(field), self.describe_cause(&by));
        Cause { depth, field, name, value, revision, frame, time_s, by, by_text }
    }

    /// What is known of a field whose write was not noted; nothing if it is gone.
    fn unknown_cause(&self, depth: usize, field: FieldId) -> Option<Cause> {
        let value = self.value(field).ok()?;
        let (name, by_text) = (self.describe_field(field), self.describe_cause(&By::Unknown));
        let revision = self.field_revision(field);
        Some(Cause { depth, field, name, value, revision, frame: 0, time_s: 0.0, by: By::Unknown, by_text })
    }

    fn describe_cause(&self, by: &By) -> String {
        let at = |origin: &Option<std::sync::Arc<str>>| origin.as_ref().map_or(String::new(), |origin| format!(" at {origin}"));
        match by {
            By::Unknown => "its default, or written before anybody asked".into(),
            By::Outside { origin: None } => "from outside".into(),
            By::Outside { origin } => format!("from outside{}", at(origin)),
            By::Route { from, strength: Strength::Strong } => format!("by the route from {}", self.describe_field(*from)),
            By::Route { from, strength: Strength::Weak } => format!("by the weak route from {}", self.describe_field(*from)),
            By::Evaluation { node, origin } => format!("by the evaluation of {}{}", self.describe(*node), at(origin)),
            By::Callback { of, origin } => format!("by the callback of {}{}", self.describe_field(*of), at(origin)),
        }
    }
}
