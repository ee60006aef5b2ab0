//! What of a caster's volume a view needs: where it is counted, which caps, which part of the screen (001 section 5).
//!
//! Why volumes counted in different ways add up. Sides and caps of one caster's volume are the boundary of its volume: a
//! closed surface on which every ray from a point P to infinity crosses as many layers as lie over P (with signs; any
//! soup of triangles is a sum of such volumes, one per triangle). Counting behind P (z-fail) gives that number, n(P).
//! Counting from the near plane's point N on the way to P (z-pass) gives n(P) - n(N). The two counts are of the same
//! caster alone, and the stencil adds up casters, so each caster may be counted in its own way where n(N) = 0 for every N
//! of the view. n(N) is not 0 only if something of the caster lies between N and the light. All those ways are the
//! convex hull of near rectangle and light; if it is apart from the caster's box, then n(N) = 0 in the whole view.
//!
//! Both counts use the same triangles with the same depths, and "in front of what is seen" is the exact complement of
//! "not in front", so the two agree bit by bit, not just nearly.
//!
//! Caps. A near cap lies on the caster's own surface, and counts as a little behind it, so that another surface in the same
//! plane is not half of it in front and half behind. It is never in front of what is seen if the surface itself was
//! drawn into depth, so z-pass leaves it out there. Of surfaces drawn from their front alone this holds for convex solids:
//! a ray that meets one from behind came in through its front. It holds for a plane sheet seen from before it, too. A far cap at infinity is in front of nothing; z-pass needs none, and
//! under parallel light all of it is one point, so z-fail needs none either. A far cap short of infinity can be between N
//! and P, unless a plane has N and every receiver on one side and the cap on the other ([`Reach::behind`]). Sides and
//! caps outside of the frustum cover no pixel.

use super::reach::{self, Reach};
use super::seen::{self, Seen, Shown};
use super::{Surface, TurnedBox, VolumeLight, hull};
use glam::{DMat4, DVec3, DVec4};
use umbriel_scene::{Aabb, View, VolumeCounting};

/// A view, and what shadows may be seen on in it.
pub struct Sight {
    /// Left, right, bottom, top: unit normals inward.
    sides: [DVec4; 4],
    /// Everything behind the near plane.
    pub(super) ahead: DVec4,
    pub(super) clip_from_world: DMat4,
    near_rectangle: [DVec4; 4],
    pub(super) eye: DVec3,
    /// Left and top of the view in its target.
    pub(super) origin: [u32; 2],
    receivers: Aabb,
    pub(super) view: View,
    pub(super) shown: Option<Shown>,
}

/// A rectangle of pixels: left, top, width, height.
pub(super) type Scissor = [u32; 4];

/// One light in one view.
pub(super) struct Watch<'a> {
    sight: &'a Sight,
    light: &'a VolumeLight,
    /// Near rectangle and light.
    between: Vec<DVec4>,
    /// Normals of the faces of their hull, and along its edges.
    normals: Vec<DVec3>,
    edges: Vec<DVec3>,
    /// Where light may fall on receivers that are seen.
    lit: Aabb,
    pub(super) scissor: Option<Scissor>,
}

/// How one caster is counted in one view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Choice {
    pub(super) z_fail: bool,
    pub(super) near_caps: bool,
    /// The surface is drawn from its front, wherever it is seen from there: near caps that it hides are left out.
    pub(super) front_hides: bool,
    pub(super) far_caps: bool,
    pub(super) scissor: Scissor,
}

