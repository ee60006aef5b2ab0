//! Closes holes.

use super::Done;
use super::soup::Soup;
use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};
use std::collections::{HashMap, HashSet};

/// Adds triangles over every hole; gives the number of holes. What is closed is the border as the signed sum of the edges
/// (each counts from where it starts to where it ends), so every mesh has closed runs of it, however wrong it is.
pub(super) fn holes(soup: &mut Soup, done: &mut Done) -> usize {
    let loops = loops(soup);
    let count = loops.len();
    let mut cutter = Earcut::new();
    let mut taken: HashSet<(u32, u32)> = soup.edges().edges.iter().map(|e| (e.a, e.b)).collect();
    for border in loops {
        let mut triangles = cap(soup, &mut cutter, &border);
        let on_border: HashSet<(u32, u32)> = sides(&border).map(|(p, q)| side(soup, p, q)).collect();
        avoid(soup, &mut triangles, |edge| taken.contains(&edge) && !on_border.contains(&edge));
        for t in &triangles {
            taken.extend(sides(t).map(|(p, q)| side(soup, p, q)));
        }
        done.cap_triangles += triangles.len();
        for t in triangles {
            soup.triangles.push(t);
            soup.turned.push(false);
        }
    }
    done.capped += count;
    count
}

/// Neighbours in a run that is closed.
fn sides(run: &[u32]) -> impl Iterator<Item = (u32, u32)> + '_ {
    run.iter().copied().zip(run.iter().copied().cycle().skip(1))
}

/// The edge between the corners of two vertices.
fn side(soup: &Soup, p: u32, q: u32) -> (u32, u32) {
    let (a, b) = (soup.corner_of[p as usize], soup.corner_of[q as usize]);
    (a.min(b), a.max(b))
}

/// Splits triangles of a cap at inner edges that the surface has already elsewhere: they would be edges of four triangles.
fn avoid(soup: &mut Soup, triangles: &mut Vec<[u32; 3]>, is_taken: impl Fn((u32, u32)) -> bool) {
    let mut clashes: Vec<(u32, u32)> = triangles.iter().flat_map(|t| sides(t).map(|(p, q)| side(soup, p, q))).collect();
    clashes.sort_unstable();
    clashes.dedup();
    clashes.retain(|edge| is_taken(*edge));
    for (a, b) in clashes {
        // Caps on both sides of a sheet must not meet in the middle.
        let share = 0.35 + 0.3 * (soup.places.len() as f32 * 0.618_034).fract();
        soup.places.push(soup.places[a as usize].lerp(soup.places[b as usize], share));
        let middle = soup.places.len() as u32 - 1;
        for place in 0..triangles.len() {
            let t = triangles[place];
            let Some(i) = (0..3).find(|i| side(soup, t[*i], t[(i + 1) % 3]) == (a, b)) else { continue };
            let [p, q, apex] = [t[i], t[(i + 1) % 3], t[(i + 2) % 3]];
            let m = soup.copy(p, None, middle);
            triangles[place] = [p, m, apex];
            triangles.push([m, q, apex]);
        }
    }
}

/// Runs of vertices around holes, in the direction in which their caps wind; no corner comes twice in a run.
fn loops(soup: &Soup) -> Vec<Vec<u32>> {
    // From each corner, where the border goes on, and a vertex that stands there.
    let mut onward: HashMap<u32, Vec<(u32, u32)>> = HashMap::new();
    let edges = soup.edges();
    for edge in &edges.edges {
        let sum: i32 = edges.triangles(edge).map(|(_, sign)| sign).sum();
        // The cap winds against its neighbour.
        let (from, to) = if sum > 0 { (edge.b, edge.a) } else { (edge.a, edge.b) };
        let vertex = edges.triangles(edge).find_map(|(t, _)| {
            let place = soup.corners(t as usize).iter().position(|c| *c == from)?;
            Some(soup.triangles[t as usize][place])
        });
        for _ in 0..sum.abs() {
            onward.entry(from).or_default().push((to, vertex.unwrap_or(0)));
        }
    }
    let mut starts: Vec<u32> = onward.keys().copied().collect();
    starts.sort_unstable();
    let mut out = Vec::new();
    for start in starts {
        let mut path: Vec<(u32, u32)> = Vec::new();
        let mut place_in_path: HashMap<u32, usize> = HashMap::new();
        let mut at = start;
        while let Some((to, vertex)) = onward.get_mut(&at).and_then(Vec::pop) {
            place_in_path.insert(at, path.len());
            path.push((at, vertex));
            if let Some(begin) = place_in_path.get(&to).copied() {
                let run = path.split_off(begin);
                for (corner, _) in &run {
                    place_in_path.remove(corner);
                }
                out.push(run.into_iter().map(|(_, vertex)| vertex).collect());
            }
            at = to;
        }
    }
    out
}

