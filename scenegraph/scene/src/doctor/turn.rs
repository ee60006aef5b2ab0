//! Normals of triangles that were turned.

use super::soup::Soup;
use crate::Mesh;
use std::collections::HashMap;

/// Turns the normals of vertices that now point away from the side that their turned triangles face; gives the vertices of
/// the mesh that are to be turned. Vertices that triangles of both kinds use are copied.
pub(super) fn normals(soup: &mut Soup, mesh: &Mesh) -> Vec<u32> {
    if mesh.normals.len() != mesh.positions.len() || !soup.turned.contains(&true) {
        return Vec::new();
    }
    let mut kept = vec![false; soup.corner_of.len()];
    let mut wanted: Vec<(usize, usize)> = Vec::new();
    for t in 0..soup.triangles.len() {
        let face = soup.scaled_normal(t).as_vec3();
        for i in 0..3 {
            let vertex = soup.triangles[t][i];
            let is_against =
                soup.turned[t] && (vertex as usize) < soup.originals && mesh.normals[vertex as usize].dot(face) < 0.0;
            if is_against {
                wanted.push((t, i));
            } else {
                kept[vertex as usize] = true;
            }
        }
    }
    // Caps have normals of their own.
    for t in (0..soup.triangles.len()).filter(|t| soup.turned[*t]) {
        let face = soup.scaled_normal(t).as_vec3();
        for vertex in soup.triangles[t] {
            let extra = (vertex as usize).checked_sub(soup.originals).map(|e| &mut soup.extras[e].normal);
            if let Some(Some(normal)) = extra {
                *normal = if normal.dot(face) < 0.0 { -*normal } else { *normal };
            }
        }
    }
    let mut turned = Vec::new();
    let mut copies: HashMap<u32, u32> = HashMap::new();
    for (t, i) in wanted {
        let vertex = soup.triangles[t][i];
        if kept[vertex as usize] {
            let normal = Some(-mesh.normals[vertex as usize]);
            let corner = soup.corner_of[vertex as usize];
            let copy = *copies.entry(vertex).or_insert_with(|| soup.copy(vertex, normal, corner));
            soup.triangles[t][i] = copy;
        } else {
            turned.push(vertex);
        }
    }
    turned.sort_unstable();
    turned.dedup();
    turned
}
