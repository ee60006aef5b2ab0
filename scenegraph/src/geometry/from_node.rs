//! Checks the fields of a Mesh node and shares their arrays with a mesh.

use glam::{Vec2, Vec3, Vec4};
use std::sync::Arc;
use umbriel_scene::{Mesh, MeshError, MorphTarget, Topology};

/// The fields of a Mesh node and of its targets.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshFields {
    pub(crate) name: String,
    pub(crate) topology: Topology,
    pub(crate) position: Arc<[Vec3]>,
    pub(crate) normal: Arc<[Vec3]>,
    pub(crate) tangent: Arc<[Vec4]>,
    pub(crate) tex_coord: Arc<[Vec2]>,
    pub(crate) tex_coord1: Arc<[Vec2]>,
    pub(crate) color: Arc<[Vec4]>,
    pub(crate) joint: Arc<[i32]>,
    pub(crate) weight: Arc<[Vec4]>,
    pub(crate) index: Arc<[i32]>,
    pub(crate) targets: Vec<MorphTarget>,
}

/// Why the fields make no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum MeshProblem {
    #[error("it has no {0}")]
    Empty(&'static str),
    #[error("index {index} at place {place} is negative")]
    NegativeIndex { index: i32, place: usize },
    #[error("joint {joint} at place {place} is outside of 0..65536")]
    Joint { joint: i32, place: usize },
    #[error("joint has {found} entries where {vertices} vertices need {}", vertices * 4)]
    JointCount { found: usize, vertices: usize },
    #[error("joint and weight must be both there or both empty")]
    JointWithoutWeight,
    #[error("{attribute} {place} is not finite")]
    NotFinite { attribute: &'static str, place: usize },
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Makes the mesh. Arrays are shared with the fields, not copied, except joints (narrower) and weights that do not sum to 1.
pub(crate) fn mesh_from_fields(f: MeshFields) -> Result<Mesh, MeshProblem> {
    if f.position.is_empty() {
        return Err(MeshProblem::Empty("vertices"));
    }
    if let Some((place, &index)) = f.index.iter().enumerate().find(|(_, i)| **i < 0) {
        return Err(MeshProblem::NegativeIndex { index, place });
    }
    let indices: Arc<[u32]> =
        if f.index.is_empty() { (0..f.position.len() as u32).collect() } else { cast_indices(f.index.clone()) };
    if indices.len() < f.topology.indices_per_primitive() {
        return Err(MeshProblem::Empty(match f.topology {
            Topology::Triangles => "triangles",
            Topology::Lines => "lines",
            Topology::Points => "points",
        }));
    }
    finite("normal", &f.normal, |v| v.is_finite())?;
    finite("tangent", &f.tangent, |v| v.is_finite())?;
    finite("tex_coord", &f.tex_coord, |v| v.is_finite())?;
    finite("tex_coord1", &f.tex_coord1, |v| v.is_finite())?;
    finite("color", &f.color, |v| v.is_finite())?;
    finite("weight", &f.weight, |v| v.is_finite())?;
    for target in &f.targets {
        finite("offset of a morph target's position", &target.positions, |v| v.is_finite())?;
        finite("offset of a morph target's normal", &target.normals, |v| v.is_finite())?;
        finite("offset of a morph target's tangent", &target.tangents, |v| v.is_finite())?;
    }
    let mesh = Mesh {
        joints: joints(&f)?,
        weights: unit_sums(&f.weight),
        name: f.name,
        topology: f.topology,
        positions: f.position,
        normals: f.normal,
        flat: false,
        tangents: f.tangent,
        uv0: f.tex_coord,
        uv1: f.tex_coord1,
        colors: f.color,
        morph_targets: f.targets,
        indices,
        bounds: Default::default(),
    };
    Ok(mesh.checked()?)
}

fn cast_indices(index: Arc<[i32]>) -> Arc<[u32]> {
    bytemuck::allocation::try_cast_slice_arc(index).unwrap_or_else(|(_, index)| index.iter().map(|i| *i as u32).collect())
}

fn finite<T>(attribute: &'static str, values: &[T], is_finite: impl Fn(&T) -> bool) -> Result<(), MeshProblem> {
    match values.iter().position(|v| !is_finite(v)) {
        Some(place) => Err(MeshProblem::NotFinite { attribute, place }),
        None => Ok(()),
    }
}

fn joints(f: &MeshFields) -> Result<Arc<[[u16; 4]]>, MeshProblem> {
    if f.joint.is_empty() != f.weight.is_empty() {
        return Err(MeshProblem::JointWithoutWeight);
    }
    if !f.joint.is_empty() && f.joint.len() != 4 * f.position.len() {
        return Err(MeshProblem::JointCount { found: f.joint.len(), vertices: f.position.len() });
    }
    if let Some((place, &joint)) = f.joint.iter().enumerate().find(|(_, j)| u16::try_from(**j).is_err()) {
        return Err(MeshProblem::Joint { joint, place });
    }
    Ok(f.joint.chunks_exact(4).map(|j| [j[0] as u16, j[1] as u16, j[2] as u16, j[3] as u16]).collect())
}

/// Weights that sum to 1, shared where they do already. A vertex without weights follows its first joint.
fn unit_sums(weights: &Arc<[Vec4]>) -> Arc<[Vec4]> {
    let fine = |w: &Vec4| w.min_element() >= 0.0 && (w.element_sum() - 1.0).abs() < 1e-4;
    if weights.iter().all(fine) {
        return weights.clone();
    }
    let fit = |w: &Vec4| {
        let w = w.max(Vec4::ZERO);
        if w.element_sum() > 0.0 { w / w.element_sum() } else { Vec4::X }
    };
    weights.iter().map(fit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> MeshFields {
        MeshFields {
            name: "tri".into(),
            position: [Vec3::ZERO, Vec3::X, Vec3::Y].into(),
            index: [0, 1, 2].into(),
            ..MeshFields::default()
        }
    }

    #[test]
    fn arrays_are_shared_and_normals_computed() {
        let fields = triangle();
        let mesh = mesh_from_fields(fields.clone()).unwrap();
        assert!(Arc::ptr_eq(&mesh.positions, &fields.position));
        assert_eq!(mesh.indices.as_ptr() as usize, fields.index.as_ptr() as usize);
        assert_eq!(&*mesh.normals, &[Vec3::Z; 3]);
        assert_eq!(mesh.bounds.max, Vec3::new(1.0, 1.0, 0.0));
    }

    #[test]
    fn without_index_the_vertices_are_taken_in_order() {
        let mesh = mesh_from_fields(MeshFields { index: [].into(), ..triangle() }).unwrap();
        assert_eq!(&*mesh.indices, &[0, 1, 2]);
    }

    #[test]
    fn weights_are_made_to_sum_to_one() {
        let weight: Arc<[Vec4]> = [Vec4::splat(1.0), Vec4::ZERO, Vec4::X].into();
        let mesh = mesh_from_fields(MeshFields { joint: [0; 12].into(), weight, ..triangle() }).unwrap();
        assert_eq!(&*mesh.weights, &[Vec4::splat(0.25), Vec4::X, Vec4::X]);
    }

    #[test]
    fn bad_fields_are_told() {
        let nan = Vec3::new(0.0, f32::NAN, 0.0);
        let rows: [(MeshFields, &str); 11] = [
            (MeshFields::default(), "it has no vertices"),
            (MeshFields { index: [0, 1, 3].into(), ..triangle() }, "index 3 at place 2"),
            (MeshFields { index: [0, -1, 2].into(), ..triangle() }, "index -1 at place 1 is negative"),
            (MeshFields { index: [0, 1].into(), ..triangle() }, "it has no triangles"),
            (MeshFields { index: [0, 1, 2, 0].into(), ..triangle() }, "4 indices are no multiple of 3"),
            (MeshFields { position: [Vec3::X, nan, Vec3::Y].into(), ..triangle() }, "position 1 is not finite"),
            (MeshFields { normal: [nan; 3].into(), ..triangle() }, "normal 0 is not finite"),
            (MeshFields { normal: [Vec3::Y; 2].into(), ..triangle() }, "normals has 2 entries where the positions have 3"),
            (MeshFields { joint: [0; 12].into(), ..triangle() }, "both"),
            (MeshFields { joint: [0; 3].into(), weight: [Vec4::X; 3].into(), ..triangle() }, "3 vertices need 12"),
            (MeshFields { joint: [70_000; 12].into(), weight: [Vec4::X; 3].into(), ..triangle() }, "joint 70000 at place 0"),
        ];
        for (fields, expected) in rows {
            let message = mesh_from_fields(fields).unwrap_err().to_string();
            assert!(message.contains(expected), "{message} should contain {expected}");
        }
    }
}
