//! Mouse and keys move the world while the views stand still in the room.
//!
//! [`Navigator`] is plain state and a pure function; [`NavigationNode`] brings it from and to the `Navigation` node.

mod input;
mod node;
mod standpoint;

pub use input::{Button, Input, Mode};
pub use node::NavigationNode;

use glam::{Mat4, Quat, Vec2, Vec3};
use standpoint::Standpoint;

/// Pose of the room in the world, and how it is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Navigator {
    /// Where the room's origin is in the world, metres.
    pub position: Vec3,
    /// How the room is turned.
    pub orientation: Quat,
    /// Metres of the world in a metre of the room.
    pub scale: f32,
    /// How input is understood.
    pub mode: Mode,
    /// Metres of the room per second, for keys.
    pub speed: f32,
    /// What the examine mode turns about, in the world.
    pub center: Vec3,
}

impl Default for Navigator {
    fn default() -> Navigator {
        Navigator {
            position: Vec3::ZERO,
            orientation: Quat::IDENTITY,
            scale: 1.0,
            mode: Mode::Examine,
            speed: 1.5,
            center: Vec3::ZERO,
        }
    }
}

/// The world never comes closer to standing on its head than this.
const POLE_MARGIN_RAD: f32 = 0.02;
/// Part of the way to the centre that one notch of the wheel goes.
const ZOOM_PER_NOTCH: f32 = 0.1;

impl Navigator {
    /// Pose of the room in the world.
    pub fn world_from_room(&self) -> Mat4 {
        Mat4::from_scale_rotation_translation(Vec3::splat(self.scale), self.orientation, self.position)
    }

    /// One step. Input that is not finite changes nothing.
    pub fn step(&mut self, input: Input<'_>) {
        let before = *self;
        match (self.mode, input) {
            (Mode::None, _) => {}
            (_, input) if !input.is_finite() => {}
            (Mode::Examine, Input::Drag { button: Button::Left, pixels, view }) => {
                let rad_per_pixel = std::f32::consts::PI / view.size[1].max(1) as f32;
                self.turn_about(self.room_point(self.center), -pixels * rad_per_pixel, &Standpoint::of(view));
            }
            (_, Input::Drag { button: Button::Left, pixels, view }) => {
                let eye = Standpoint::of(view);
                self.turn_about(eye.position, pixels * eye.pixel_at_1m, &eye);
            }
            (Mode::Examine, Input::Drag { pixels, view, .. }) => self.pan_with_centre(pixels, &Standpoint::of(view)),
            (_, Input::Drag { pixels, view, .. }) => {
                let eye = Standpoint::of(view);
                self.travel(eye.across(-pixels) * (2.0 * self.speed));
            }
            (Mode::Examine, Input::Wheel { notches, view }) => self.zoom(notches, &Standpoint::of(view)),
            (_, Input::Wheel { notches, view }) => self.go(Vec3::NEG_Z * (0.2 * notches), &Standpoint::of(view)),
            (_, Input::Keys { direction, haste, dt_s, view }) => self.go(direction * (haste * dt_s), &Standpoint::of(view)),
        }
        if !(self.position.is_finite() && self.orientation.is_finite() && self.center.is_finite()) {
            *self = before;
        }
    }

    /// The world's upward direction, as it is in the room now.
    fn up_in_room(&self) -> Vec3 {
        self.orientation.inverse() * Vec3::Y
    }

    fn room_point(&self, p_in_world: Vec3) -> Vec3 {
        self.world_from_room().inverse().transform_point3(p_in_world)
    }

    /// The room goes by `way` (in the room, metres): the world is seen to come the other way.
    fn travel(&mut self, way: Vec3) {
        self.position += self.orientation * way * self.scale;
    }

    /// Goes for some seconds at the usual speed, in the directions of the view (x right, y up, z back). Walking stays level.
    fn go(&mut self, seconds: Vec3, eye: &Standpoint) {
        let way = if self.mode == Mode::Walk {
            let up = self.up_in_room();
            level(eye.right, up) * seconds.x - level(eye.ahead, up) * seconds.z
        } else {
            eye.right * seconds.x + eye.up * seconds.y - eye.ahead * seconds.z
        };
        self.travel(way * self.speed);
    }

