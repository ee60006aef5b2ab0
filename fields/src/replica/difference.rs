//! Where a replica first differs from what it should be.

use std::fmt;

use super::Replica;

/// The first difference, in the order of the application's nodes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The frame after which it showed.
    pub frame: u64,
    /// What messages call the node.
    pub node: String,
    /// The field; none if the node itself is missing, too many, or has another name.
    pub field: Option<String>,
    /// What the replica holds.
    pub found: String,
    /// What the application holds.
    pub expected: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "frame {}: {}", self.frame, self.node)?;
        if let Some(field) = &self.field {
            write!(f, ", field `{field}`")?;
        }
        write!(f, ": {} here, {} in the application", self.found, self.expected)
    }
}

impl Replica {
    /// Where this replica differs from one that was made of a snapshot of the same frame.
    pub fn difference(&self, truth: &Replica) -> Option<Difference> {
        let slots = self.herds.seats.len().max(truth.herds.seats.len());
        let of =
            |replica: &Replica, slot: usize| replica.herds.seats.get(slot).map(|seat| seat.number).filter(|number| *number > 0);
        (0..slots).find_map(|slot| self.difference_at(truth, of(self, slot), of(truth, slot)))
    }

    fn difference_at(&self, truth: &Replica, ours: Option<u64>, theirs: Option<u64>) -> Option<Difference> {
        let number = match (ours, theirs) {
            (Some(ours), Some(theirs)) if ours == theirs => ours,
            (None, None) => return None,
            (_, Some(theirs)) => return Some(truth.about(theirs, None, "nothing".into(), "the node".into())),
            (Some(ours), None) => return Some(self.about(ours, None, "the node".into(), "nothing".into())),
        };
        if self.herds.own(number) != truth.herds.own(number) {
            let name = |replica: &Replica| replica.node(number).map(|node| replica.graph.describe(node)).unwrap_or_default();
            return Some(truth.about(number, None, name(self), name(truth)));
        }
        let mut indices = self.herds.fields(number);
        indices.extend(truth.herds.fields(number));
        indices.sort_unstable();
        let is_other = |index: &u16| self.herds.field(number, *index) != truth.herds.field(number, *index);
        let index = indices.into_iter().find(is_other)?;
        let value = |replica: &Replica| match replica.field_at(number, index) {
            Some(field) => short(format!("{:?}", replica.graph.value(field))),
            None => "no such field".into(),
        };
        Some(truth.about(number, Some(index), value(self), value(truth)))
    }

    fn field_at(&self, number: u64, index: u16) -> Option<crate::FieldId> {
        self.place((number, index)).ok()
    }

    fn about(&self, number: u64, index: Option<u16>, found: String, expected: String) -> Difference {
        let node = self.node(number).map(|node| self.graph.describe(node)).unwrap_or_else(|| format!("node {number}"));
        let name = |index| {
            let field = self.field_at(number, index)?;
            Some(self.graph.declaration(field).ok()?.name.to_string())
        };
        Difference { frame: self.frame(), node, field: index.map(|index| name(index).unwrap_or_default()), found, expected }
    }
}

/// A value as it prints, cut where it is long.
fn short(text: String) -> String {
    const SHOWN: usize = 120;
    let text = text.strip_prefix("Ok(").and_then(|text| text.strip_suffix(')')).map_or(text.clone(), String::from);
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}
