//! One frame of a recording, played on a graph: the host's part is played too.

use super::blocks::{EventRecord, Place};
use super::numbers::{Numbers, mode_of};
use super::types::Types;
use crate::{Error, FieldId, Graph, Host, NodeId, Strength};

pub(super) struct Playback<'a> {
    pub(super) events: &'a [EventRecord],
    pub(super) at: usize,
    pub(super) numbers: &'a mut Numbers,
    pub(super) types: &'a mut Types,
    /// The time of the last evaluation.
    pub(super) time_s: Option<f64>,
    /// The first thing that did not go as it was recorded.
    pub(super) fault: Option<String>,
}

impl Playback<'_> {
    fn fail(&mut self, fault: impl Into<String>) {
        self.fault.get_or_insert_with(|| fault.into());
    }

    /// Plays up to the end, or up to the end of a call of the host.
    pub(super) fn play(&mut self, graph: &mut Graph) {
        while let Some(event) = self.events.get(self.at) {
            self.at += 1;
            match event {
                EventRecord::Leave => return,
                EventRecord::Frame(time_s) => {
                    self.time_s = Some(*time_s);
                    graph.evaluate(*time_s, self);
                    self.leave_frame(graph);
                }
                EventRecord::Told(..) | EventRecord::HostEvaluates(_) => self.skip_call(graph),
                event => {
                    if let Err(fault) = self.apply(event, graph) {
                        let what = format!("{event:?}");
                        let what = what.split(|letter: char| !letter.is_alphabetic()).next().unwrap_or_default();
                        self.fail(format!("`{what}` cannot be done again: {fault}"));
                    }
                }
            }
        }
    }

    /// After an evaluation, calls that were recorded but did not come.
    fn leave_frame(&mut self, graph: &mut Graph) {
        loop {
            match self.events.get(self.at) {
                Some(EventRecord::Told(..) | EventRecord::HostEvaluates(_)) => {
                    self.at += 1;
                    self.skip_call(graph);
                }
                Some(EventRecord::Leave) => {
                    self.at += 1;
                    return;
                }
                Some(_) | None => return self.fail("the evaluation ended before all that happened in it was played"),
            }
        }
    }

    /// A call of the host that the replay does not make; what it did is done all the same.
    fn skip_call(&mut self, graph: &mut Graph) {
        let missing = match &self.events[self.at - 1] {
            EventRecord::HostEvaluates(node) => {
                format!("{} was evaluated by the host, and is not now", self.describe(graph, *node))
            }
            EventRecord::Told(field, _) => {
                format!("the host was told of {}, and is not now", graph.describe_field(self.field(*field)))
            }
            _ => String::new(),
        };
        self.fail(missing);
        self.play(graph);
    }

    fn describe(&self, graph: &Graph, node: u64) -> String {
        graph.describe(self.node(node))
    }

    fn node(&self, number: u64) -> NodeId {
        self.numbers.nodes.keys.get(&number).copied().unwrap_or_default()
    }

    fn field(&self, (node, index): Place) -> FieldId {
        FieldId { node: self.node(node), index }
    }

    fn apply(&mut self, event: &EventRecord, graph: &mut Graph) -> Result<(), String> {
        let text = |error: Error| error.to_string();
        match event {
            EventRecord::Created { node, node_type } => {
                let node_type = self.types.get(*node_type, graph, self.numbers).map_err(|error| error.to_string())?;
                let made = graph.create_of(node_type);
                self.numbers.nodes.bind(*node, made);
                Ok(())
            }
            EventRecord::Deleted(node) => graph.delete(self.node(*node)).map_err(text),
            EventRecord::Named(node, name) => graph.set_name(self.node(*node), name).map_err(text),
            EventRecord::FieldAdded((node, index), field) => {
                let field = field.field(self.numbers)?;
                let added = graph.add_field(self.node(*node), field).map_err(text)?;
                if added.index == *index { Ok(()) } else { Err(format!("{} took another place", graph.describe_field(added))) }
            }
            EventRecord::FieldRemoved(field) => graph.remove_field(self.field(*field)).map_err(text),
            EventRecord::Wrote { field, silent, value } => {
                let field = self.field(*field);
                let field_type = graph.declaration(field).map_err(text)?.field_type;
                let value = self.numbers.value(value, field_type)?;
                if *silent { graph.set_silent(field, value) } else { graph.set_value(field, value) }.map_err(text)
            }
            EventRecord::Touched(field) => graph.touch(self.field(*field)).map_err(text),
            EventRecord::Connected { route, from, to, weak, delivers } => {
                let (from, to) = (self.field(*from), self.field(*to));
                let strength = if *weak { Strength::Weak } else { Strength::Strong };
                let made = if *delivers { graph.connect(from, to, strength) } else { graph.link(from, to, strength) };
                self.numbers.routes.bind(*route, made.map_err(text)?);
                Ok(())
            }
            EventRecord::Disconnected(route) => {
                let id = self.numbers.routes.keys.get(route).copied().unwrap_or_default();
                self.numbers.routes.forget(id);
                if graph.disconnect(id) { Ok(()) } else { Err("a route that was removed does not exist".into()) }
            }
            EventRecord::Rested(nodes) => {
                let nodes: Vec<NodeId> = nodes.iter().map(|node| self.node(*node)).collect();
                graph.rest(&nodes);
                Ok(())
            }
            EventRecord::Carries { route, field_type, value } => {
                let field_type = crate::codec::field_type_named(field_type).ok_or("a value of an unknown type")?;
                let value = self.numbers.value(value, field_type)?;
                graph.carry(self.numbers.routes.keys.get(route).copied().unwrap_or_default(), value);
                Ok(())
            }
            EventRecord::Observed { observer, field, token } => {
                let made = graph.observe(self.field(*field), *token).map_err(text)?;
                self.numbers.observers.bind(*observer, made);
                Ok(())
            }
            EventRecord::Unobserved(observer) => {
                let id = self.numbers.observers.keys.get(observer).copied().unwrap_or_default();
                self.numbers.observers.forget(id);
                if graph.unobserve(id) { Ok(()) } else { Err("an observer that was removed does not exist".into()) }
            }
            EventRecord::ModeSet(node, mode) => graph.set_mode(self.node(*node), mode_of(*mode)).map_err(text),
            EventRecord::Woken(node) => graph.wake(self.node(*node)).map_err(text),
            EventRecord::Pulled(node) => graph.pull(self.node(*node), self).map_err(text),
            // That it was refused may have been part of what happened.
            EventRecord::Depends(node, on) => {
                let _ = graph.depend_for_this_frame(self.node(*node), self.node(*on));
                Ok(())
            }
            EventRecord::Frame(_) | EventRecord::Told(..) | EventRecord::HostEvaluates(_) | EventRecord::Leave => Ok(()),
        }
    }

    /// The recorded call that is this one; the replay goes on without it if it is another.
    fn enter(&mut self, graph: &mut Graph, is_this: impl Fn(&Self, &EventRecord) -> bool, now: String) {
        match self.events.get(self.at) {
            Some(event) if is_this(self, event) => {
                self.at += 1;
                self.play(graph);
            }
            _ => self.fail(now),
        }
    }
}

impl Host for Playback<'_> {
    fn field_changed(&mut self, graph: &mut Graph, field: FieldId, token: u64) {
        let now = format!("the host is told of {} now, and was not", graph.describe_field(field));
        let same = |this: &Self, event: &EventRecord| matches!(event, EventRecord::Told(place, other) if *other == token && this.field(*place) == field);
        self.enter(graph, same, now);
    }

    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        let now = format!("{} is evaluated by the host now, and was not", graph.describe(node));
        let same =
            |this: &Self, event: &EventRecord| matches!(event, EventRecord::HostEvaluates(other) if this.node(*other) == node);
        self.enter(graph, same, now);
    }
}
