//! From triangles under treatment to a [`Mended`], and from that to a mesh.

use super::soup::Soup;
use super::{Added, Done, Mended, Steps, turn};
use crate::{Aabb, Mesh, MorphTarget};
use glam::{Vec3, Vec4};
use std::sync::Arc;

/// Closes the treatment.
pub(super) fn finish(mut soup: Soup, mesh: &Mesh, steps: &Steps, done: Done) -> Mended {
    let turned = turn::normals(&mut soup, mesh);
    let bits = |p: Vec3| p.to_array().map(f32::to_bits);
    let is_moved = |v: &usize| {
        let (old, new) = (mesh.positions[*v], soup.places[soup.corner_of[*v] as usize]);
        // The sign of a zero is left alone, unless welding is asked for.
        old != new || steps.weld_m.is_some() && bits(old) != bits(new)
    };
    let place = |v: usize| soup.places[soup.corner_of[v] as usize];
    let moved = (0..soup.originals).filter(|v| mesh.positions[*v].is_finite()).filter(is_moved);
    let moved = moved.map(|v| (v as u32, place(v))).collect();
    let added = soup.extras.iter().enumerate().map(|(i, e)| Added {
        from: e.from,
        to: e.to,
        share: e.share,
        position: place(soup.originals + i),
        normal: e.normal,
    });
    let added = added.collect();
    Mended { indices: soup.triangles.into_flattened(), moved, turned, added, done, ..Mended::default() }
}

impl Mended {
    /// Is the mesh as it was?
    pub fn is_unchanged(&self) -> bool {
        self.done.is_nothing() && self.moved.is_empty() && self.added.is_empty()
    }
}

/// The mesh as it is when mended. What was not changed is shared with the old one.
pub(super) fn applied(mesh: &Mesh, mended: &Mended) -> Mesh {
    let add = mended.added.as_slice();
    let mut positions = mesh.positions.to_vec();
    mended.moved.iter().for_each(|(v, p)| positions[*v as usize] = *p);
    positions.extend(add.iter().map(|a| a.position));
    let mut normals = grown(&mesh.normals, add, |x: Vec3, y, share| x.lerp(y, share).normalize_or(x)).to_vec();
    let mut tangents = grown(&mesh.tangents, add, |x: Vec4, y, share| {
        x.truncate().lerp(y.truncate(), share).normalize_or(x.truncate()).extend(x.w)
    });
    for v in &mended.turned {
        if let Some(n) = normals.get_mut(*v as usize) {
            *n = -*n;
        }
    }
    if !normals.is_empty() {
        for (i, a) in add.iter().enumerate() {
            normals[mesh.positions.len() + i] = a.normal.unwrap_or(normals[mesh.positions.len() + i]);
        }
    }
    if !mended.turned.is_empty() && !tangents.is_empty() {
        let mut list = tangents.to_vec();
        mended.turned.iter().for_each(|v| list[*v as usize].w *= -1.0);
        tangents = list.into();
    }
    let offset = |x: Vec3, y: Vec3, share: f32| x.lerp(y, share);
    let target = |t: &MorphTarget| MorphTarget {
        positions: grown(&t.positions, add, offset),
        normals: grown(&t.normals, add, offset),
        tangents: grown(&t.tangents, add, offset),
    };
    Mesh {
        name: mesh.name.clone(),
        topology: mesh.topology,
        normals: normals.into(),
        tangents,
        uv0: grown(&mesh.uv0, add, |x, y, share| x.lerp(y, share)),
        uv1: grown(&mesh.uv1, add, |x, y, share| x.lerp(y, share)),
        colors: grown(&mesh.colors, add, |x: Vec4, y, share| x.lerp(y, share)),
        // Joints have no middle.
        joints: grown(&mesh.joints, add, |x: [u16; 4], y, share| if share > 0.5 { y } else { x }),
        weights: grown(&mesh.weights, add, |x: Vec4, y, share| if share > 0.5 { y } else { x }),
        morph_targets: mesh.morph_targets.iter().map(target).collect(),
        indices: mended.indices.clone().into(),
        bounds: Aabb::from_points(positions.iter().copied()),
        positions: positions.into(),
    }
}

/// An attribute with values for the added vertices.
fn grown<T: Copy>(values: &Arc<[T]>, added: &[Added], mix: impl Fn(T, T, f32) -> T) -> Arc<[T]> {
    if added.is_empty() || values.is_empty() {
        return values.clone();
    }
    let more = added.iter().map(|a| mix(values[a.from as usize], values[a.to as usize], a.share));
    values.iter().copied().chain(more).collect()
}

impl Mended {
    /// The mesh as it is when mended. What was not changed is shared with the old one.
    pub fn apply(&self, mesh: &Mesh) -> Mesh {
        applied(mesh, self)
    }
}
