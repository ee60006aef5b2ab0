//! What of a mesh casts: connected surfaces, how they are wound, and how many layers of shadow they may put over a point.

use super::layers::{self, Deep};
use glam::Vec3;
use umbriel_scene::{Edge, Edges, Mesh};

/// Layers that one stencil group may hold where the eighth bit keeps what groups before it shadowed.
pub(super) const GROUP_LAYERS: u32 = 127;
/// Layers that the stencil holds when a single group fills it.
pub(super) const STENCIL_LAYERS: u32 = 255;
/// A mesh is not cut further than this.
const MAX_PARTS: usize = 64;
/// The layers of surfaces with more faces are counted.
const DEEP_SURFACE_FACES: u32 = 16;
/// Layers set aside for one connected surface that is not convex.
const BENT_SURFACE_LAYERS: u32 = 8;

/// Surfaces of a mesh that are cast together.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Part {
    /// Three vertices, and 1 where the closed surface is wound outward, 2 inward, 0 where it is open or inconsistent,
    /// [`SOLID`] where it belongs to a convex solid wound outward, other solids that share its edges set aside.
    pub(super) triangles: Vec<[u32; 4]>,
    /// Vertices a and b, first and number of the incidences.
    pub(super) edges: Vec<[u32; 4]>,
    /// Triangle << 1, plus 1 where the triangle runs from b to a.
    pub(super) incidences: Vec<u32>,
    /// Layers it may put over a point.
    pub(super) layers: u32,
    /// All triangles lie in one plane and show the same side: three of its points, as they are wound.
    pub(super) sheet: Option<[Vec3; 3]>,
}

/// Of a triangle of a convex solid, wound outward.
pub(super) const SOLID: u32 = 3;

impl Part {
    /// Size of its longest list, bytes.
    pub(super) fn largest_list(&self) -> u64 {
        let lists: [&[u8]; 3] =
            [bytemuck::cast_slice(&self.triangles), bytemuck::cast_slice(&self.edges), bytemuck::cast_slice(&self.incidences)];
        lists.iter().map(|l| l.len() as u64).max().unwrap_or(0)
    }
}

/// Cuts a mesh into parts of at most [`GROUP_LAYERS`] layers each, surfaces that have more of them by themselves among it: the
/// volume of any triangles is the sum of theirs, wherever they are cut apart.
pub(super) fn parts(mesh: &Mesh) -> Vec<Part> {
    let edges = Edges::of_mesh(mesh);
    let triangle = |t: u32| [0, 1, 2].map(|i| mesh.indices[3 * t as usize + i]);
    let (surface_of, count) = connected(mesh.triangle_count(), &edges, |_| true);
    let surfaces = surfaces(mesh, &edges, &surface_of, count);
    let (cut_of, cuts) = cut(mesh, &surface_of, surfaces);
    let (part_of, layers) = distribute(cuts.iter().map(|s| s.layers));
    let solids = solids(mesh, &edges);
    let mut parts: Vec<Part> = layers.iter().map(|&layers| Part { layers, ..Part::default() }).collect();
    let mut place = vec![0; cut_of.len()];
    let part_of = |t: u32| part_of[cut_of[t as usize] as usize];
    for (t, &cut) in (0u32..).zip(&cut_of).filter(|(_, s)| **s != NONE) {
        let part = &mut parts[part_of(t)];
        place[t as usize] = part.triangles.len() as u32;
        let [a, b, c] = triangle(t);
        part.triangles.push([a, b, c, if solids[t as usize] { SOLID } else { cuts[cut as usize].winding }]);
    }
    for part in &mut parts {
        part.sheet = sheet(mesh, &part.triangles);
    }
    let mut sorted = Vec::new();
    for edge in &edges.edges {
        sorted.clear();
        sorted.extend_from_slice(&edges.incidences[edge.first as usize..][..edge.count as usize]);
        sorted.sort_by_key(|i| part_of(i >> 1));
        for incidences in sorted.chunk_by(|i, j| part_of(i >> 1) == part_of(j >> 1)) {
            let part = &mut parts[part_of(incidences[0] >> 1)];
            part.edges.push([edge.a, edge.b, part.incidences.len() as u32, incidences.len() as u32]);
            part.incidences.extend(incidences.iter().map(|i| place[(i >> 1) as usize] << 1 | (i & 1)));
        }
    }
    parts
}

