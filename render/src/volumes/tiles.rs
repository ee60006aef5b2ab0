//! What each part of a view can show of a shadow: the depth bounds of 001 section 5.3, tile by tile, where it asks a whole
//! volume by one pair of depths and a card that tests them.
//!
//! The view is laid out in tiles. In each, whatever receives lies between two depths, found from the boxes around receivers;
//! triangles that cover a tile hide what is behind them. A volume that touches no such cell changes nothing that is seen:
//! over all of its pixels it counts to 0, whichever way it is counted. No depth is read back, so that no frame waits.

use super::TurnedBox;
use super::hull::{self, extent};
use glam::{DMat4, DVec3, DVec4};
use umbriel_scene::View;

/// Pixels of a tile's side, at least.
const SMALLEST: u32 = 8;
/// Tiles across and down, at most.
const MOST: u32 = 32;

/// The depth bounds of a view.
pub(super) struct Tiles {
    eye: DVec3,
    /// Pixels of a tile's side.
    side: u32,
    across: u32,
    /// The view's direction and the axes of the world, unit vectors.
    fixed: [DVec3; 4],
    cells: Vec<Option<Cell>>,
}

/// A tile with its depths: the part of the view's pyramid that holds all it shows of receivers.
struct Cell {
    tile: Tile,
    far_m: f64,
    corners: [DVec4; 8],
    /// From where to where it goes along the fixed axes.
    extents: [(f64, f64); 4],
}

/// The pyramid behind a tile.
#[derive(Clone, Copy)]
struct Tile {
    /// To the corners, at depth 1, in the world.
    rays: [DVec3; 4],
    /// The same in the view.
    view_rays: [DVec3; 4],
    /// Planes through the eye, normals inward.
    normals: [DVec3; 4],
}

/// A box that shadows may fall on, from the eye.
struct Receiver {
    corners: [DVec3; 8],
    /// Normals of its sides, and from where to where it goes along them.
    slabs: [(DVec3, f64, f64); 3],
}

impl Receiver {
    fn new(b: &TurnedBox, eye: DVec3) -> Receiver {
        let corners = b.corners.map(|c| c.truncate() - eye);
        let slab = |normal: DVec3| {
            let heights = corners.map(|c| normal.dot(c));
            (normal, heights.into_iter().fold(f64::INFINITY, f64::min), heights.into_iter().fold(f64::NEG_INFINITY, f64::max))
        };
        Receiver { corners, slabs: b.normals().map(slab) }
    }
}

/// What is seen of a scene in a view, as far as shadows are concerned.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Boxes around all that shadows may fall on.
    pub receivers: Vec<TurnedBox>,
    /// Some of the triangles in the depth buffer, in the world.
    pub hiding: Vec<[glam::Vec3; 3]>,
}

/// How the picture is cut into tiles.
struct Grid {
    /// Pixels of a tile's side.
    side: u32,
    across: u32,
    down: u32,
    /// Left, top, and the width and height of a pixel, at depth 1; y downwards.
    origin: [f64; 2],
    pixel: [f64; 2],
    size: [u32; 2],
    near: f64,
}

impl Grid {
    fn new(view: &View) -> Grid {
        let [width, height] = view.size;
        let side = SMALLEST.max(width.max(height).div_ceil(MOST));
        let f = &view.frustum;
        let [left, right, bottom, top, near] = [f.left, f.right, f.bottom, f.top, f.near].map(f64::from);
        Grid {
            side,
            across: width.div_ceil(side),
            down: height.div_ceil(side),
            origin: [left / near, -top / near],
            pixel: [(right - left) / near / f64::from(width), (top - bottom) / near / f64::from(height)],
            size: view.size,
            near,
        }
    }

    /// From the eye to the corners of a tile, at depth 1, in the view.
    fn rays(&self, x: u32, y: u32) -> [DVec3; 4] {
        let at = |x: u32, y: u32| {
            let [x, y] = [(x, 0), (y, 1)].map(|(tile, i)| {
                let pixel = (tile * self.side).min(self.size[i]);
                self.origin[i] + self.pixel[i] * f64::from(pixel)
            });
            DVec3::new(x, -y, -1.0)
        };
        [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]
    }

