//! The compiled list: one entry per path from the world to a node, parents before children, sub-trees contiguous.

use super::read::{Reader, label};
use super::role::{Role, TypeInfo, Types};
use glam::{Mat4, Quat, Vec3};
use slotmap::SecondaryMap;
use std::collections::HashSet;
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId};

/// No entry.
pub(super) const NONE: u32 = u32::MAX;
/// A parent that shows all its children.
pub(super) const ALL: i32 = -2;

/// One place of one node in the world.
#[derive(Clone, Debug)]
pub(super) struct Instance {
    pub(super) node: NodeId,
    pub(super) role: Role,
    pub(super) parent: u32,
    /// One past the last entry of the sub-tree.
    pub(super) end: u32,
    /// Next instance of the same node.
    pub(super) next: u32,
    /// Place among the parent's children.
    pub(super) ordinal: i32,
    /// Which child is shown.
    pub(super) choice: i32,
    /// Place in the list of its role: drawables, lights, viewpoints.
    pub(super) slot: u32,
    /// Bends a skin.
    pub(super) joint: bool,
    /// No Switch or LOD above hides it.
    pub(super) shown: bool,
    /// All transforms above are finite.
    pub(super) finite: bool,
    pub(super) parent_from_local: Mat4,
    pub(super) room_from_local: Mat4,
}

/// The compiled list and, per node, the first of its entries.
#[derive(Default)]
pub(super) struct Instances {
    pub(super) list: Vec<Instance>,
    pub(super) first: SecondaryMap<NodeId, u32>,
}

impl Instances {
    /// All places of a node, in tree order.
    pub(super) fn of(&self, node: NodeId) -> impl Iterator<Item = u32> + '_ {
        let first = self.first.get(node).copied().unwrap_or(NONE);
        std::iter::successors((first != NONE).then_some(first), |i| {
            let next = self.list[*i as usize].next;
            (next != NONE).then_some(next)
        })
    }

    pub(super) fn at(&self, place: u32) -> &Instance {
        &self.list[place as usize]
    }
}

/// What went wrong while compiling: per node, a message.
#[derive(Default)]
pub(super) struct CompileProblems {
    pub(super) cycles: Vec<(NodeId, String)>,
    pub(super) limit: Vec<(NodeId, String)>,
}

/// A node whose children are being added.
struct Open {
    place: u32,
    branches: Vec<(i32, NodeId)>,
    next: usize,
}

/// Walks the graph from `root`, without recursion, and lists every path. Stops at `limit` entries. Nodes that stand in
/// `before` keep their local transforms: those written since are read again by the caller.
pub(super) fn compile(
    graph: &Graph,
    types: &mut Types,
    root: Option<NodeId>,
    limit: usize,
    before: &Instances,
) -> (Instances, CompileProblems) {
    let mut out = Instances::default();
    let mut problems = CompileProblems::default();
    let mut last: SecondaryMap<NodeId, u32> = SecondaryMap::new();
    let mut on_path: SecondaryMap<NodeId, ()> = SecondaryMap::new();
    let mut open: Vec<Open> = Vec::new();
    let Some(root) = root else { return (out, problems) };
    let mut pending = Some((root, NONE, 0));
    loop {
        if let Some((node, parent, ordinal)) = pending.take() {
            let type_place = types.of(graph, node);
            let info = types.get(type_place);
            if !info.role.is_placed() {
                continue;
            }
            if out.list.len() >= limit {
                let message =
                    format!("the scene has more than {limit} places; the rest is left out (nodes that share children multiply)");
                problems.limit.push((root, message));
                break;
            }
            let place = out.list.len() as u32;
            match last.insert(node, place) {
                Some(before) => out.list[before as usize].next = place,
                None => drop(out.first.insert(node, place)),
            }
            out.list.push(new_instance(graph, info, node, parent, ordinal, before));
            on_path.insert(node, ());
            open.push(Open { place, branches: branches(graph, node, info), next: 0 });
        }
        let Some(top) = open.last_mut() else { break };
        let Some(&(ordinal, child)) = top.branches.get(top.next) else {
            let end = out.list.len() as u32;
            let closed = &mut out.list[top.place as usize];
            closed.end = end;
            on_path.remove(closed.node);
            open.pop();
            continue;
        };
        top.next += 1;
        if on_path.contains_key(child) {
            let from = out.list[top.place as usize].node;
            let message = format!("'{}' below it is also above it; this branch is left out", label(graph, child));
            problems.cycles.push((from, message));
            continue;
        }
        pending = Some((child, top.place, ordinal));
    }
    // Where the limit cut the walk, the open entries end here.
    let end = out.list.len() as u32;
    for unfinished in open {
        out.list[unfinished.place as usize].end = end;
    }
    (out, problems)
}

