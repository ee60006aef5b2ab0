//! The order of evaluation: ranks that follow strong routes, and the search for loops that keeps it possible.

use std::collections::HashMap;

use crate::graph::slot_of;
use crate::record::Event;
use crate::schedule::NO_RANK;
use crate::{Error, Graph, NodeId, RouteId, Strength};

/// One half of a search from both ends.
struct Side {
    root: NodeId,
    forward: bool,
    open: Vec<NodeId>,
    /// The route by which each node was reached.
    reached_by: HashMap<NodeId, RouteId>,
    /// Routes looked at.
    work: usize,
}

impl Side {
    fn new(root: NodeId, forward: bool) -> Self {
        Self { root, forward, open: vec![root], reached_by: HashMap::new(), work: 0 }
    }

    fn has(&self, node: NodeId) -> bool {
        node == self.root || self.reached_by.contains_key(&node)
    }

    /// Looks at one more node; where it met the other side.
    fn step(&mut self, graph: &Graph, node: NodeId, other: &Side) -> Option<NodeId> {
        let routes = if self.forward { &graph.nodes[node].outgoing } else { &graph.nodes[node].incoming };
        self.work += 1 + routes.len();
        for route in routes {
            let edge = &graph.routes.all[*route];
            let next = if self.forward { edge.to.node } else { edge.from.node };
            if edge.strength == Strength::Weak || self.has(next) {
                continue;
            }
            self.reached_by.insert(next, *route);
            if other.has(next) {
                return Some(next);
            }
            self.open.push(next);
        }
        None
    }

    /// The routes between the root and a node, starting at the node.
    fn path(&self, graph: &Graph, from: NodeId) -> Vec<RouteId> {
        let mut at = from;
        let mut path = Vec::new();
        while at != self.root {
            let route = self.reached_by[&at];
            path.push(route);
            let edge = &graph.routes.all[route];
            at = if self.forward { edge.from.node } else { edge.to.node };
        }
        path
    }
}

/// The strong routes that lead from `to` back to `from`, if a strong route from `from` to `to` would close a loop.
///
/// Searches from both ends, always where less was looked at, and ends when either has seen all that it can reach.
pub(crate) fn closes_loop(graph: &Graph, from: NodeId, to: NodeId) -> Option<Vec<RouteId>> {
    if from == to {
        return Some(Vec::new());
    }
    let rank = |node| graph.schedule.turns[slot_of(node) as usize].rank;
    if !graph.schedule.stale && rank(from) != NO_RANK && rank(to) != NO_RANK && rank(from) < rank(to) {
        return None;
    }
    let (mut forward, mut backward) = (Side::new(to, true), Side::new(from, false));
    loop {
        let (side, other) = if forward.work <= backward.work { (&mut forward, &backward) } else { (&mut backward, &forward) };
        let node = side.open.pop()?;
        if let Some(meeting) = side.step(graph, node, other) {
            let mut routes = forward.path(graph, meeting);
            routes.reverse();
            routes.extend(backward.path(graph, meeting));
            return Some(routes);
        }
    }
}

impl Graph {
    /// Gives both nodes a place in the order; the order is stale if it cannot be mended cheaply.
    pub(crate) fn order_strong(&mut self, from: NodeId, to: NodeId) {
        let (source, target) = (slot_of(from), slot_of(to));
        let before = self.schedule.ranked(source);
        let after = self.schedule.ranked(target);
        if after > before {
            // Nodes of a level may have no routes between each other: what follows in it moves on.
            let level = self.schedule.level_end(before as usize);
            self.schedule.stale |= level.is_some() && level == self.schedule.level_end(after as usize);
            return;
        }
        let strong = |route: &RouteId| self.routes.all[*route].strength == Strength::Strong;
        if self.nodes[to].outgoing.iter().any(strong) {
            self.schedule.stale = true;
        } else {
            self.schedule.move_to_end(target);
        }
    }

    /// Makes the ranks anew if a route contradicts them.
    pub(crate) fn refresh_order(&mut self) {
        if !self.schedule.stale {
            return;
        }
        while let Err(unordered) = self.renumber() {
            // Strong routes have no loops, so only what was asked for this frame can stand in the way.
            tracing::error!("{unordered} nodes cannot be ordered");
            if self.frame.dependencies.pop().is_none() {
                self.schedule.stale = false;
                return;
            }
        }
    }

    /// Kahn's algorithm over the strong routes and this frame's dependencies; the error is how many nodes are in loops.
    fn renumber(&mut self) -> Result<(), usize> {
        let slots: Vec<u32> = self.schedule.by_rank.iter().copied().filter(|slot| *slot != NO_RANK).collect();
        let mut waits_for = vec![0u32; self.ids.len()];
        let mut after: HashMap<u32, Vec<u32>> = HashMap::new();
        for (later, earlier) in &self.frame.dependencies {
            if self.contains(*later) && self.contains(*earlier) {
                after.entry(slot_of(*earlier)).or_default().push(slot_of(*later));
                waits_for[slot_of(*later) as usize] += 1;
            }
        }
        for slot in &slots {
            let incoming = &self.nodes[self.ids[*slot as usize]].incoming;
            let strong = incoming.iter().filter(|route| self.routes.all[**route].strength == Strength::Strong).count();
            waits_for[*slot as usize] += strong as u32;
        }
        let mut order: Vec<u32> = slots.iter().copied().filter(|slot| waits_for[*slot as usize] == 0).collect();
        let (mut done, mut levels) = (0, Vec::new());
        while done < order.len() {
            // What no node of the levels so far has to wait for is the next level: first in, first out keeps them apart.
            if levels.last().is_none_or(|end| *end == done) {
                order[done..].sort_unstable();
                levels.push(order.len());
            }
            let slot = order[done];
            done += 1;
            let outgoing = self.nodes[self.ids[slot as usize]].outgoing.iter().map(|route| &self.routes.all[*route]);
            let strong = outgoing.filter(|route| route.strength == Strength::Strong).map(|route| slot_of(route.to.node));
            for next in strong.chain(after.get(&slot).into_iter().flatten().copied()) {
                waits_for[next as usize] -= 1;
                if waits_for[next as usize] == 0 {
                    order.push(next);
                }
            }
        }
        if order.len() < slots.len() {
            return Err(slots.len() - order.len());
        }
        self.schedule.set_order(order, levels.into_iter().map(|end| end as u32).collect());
        Ok(())
    }

    /// The nodes that take part in evaluation, in the order in which they have their turns; of the last frame, if routes were made since.
    pub fn evaluation_order(&self) -> impl Iterator<Item = NodeId> {
        self.schedule.by_rank.iter().filter(|slot| **slot != NO_RANK).map(|slot| self.ids[*slot as usize])
    }

    /// In this frame, or in the next if none is being evaluated, `node` has its turn after `on`; if `on` is evaluated only when asked for, this
    /// asks. Without effect for a node that had its turn in this frame.
    pub fn depend_for_this_frame(&mut self, node: NodeId, on: NodeId) -> Result<(), Error> {
        self.node(node)?;
        self.node(on)?;
        self.note(|| Event::Depends(node, on));
        let (later, earlier) = (slot_of(node), slot_of(on));
        let (before, after) = (self.schedule.ranked(earlier), self.schedule.ranked(later));
        self.frame.dependencies.push((node, on));
        if (self.schedule.stale || before >= after) && self.renumber().is_err() {
            self.frame.dependencies.pop();
            return Err(Error::Dependency { node: self.describe(node), on: self.describe(on) });
        }
        self.ask(on);
        Ok(())
    }
}
