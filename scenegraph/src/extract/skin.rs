//! Skins and morph targets: poses, and boxes that surely hold the deformed mesh.

use super::instance::{Instances, NONE};
use glam::{Mat4, Vec3};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use umbriel_fields::NodeId;
use umbriel_scene::{Aabb, Mesh, Pose};

/// What a shape's Skin node says.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Skin {
    /// Dead joints keep their places.
    pub(super) joints: Vec<Option<NodeId>>,
    pub(super) inverse_bind: Arc<[Mat4]>,
}

/// Boxes of what each joint moves and of what each morph target adds; computed once per mesh.
#[derive(Debug, Default)]
pub(super) struct JointBounds {
    /// Around the vertices that follow a joint, at rest. Empty for meshes without joints.
    per_joint: Vec<Aabb>,
    rest: Aabb,
    /// Smallest and largest offset of each target; 0 included.
    targets: Vec<Aabb>,
}

impl JointBounds {
    pub(super) fn of(mesh: &Mesh) -> JointBounds {
        let joints = mesh.joints.iter().flatten().copied().max().map_or(0, |most| most as usize + 1);
        let mut per_joint = vec![Aabb::EMPTY; joints];
        for ((p, joints), weights) in mesh.positions.iter().zip(mesh.joints.iter()).zip(mesh.weights.iter()) {
            for (joint, weight) in joints.iter().zip(weights.to_array()) {
                if weight > 0.0 {
                    let b = &mut per_joint[*joint as usize];
                    *b = b.union(Aabb { min: *p, max: *p });
                }
            }
        }
        let zero = Aabb { min: Vec3::ZERO, max: Vec3::ZERO };
        let targets = mesh.morph_targets.iter().map(|t| Aabb::from_points(t.positions.iter().copied()).union(zero)).collect();
        JointBounds { per_joint, rest: mesh.bounds, targets }
    }

    /// How many joints the mesh asks for.
    pub(super) fn joint_count(&self) -> usize {
        self.per_joint.len()
    }

    /// How many morph targets the mesh has.
    pub(super) fn target_count(&self) -> usize {
        self.targets.len()
    }

    /// A box in the room around the mesh in this pose. A deformed vertex is a mean of places under its joints, so it lies
    /// in the box around the boxes of all joints.
    pub(super) fn posed(&self, room_from_object: &Mat4, pose: &Pose) -> Aabb {
        let (mut low, mut high) = (Vec3::ZERO, Vec3::ZERO);
        for (target, weight) in self.targets.iter().zip(&pose.morph_weights) {
            let (a, b) = (target.min * *weight, target.max * *weight);
            low += a.min(b);
            high += a.max(b);
        }
        let grown = |b: &Aabb| if b.is_empty() { *b } else { Aabb { min: b.min + low, max: b.max + high } };
        if pose.object_from_bind.is_empty() {
            return grown(&self.rest).transformed(room_from_object);
        }
        let moved = |(b, m): (&Aabb, &Mat4)| grown(b).transformed(&(*room_from_object * *m));
        self.per_joint.iter().zip(&pose.object_from_bind).map(moved).fold(Aabb::EMPTY, Aabb::union)
    }
}

/// Which places in the world bend which drawn shapes.
#[derive(Default)]
pub(super) struct Bindings {
    /// Joints of each skinned place, in the order of its skin.
    joints: BTreeMap<u32, Vec<u32>>,
    users: HashMap<u32, Vec<u32>>,
}

