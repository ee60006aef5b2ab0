//! Recording why fields were written, while somebody wants to know: each write with its value, its frame, and the writes that it came from.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::changes::Revision;
use crate::program::Group;
use crate::{Evaluator, FieldId, Graph, Host, NodeId, RouteId, Strength, Value};

/// More writes are not remembered, but for the last one of each field.
const LIMIT: usize = 200_000;

/// Counts the writes that were noted; 0 is none.
pub(crate) type WriteId = u64;

/// How a field came to be written.
#[derive(Clone, Debug, PartialEq)]
pub enum By {
    /// Nobody noted it: it holds its default, or was written before [`Graph::explain`] or too long ago.
    Unknown,
    /// From outside of the graph, with what [`Graph::set_origin`] said of the place.
    Outside {
        /// Such as `market.rhai:12`.
        origin: Option<Arc<str>>,
    },
    /// By a route.
    Route {
        /// The source.
        from: FieldId,
        /// Whether it took effect in the frame of the source's write or in the one after.
        strength: Strength,
    },
    /// By the evaluation of a node; what that had found changed are the causes below.
    Evaluation {
        /// The node.
        node: NodeId,
        /// What [`Graph::set_origin`] said of the place, if the host evaluates the node.
        origin: Option<Arc<str>>,
    },
    /// By the host when it was told of the change of a field, which is the cause below.
    Callback {
        /// The field.
        of: FieldId,
        /// What [`Graph::set_origin`] said of the place.
        origin: Option<Arc<str>>,
    },
}

/// What the host does, and the writes because of which it does.
type During = Option<(By, Arc<[(FieldId, WriteId)]>)>;

/// A write that was noted.
#[derive(Clone, Debug)]
pub(crate) struct Noted {
    pub(crate) id: WriteId,
    pub(crate) field: FieldId,
    pub(crate) revision: Revision,
    pub(crate) value: Value,
    pub(crate) frame: u64,
    pub(crate) time_s: f64,
    pub(crate) by: By,
    /// The writes that it came from.
    pub(crate) from: Arc<[(FieldId, WriteId)]>,
}

/// What is noted while a graph explains itself.
#[derive(Debug, Default)]
pub(crate) struct Explain {
    /// The last writes, in order.
    recent: VecDeque<Noted>,
    /// The last write of each field.
    last: HashMap<FieldId, Noted>,
    made: WriteId,
    origin: Option<Arc<str>>,
    /// What the host does at the moment, and because of what.
    during: During,
    /// The source's write of what weak routes carry.
    carried: HashMap<RouteId, (FieldId, WriteId)>,
    pub(crate) times: HashMap<NodeId, Duration>,
}

impl Explain {
    /// A write by its number, if it is remembered.
    pub(crate) fn write(&self, field: FieldId, id: WriteId) -> Option<&Noted> {
        let first = self.recent.front()?.id;
        let recent = id.checked_sub(first).and_then(|place| self.recent.get(place as usize));
        recent.or_else(|| self.last.get(&field).filter(|noted| noted.id == id))
    }

    /// The last write of a field.
    pub(crate) fn last(&self, field: FieldId) -> Option<&Noted> {
        self.last.get(&field)
    }

    /// What was written since the last frame belongs to this one, whose time was not known then.
    pub(crate) fn frame_begins(&mut self, frame: u64, time_s: f64) {
        for noted in self.recent.iter_mut().rev().take_while(|noted| noted.frame == frame) {
            noted.time_s = time_s;
            if let Some(last) = self.last.get_mut(&noted.field).filter(|last| last.id == noted.id) {
                last.time_s = time_s;
            }
        }
    }

    fn source(&self, field: FieldId) -> (FieldId, WriteId) {
        (field, self.last.get(&field).map_or(0, |noted| noted.id))
    }
}

impl Graph {
    /// From now on, or no longer, notes why fields are written, and how long nodes take; see [`Graph::why`] and [`Graph::costs`]. While it is
    /// on, each write costs some ten times as much, and one thread evaluates all. Off, which is the default, it costs nothing.
    pub fn explain(&mut self, on: bool) {
        if on != self.explain.is_some() {
            self.explain = on.then(Box::default);
        }
    }

    /// True while the graph notes why fields are written.
    pub fn explains(&self) -> bool {
        self.explain.is_some()
    }

    /// Says where the next writes from outside come from, such as `market.rhai:12`; the empty text says nothing. Without effect unless the
    /// graph explains itself.
    pub fn set_origin(&mut self, origin: &str) {
        if let Some(explain) = &mut self.explain {
            explain.origin = (!origin.is_empty()).then(|| origin.into());
        }
    }

