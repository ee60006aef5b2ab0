//! Morph targets and linear blend skinning on the CPU: what the tracer sees, and what a GPU's result is compared with.

use crate::{Mesh, MorphTarget, Pose};
use glam::{Mat3, Mat4, Vec3, Vec4};
use std::sync::Arc;

/// A mesh's vertices after its deformation, in object space. Each list is as long as the mesh's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deformed {
    /// Positions, metres.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// Unit tangents; w is the sign of the bitangent, as at rest.
    pub tangents: Vec<Vec4>,
}

/// Applies `pose` to `mesh`: first the morph targets, then the skin, as in glTF 2.0 section 3.7.
///
/// Weights and matrices that the pose lacks count as zero and as identity; a vertex whose skin weights are all zero stays
/// where it is. Normals are turned by the cofactors of the blended matrix, so uneven scales keep them upright.
pub fn deformed(mesh: &Mesh, pose: &Pose) -> Deformed {
    let mut out =
        Deformed { positions: mesh.positions.to_vec(), normals: mesh.normals.to_vec(), tangents: mesh.tangents.to_vec() };
    morph(&mut out, &mesh.morph_targets, &pose.morph_weights);
    if !pose.object_from_bind.is_empty() && mesh.joints.len() == mesh.positions.len() && mesh.weights.len() == mesh.joints.len() {
        skin(&mut out, &mesh.joints, &mesh.weights, &pose.object_from_bind);
    }
    out
}

fn morph(out: &mut Deformed, targets: &[MorphTarget], weights: &[f32]) {
    let mut moved = false;
    for (target, &weight) in targets.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
        moved = true;
        add(&mut out.positions, &target.positions, weight);
        add(&mut out.normals, &target.normals, weight);
        for (tangent, offset) in out.tangents.iter_mut().zip(target.tangents.iter()) {
            *tangent += (*offset * weight).extend(0.0);
        }
    }
    if moved {
        out.normals.iter_mut().for_each(|n| *n = n.try_normalize().unwrap_or(*n));
        out.tangents.iter_mut().for_each(|t| *t = renormalized(*t, t.truncate()));
    }
}

fn add(values: &mut [Vec3], offsets: &Arc<[Vec3]>, weight: f32) {
    for (value, offset) in values.iter_mut().zip(offsets.iter()) {
        *value += *offset * weight;
    }
}

fn skin(out: &mut Deformed, joints: &[[u16; 4]], weights: &[Vec4], object_from_bind: &[Mat4]) {
    for (vertex, (joints, weights)) in joints.iter().zip(weights).enumerate() {
        let Some(matrix) = blended(*joints, *weights, object_from_bind) else { continue };
        out.positions[vertex] = matrix.transform_point3(out.positions[vertex]);
        if let Some(normal) = out.normals.get_mut(vertex) {
            *normal = turned_normal(&matrix, *normal);
        }
        if let Some(tangent) = out.tangents.get_mut(vertex) {
            *tangent = renormalized(*tangent, matrix.transform_vector3(tangent.truncate()));
        }
    }
}

/// The sum of the joints' matrices by weight; `None` where every weight is zero.
fn blended(joints: [u16; 4], weights: Vec4, object_from_bind: &[Mat4]) -> Option<Mat4> {
    let influences = joints.into_iter().zip(weights.to_array()).filter(|(_, w)| *w != 0.0);
    let matrices = influences.map(|(j, w)| object_from_bind.get(usize::from(j)).copied().unwrap_or(Mat4::IDENTITY) * w);
    matrices.reduce(|a, b| a + b)
}

fn turned_normal(matrix: &Mat4, normal: Vec3) -> Vec3 {
    let m = Mat3::from_mat4(*matrix);
    let cofactors = Mat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    let side = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    (cofactors * normal * side).try_normalize().unwrap_or(normal)
}

fn renormalized(old: Vec4, direction: Vec3) -> Vec4 {
    direction.try_normalize().unwrap_or(old.truncate()).extend(old.w)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    /// One vertex at (1, 0, 0) with normal +x and tangent +y, bound to joints 0 and 1.
    fn bone(weights: Vec4, targets: Vec<MorphTarget>) -> Mesh {
        Mesh {
            positions: [Vec3::X].into(),
            normals: [Vec3::X].into(),
            tangents: [Vec3::Y.extend(-1.0)].into(),
            joints: [[0, 1, 0, 0]].into(),
            weights: [weights].into(),
            morph_targets: targets,
            ..Mesh::default()
        }
    }

    #[test]
    fn skins_and_morphs() {
        let turn = Mat4::from_rotation_z(FRAC_PI_2);
        let lift = Mat4::from_translation(Vec3::Z * 2.0);
        let flat = Mat4::from_scale(Vec3::new(1.0, 0.5, 1.0)) * Mat4::from_rotation_z(FRAC_PI_2 * 0.5);
        let mirror = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let slope = Vec3::new(0.5, 1.0, 0.0).normalize();
        let w = Vec4::new;
        let rows = [
            ("no skin", vec![], w(1.0, 0.0, 0.0, 0.0), Vec3::X, Vec3::X),
            ("one joint", vec![turn, lift], w(1.0, 0.0, 0.0, 0.0), Vec3::Y, Vec3::Y),
            (
                "half and half",
                vec![turn, lift],
                w(0.5, 0.5, 0.0, 0.0),
                Vec3::new(0.5, 0.5, 1.0),
                Vec3::new(1.0, 1.0, 0.0).normalize(),
            ),
            ("uneven scale", vec![flat], w(1.0, 0.0, 0.0, 0.0), flat.transform_point3(Vec3::X), slope),
            ("mirror", vec![mirror], w(1.0, 0.0, 0.0, 0.0), Vec3::NEG_X, Vec3::NEG_X),
            ("missing joint", vec![turn], w(0.0, 1.0, 0.0, 0.0), Vec3::X, Vec3::X),
            ("no weight", vec![turn], Vec4::ZERO, Vec3::X, Vec3::X),
        ];
        for (name, object_from_bind, weights, position, normal) in rows {
            let out = deformed(&bone(weights, vec![]), &Pose { object_from_bind, morph_weights: vec![] });
            assert!(out.positions[0].abs_diff_eq(position, 1e-6), "{name}: position {}", out.positions[0]);
            assert!(out.normals[0].abs_diff_eq(normal, 1e-6), "{name}: normal {}", out.normals[0]);
            assert_eq!(out.tangents[0].w, -1.0, "{name}");
        }
    }

    #[test]
    fn morphs_before_the_skin_turns() {
        let target = |p: Vec3, n: Vec3| MorphTarget { positions: [p].into(), normals: [n].into(), tangents: [].into() };
        let mesh =
            bone(Vec4::X, vec![target(Vec3::X, Vec3::ZERO), target(Vec3::Y * 9.0, Vec3::ZERO), target(Vec3::ZERO, Vec3::Y)]);
        let pose = Pose { object_from_bind: vec![Mat4::from_rotation_z(FRAC_PI_2)], morph_weights: vec![2.0, 0.0, 1.0] };
        let out = deformed(&mesh, &pose);
        assert!(out.positions[0].abs_diff_eq(Vec3::Y * 3.0, 1e-6), "{}", out.positions[0]);
        assert!(out.normals[0].abs_diff_eq(Vec3::new(-1.0, 1.0, 0.0).normalize(), 1e-6), "{}", out.normals[0]);
        assert!(out.tangents[0].abs_diff_eq(Vec3::NEG_X.extend(-1.0), 1e-6), "{}", out.tangents[0]);
    }
}
