//! Types of a recording: those that the reader knows, and those that only the recording knows.

use std::sync::Arc;

use super::RecordError;
use super::blocks::TypeRecord;
use super::numbers::{Numbers, mode_of};
use crate::codec::PlainField;
use crate::naming::hint;
use crate::{Evaluator, Graph, NodeType, canonical};

/// The types by their numbers, made when first asked for.
#[derive(Default)]
pub(super) struct Types {
    pub(super) records: Vec<TypeRecord>,
    made: Vec<Option<Arc<NodeType>>>,
}

impl Types {
    pub(super) fn get(&mut self, number: u32, graph: &Graph, numbers: &mut Numbers) -> Result<Arc<NodeType>, RecordError> {
        let at = number as usize;
        let Some(record) = self.records.get(at) else {
            return Err(RecordError::Damaged { fault: format!("there is no type {number}") });
        };
        self.made.resize(self.records.len(), None);
        if let Some(made) = &self.made[at] {
            return Ok(made.clone());
        }
        let made = resolve(record, graph, numbers)?;
        self.made[at] = Some(made.clone());
        Ok(made)
    }

    /// Forgets what was made, for another graph with other types.
    pub(super) fn reset(&mut self) {
        self.made.clear();
    }
}

/// A type that the host evaluated needs no host in a replay: what it did was recorded. Any other must be known, and be the same.
fn resolve(record: &TypeRecord, graph: &Graph, numbers: &mut Numbers) -> Result<Arc<NodeType>, RecordError> {
    if record.evaluator != 1 {
        return made_up(record, numbers).map_err(|fault| RecordError::Damaged { fault });
    }
    let known = graph.types().get(&record.name).ok().filter(|known| canonical(&known.name) == canonical(&record.name));
    let Some(known) = known else {
        let names: Vec<_> = graph.types().iter().map(|known| known.name.clone()).collect();
        let hint = hint(&record.name, names.iter().map(|name| &**name));
        return Err(RecordError::MissingType { name: record.name.clone(), hint });
    };
    match difference(record, &numbers.type_record(&known)) {
        None => Ok(known),
        Some(difference) => Err(RecordError::OtherType { name: record.name.clone(), difference }),
    }
}

fn difference(recorded: &TypeRecord, known: &TypeRecord) -> Option<String> {
    if recorded.evaluator != known.evaluator {
        return Some("it is evaluated by something else".into());
    }
    if recorded.fields.len() != known.fields.len() {
        return Some(format!("it had {} fields and has {}", recorded.fields.len(), known.fields.len()));
    }
    let behaviour = |field: &PlainField| {
        let default = if field.field_type.starts_with("image") { Vec::new() } else { field.default.clone() };
        let (pulse, output) = (field.pulse, field.output);
        (
            field.name.clone(),
            field.field_type.clone(),
            default,
            field.range.map(|(a, b)| (a.to_bits(), b.to_bits())),
            pulse,
            output,
        )
    };
    let differs = |(a, b): &(&PlainField, &PlainField)| behaviour(a) != behaviour(b) || a.choices != b.choices;
    let (was, is) = recorded.fields.iter().zip(&known.fields).find(differs)?;
    Some(format!(
        "field `{}` ({}) is now `{}` ({}), or has another default, range or choices",
        was.name, was.field_type, is.name, is.field_type
    ))
}

fn made_up(record: &TypeRecord, numbers: &mut Numbers) -> Result<Arc<NodeType>, String> {
    let mut node_type = NodeType::new(record.name.as_str(), "Known from a recording.");
    for field in &record.fields {
        node_type = node_type.field(field.field(numbers)?);
    }
    node_type.mode = mode_of(record.mode);
    if record.evaluator == 2 {
        node_type.evaluator = Evaluator::Host;
    }
    match node_type.fault() {
        None => Ok(Arc::new(node_type)),
        Some(fault) => Err(format!("type `{}` cannot be used: {fault}", record.name)),
    }
}