impl Sight {
    /// A view with the box of everything in it that shadows may fall on; an empty box leaves that open.
    pub fn new(view: &View, receivers: Aabb) -> Sight {
        let world_from_view = view.view_from_world.as_dmat4().inverse();
        let f = &view.frustum;
        let near_corner = |x: f32, y: f32| world_from_view * DVec3::new(x.into(), y.into(), (-f.near).into()).extend(1.0);
        let clip_from_world = (view.frustum.clip_from_view() * view.view_from_world).as_dmat4();
        let [x, y, w] = [0, 1, 3].map(|i| clip_from_world.row(i));
        let unit = |plane: DVec4| plane / plane.truncate().length();
        Sight {
            sides: [w + x, w - x, w + y, w - y].map(unit),
            ahead: unit(w - DVec4::W * f64::from(f.near)),
            clip_from_world,
            near_rectangle: [(f.left, f.bottom), (f.right, f.bottom), (f.right, f.top), (f.left, f.top)]
                .map(|(x, y)| near_corner(x, y)),
            eye: world_from_view.w_axis.truncate(),
            origin: [0, 0],
            receivers,
            view: view.clone(),
            shown: None,
        }
    }

    /// The same with what is known of surfaces in it: all that shadows may fall on, or else these go without a shadow.
    pub fn with(self, seen: Seen) -> Sight {
        Sight { shown: Some(Shown::new(seen)), ..self }
    }

    /// The same in a target where the view begins at this pixel.
    pub fn at(self, origin: [u32; 2]) -> Sight {
        Sight { origin, ..self }
    }

    pub(super) fn whole(&self) -> Scissor {
        [0, 0, self.view.size[0], self.view.size[1]]
    }

    /// Is all of a hull outside of the frustum? Beyond a far plane is nothing.
    fn is_outside(&self, points: &[DVec4], margin: f64) -> bool {
        self.sides.iter().chain([&self.ahead]).any(|plane| hull::is_behind(points, *plane, margin))
    }

    /// The pixels that a box may cover; `None` for none.
    fn pixels(&self, b: &Aabb) -> Option<Scissor> {
        let corners = hull::corners(b);
        let inside = |p: &DVec4| self.ahead.dot(*p);
        let mut points: Vec<DVec4> = corners.iter().filter(|c| inside(c) >= 0.0).copied().collect();
        // Where edges of the box pass the near plane.
        for (i, j) in hull::edges() {
            let (a, b) = (corners[i], corners[j]);
            let (over_a, over_b) = (inside(&a), inside(&b));
            if (over_a < 0.0) != (over_b < 0.0) {
                points.push(a + (b - a) * (over_a / (over_a - over_b)));
            }
        }
        self.pixels_around(points.into_iter().map(|p| self.clip_from_world * p))
    }

    /// The pixels of the view around places in clip space, all before the eye; `None` for none.
    pub(super) fn pixels_around(&self, places: impl Iterator<Item = DVec4>) -> Option<Scissor> {
        let size = self.view.size;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for clip in places {
            let ndc = [clip.x / clip.w, -clip.y / clip.w];
            for i in 0..2 {
                let pixel = (ndc[i] * 0.5 + 0.5) * f64::from(size[i]);
                (low[i], high[i]) = (low[i].min(pixel), high[i].max(pixel));
            }
        }
        // Conversion from float to integer ends at the borders of the integer.
        let from = [0, 1].map(|i| ((low[i] - 1.0).floor() as u32).min(size[i]));
        let to = [0, 1].map(|i| ((high[i] + 1.0).ceil() as u32).min(size[i]));
        (to[0] > from[0] && to[1] > from[1]).then(|| [from[0], from[1], to[0] - from[0], to[1] - from[1]])
    }
}

