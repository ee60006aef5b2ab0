//! Mouse and keys of one window.

use super::Command;
use crate::navigation::Button;
use glam::{Vec2, Vec3};
use umbriel_scene::{Layout, Picture, View};
use winit::event::{ElementState, MouseButton, MouseScrollDelta};
use winit::keyboard::{KeyCode, PhysicalKey};

/// Pixels of a touchpad that count as a notch of a wheel.
const PIXELS_PER_NOTCH: f32 = 50.0;
/// What Shift does to the speed.
const HASTE: f32 = 5.0;

/// What a key does once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    Quit,
    Screenshot,
    Command(Command),
}

/// What is held, and where the mouse is.
#[derive(Default)]
pub(super) struct Controls {
    pub(super) cursor: Vec2,
    /// The mouse moved since the app was told of it.
    pub(super) strayed: bool,
    buttons: Vec<Button>,
    keys: Vec<KeyCode>,
}

impl Controls {
    /// The mouse is at `cursor` now. Gives the drag, if a button is held.
    pub(super) fn moved(&mut self, cursor: Vec2) -> Option<(Button, Vec2)> {
        let pixels = cursor - self.cursor;
        self.cursor = cursor;
        self.strayed = true;
        self.buttons.first().map(|b| (*b, pixels))
    }

    pub(super) fn button(&mut self, button: MouseButton, state: ElementState) {
        let button = match button {
            MouseButton::Left => Button::Left,
            MouseButton::Middle => Button::Middle,
            MouseButton::Right => Button::Right,
            _ => return,
        };
        hold(&mut self.buttons, button, state);
    }

    /// Is the button held that picks?
    pub(super) fn presses(&self) -> bool {
        self.buttons.contains(&Button::Left)
    }

    /// A key went up or down. Gives what it does once.
    pub(super) fn key(&mut self, key: PhysicalKey, state: ElementState, repeat: bool) -> Option<Action> {
        let PhysicalKey::Code(code) = key else { return None };
        hold(&mut self.keys, code, state);
        if state == ElementState::Released || repeat {
            return None;
        }
        Some(match code {
            KeyCode::Escape => Action::Quit,
            KeyCode::KeyP | KeyCode::F12 => Action::Screenshot,
            KeyCode::KeyR | KeyCode::F5 => Action::Command(Command::Reload),
            KeyCode::PageDown => Action::Command(Command::NextViewpoint),
            KeyCode::PageUp => Action::Command(Command::PreviousViewpoint),
            KeyCode::Home => Action::Command(Command::ResetNavigation),
            _ => return None,
        })
    }

    /// Another window has the keys now: nothing is held here any more.
    pub(super) fn release_all(&mut self) {
        self.buttons.clear();
        self.keys.clear();
    }

    /// Where the held keys lead (x right, y up, z back), and how hastily. None when none is held.
    pub(super) fn held(&self) -> Option<(Vec3, f32)> {
        let on = |codes: &[KeyCode]| f32::from(u8::from(codes.iter().any(|c| self.keys.contains(c))));
        let direction = Vec3::new(
            on(&[KeyCode::KeyD, KeyCode::ArrowRight]) - on(&[KeyCode::KeyA, KeyCode::ArrowLeft]),
            on(&[KeyCode::KeyE]) - on(&[KeyCode::KeyQ]),
            on(&[KeyCode::KeyS, KeyCode::ArrowDown]) - on(&[KeyCode::KeyW, KeyCode::ArrowUp]),
        );
        let haste = 1.0 + (HASTE - 1.0) * on(&[KeyCode::ShiftLeft, KeyCode::ShiftRight]);
        (direction != Vec3::ZERO).then_some((direction, haste))
    }
}

fn hold<T: PartialEq>(held: &mut Vec<T>, what: T, state: ElementState) {
    held.retain(|h| *h != what);
    if state == ElementState::Pressed {
        held.push(what);
    }
}

/// Notches of the wheel, up positive.
pub(super) fn notches(delta: MouseScrollDelta) -> f32 {
    match delta {
        MouseScrollDelta::LineDelta(_, y) => y,
        MouseScrollDelta::PixelDelta(p) => p.y as f32 / PIXELS_PER_NOTCH,
    }
}

/// The view under the mouse, and the place in it from (0, 0) at the top left to (1, 1); `cursor` and `window` in pixels of the window, which
/// shows the whole picture.
pub(super) fn view_at(picture: &Picture, cursor: Vec2, window: [u32; 2]) -> Option<(&View, Vec2)> {
    let at = Vec2::from([0, 1].map(|i| cursor[i] * picture.size[i] as f32 / window[i].max(1) as f32));
    let Layout::Tiles(tiles) = &picture.layout else {
        let [width, height] = picture.size.map(|side| side.max(1) as f32);
        return picture.views.first().map(|view| (view, at / Vec2::new(width, height)));
    };
    let [x, y] = at.max(Vec2::ZERO).to_array().map(|place| place as u32);
    let inside = |r: &umbriel_scene::Rect| (r.x..r.x + r.width).contains(&x) && (r.y..r.y + r.height).contains(&y);
    let place = tiles.iter().position(inside).unwrap_or(0);
    let (tile, view) = (tiles.get(place)?, picture.views.get(place)?);
    let corner = Vec2::new(tile.x as f32, tile.y as f32);
    Some((view, (at - corner) / Vec2::new(tile.width.max(1) as f32, tile.height.max(1) as f32)))
}

