//! Dynamic fields: fields that one node has and its type has not.

use crate::column::FREE;
use crate::graph::slot_of;
use crate::record::Event;
use crate::{Error, Field, FieldId, Graph, NodeId};

impl Graph {
    /// Gives one node a field that its type does not have.
    pub fn add_field(&mut self, id: NodeId, field: Field) -> Result<FieldId, Error> {
        let node = self.node(id)?;
        if let Some(fault) = field.fault() {
            return Err(Error::BadField { node: self.describe(id), fault });
        }
        for name in std::iter::once(&field.name).chain(&field.aliases) {
            if node.index_of(name).is_some() {
                return Err(Error::DuplicateField { node: self.describe(id), name: name.to_string() });
            }
        }
        let declared = node.node_type.fields.len();
        let place = node.dynamic.iter().position(Option::is_none).unwrap_or(node.dynamic.len());
        let Some(index) = u16::try_from(declared + place).ok().filter(|index| *index < u16::MAX) else {
            return Err(Error::BadField { node: self.describe(id), fault: format!("it has {} fields already", u16::MAX) });
        };
        let revision = self.changes.next();
        let slot = self.columns.insert(field.default.clone(), (slot_of(id), index), revision);
        let node = &mut self.nodes[id];
        if place == node.dynamic.len() {
            node.dynamic.push(None);
            node.slots.push(FREE);
        }
        let noted = self.journal.is_some().then(|| Box::new(field.clone()));
        node.dynamic[place] = Some(field);
        node.slots[index as usize] = slot;
        self.schedule.layout += 1;
        self.changes.reshaped(slot_of(id), revision);
        self.schedule.mark(slot_of(id));
        let added = FieldId { node: id, index };
        if let Some(field) = noted {
            self.note(|| Event::FieldAdded(added, field));
        }
        Ok(added)
    }

    /// Removes a field that was added to one node, with its routes and observers.
    pub fn remove_field(&mut self, field: FieldId) -> Result<(), Error> {
        let declared = self.declaration(field)?;
        let field_type = declared.field_type;
        let first_dynamic = self.nodes[field.node].node_type.fields.len();
        if (field.index as usize) < first_dynamic {
            return Err(Error::NotDynamic { field: self.describe_field(field) });
        }
        for route in self.routes_from(field).chain(self.routes_to(field)).collect::<Vec<_>>() {
            self.disconnect(route);
        }
        self.forget_observers_of(field);
        self.silenced.remove(&field);
        let node = &mut self.nodes[field.node];
        node.dynamic[field.index as usize - first_dynamic] = None;
        let slot = std::mem::replace(&mut node.slots[field.index as usize], FREE);
        self.columns.remove(field_type, slot);
        let revision = self.changes.next();
        self.changes.reshaped(slot_of(field.node), revision);
        self.note(|| Event::FieldRemoved(field));
        Ok(())
    }
}