/// The triangles of a cap. They have vertices of their own, so that nothing beside the hole is shaded differently.
fn cap(soup: &mut Soup, cutter: &mut Earcut<f64>, border: &[u32]) -> Vec<[u32; 3]> {
    if border.len() < 3 {
        return Vec::new(); // two edges that lie on each other
    }
    let points: Vec<DVec3> = border.iter().map(|v| soup.places[soup.corner_of[*v as usize] as usize].as_dvec3()).collect();
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    // Newell's normal: that of the plane in which the run encloses most.
    let around = points.iter().zip(points.iter().cycle().skip(1));
    let scaled: DVec3 = around.map(|(p, q)| (*p - middle).cross(*q - middle)).sum();
    let normal = scaled.normalize_or(DVec3::Y);
    let (right, up) = normal.any_orthonormal_pair();
    let flat: Vec<[f64; 2]> = points.iter().map(|p| [(*p - middle).dot(right), (*p - middle).dot(up)]).collect();
    let mut indices: Vec<u32> = Vec::new();
    cutter.earcut(flat.iter().copied(), &[], &mut indices);
    let cut: Vec<[u32; 3]> = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    let cut = if is_whole(&flat, &cut) { Some(cut.iter().map(|t| wound(&flat, *t)).collect::<Vec<_>>()) } else { None };
    let looks = |normal: DVec3| Some(normal.as_vec3().normalize_or(Vec3::Y));
    match cut {
        Some(cut) => {
            let own: Vec<u32> = border.iter().map(|v| soup.copy(*v, looks(normal), soup.corner_of[*v as usize])).collect();
            cut.into_iter().map(|t| t.map(|i| own[i as usize])).collect()
        }
        None => fan(soup, border, &points, middle),
    }
}

/// Ears cover the polygon once: there are two fewer of them than corners, each side of the polygon is one of theirs, and
/// none is turned over.
fn is_whole(flat: &[[f64; 2]], cut: &[[u32; 3]]) -> bool {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| DVec2::from_array(flat[i as usize]));
        (b - a).perp_dot(c - a)
    };
    let all: f64 = cut.iter().map(|t| area(t).abs()).sum();
    let polygon: f64 = flat.iter().zip(flat.iter().cycle().skip(1)).map(|(p, q)| p[0] * q[1] - p[1] * q[0]).sum();
    cut.len() == flat.len() - 2 && (all - polygon.abs()).abs() <= 1e-6 * polygon.abs() && cut.iter().all(|t| area(t) != 0.0)
}

/// Counter-clockwise, as the run is in its own plane.
fn wound(flat: &[[f64; 2]], [a, b, c]: [u32; 3]) -> [u32; 3] {
    let [p, q, r] = [a, b, c].map(|i| DVec2::from_array(flat[i as usize]));
    if (q - p).perp_dot(r - p) < 0.0 { [a, c, b] } else { [a, b, c] }
}

/// Triangles around the middle: for a border that crosses itself in its plane. It is closed whatever it looks like.
fn fan(soup: &mut Soup, border: &[u32], points: &[DVec3], middle: DVec3) -> Vec<[u32; 3]> {
    soup.places.push(middle.as_vec3());
    let corner = soup.places.len() as u32 - 1;
    let mut out = Vec::new();
    for i in 0..border.len() {
        let j = (i + 1) % border.len();
        let normal = Some((points[i] - middle).cross(points[j] - middle).as_vec3().normalize_or(Vec3::Y));
        let at = |soup: &mut Soup, v: u32| soup.copy(v, normal, soup.corner_of[v as usize]);
        let (x, y) = (at(soup, border[i]), at(soup, border[j]));
        let tip = soup.copy(border[i], normal, corner);
        out.push([x, y, tip]);
    }
    out
}