    /// Notes a write that was just made by somebody outside of routes and native evaluation.
    #[inline]
    pub(crate) fn explain_write(&mut self, field: FieldId) {
        if let Some(explain) = &self.explain {
            let origin = explain.origin.clone();
            let (by, from) = match explain.during.clone() {
                Some((By::Evaluation { node, .. }, from)) => (By::Evaluation { node, origin }, from),
                Some((By::Callback { of, .. }, from)) => (By::Callback { of, origin }, from),
                _ => (By::Outside { origin }, Arc::default()),
            };
            self.note_cause(field, by, from);
        }
    }

    fn note_cause(&mut self, field: FieldId, by: By, from: Arc<[(FieldId, WriteId)]>) {
        let Ok(value) = self.value(field) else { return };
        let revision = self.field_revision(field);
        // What happens between frames takes effect in the next.
        let frame = self.frame.number + !self.frame.begun as u64;
        let time_s = self.frame.time_s;
        let Some(explain) = &mut self.explain else { return };
        explain.made += 1;
        let noted = Noted { id: explain.made, field, revision, value, frame, time_s, by, from };
        explain.last.insert(field, noted.clone());
        explain.recent.push_back(noted);
        if explain.recent.len() > LIMIT {
            explain.recent.pop_front();
        }
    }

    /// Notes what a copy list just wrote.
    pub(crate) fn explain_group(&mut self, slot: u32, group: &Group, revision: Revision) {
        let Some(explain) = &self.explain else { return };
        let from = FieldId { node: self.ids[slot as usize], index: group.index };
        let source: Arc<[_]> = Arc::from([explain.source(from)]);
        for target in group.direct.iter().flat_map(|run| run.slot..run.slot + run.count) {
            if self.columns.revisions(group.field_type)[target as usize] == revision {
                let (owner, index) = self.columns.owners(group.field_type)[target as usize];
                let field = FieldId { node: self.ids[owner as usize], index };
                self.note_cause(field, By::Route { from, strength: Strength::Strong }, source.clone());
            }
        }
    }

    /// Notes what a route that needs more than a copy just wrote.
    pub(crate) fn explain_route(&mut self, route: RouteId) {
        let Some(explain) = &mut self.explain else { return };
        let Some(crate::Route { from, to, strength, .. }) = self.routes.all.get(route).copied() else { return };
        let carried = if strength == Strength::Weak { explain.carried.remove(&route) } else { None };
        let source = carried.unwrap_or_else(|| explain.source(from));
        self.note_cause(to, By::Route { from, strength }, Arc::from([source]));
    }

    /// Notes which write a weak route carries.
    pub(crate) fn explain_departure(&mut self, slot: u32, group: &Group) {
        let Some(explain) = &mut self.explain else { return };
        let source = explain.source(FieldId { node: self.ids[slot as usize], index: group.index });
        explain.carried.extend(group.weak.iter().map(|route| (*route, source)));
    }

    /// Evaluates a node, notes how long it takes and what it writes. False if the node was deleted on the way.
    pub(crate) fn evaluate_explained(&mut self, id: NodeId, host: &mut dyn Host) -> bool {
        let fields: Vec<FieldId> = self.field_ids(id).map(|(field, _)| field).collect();
        let changed = fields.iter().copied().filter(|field| self.changed(*field));
        let Some(explain) = &self.explain else { return self.run_evaluator(id, host) };
        let inputs: Arc<[_]> = changed.map(|field| explain.source(field)).collect();
        let by = By::Evaluation { node: id, origin: None };
        let before = self.changes.last();
        let native = matches!(self.nodes[id].node_type.evaluator, Evaluator::Native(_));
        let outer = if native { None } else { self.enter(by.clone(), inputs.clone()) };
        let start = Instant::now();
        let alive = self.run_evaluator(id, host);
        let time = start.elapsed();
        if native {
            for field in fields.into_iter().filter(|field| self.field_revision(*field) > before).collect::<Vec<_>>() {
                self.note_cause(field, by.clone(), inputs.clone());
            }
        } else {
            self.leave(outer);
        }
        if let Some(explain) = &mut self.explain {
            *explain.times.entry(id).or_default() += time;
        }
        alive
    }

    /// The host is told of a field; what it writes comes from that.
    pub(crate) fn tell_explained(&mut self, field: FieldId, token: u64, host: &mut dyn Host) {
        let Some(explain) = &self.explain else { return host.field_changed(self, field, token) };
        let cause: Arc<[_]> = Arc::from([explain.source(field)]);
        let outer = self.enter(By::Callback { of: field, origin: None }, cause);
        host.field_changed(self, field, token);
        self.leave(outer);
    }

    fn enter(&mut self, by: By, from: Arc<[(FieldId, WriteId)]>) -> During {
        self.explain.as_mut().and_then(|explain| explain.during.replace((by, from)))
    }

    fn leave(&mut self, outer: During) {
        if let Some(explain) = &mut self.explain {
            explain.during = outer;
        }
    }

    pub(crate) fn forget_explained(&mut self, id: NodeId) {
        if let Some(explain) = &mut self.explain {
            explain.times.remove(&id);
        }
    }
}
