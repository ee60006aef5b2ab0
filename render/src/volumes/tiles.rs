//! What each part of a view can show of a shadow: the depth bounds of 001 section 5.3, tile by tile, where it asks a whole
//! volume by one pair of depths and a card that tests them.
//!
//! The view is laid out in tiles. In each, whatever receives lies between two depths, found from the boxes around receivers;
//! triangles that cover a tile hide what is behind them. A volume that touches no such cell changes nothing that is seen:
//! over all of its pixels it counts to 0, whichever way it is counted. No depth is read back, so that no frame waits.

use super::hull::{self, extent};
use glam::{BVec3, DMat4, DVec3, DVec4};
use umbriel_scene::{Aabb, View};

/// Pixels of a tile's side, at least.
const SMALLEST: u32 = 32;
/// Tiles across and down, at most.
const MOST: u32 = 16;

/// The depth bounds of a view.
pub(super) struct Tiles {
    eye: DVec3,
    /// Pixels of a tile's side.
    side: u32,
    across: u32,
    cells: Vec<Option<Cell>>,
}

/// A tile with its depths: the part of the view's pyramid that holds all it shows of receivers.
struct Cell {
    tile: Tile,
    far_m: f64,
    corners: [DVec4; 8],
}

/// The pyramid behind a tile.
#[derive(Clone, Copy)]
struct Tile {
    /// To the corners, at depth 1.
    rays: [DVec3; 4],
    /// Planes through the eye, normals inward.
    normals: [DVec3; 4],
}

/// What is seen of a scene in a view, as far as shadows are concerned.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Boxes around all that shadows may fall on.
    pub receivers: Vec<Aabb>,
    /// Some of the triangles in the depth buffer, in the world.
    pub hiding: Vec<[glam::Vec3; 3]>,
}

impl Tiles {
    /// Of a view, with its depths.
    pub(super) fn new(view: &View, seen: &Seen) -> Tiles {
        let world_from_view = view.view_from_world.as_dmat4().inverse();
        let [width, height] = view.size;
        let side = SMALLEST.max(width.max(height).div_ceil(MOST));
        let (across, down) = (width.div_ceil(side), height.div_ceil(side));
        let f = &view.frustum;
        let [left, right, bottom, top, near] = [f.left, f.right, f.bottom, f.top, f.near].map(f64::from);
        let ray = |x: u32, y: u32| {
            let at = |pixel: u32, size: u32, from: f64, to: f64| from + (to - from) * f64::from(pixel) / f64::from(size);
            let (x, y) = (at(x, width, left, right), at(y, height, top, bottom));
            world_from_view.transform_vector3(DVec3::new(x / near, y / near, -1.0))
        };
        let eye = world_from_view.transform_point3(DVec3::ZERO);
        let view_from_world = view.view_from_world.as_dmat4();
        let cells = (0..across * down).map(|i| {
            let (x, y) = (i % across * side, i / across * side);
            let (x_end, y_end) = ((x + side).min(width), (y + side).min(height));
            let tile = Tile::new([ray(x, y), ray(x_end, y), ray(x_end, y_end), ray(x, y_end)]);
            let spans = seen.receivers.iter().filter_map(|b| tile.span(eye, &view_from_world, b));
            let (mut low, mut high) = spans.fold((f64::INFINITY, 0f64), |all, span| (all.0.min(span.0), all.1.max(span.1)));
            let hidden = seen.hiding.iter().filter_map(|t| tile.hidden_beyond(near, &view_from_world, t));
            high = hidden.fold(high, f64::min);
            // Rounding, of the device and of the boxes, and what lies exactly in a plane.
            let slack = 1e-3 + 1e-4 * high;
            (low, high) = ((low - slack).max(near), high + slack);
            (low <= high).then(|| Cell::new(tile, eye, low, high))
        });
        Tiles { eye, side, across, cells: cells.collect() }
    }

    /// The smallest rectangle of pixels, inside of `within`, outside of which a hull touches nothing that is seen.
    pub(super) fn touched(&self, volume: &[DVec4], axes: &[DVec3], within: [u32; 4], margin: f64) -> Option<[u32; 4]> {
        let [left, top, width, height] = within;
        let axes: Vec<_> = axes.iter().filter_map(|a| a.try_normalize()).map(|axis| (axis, extent(volume, axis))).collect();
        let mut found: Option<[u32; 4]> = None;
        for y in top / self.side..=(top + height - 1) / self.side {
            for x in left / self.side..=(left + width - 1) / self.side {
                let Some(Some(cell)) = self.cells.get((y * self.across + x) as usize) else { continue };
                let inside = found.is_some_and(|[l, t, r, b]| l <= x && x < r && t <= y && y < b);
                if inside || cell.is_apart(self.eye, volume, &axes, margin) {
                    continue;
                }
                let [l, t, r, b] = found.unwrap_or([x, y, x, y]);
                found = Some([l.min(x), t.min(y), r.max(x + 1), b.max(y + 1)]);
            }
        }
        let [l, t, r, b] = found?.map(|tile| tile * self.side);
        let (l, t, r, b) = (l.max(left), t.max(top), r.min(left + width), b.min(top + height));
        (r > l && b > t).then(|| [l, t, r - l, b - t])
    }
}