    /// Tiles that points may lie in, given in the view: first and behind the last across, the same down.
    fn around(&self, points: &[DVec3]) -> [u32; 4] {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in points {
            // What spans the near plane may be anywhere.
            if -p.z < self.near {
                return [0, self.across, 0, self.down];
            }
            for (i, at) in [p.x / -p.z, p.y / p.z].into_iter().enumerate() {
                let tile = (at - self.origin[i]) / (self.pixel[i] * f64::from(self.side));
                (low[i], high[i]) = (low[i].min(tile), high[i].max(tile));
            }
        }
        // Rounding may take a point into the next tile; conversion from float to integer ends at the borders of the integer.
        let first = |i: usize| (low[i] - 1e-3).floor() as u32;
        let end = |i: usize, count: u32| ((high[i] + 1e-3).floor() as i64 + 1).clamp(0, i64::from(count)) as u32;
        [first(0), end(0, self.across), first(1), end(1, self.down)]
    }
}

impl Tiles {
    /// Of a view, with its depths.
    pub(super) fn new(view: &View, seen: &Seen) -> Tiles {
        let view_from_world = view.view_from_world.as_dmat4();
        let world_from_view = view_from_world.inverse();
        let eye = world_from_view.transform_point3(DVec3::ZERO);
        let grid = Grid::new(view);
        let (across, down) = (grid.across, grid.down);
        let tiles = (0..across * down).map(|i| Tile::new(grid.rays(i % across, i / across), &world_from_view));
        let tiles: Vec<Tile> = tiles.collect();
        let mut depths = vec![(f64::INFINITY, 0f64); tiles.len()];
        let mut each = |[left, right, top, bottom]: [u32; 4], change: &mut dyn FnMut(&Tile, &mut (f64, f64))| {
            for i in (top..bottom).flat_map(|y| (left..right).map(move |x| (y * across + x) as usize)) {
                change(&tiles[i], &mut depths[i]);
            }
        };
        for b in &seen.receivers {
            let around = grid.around(&b.corners.map(|c| view_from_world.transform_point3(c.truncate())));
            let receiver = Receiver::new(b, eye);
            each(around, &mut |tile, depths| {
                if let Some((low, high)) = tile.span(&view_from_world, &receiver) {
                    *depths = (depths.0.min(low), depths.1.max(high));
                }
            });
        }
        for triangle in &seen.hiding {
            let hiding = Hiding::new(triangle.map(|p| view_from_world.transform_point3(p.as_dvec3())));
            each(grid.around(&hiding.corners), &mut |tile, depths| {
                depths.1 = hiding.beyond(tile, grid.near).map_or(depths.1, |far| depths.1.min(far));
            });
        }
        let fixed = [-view_from_world.row(2).truncate().normalize_or_zero(), DVec3::X, DVec3::Y, DVec3::Z];
        let cells = tiles.into_iter().zip(depths).map(|(tile, (low, high))| {
            // Rounding, of the device and of the boxes, and what lies exactly in a plane.
            let slack = 1e-3 + 1e-4 * high;
            let (low, high) = ((low - slack).max(grid.near), high + slack);
            (low <= high).then(|| Cell::new(tile, eye, &fixed, low, high))
        });
        Tiles { eye, side: grid.side, across, fixed, cells: cells.collect() }
    }