/// Cuts surfaces of more than [`GROUP_LAYERS`] layers into runs of as many triangles, or of more where these would be too many.
fn cut(mesh: &Mesh, surface_of: &[u32], surfaces: Vec<Surface>) -> (Vec<u32>, Vec<Surface>) {
    let is_deep = |s: &Surface| s.layers > GROUP_LAYERS;
    if !surfaces.iter().any(is_deep) {
        return (surface_of.to_vec(), surfaces);
    }
    let mut faces = vec![0u32; surfaces.len()];
    surface_of.iter().filter(|s| **s != NONE).for_each(|s| faces[*s as usize] += 1);
    let (mut cuts, mut deep): (Vec<Surface>, Vec<Deep>) = (Vec::new(), Vec::new());
    // First cut of each surface, triangles of a cut, and triangles met so far.
    let mut runs = Vec::new();
    for (surface, &faces) in surfaces.iter().zip(&faces) {
        let run = if is_deep(surface) { GROUP_LAYERS.max(faces.div_ceil(MAX_PARTS as u32)) } else { u32::MAX };
        runs.push((cuts.len() as u32, run, 0u32));
        for _ in 0..faces.div_ceil(run) {
            if run != u32::MAX && run > GROUP_LAYERS {
                deep.push(Deep { surface: cuts.len() as u32, is_closed: surface.winding != 0 });
            }
            cuts.push(Surface { layers: surface.layers.min(run), ..*surface });
        }
    }
    let cut_of: Vec<u32> = surface_of
        .iter()
        .map(|&surface| {
            if surface == NONE {
                return NONE;
            }
            let (first, run, met) = &mut runs[surface as usize];
            *met += 1;
            *first + (*met - 1) / *run
        })
        .collect();
    if !deep.is_empty() {
        for (deep, layers) in deep.iter().zip(layers::counted(mesh, &cut_of, &deep)) {
            cuts[deep.surface as usize].layers = layers.max(1);
        }
    }
    (cut_of, cuts)
}

/// The surface of a degenerate triangle.
const NONE: u32 = u32::MAX;

/// Triangles connected through edges.
#[derive(Clone, Copy)]
struct Surface {
    /// As in [`Part::triangles`].
    winding: u32,
    /// As in [`Part::layers`].
    layers: u32,
}

/// What is known of the form of a surface.
#[derive(Clone, Copy)]
struct Form {
    faces: u32,
    /// As in [`Part::triangles`].
    winding: u32,
    /// A solid without dents.
    is_convex: bool,
}

/// The surface of each triangle, in the order of their first triangles, and their number. Edges that are `crossed` connect.
fn connected(triangle_count: usize, edges: &Edges, crossed: impl Fn(&Edge) -> bool) -> (Vec<u32>, usize) {
    let mut parent = vec![NONE; triangle_count];
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        if parent[i as usize] == NONE {
            parent[i as usize] = i;
        }
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    for edge in &edges.edges {
        let first = root(&mut parent, edges.incidences[edge.first as usize] >> 1);
        for (t, _) in edges.triangles(edge).skip(1) {
            let other = root(&mut parent, t);
            if crossed(edge) {
                parent[other as usize] = first;
            }
        }
    }
    let mut number = vec![NONE; triangle_count];
    let mut next = 0;
    let of = (0..triangle_count as u32).map(|i| {
        if parent[i as usize] == NONE {
            return NONE;
        }
        let r = root(&mut parent, i) as usize;
        if number[r] == NONE {
            number[r] = next;
            next += 1;
        }
        number[r]
    });
    (of.collect(), next as usize)
}

