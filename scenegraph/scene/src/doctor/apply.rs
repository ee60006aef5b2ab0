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
    // All vertices of a corner must move together, or it would come apart.
    let mut movers: Vec<Option<u32>> = vec![None; soup.places.len()];
    for (v, corner) in soup.corner_of.iter().enumerate() {
        movers[*corner as usize].get_or_insert_with(|| soup.original(v as u32));
    }
    let added = soup.extras.iter().enumerate().map(|(i, e)| Added {
        from: e.from,
        to: e.to,
        share: e.share,
        moves_like: movers[soup.corner_of[soup.originals + i] as usize].unwrap_or(e.from),
        position: place(soup.originals + i),
        normal: e.normal,
    });
    let added = added.collect();
    Mended { indices: soup.triangles.into_flattened(), moved, turned, added, done, ..Mended::default() }
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
    let target = |t: &MorphTarget| MorphTarget {
        positions: moving(&t.positions, add),
        normals: moving(&t.normals, add),
        tangents: moving(&t.tangents, add),
    };
    Mesh {
        name: mesh.name.clone(),
        topology: mesh.topology,
        normals: normals.into(),
        flat: mesh.flat,
        tangents,
        uv0: grown(&mesh.uv0, add, |x, y, share| x.lerp(y, share)),
        uv1: grown(&mesh.uv1, add, |x, y, share| x.lerp(y, share)),
        colors: grown(&mesh.colors, add, |x: Vec4, y, share| x.lerp(y, share)),
        joints: moving(&mesh.joints, add),
        weights: moving(&mesh.weights, add),
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

/// What moves the added vertices.
fn moving<T: Copy>(values: &Arc<[T]>, added: &[Added]) -> Arc<[T]> {
    if added.is_empty() || values.is_empty() {
        return values.clone();
    }
    values.iter().copied().chain(added.iter().map(|a| values[a.moves_like as usize])).collect()
}

impl Mended {
    /// Is the mesh as it was?
    pub fn is_unchanged(&self) -> bool {
        self.done.is_nothing() && self.moved.is_empty() && self.added.is_empty()
    }

    /// The mesh as it is when mended. What was not changed is shared with the old one.
    pub fn apply(&self, mesh: &Mesh) -> Mesh {
        applied(mesh, self)
    }
}