impl Cell {
    fn new(tile: Tile, eye: DVec3, near_m: f64, far_m: f64) -> Cell {
        let corner = |i: usize| (eye + tile.rays[i % 4] * if i < 4 { near_m } else { far_m }).extend(1.0);
        Cell { tile, far_m, corners: std::array::from_fn(corner) }
    }

    fn is_apart(&self, eye: DVec3, volume: &[DVec4], axes: &[(DVec3, (f64, f64))], margin: f64) -> bool {
        // Vertices lie on a grid in the picture: a small part of a pixel.
        let margin = margin + 1e-4 * self.far_m;
        let is_beside = |n: &DVec3| hull::is_behind(volume, n.extend(-n.dot(eye)), margin);
        self.tile.normals.iter().any(is_beside)
            || axes.iter().any(|(axis, (low, high))| {
                let own = extent(&self.corners, *axis);
                own.0 > high + margin || *low > own.1 + margin
            })
    }
}

impl Tile {
    fn new(rays: [DVec3; 4]) -> Tile {
        let centre = rays.iter().sum::<DVec3>();
        let normal = |i: usize| {
            let n = rays[i].cross(rays[(i + 1) % 4]).normalize_or_zero();
            if n.dot(centre) < 0.0 { -n } else { n }
        };
        Tile { rays, normals: std::array::from_fn(normal) }
    }

    /// Nearest and farthest depth of what a box has in the pyramid: at its corners there, where the pyramid's edges pass it,
    /// and where its edges pass the pyramid's sides.
    fn span(&self, eye: DVec3, view_from_world: &DMat4, b: &Aabb) -> Option<(f64, f64)> {
        let (min, max) = (b.min.as_dvec3() - eye, b.max.as_dvec3() - eye);
        let depth = |p: DVec3| -view_from_world.transform_vector3(p).z;
        let corners: [DVec3; 8] =
            std::array::from_fn(|i| DVec3::select(BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), max, min));
        let heights = corners.map(|c| self.normals.map(|n| n.dot(c)));
        if (0..4).any(|side| heights.iter().all(|h| h[side] < 0.0)) {
            return None;
        }
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut take = |w: f64| (low, high) = (low.min(w), high.max(w));
        for (corner, heights) in corners.iter().zip(&heights) {
            if heights.iter().all(|h| *h >= 0.0) {
                take(depth(*corner));
            }
        }
        for ray in self.rays {
            let (a, b) = (min / ray, max / ray);
            // 0 / 0 where the ray runs in a side of the box: no bound.
            let from = a.min(b).to_array().into_iter().filter(|t| !t.is_nan()).fold(0.0, f64::max);
            let to = a.max(b).to_array().into_iter().filter(|t| !t.is_nan()).fold(f64::INFINITY, f64::min);
            if from <= to {
                take(from);
                take(to);
            }
        }
        let slack = 1e-9 * (min.abs().max(max.abs())).max_element();
        for (i, bit) in (0..8).flat_map(|i| [1, 2, 4].map(|bit| (i, i | bit))).filter(|(i, j)| i != j) {
            for (a, b) in heights[i].into_iter().zip(heights[bit]) {
                if (a < 0.0) != (b < 0.0) {
                    let p = corners[i].lerp(corners[bit], a / (a - b));
                    if self.normals.iter().all(|n| n.dot(p) >= -slack) {
                        take(depth(p));
                    }
                }
            }
        }
        (high > 0.0).then(|| (low.max(0.0), high))
    }

    /// Depth beyond which a triangle hides everything in the tile; none where it does not cover the tile.
    ///
    /// Over the picture, 1 / depth of a plane is linear, so that it is least at a corner.
    fn hidden_beyond(&self, near: f64, view_from_world: &DMat4, triangle: &[glam::Vec3; 3]) -> Option<f64> {
        let [a, b, c] = triangle.map(|p| view_from_world.transform_point3(p.as_dvec3()));
        let normal = (b - a).cross(c - a);
        let over = normal.dot(a);
        if over == 0.0 {
            return None;
        }
        let mut farthest = 0f64;
        for ray in self.rays {
            let ray = view_from_world.transform_vector3(ray);
            let t = over / normal.dot(ray);
            let p = ray * t;
            let is_inside = [(a, b), (b, c), (c, a)].iter().all(|(from, to)| normal.dot((*to - *from).cross(p - *from)) > 0.0);
            // What is in front of the near plane is not drawn.
            if !(t > near * (1.0 + 1e-6) && t.is_finite() && is_inside) {
                return None;
            }
            farthest = farthest.max(t);
        }
        Some(farthest)
    }
}