/// Which triangles belong to convex solids wound outward. Where more than two triangles meet at an edge, several solids may.
fn solids(mesh: &Mesh, edges: &Edges) -> Vec<bool> {
    let (solid_of, count) = connected(mesh.triangle_count(), edges, |edge| edge.count == 2);
    let forms = forms(mesh, edges, &solid_of, count);
    let is_solid = |solid: &u32| *solid != NONE && forms[*solid as usize].is_convex && forms[*solid as usize].winding == 1;
    solid_of.iter().map(is_solid).collect()
}

/// Three points of the plane in which all triangles lie, if they show the same side.
fn sheet(mesh: &Mesh, triangles: &[[u32; 4]]) -> Option<[Vec3; 3]> {
    let corners = |t: &[u32; 4]| [t[0], t[1], t[2]].map(|i| mesh.positions[i as usize]);
    let normal = |[a, b, c]: [Vec3; 3]| (b - a).as_dvec3().cross((c - a).as_dvec3());
    let first = corners(triangles.first()?);
    let n = normal(first).normalize_or_zero();
    let origin = first[0].as_dvec3();
    let is_in_plane = |t: &[u32; 4]| {
        let corners = corners(t);
        normal(corners).dot(n) > 0.0 && corners.iter().all(|p| n.dot(p.as_dvec3() - origin) == 0.0)
    };
    triangles.iter().all(is_in_plane).then_some(first)
}

/// Finds out which surfaces are closed, how these are wound, and how many layers they may put over a point.
fn surfaces(mesh: &Mesh, edges: &Edges, surface_of: &[u32], count: usize) -> Vec<Surface> {
    let forms = forms(mesh, edges, surface_of, count);
    let of = |form: &Form| Surface {
        winding: form.winding,
        layers: if form.is_convex { 1 } else { form.faces.min(BENT_SURFACE_LAYERS) },
    };
    let mut surfaces: Vec<Surface> = forms.iter().map(of).collect();
    let deep = (0u32..)
        .zip(surfaces.iter().zip(&forms))
        .filter(|(_, (surface, form))| surface.layers > 1 && form.faces > DEEP_SURFACE_FACES);
    let deep: Vec<Deep> = deep.map(|(i, (surface, _))| Deep { surface: i, is_closed: surface.winding != 0 }).collect();
    if !deep.is_empty() {
        for (deep, layers) in deep.iter().zip(layers::counted(mesh, surface_of, &deep)) {
            let surface = &mut surfaces[deep.surface as usize];
            surface.layers = surface.layers.max(layers);
        }
    }
    surfaces
}

/// Finds out which surfaces are closed, how these are wound, and which are convex.
fn forms(mesh: &Mesh, edges: &Edges, surface_of: &[u32], count: usize) -> Vec<Form> {
    #[derive(Clone, Copy, Default)]
    struct Sums {
        faces: u32,
        open: bool,
        bent: bool,
        euler: i64,
        volume: f64,
        volume_scale: f64,
        origin: Option<glam::DVec3>,
    }
    let at = |i: u32| mesh.positions[i as usize].as_dvec3();
    let triangle = |t: u32| [0, 1, 2].map(|i| mesh.indices[3 * t as usize + i]);
    let mut sums = vec![Sums::default(); count];
    for (t, &surface) in (0u32..).zip(surface_of).filter(|(_, s)| **s != NONE) {
        let s = &mut sums[surface as usize];
        let [a, b, c] = triangle(t).map(at);
        let origin = *s.origin.get_or_insert(a);
        let volume = (a - origin).dot((b - origin).cross(c - origin));
        s.volume += volume;
        s.volume_scale += volume.abs();
        s.faces += 1;
        s.euler += 1;
    }
    let mut meeting: Vec<(u32, u32, i32)> = Vec::new();
    for edge in &edges.edges {
        meeting.clear();
        meeting.extend(edges.triangles(edge).map(|(t, sign)| (surface_of[t as usize], t, sign)));
        meeting.sort_unstable();
        for of_surface in meeting.chunk_by(|a, b| a.0 == b.0) {
            let s = &mut sums[of_surface[0].0 as usize];
            s.euler -= 1;
            match of_surface[..] {
                [(_, one, sign), (_, other, against)] if sign != against => {
                    let [p, q, r] = triangle(one).map(at);
                    let n = (q - p).cross(r - p) * s.volume.signum();
                    s.bent |= triangle(other).iter().any(|&i| n.dot(at(i) - p) > 1e-6 * n.length() * (at(i) - p).length());
                }
                _ => s.open = true,
            }
        }
    }
    // What turns around itself more than once has no dent either, but not the Euler number of a ball.
    let may_be_convex = |surface: u32| !sums[surface as usize].open && !sums[surface as usize].bent;
    let mut vertices: Vec<(u32, u32)> = Vec::new();
    for edge in &edges.edges {
        for (t, _) in edges.triangles(edge) {
            let surface = surface_of[t as usize];
            if may_be_convex(surface) {
                vertices.extend([(surface, edge.a), (surface, edge.b)]);
            }
        }
    }
    vertices.sort_unstable();
    vertices.dedup();
    for (surface, _) in vertices {
        sums[surface as usize].euler += 1;
    }
    let form = |s: &Sums| {
        let solid = !s.open && s.volume.abs() > 1e-6 * s.volume_scale;
        let winding = match solid {
            false => 0,
            true if s.volume > 0.0 => 1,
            true => 2,
        };
        Form { faces: s.faces, winding, is_convex: solid && !s.bent && s.euler == 2 }
    };
    sums.iter().map(form).collect()
}