/// The view that leads ahead, wherever the mouse is: of several walls the one that an unturned head looks at, along -z.
pub(super) fn view_ahead(picture: &Picture) -> Option<&View> {
    let backwards = |view: &View| view.view_from_world.inverse().z_axis.z;
    picture.views.iter().max_by(|a, b| backwards(a).total_cmp(&backwards(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{Arrangement, ScreenCorners, cylinder_screens, off_axis, room_screens};
    use ElementState::{Pressed, Released};
    use glam::Mat4;
    use umbriel_scene::Frustum;

    #[test]
    fn held_keys_lead_and_cancel() {
        let rows = [
            (&[] as &[KeyCode], None),
            (&[KeyCode::KeyW], Some((Vec3::NEG_Z, 1.0))),
            (&[KeyCode::KeyW, KeyCode::ArrowUp], Some((Vec3::NEG_Z, 1.0))),
            (&[KeyCode::KeyW, KeyCode::KeyS], None),
            (&[KeyCode::KeyD, KeyCode::KeyE, KeyCode::ShiftLeft], Some((Vec3::new(1.0, 1.0, 0.0), HASTE))),
            (&[KeyCode::ShiftLeft], None),
        ];
        for (keys, want) in rows {
            let mut controls = Controls::default();
            for key in keys {
                controls.key(PhysicalKey::Code(*key), Pressed, false);
            }
            assert_eq!(controls.held(), want, "{keys:?}");
            controls.release_all();
            assert_eq!(controls.held(), None);
        }
    }

    #[test]
    fn keys_act_once() {
        let mut controls = Controls::default();
        let reload = PhysicalKey::Code(KeyCode::KeyR);
        assert_eq!(controls.key(reload, Pressed, false), Some(Action::Command(Command::Reload)));
        assert_eq!(controls.key(reload, Pressed, true), None);
        assert_eq!(controls.key(reload, Released, false), None);
    }

    #[test]
    fn dragging_needs_a_button() {
        let mut controls = Controls::default();
        assert_eq!(controls.moved(Vec2::new(5.0, 5.0)), None);
        controls.button(MouseButton::Left, Pressed);
        controls.button(MouseButton::Right, Pressed);
        assert_eq!(controls.moved(Vec2::new(7.0, 4.0)), Some((Button::Left, Vec2::new(2.0, -1.0))));
        controls.button(MouseButton::Left, Released);
        assert_eq!(controls.moved(Vec2::new(7.0, 5.0)), Some((Button::Right, Vec2::new(0.0, 1.0))));
    }

    #[test]
    fn the_view_under_the_mouse() {
        let frustum = Frustum::symmetric(1.0, 1.0, 0.1);
        let view = |name: &str| View { name: name.into(), view_from_world: Mat4::IDENTITY, frustum, size: [100, 100] };
        let row = Arrangement::Row.picture("row".into(), vec![view("a"), view("b"), view("c")], 1).unwrap();
        // The window is half as large as the picture.
        for (x, y, want) in [(10.0, 10.0, "a"), (60.0, 49.0, "b"), (149.0, 0.0, "c"), (900.0, -7.0, "a")] {
            assert_eq!(view_at(&row, Vec2::new(x, y), [150, 50]).unwrap().0.name, want, "{x} {y}");
        }
        assert_eq!(view_at(&row, Vec2::new(75.0, 10.0), [150, 50]).unwrap().1, Vec2::new(0.5, 0.2));
    }

    #[test]
    fn of_many_walls_the_front_one_leads_ahead() {
        let room = room_screens(3.0, 3.0, 3.0);
        let ring = cylinder_screens(7, 4.7, 2.0, 2.0, Vec3::Y);
        for (walls, front) in [(vec![room.left, room.floor, room.front, room.right], 2), (ring, 3), (vec![room.right], 0)] {
            let view = |(i, wall): (usize, &ScreenCorners)| {
                let (view_from_world, frustum) = off_axis(Vec3::new(0.1, 1.2, 0.2), wall, 0.1).unwrap();
                View { name: i.to_string(), view_from_world, frustum, size: [10, 10] }
            };
            let views = walls.iter().enumerate().map(view).collect();
            let picture = Arrangement::Row.picture("walls".into(), views, 1).unwrap();
            assert_eq!(view_ahead(&picture).unwrap().name, front.to_string());
        }
    }
}
