//! What a node type's evaluate sees: the node's own fields, the time, and nothing else, so that it can run anywhere.

use std::collections::HashMap;

use crate::changes::{ChangeLog, Revision};
use crate::column::Columns;
use crate::frame::Problem;
use crate::graph::Node;
use crate::{Field, FieldId, FieldValue, NodeId, SetRule};

/// One evaluation of one node. Fields are addressed by their place in the declaration.
pub struct Evaluation<'a> {
    pub(crate) id: NodeId,
    pub(crate) slot: u32,
    pub(crate) node: &'a Node,
    pub(crate) columns: &'a mut Columns,
    pub(crate) changes: &'a mut ChangeLog,
    pub(crate) silenced: &'a HashMap<FieldId, Revision>,
    pub(crate) problems: &'a mut Vec<Problem>,
    pub(crate) time_s: f64,
    /// Writes up to this revision were seen by the last evaluation.
    pub(crate) evaluated: Revision,
    pub(crate) again: bool,
}

impl Evaluation<'_> {
    /// The node.
    pub fn node(&self) -> NodeId {
        self.id
    }

    /// The time of the frame in seconds, the same for all nodes.
    pub fn time(&self) -> f64 {
        self.time_s
    }

    /// The value of a field, converted if it is asked for as another type that converts. What cannot be read is reported and reads as empty.
    pub fn get<T: FieldValue>(&mut self, index: u16) -> T {
        if let Some(field) = self.node.field(index) {
            let slot = self.node.slots[index as usize];
            if field.field_type == T::TYPE {
                return T::column(self.columns).values[slot as usize].clone();
            }
            if let Some(value) = self.columns.value(field.field_type, slot).convert(T::TYPE).as_ref().and_then(T::from_value) {
                return value;
            }
        }
        self.report(format!("field number {index} cannot be read as {}", T::TYPE));
        T::empty()
    }

    /// Writes a field, moved into its range. What cannot be written is reported.
    pub fn set<T: FieldValue>(&mut self, index: u16, value: T) {
        let Some(field) = self.node.field(index) else {
            return self.report(format!("field number {index} cannot be written: there is none"));
        };
        let slot = self.node.slots[index as usize];
        let compare = field.on_set == SetRule::Compare;
        let revision = self.changes.last() + 1;
        let written = if field.field_type == T::TYPE && field.range.is_none() {
            T::column_mut(self.columns).write(slot, value, compare, revision)
        } else {
            let Some(value) = value.into().convert(field.field_type) else {
                let expected = field.field_type;
                return self.report(format!("{} does not convert to {expected}, the type of `{}`", T::TYPE, field.name));
            };
            let value = field.range.map_or(value.clone(), |(smallest, largest)| value.clamped(smallest, largest));
            self.columns.write(slot, value, compare, revision)
        };
        if written {
            self.changes.next();
            self.changes.wrote(self.slot, revision);
        }
    }

    /// True if the field was written since the last evaluation, or since the node was created.
    pub fn changed(&self, index: u16) -> bool {
        let Some(field) = self.node.field(index) else { return false };
        let revision = self.columns.revisions(field.field_type)[self.node.slots[index as usize] as usize];
        revision > self.evaluated && self.silenced.get(&FieldId { node: self.id, index }) != Some(&revision)
    }

    /// True if the field was ever written, since the node was created.
    pub fn written(&self, index: u16) -> bool {
        let Some(field) = self.node.field(index) else { return false };
        self.columns.revisions(field.field_type)[self.node.slots[index as usize] as usize] > self.node.created
    }

    /// The declarations of the node's fields with their places.
    pub fn fields(&self) -> impl Iterator<Item = (u16, &Field)> {
        self.node.fields()
    }

    /// The place of a field by its name; for dynamic fields.
    pub fn index(&self, name: &str) -> Option<u16> {
        self.node.fields().find(|(_, field)| field.is_named(name)).map(|(index, _)| index)
    }

    /// Asks for an evaluation in the next frame, changed or not; for nodes in motion.
    pub fn again(&mut self) {
        self.again = true;
    }

    /// Tells the author what is wrong; see [`crate::FrameReport::problems`].
    pub fn report(&mut self, message: impl Into<String>) {
        self.problems.push(Problem { node: self.id, field: None, message: message.into() });
    }

    /// Tells the author what is wrong with a field.
    pub fn report_field(&mut self, index: u16, message: impl Into<String>) {
        let field = Some(FieldId { node: self.id, index });
        self.problems.push(Problem { node: self.id, field, message: message.into() });
    }
}
