//! What hides what, tile by tile of a view: triangles that cover a tile hide what is behind them. No depth is read back, so that
//! no frame waits.

use super::faces::Face;
use super::hull;
use glam::{DVec3, DVec4};
use umbriel_scene::View;

/// Pixels of a tile's side, at least.
const SMALLEST: u32 = 8;
/// Tiles across and down, at most.
const MOST: u32 = 32;

/// The tiles of a view.
pub(super) struct Tiles {
    eye: DVec3,
    /// Pixels of a tile's side.
    side: u32,
    across: u32,
    tiles: Vec<Tile>,
}

/// The pyramid behind a tile.
struct Tile {
    /// Along its edges, to depth 1, in the world.
    rays: [DVec3; 4],
    covers: Vec<Cover>,
}

/// A face that covers a tile.
struct Cover {
    /// Where the tile's edges end on it, in the world.
    ends: [DVec3; 4],
    /// 1 / depth there and a little beyond. Over the picture, that is linear for a plane.
    nearness: [f64; 4],
}

/// What is looked for in tiles.
#[derive(Clone, Copy)]
pub(super) enum Sought<'a> {
    /// Something in the plane of a face.
    On(&'a Face),
    /// Something at this depth or beyond.
    Beyond(f64),
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
    /// Of a view, with the faces in its depth buffer that hide what is behind them.
    pub(super) fn new(view: &View, hiding: &[Face]) -> Tiles {
        let view_from_world = view.view_from_world.as_dmat4();
        let world_from_view = view_from_world.inverse();
        let eye = world_from_view.w_axis.truncate();
        let grid = Grid::new(view);
        let mut tiles: Vec<Tile> = (0..grid.across * grid.down)
            .map(|i| grid.rays(i % grid.across, i / grid.across).map(|ray| world_from_view.transform_vector3(ray)))
            .map(|rays| Tile { rays, covers: Vec::new() })
            .collect();
        for face in hiding {
            let corners: Vec<DVec3> = face.corners().iter().map(|p| view_from_world.transform_point3(*p)).collect();
            let sides = sides(face, eye);
            let [left, right, top, bottom] = grid.around(&corners);
            for (x, y) in (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))) {
                tiles[(y * grid.across + x) as usize].hide_behind(face, &sides, eye, grid.near);
            }
        }
        Tiles { eye, side: grid.side, across: grid.across, tiles }
    }

    /// The smallest rectangle of pixels, inside of `within`, in which what is sought may be seen, and something behind all of `planes`
    /// (unit normals inward).
    pub(super) fn seen(&self, within: [u32; 4], sought: Sought<'_>, planes: &[DVec4]) -> Option<[u32; 4]> {
        let [left, top, width, height] = within;
        let mut found: Option<[u32; 4]> = None;
        for y in top / self.side..=(top + height - 1) / self.side {
            for x in left / self.side..=(left + width - 1) / self.side {
                let inside = found.is_some_and(|[l, t, r, b]| l <= x && x < r && t <= y && y < b);
                let tile = &self.tiles[(y * self.across + x) as usize];
                if inside || tile.hides(sought, self.eye) || tile.is_before_one_of(planes, self.eye) {
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

impl Tile {
    /// Adds a face where it covers the tile. `sides` are of [`sides`].
    fn hide_behind(&mut self, face: &Face, sides: &[DVec3], eye: DVec3, near: f64) {
        let depths = self.rays.map(|ray| 1.0 / face.nearness(eye, ray));
        // What is in front of the near plane is not drawn.
        let is_drawn = |depth: &f64| *depth > near * (1.0 + 1e-6) && depth.is_finite();
        let is_inside = |ray: &DVec3| sides.iter().all(|side| side.dot(*ray) > 0.0);
        if depths.iter().all(is_drawn) && self.rays.iter().all(is_inside) {
            let ends = std::array::from_fn(|i| eye + self.rays[i] * depths[i]);
            // Rounding, of the device as well.
            let nearness = depths.map(|depth| 1.0 / (depth + 1e-3 + 1e-4 * depth));
            self.covers.push(Cover { ends, nearness });
        }
    }

    /// Is what is sought behind a face that covers the tile, wherever it is in it?
    fn hides(&self, sought: Sought<'_>, eye: DVec3) -> bool {
        let nearness = match sought {
            Sought::On(face) => self.rays.map(|ray| face.nearness(eye, ray)),
            Sought::Beyond(depth) => [1.0 / depth; 4],
        };
        self.covers.iter().any(|cover| nearness.iter().zip(&cover.nearness).all(|(own, other)| own < other))
    }

    /// Is all that is seen in it outside of a plane? It lies between the eye and a face that covers the tile.
    fn is_before_one_of(&self, planes: &[DVec4], eye: DVec3) -> bool {
        let is_outside = |plane: &DVec4, p: DVec3| hull::height(plane, p) < 0.0;
        let mut outside_of = planes.iter().filter(|plane| is_outside(plane, eye));
        outside_of.any(|plane| self.covers.iter().any(|cover| cover.ends.iter().all(|end| is_outside(plane, *end))))
    }
}

/// Planes through the eye and the sides of a face; rays that are inside of all of them pass through it.
fn sides(face: &Face, eye: DVec3) -> Vec<DVec3> {
    let corners = face.corners();
    let turn = -face.distance_to(eye).signum();
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(from, to)| (*from - eye).cross(*to - eye) * turn).collect()
}