impl<'a> Watch<'a> {
    pub(super) fn new(sight: &'a Sight, light: &'a VolumeLight) -> Watch<'a> {
        let near = &sight.near_rectangle;
        let toward = light.toward_light.as_dvec4();
        let mut between = near.to_vec();
        between.push(toward);
        let across = [near[1] - near[0], near[3] - near[0]].map(DVec4::truncate);
        let up: Vec<DVec3> = near.iter().map(|n| toward.truncate() - n.truncate() * toward.w).collect();
        let mut normals = vec![across[0].cross(across[1])];
        normals.extend((0..4).map(|i| (near[(i + 1) % 4] - near[i]).truncate().cross(up[i])));
        let edges = across.into_iter().chain(up).collect();
        let everything = Aabb { min: glam::Vec3::NEG_INFINITY, max: glam::Vec3::INFINITY };
        let receivers = if sight.receivers.is_empty() { everything } else { sight.receivers };
        let lit = common(&receivers, &light.bounds());
        let bounded = lit.min.is_finite() && lit.max.is_finite();
        let scissor = match light.settings.culling {
            true if lit.is_empty() => None,
            true if bounded => sight.pixels(&lit),
            _ => Some(sight.whole()),
        };
        Watch { sight, light, between, normals, edges, lit, scissor }
    }

    /// How a caster with these bounds is counted; `None` where the view shows nothing of its shadow.
    pub(super) fn choose(&self, bounds: &TurnedBox, surface: Surface, reach: &Reach) -> Option<Choice> {
        let sight = self.sight;
        let all = Choice { z_fail: true, near_caps: true, front_hides: false, far_caps: true, scissor: self.scissor? };
        if bounds.in_world.is_empty() {
            return Some(all);
        }
        let (corners, normals) = (bounds.corners, bounds.normals());
        let toward = self.light.toward_light.as_dvec4();
        let volume = reach::swept(&corners, toward, reach);
        let margin = hull::margin(&volume) + hull::margin(&sight.near_rectangle);
        let culls = self.light.settings.culling;
        if culls
            && (self.light.misses(&bounds.in_world)
                || sight.is_outside(&volume, margin)
                || hull::planes(&self.lit).iter().any(|p| p.is_finite() && hull::is_behind(&volume, *p, margin)))
        {
            return None;
        }
        let products = || self.edges.iter().flat_map(|edge| bounds.edges.map(|other| edge.cross(other)));
        let is_safe = self.light.settings.counting == VolumeCounting::Auto
            && hull::are_apart(&self.between, &corners, self.normals.iter().copied().chain(normals).chain(products()), margin);
        // Under parallel light without end the far cap is a point, whatever else is asked for.
        let has_far_cap = toward.w != 0.0 || reach.has_end();
        let mut choice = Choice { z_fail: !is_safe, far_caps: has_far_cap, ..all };
        if is_safe {
            let is_in_front = |plane: DVec4| sight.near_rectangle.iter().all(|n| plane.dot(*n) > 0.0);
            choice.near_caps = surface != Surface::BothSides;
            choice.front_hides = surface == Surface::Front;
            choice.far_caps &= reach.has_end() && !reach.behind.is_some_and(is_in_front);
        }
        if !culls {
            return Some(choice);
        }
        choice.near_caps &= !sight.is_outside(&corners, margin);
        choice.far_caps &= !sight.is_outside(&volume[8..], margin);
        let mut lit = self.lit;
        if reach.times != f64::INFINITY {
            let swept = Aabb::from_points(volume.iter().map(|p| p.truncate().as_vec3()));
            lit = common(&lit, &Aabb { min: swept.min - margin as f32, max: swept.max + margin as f32 });
            choice.scissor = overlap(choice.scissor, sight.pixels(&lit)?)?;
        }
        if self.light.settings.depth_bounds
            && let Some(shown) = &sight.shown
        {
            let planes = seen::planes(bounds, toward, sight.eye, margin);
            choice.scissor = shown.touched(sight, bounds, &lit, &planes, choice.scissor)?;
        }
        Some(choice)
    }
}

fn common(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb { min: a.min.max(b.min), max: a.max.min(b.max) }
}

pub(super) fn overlap(a: Scissor, b: Scissor) -> Option<Scissor> {
    let from = [0, 1].map(|i| a[i].max(b[i]));
    let to = [0, 1].map(|i| (a[i] + a[i + 2]).min(b[i] + b[i + 2]));
    (to[0] > from[0] && to[1] > from[1]).then(|| [from[0], from[1], to[0] - from[0], to[1] - from[1]])
}