/// Part of each surface, and the layers of each part. Beyond [`MAX_PARTS`] it is one part again, with all layers.
fn distribute(layers: impl Iterator<Item = u32>) -> (Vec<usize>, Vec<u32>) {
    let mut part_layers = Vec::new();
    let mut part_of = Vec::new();
    for l in layers {
        match part_layers.last_mut() {
            Some(sum) if *sum + l <= GROUP_LAYERS => *sum += l,
            _ => part_layers.push(l),
        }
        part_of.push(part_layers.len() - 1);
    }
    let total: u32 = part_layers.iter().sum();
    if part_layers.len() > MAX_PARTS {
        return (vec![0; part_of.len()], vec![total]);
    }
    (part_of, part_layers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    const CORNERS: [[f32; 3]; 8] =
        [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.], [0., 0., 1.], [1., 0., 1.], [0., 1., 1.], [1., 1., 1.]];
    const OUTWARD: [u32; 36] =
        [0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5];

    fn boxes(count: usize, indices: &[u32]) -> Mesh {
        let corner = |n: usize| CORNERS.map(|c| Vec3::from(c) * (n + 1) as f32 - Vec3::splat(n as f32 * 0.5));
        Mesh {
            positions: (0..count).flat_map(corner).collect(),
            indices: (0..count as u32).flat_map(|n| indices.iter().map(move |i| 8 * n + i)).collect(),
            ..Mesh::default()
        }
    }

    /// A strip folded to and fro lies over itself as often as it has folds.
    #[test]
    fn layers_of_one_surface_are_counted() {
        for folds in [100u32, 200, 400] {
            let at = |i: u32| [Vec3::new((i % 2) as f32, 0.01 * i as f32, 0.0), Vec3::new((i % 2) as f32, 0.01 * i as f32, 1.0)];
            let mesh = Mesh {
                positions: (0..=folds).flat_map(at).collect(),
                indices: (0..folds).flat_map(|i| [0, 1, 2, 2, 1, 3].map(|k| 2 * i + k)).collect(),
                ..Mesh::default()
            };
            let layers: Vec<u32> = parts(&mesh).iter().map(|p| p.layers).collect();
            assert!(layers.iter().all(|l| *l <= GROUP_LAYERS), "{folds} folds: {layers:?}");
            assert!((folds..=3 * folds).contains(&layers.iter().sum()), "{folds} folds: {layers:?}");
        }
    }

    #[test]
    fn sheets_show_one_side_in_one_plane() {
        let at = |height: f32| [[0., 0., 0.], [1., 0., 0.], [0., 0., 1.], [1., height, 1.]].map(Vec3::from).to_vec();
        for (name, height, indices, is_sheet) in [
            ("flat", 0.0, [0, 2, 1, 1, 2, 3], true),
            ("bent", 0.01, [0, 2, 1, 1, 2, 3], false),
            ("turned over in part", 0.0, [0, 2, 1, 1, 3, 2], false),
        ] {
            let mesh = Mesh { positions: at(height).into(), indices: indices.to_vec().into(), ..Mesh::default() };
            assert_eq!(parts(&mesh)[0].sheet.is_some(), is_sheet, "{name}");
        }
    }

    #[test]
    fn surfaces_are_recognised() {
        let inward: Vec<u32> = OUTWARD.chunks(3).flat_map(|t| [t[0], t[2], t[1]]).collect();
        let mut mixed = OUTWARD;
        mixed.swap(1, 2);
        let mut dented = boxes(1, &OUTWARD);
        Arc::make_mut(&mut dented.positions)[7] = Vec3::splat(0.3);
        let mut touching = boxes(2, &OUTWARD);
        let beside = CORNERS.map(|c| Vec3::from(c) + Vec3::new(1.0, 1.0, 0.0));
        touching.positions = CORNERS.map(Vec3::from).into_iter().chain(beside).collect();
        touching.indices =
            touching.indices.iter().map(|i| [(8, 3), (12, 7)].iter().find(|m| m.0 == *i).map_or(*i, |m| m.1)).collect();
        /// Name, mesh, triangles of each part, their winding, layers of each part.
        type Row = (&'static str, Mesh, Vec<usize>, u32, Vec<u32>);
        let rows: Vec<Row> = vec![
            ("nothing", Mesh::default(), vec![], 0, vec![]),
            ("outward", boxes(1, &OUTWARD), vec![12], SOLID, vec![1]),
            ("touching at an edge", touching, vec![24], SOLID, vec![8]),
            ("inward", boxes(1, &inward), vec![12], 2, vec![1]),
            ("inconsistent", boxes(1, &mixed), vec![12], 0, vec![8]),
            ("open", boxes(1, &OUTWARD[..30]), vec![10], 0, vec![8]),
            ("dented", dented, vec![12], 1, vec![8]),
            ("degenerate triangles are dropped", boxes(1, &[0, 0, 1, 0, 1, 2]), vec![1], 0, vec![1]),
            ("many", boxes(200, &OUTWARD), vec![127 * 12, 73 * 12], SOLID, vec![127, 73]),
            ("too many for one stencil", boxes(300, &OUTWARD), vec![127 * 12, 127 * 12, 46 * 12], SOLID, vec![127, 127, 46]),
            (
                "loose leaves",
                boxes(800, &OUTWARD[..6]),
                [vec![126; 12], vec![88]].concat(),
                0,
                [vec![126; 12], vec![88]].concat(),
            ),
            ("more than can be cut", boxes(5000, &OUTWARD[..6]), vec![10_000], 0, vec![10_000]),
        ];
        for (name, mesh, triangles, winding, layers) in rows {
            let parts = parts(&mesh);
            assert_eq!(parts.iter().map(|p| p.triangles.len()).collect::<Vec<_>>(), triangles, "{name}");
            assert_eq!(parts.iter().map(|p| p.layers).collect::<Vec<_>>(), layers, "{name}");
            for part in parts {
                assert!(part.triangles.iter().all(|t| t[3] == winding), "{name}");
                assert_eq!(part.incidences.len(), 3 * part.triangles.len(), "{name}");
                for [a, b, first, count] in part.edges {
                    for i in &part.incidences[first as usize..][..count as usize] {
                        let [p, q, r, _] = part.triangles[(i >> 1) as usize];
                        let (from, to) = if i & 1 == 0 { (a, b) } else { (b, a) };
                        assert!([(p, q), (q, r), (r, p)].contains(&(from, to)), "{name}");
                    }
                }
            }
        }
    }
}
