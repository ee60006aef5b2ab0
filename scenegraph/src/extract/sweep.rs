//! Moves and shows what stands below changed places.

use super::instance::{ALL, Instances, NONE};
use super::problem::Problems;
use super::read::Reader;
use super::role::Role;
use glam::{Mat4, Vec3};
use std::collections::BTreeSet;
use std::sync::Arc;
use umbriel_fields::Graph;

/// Leaves that a sweep has passed.
#[derive(Default)]
pub(super) struct Touched {
    pub(super) shapes: Vec<u32>,
    pub(super) lights: BTreeSet<u32>,
    pub(super) joints: Vec<u32>,
    pub(super) viewpoints: bool,
    pub(super) groups: bool,
    /// Places visited.
    pub(super) visited: usize,
}

/// Recomputes the sub-trees of `places`, each entry at most once. A sub-tree is one contiguous run, parents first.
pub(super) fn sweep(
    graph: &Graph,
    instances: &mut Instances,
    places: &BTreeSet<u32>,
    room_from_world: Mat4,
    head: Vec3,
    problems: &mut Problems,
    touched: &mut Touched,
) {
    let mut done = 0;
    for place in places {
        if *place < done {
            continue;
        }
        done = instances.at(*place).end;
        for at in *place..done {
            visit(graph, instances, at, room_from_world, head, problems, touched);
        }
    }
}

fn visit(
    graph: &Graph,
    instances: &mut Instances,
    at: u32,
    room_from_world: Mat4,
    head: Vec3,
    problems: &mut Problems,
    touched: &mut Touched,
) {
    touched.visited += 1;
    let parent = instances.at(at).parent;
    let (room_from_parent, parent_shown, parent_finite, choice) = if parent == NONE {
        (room_from_world, true, true, ALL)
    } else {
        let p = instances.at(parent);
        (p.room_from_local, p.shown, p.finite, p.choice)
    };
    let instance = &mut instances.list[at as usize];
    instance.room_from_local = room_from_parent * instance.parent_from_local;
    instance.shown = parent_shown && (choice == ALL || choice == instance.ordinal);
    instance.finite = parent_finite && instance.room_from_local.is_finite();
    if parent_finite && matches!(instance.role, Role::Transform | Role::Stencil) {
        let problem = (!instance.finite)
            .then(|| "the transform is not finite; what stands below is left out until it is mended".to_owned());
        problems.set(graph, instance.node, "transform", problem);
    }
    match instance.role {
        Role::Shape => touched.shapes.push(at),
        Role::Light => drop(touched.lights.insert(at)),
        Role::Viewpoint => touched.viewpoints = true,
        Role::Stencil => touched.groups = true,
        Role::Lod => {
            let choice = lod_choice(graph, instances, at, head);
            instances.list[at as usize].choice = choice;
        }
        _ => {}
    }
    if instances.at(at).joint {
        touched.joints.push(at);
    }
}

/// The child that suits the distance of the head from the LOD's centre, measured in the LOD's own space as in X3D.
pub(super) fn lod_choice(graph: &Graph, instances: &Instances, at: u32, head: Vec3) -> i32 {
    let instance = instances.at(at);
    let read = Reader::new(graph, instance.node);
    let (range, center): (Arc<[f32]>, Vec3) = (read.get("range"), read.get("center"));
    let children: Arc<[Option<umbriel_fields::NodeId>]> = read.get("children");
    let distance = instance.room_from_local.inverse().transform_point3(head).distance(center);
    let step = range.iter().position(|r| distance < *r).unwrap_or(range.len());
    step.min(children.len().saturating_sub(1)) as i32
}
