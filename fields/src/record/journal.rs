//! What happens to a graph from outside, in order: everything but what routes and native evaluation do, which follows from it.

use std::sync::Arc;

use crate::{Field, FieldId, Graph, Mode, NodeId, NodeType, ObserverId, RouteId, Strength, Value};

/// One thing that somebody outside of routes and native evaluation did. Only what succeeded is noted, unless a failure leaves traces.
#[derive(Clone, Debug)]
pub(crate) enum Event {
    Created(NodeId, Arc<NodeType>),
    Deleted(NodeId),
    Named(NodeId, Option<Arc<str>>),
    FieldAdded(FieldId, Box<Field>),
    FieldRemoved(FieldId),
    Wrote {
        field: FieldId,
        value: Value,
        silent: bool,
    },
    Touched(FieldId),
    Connected {
        route: RouteId,
        from: FieldId,
        to: FieldId,
        strength: Strength,
        /// What the target held right after that.
        held: Value,
    },
    /// A route made without delivering what the source holds.
    Linked {
        route: RouteId,
        from: FieldId,
        to: FieldId,
        strength: Strength,
    },
    /// Nodes were told that they have seen everything.
    Rested(Vec<NodeId>),
    /// A value was put on its way along a weak route.
    Carries(RouteId, Value),
    Disconnected(RouteId),
    Observed {
        observer: ObserverId,
        field: FieldId,
        token: u64,
    },
    Unobserved(ObserverId),
    ModeSet(NodeId, Mode),
    Woken(NodeId),
    Pulled(NodeId),
    Depends(NodeId, NodeId),
    /// A frame begins; the host's calls in it follow, up to `Leave`.
    Frame(f64),
    /// The host is told of a write; what it does follows, up to `Leave`.
    Told(FieldId, u64),
    /// The host evaluates a node; what it does follows, up to `Leave`.
    HostEvaluates(NodeId),
    Leave,
}

/// Events since the journal was last emptied.
#[derive(Debug, Default)]
pub(crate) struct Journal {
    pub(crate) events: Vec<Event>,
}

impl Graph {
    /// Notes an event if anybody records; a branch otherwise.
    #[inline]
    pub(crate) fn note(&mut self, event: impl FnOnce() -> Event) {
        if let Some(journal) = &mut self.journal {
            journal.events.push(event());
        }
    }

    /// Notes a write that was just made.
    #[inline]
    pub(crate) fn note_write(&mut self, field: FieldId, silent: bool) {
        if self.journal.is_some()
            && let Ok(value) = self.value(field)
        {
            self.note(|| Event::Wrote { field, value, silent });
        }
    }
}