    /// The smallest rectangle of pixels, inside of `within`, outside of which a hull touches nothing that is seen. `axes` are
    /// further directions in which it may be apart from it.
    pub(super) fn touched(&self, volume: &[DVec4], axes: &[DVec3], within: [u32; 4], margin: f64) -> Option<[u32; 4]> {
        let [left, top, width, height] = within;
        let fixed = self.fixed.map(|axis| extent(volume, axis));
        let axes: Vec<_> = axes.iter().filter_map(|a| a.try_normalize()).map(|axis| (axis, extent(volume, axis))).collect();
        let mut found: Option<[u32; 4]> = None;
        for y in top / self.side..=(top + height - 1) / self.side {
            for x in left / self.side..=(left + width - 1) / self.side {
                let Some(Some(cell)) = self.cells.get((y * self.across + x) as usize) else { continue };
                let inside = found.is_some_and(|[l, t, r, b]| l <= x && x < r && t <= y && y < b);
                if inside || cell.is_apart(self.eye, volume, &fixed, &axes, margin) {
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
    fn new(tile: Tile, eye: DVec3, fixed: &[DVec3; 4], near_m: f64, far_m: f64) -> Cell {
        let corner = |i: usize| (eye + tile.rays[i % 4] * if i < 4 { near_m } else { far_m }).extend(1.0);
        let corners = std::array::from_fn(corner);
        Cell { tile, far_m, corners, extents: fixed.map(|axis| extent(&corners, axis)) }
    }

    fn is_apart(&self, eye: DVec3, volume: &[DVec4], fixed: &[(f64, f64); 4], axes: &[(DVec3, (f64, f64))], margin: f64) -> bool {
        // Vertices lie on a grid in the picture: a small part of a pixel.
        let margin = margin + 1e-4 * self.far_m;
        let is_between = |own: (f64, f64), (low, high): (f64, f64)| own.0 > high + margin || low > own.1 + margin;
        let is_beside = |n: &DVec3| hull::is_behind(volume, n.extend(-n.dot(eye)), margin);
        self.extents.iter().zip(fixed).any(|(own, other)| is_between(*own, *other))
            || self.tile.normals.iter().any(is_beside)
            || axes.iter().any(|(axis, other)| is_between(extent(&self.corners, *axis), *other))
    }
}

impl Tile {
    fn new(view_rays: [DVec3; 4], world_from_view: &DMat4) -> Tile {
        let rays = view_rays.map(|ray| world_from_view.transform_vector3(ray));
        let centre = rays.iter().sum::<DVec3>();
        let normal = |i: usize| {
            let n = rays[i].cross(rays[(i + 1) % 4]).normalize_or_zero();
            if n.dot(centre) < 0.0 { -n } else { n }
        };
        Tile { rays, view_rays, normals: std::array::from_fn(normal) }
    }

    /// Nearest and farthest depth of what a box has in the pyramid: at its corners there, where the pyramid's edges pass it,
    /// and where its edges pass the pyramid's sides.
    fn span(&self, view_from_world: &DMat4, b: &Receiver) -> Option<(f64, f64)> {
        let depth = |p: DVec3| -view_from_world.transform_vector3(p).z;
        let corners = &b.corners;
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
            let (mut from, mut to) = (0f64, f64::INFINITY);
            for (normal, low, high) in &b.slabs {
                let sinks = normal.dot(ray);
                let (a, b) = (low / sinks, high / sinks);
                // 0 / 0 where the ray runs in a side of the box: no bound.
                if !a.is_nan() && !b.is_nan() {
                    (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
                }
            }
            if from <= to {
                take(from);
                take(to);
            }
        }
        let slack = 1e-9 * corners.iter().map(|c| c.abs().max_element()).fold(0.0, f64::max);
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
}

/// A triangle that may hide what is behind it, in the view.
struct Hiding {
    corners: [DVec3; 3],
    normal: DVec3,
    /// How far its plane is from the eye, times the length of the normal.
    over: f64,
    /// Planes through the eye and its sides; what is in all of them is seen through the triangle.
    sides: [DVec3; 3],
}

impl Hiding {
    fn new(corners: [DVec3; 3]) -> Hiding {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let over = normal.dot(a);
        let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| from.cross(to) * over.signum());
        Hiding { corners, normal, over, sides }
    }

    /// Depth beyond which it hides everything in a tile; none where it does not cover the tile.
    ///
    /// Over the picture, 1 / depth of a plane is linear, so that it is least at a corner.
    fn beyond(&self, tile: &Tile, near: f64) -> Option<f64> {
        let mut farthest = 0f64;
        for ray in tile.view_rays {
            let t = self.over / self.normal.dot(ray);
            // What is in front of the near plane is not drawn.
            let is_drawn = t > near * (1.0 + 1e-6) && t.is_finite();
            if !is_drawn || self.sides.iter().any(|side| side.dot(ray) <= 0.0) {
                return None;
            }
            farthest = farthest.max(t);
        }
        Some(farthest)
    }
}