    /// Turns the room about a point that keeps its place, by `angles` to the left and upwards. The world is seen to turn the
    /// other way, so that what is far follows a mouse that moves by `angles`, and what is in front of the pivot one that
    /// moves by `-angles`. The horizon stays level.
    fn turn_about(&mut self, pivot_in_room: Vec3, angles: Vec2, eye: &Standpoint) {
        let up = self.up_in_room();
        let elevation = eye.ahead.dot(up).clamp(-1.0, 1.0).asin();
        let limit = std::f32::consts::FRAC_PI_2 - POLE_MARGIN_RAD;
        let pitch = angles.y.clamp((-limit - elevation).min(0.0), (limit - elevation).max(0.0));
        let turn = Quat::from_axis_angle(up, angles.x) * Quat::from_axis_angle(level(eye.right, up), pitch);
        let pivot_in_world = self.world_from_room().transform_point3(pivot_in_room);
        self.orientation = (self.orientation * turn).normalize();
        self.position = pivot_in_world - self.orientation * pivot_in_room * self.scale;
    }

    /// What is as far away as the centre goes along with the mouse; the centre stays where it is in the room.
    fn pan_with_centre(&mut self, pixels: Vec2, eye: &Standpoint) {
        let centre_in_room = self.room_point(self.center);
        let depth = (centre_in_room - eye.position).dot(eye.ahead).max(eye.near);
        self.travel(eye.across(-pixels) * depth);
        self.center = self.world_from_room().transform_point3(centre_in_room);
    }

    /// The centre comes nearer along the line on which it is seen, down to twice the near plane.
    fn zoom(&mut self, notches: f32, eye: &Standpoint) {
        let to_centre = self.room_point(self.center) - eye.position;
        let closest = 2.0 * eye.near;
        let distance = to_centre.length();
        let direction = if distance < closest { eye.ahead } else { to_centre / distance };
        let distance = distance.max(closest);
        let wanted = (distance * (1.0 - ZOOM_PER_NOTCH).powf(notches)).max(closest);
        self.travel(direction * (distance - wanted));
    }
}