impl Bindings {
    /// Finds the joints of every skinned place anew and marks them.
    pub(super) fn bind<'s>(&mut self, instances: &mut Instances, skinned: impl Iterator<Item = (u32, &'s Skin)>) {
        for place in self.users.keys() {
            if let Some(instance) = instances.list.get_mut(*place as usize) {
                instance.joint = false;
            }
        }
        self.joints.clear();
        self.users.clear();
        for (place, skin) in skinned {
            let joints: Vec<u32> = skin.joints.iter().map(|j| j.map_or(NONE, |j| nearest(instances, place, j))).collect();
            for joint in joints.iter().filter(|j| **j != NONE) {
                self.users.entry(*joint).or_default().push(place);
                instances.list[*joint as usize].joint = true;
            }
            self.joints.insert(place, joints);
        }
    }

    /// The places that the joint bends.
    pub(super) fn users(&self, joint: u32) -> &[u32] {
        self.users.get(&joint).map_or(&[], Vec::as_slice)
    }

    /// glTF 2.0: the joint's place as seen from the object, times its inverse bind matrix. A joint that stands nowhere
    /// leaves its vertices at rest. None where a joint is not finite.
    pub(super) fn object_from_bind(&self, instances: &Instances, place: u32, skin: &Skin) -> Option<Vec<Mat4>> {
        let object_from_room = instances.at(place).room_from_local.inverse();
        let matrix = |(i, joint): (usize, &u32)| {
            if *joint == NONE {
                return Some(Mat4::IDENTITY);
            }
            let joint_from_bind = skin.inverse_bind.get(i).copied().unwrap_or(Mat4::IDENTITY);
            let m = object_from_room * instances.at(*joint).room_from_local * joint_from_bind;
            m.is_finite().then_some(m)
        };
        self.joints.get(&place)?.iter().enumerate().map(matrix).collect()
    }
}

/// The instance of a joint that shares the nearest ancestor with the shape: each copy of a figure has its own joints.
fn nearest(instances: &Instances, shape: u32, joint: NodeId) -> u32 {
    let mut candidates = instances.of(joint);
    let Some(first) = candidates.next() else { return NONE };
    if candidates.next().is_none() {
        return first;
    }
    let mut above = shape;
    while above != NONE {
        let end = instances.at(above).end;
        if let Some(found) = instances.of(joint).find(|c| (above..end).contains(c)) {
            return found;
        }
        above = instances.at(above).parent;
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec4};

    /// A strip whose upper end follows joint 1, in many poses and with a morph target: no vertex leaves the box.
    #[test]
    fn the_box_holds_every_posed_vertex() {
        let n = 20;
        let t = |i: usize| i as f32 / (n - 1) as f32;
        let positions: Arc<[Vec3]> = (0..n).map(|i| Vec3::new((i % 2) as f32 * 0.3, t(i) * 2.0, 0.0)).collect();
        let mesh = Mesh {
            joints: (0..n).map(|_| [0, 1, 0, 0]).collect(),
            weights: (0..n).map(|i| Vec4::new(1.0 - t(i), t(i), 0.0, 0.0)).collect(),
            morph_targets: vec![umbriel_scene::MorphTarget {
                positions: (0..n).map(|i| Vec3::Z * t(i)).collect(),
                ..Default::default()
            }],
            indices: (0..n as u32 - 2).flat_map(|i| [i, i + 1, i + 2]).collect(),
            positions,
            ..Mesh::default()
        };
        let mesh = mesh.checked().unwrap();
        let bounds = JointBounds::of(&mesh);
        let room_from_object = Mat4::from_scale(Vec3::new(-1.0, 2.0, 1.0)) * Mat4::from_rotation_x(0.4);
        for step in 0..24 {
            let bend = Mat4::from_quat(Quat::from_rotation_z(step as f32 * 0.3)) * Mat4::from_translation(Vec3::X * 0.1);
            let weight = (step as f32 - 12.0) * 0.2;
            let pose = Pose { object_from_bind: vec![Mat4::from_translation(Vec3::Y), bend], morph_weights: vec![weight] };
            let found = bounds.posed(&room_from_object, &pose);
            for (i, p) in mesh.positions.iter().enumerate() {
                let morphed = *p + mesh.morph_targets[0].positions[i] * weight;
                let w = mesh.weights[i];
                let skinned = pose.object_from_bind[0].transform_point3(morphed) * w.x
                    + pose.object_from_bind[1].transform_point3(morphed) * w.y;
                let p = room_from_object.transform_point3(skinned);
                assert!(p.cmpge(found.min - 1e-4).all() && p.cmple(found.max + 1e-4).all(), "step {step}, vertex {i}");
            }
        }
    }
}