fn new_instance(graph: &Graph, info: &TypeInfo, node: NodeId, parent: u32, ordinal: i32, before: &Instances) -> Instance {
    let (parent_from_local, choice) = match before.of(node).next().map(|place| before.at(place)) {
        Some(old) => (old.parent_from_local, old.choice),
        None => (
            info.transform.map_or(Mat4::IDENTITY, |keys| local_matrix(graph, node, keys)),
            if info.role == Role::Switch { switch_choice(graph, node) } else { ALL },
        ),
    };
    Instance {
        node,
        role: info.role,
        parent,
        end: 0,
        next: NONE,
        ordinal,
        choice,
        slot: NONE,
        joint: false,
        shown: true,
        finite: true,
        parent_from_local,
        room_from_local: Mat4::IDENTITY,
    }
}

/// The child that a Switch shows; any negative number shows none.
pub(super) fn switch_choice(graph: &Graph, node: NodeId) -> i32 {
    Reader::new(graph, node).get::<i32>("which_choice").max(-1)
}

/// Children in order, then a StencilShadow's casters that do not stand below its children anyway.
fn branches(graph: &Graph, node: NodeId, info: &TypeInfo) -> Vec<(i32, NodeId)> {
    let Some(children) = info.children else { return Vec::new() };
    let reader = Reader::new(graph, node);
    let children: Arc<[Option<NodeId>]> = reader.at(children);
    let living = |(i, id): (i32, &Option<NodeId>)| id.filter(|id| graph.contains(*id)).map(|id| (i, id));
    let mut out: Vec<(i32, NodeId)> = (0..).zip(children.iter()).filter_map(living).collect();
    if info.role == Role::Stencil {
        let casters = reader.nodes("caster");
        let below = if casters.is_empty() { HashSet::new() } else { all_below(graph, &out) };
        for (_, caster) in casters {
            if !below.contains(&caster) && !out.iter().any(|(_, id)| *id == caster) {
                out.push((out.len() as i32, caster));
            }
        }
    }
    out
}

/// These nodes and everything below them, each once.
fn all_below(graph: &Graph, roots: &[(i32, NodeId)]) -> HashSet<NodeId> {
    let mut open: Vec<NodeId> = roots.iter().map(|(_, id)| *id).collect();
    let mut seen = HashSet::new();
    while let Some(node) = open.pop() {
        if seen.insert(node) {
            let read = Reader::new(graph, node);
            open.extend(["children", "caster"].into_iter().flat_map(|field| read.nodes(field)).map(|(_, id)| id));
        }
    }
    seen
}

/// T C R SR S -SR -C, then `matrix` innermost (X3D Transform).
pub(super) fn local_matrix(graph: &Graph, node: NodeId, keys: [u16; 6]) -> Mat4 {
    let read = Reader::new(graph, node);
    let [translation, center] = [keys[0], keys[3]].map(|k| read.at::<Vec3>(k));
    let scale: Vec3 = read.at(keys[2]);
    let [rotation, scale_orientation] = [keys[1], keys[4]].map(|k| unit(read.at::<Quat>(k)));
    let matrix: Mat4 = read.at(keys[5]);
    let mut local = if center == Vec3::ZERO && scale_orientation == Quat::IDENTITY {
        Mat4::from_scale_rotation_translation(scale, rotation, translation)
    } else {
        let stretch = Mat4::from_quat(scale_orientation) * Mat4::from_scale(scale) * Mat4::from_quat(scale_orientation.inverse());
        Mat4::from_translation(translation + center) * Mat4::from_quat(rotation) * stretch * Mat4::from_translation(-center)
    };
    if matrix != Mat4::IDENTITY {
        local *= matrix;
    }
    local
}

/// Of length one, so that a rotation never stretches; a zero quaternion turns nothing, NaN stays NaN.
pub(super) fn unit(q: Quat) -> Quat {
    let length = q.length();
    if length == 0.0 { Quat::IDENTITY } else { Quat::from_xyzw(q.x / length, q.y / length, q.z / length, q.w / length) }
}