/// The part of `v` that is at a right angle to `up`, of length one.
fn level(v: Vec3, up: Vec3) -> Vec3 {
    v.reject_from_normalized(up).normalize_or(v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use umbriel_scene::{Frustum, View};

    const SIZE: [u32; 2] = [1280, 720];

    fn view(room_from_view: Mat4) -> View {
        let frustum = Frustum::symmetric(0.8, 1280.0 / 720.0, 0.1);
        View { name: "v".into(), view_from_world: room_from_view.inverse(), frustum, size: SIZE }
    }

    fn standing() -> View {
        view(Mat4::from_translation(Vec3::new(0.0, 1.7, 4.0)))
    }

    fn drag(button: Button, x: f32, y: f32, view: &View) -> Input<'_> {
        Input::Drag { button, pixels: Vec2::new(x, y), view }
    }

    /// Pixels from the top left corner, and the distance ahead.
    fn seen(n: &Navigator, view: &View, p_in_world: Vec3) -> Vec3 {
        let view_from_world = view.view_from_world * n.world_from_room().inverse();
        let p = view.frustum.clip_from_view().project_point3(view_from_world.transform_point3(p_in_world));
        let depth = -view_from_world.transform_point3(p_in_world).z;
        Vec3::new((p.x + 1.0) * 0.5 * SIZE[0] as f32, (1.0 - p.y) * 0.5 * SIZE[1] as f32, depth)
    }

    fn ahead_in_world(n: &Navigator, view: &View) -> Vec3 {
        (n.world_from_room() * view.view_from_world.inverse()).transform_vector3(Vec3::NEG_Z).normalize()
    }

    #[test]
    fn orbits_by_the_dragged_angle_about_the_centre() {
        let view = standing();
        let quarter = SIZE[1] as f32 * 0.5;
        // Where the front of the centre (towards the viewer) goes, as seen in the room.
        for (x, y, want) in [
            (
                100.0,
                0.0,
                Vec3::new((100.0 / 720.0 * std::f32::consts::PI).sin(), 0.0, (100.0 / 720.0 * std::f32::consts::PI).cos()),
            ),
            (quarter, 0.0, Vec3::X),
            (-quarter, 0.0, Vec3::NEG_X),
            (
                0.0,
                100.0,
                Vec3::new(0.0, -(100.0 / 720.0 * std::f32::consts::PI).sin(), (100.0 / 720.0 * std::f32::consts::PI).cos()),
            ),
        ] {
            let mut n =
                Navigator { center: Vec3::new(0.5, 1.7, -1.0), position: Vec3::new(0.5, 0.0, 0.0), ..Navigator::default() };
            let room_from_world = n.world_from_room().inverse();
            let front_in_world = n.center + Vec3::Z;
            let before = seen(&n, &view, n.center);
            n.step(drag(Button::Left, x, y, &view));
            assert!(seen(&n, &view, n.center).abs_diff_eq(before, 1e-2), "the centre moved");
            let went =
                n.world_from_room().inverse().transform_point3(front_in_world) - room_from_world.transform_point3(n.center);
            assert!(went.abs_diff_eq(want, 1e-4), "{x} {y}: {went} is not {want}");
        }
    }

    #[test]
    fn the_world_never_stands_on_its_head() {
        let view = standing();
        for mode in [Mode::Examine, Mode::Fly] {
            for y in [5000.0, -5000.0] {
                let mut n = Navigator { mode, ..Navigator::default() };
                n.step(drag(Button::Left, 77.0, y, &view));
                n.step(drag(Button::Left, -300.0, y, &view));
                let elevation = ahead_in_world(&n, &view).y.asin();
                assert!((elevation.abs() - (std::f32::consts::FRAC_PI_2 - POLE_MARGIN_RAD)).abs() < 1e-3, "{elevation}");
                let right = n.orientation * Vec3::X;
                assert!(right.y.abs() < 1e-4, "the horizon is not level: {right}");
            }
        }
    }

    #[test]
    fn the_wheel_zooms_along_the_line_to_the_centre() {
        let view = standing();
        for (notches, factor) in [(1.0, 0.9), (-1.0, 1.0 / 0.9), (3.0, 0.729), (500.0, 0.0)] {
            let mut n = Navigator { center: Vec3::new(0.4, 1.0, -2.0), ..Navigator::default() };
            let before = seen(&n, &view, n.center);
            n.step(Input::Wheel { notches, view: &view });
            let after = seen(&n, &view, n.center);
            assert!(after.truncate().abs_diff_eq(before.truncate(), 0.1), "{notches}: {before} became {after}");
            let want = (before.z * factor).max(0.2);
            assert!((after.z - want).abs() < 1e-2, "{notches}: {after} is not {want} away");
        }
    }

    #[test]
    fn panning_keeps_the_world_under_the_mouse() {
        let view = standing();
        for scale in [1.0, 20.0] {
            let mut n = Navigator { center: Vec3::new(0.4, 1.0, -2.0), scale, ..Navigator::default() };
            let held = n.center;
            let (before, centre_in_room) = (seen(&n, &view, held), n.room_point(held));
            n.step(drag(Button::Right, 120.0, -45.0, &view));
            let after = seen(&n, &view, held);
            assert!(after.abs_diff_eq(before + Vec3::new(120.0, -45.0, 0.0), 0.1), "{before} became {after}");
            assert!(n.room_point(n.center).abs_diff_eq(centre_in_room, 1e-4));
        }
    }

    #[test]
    fn looking_around_takes_what_is_ahead_along() {
        let view = standing();
        let mut n = Navigator { mode: Mode::Fly, ..Navigator::default() };
        let ahead = Vec3::new(0.0, 1.7, -50.0);
        n.step(drag(Button::Left, 30.0, 20.0, &view));
        let after = seen(&n, &view, ahead);
        assert!(after.truncate().abs_diff_eq(Vec2::new(670.0, 380.0), 0.2), "{after}");
    }

    #[test]
    fn keys_go_where_the_view_looks_and_walking_stays_level() {
        let down = view(Mat4::from_rotation_translation(Quat::from_rotation_x(-0.5), Vec3::new(0.0, 1.7, 4.0)));
        let key = |direction: Vec3| Input::Keys { direction, haste: 2.0, dt_s: 0.5, view: &down };
        let rows = [
            (Mode::Fly, Vec3::NEG_Z, Vec3::new(0.0, -0.5f32.sin(), -0.5f32.cos()) * 3.0),
            (Mode::Walk, Vec3::NEG_Z, Vec3::NEG_Z * 3.0),
            (Mode::Walk, Vec3::X, Vec3::X * 3.0),
            (Mode::Walk, Vec3::Y, Vec3::ZERO),
            (Mode::None, Vec3::X, Vec3::ZERO),
        ];
        for (mode, direction, want) in rows {
            let mut n = Navigator { mode, speed: 3.0, ..Navigator::default() };
            n.step(key(direction));
            assert!(n.position.abs_diff_eq(want, 1e-5), "{mode:?} {direction}: {}", n.position);
        }
    }

    #[test]
    fn nonsense_changes_nothing() {
        let view = standing();
        for mode in [Mode::Examine, Mode::Fly, Mode::Walk] {
            let start = Navigator { mode, ..Navigator::default() };
            let mut n = start;
            n.step(drag(Button::Left, f32::NAN, 1.0, &view));
            n.step(drag(Button::Middle, f32::INFINITY, 1.0, &view));
            n.step(Input::Wheel { notches: f32::NAN, view: &view });
            n.step(Input::Keys { direction: Vec3::NAN, haste: 1.0, dt_s: 1.0, view: &view });
            assert_eq!(n, start);
        }
    }
}
