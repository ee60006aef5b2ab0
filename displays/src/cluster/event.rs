//! What happens at a display, for the application.

use glam::{Mat4, Vec2, Vec3};
use serde::{Deserialize, Serialize};
use umbriel_fields::NodeId;
use umbriel_fields::replica::node_numbered;
use umbriel_scene::{Frustum, View};

use crate::navigation::{self, Button};
use crate::rig::Pointed;

/// Something that a person did at a display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Event {
    /// Mouse or keys move the room through the world.
    Moved(Motion),
    /// The room goes back to where it started.
    Home,
    /// The mouse points somewhere.
    Pointed(Pointing),
}

/// An event, and where it happened.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Name of the display.
    pub display: String,
    /// What happened.
    pub event: Event,
}

/// [`navigation::Input`] on its way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    by: By,
    /// Columns of the view's matrix, which leads from the room.
    view_from_room: [f32; 16],
    /// Left, right, bottom, top and near.
    frustum: [f32; 5],
    /// Pixels across and down.
    size: [u32; 2],
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum By {
    Drag { button: u8, pixels: [f32; 2] },
    Wheel { notches: f32 },
    Keys { direction: [f32; 3], haste: f32, dt_s: f32 },
}

/// [`Pointed`] on its way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pointing {
    origin: [f32; 3],
    direction: [f32; 3],
    /// The application's number of the shape; the place on it and the normal there.
    over: Option<(u64, [f32; 3], [f32; 3])>,
    pressed: bool,
}

impl Pointing {
    /// `number` gives the application's number of a node.
    pub fn new(pointed: &Pointed, number: impl Fn(NodeId) -> Option<u64>) -> Pointing {
        let over = pointed.over.and_then(|(node, point, normal)| Some((number(node)?, point.into(), normal.into())));
        Pointing { origin: pointed.origin.into(), direction: pointed.direction.into(), over, pressed: pointed.pressed }
    }

    /// In the application.
    pub fn pointed(&self) -> Pointed {
        Pointed {
            origin: self.origin.into(),
            direction: self.direction.into(),
            over: self.over.map(|(number, point, normal)| (node_numbered(number), point.into(), normal.into())),
            pressed: self.pressed,
        }
    }
}

const BUTTONS: [Button; 3] = [Button::Left, Button::Middle, Button::Right];

impl From<navigation::Input<'_>> for Motion {
    fn from(input: navigation::Input<'_>) -> Motion {
        let (by, view) = match input {
            navigation::Input::Drag { button, pixels, view } => {
                let button = BUTTONS.iter().position(|known| *known == button).unwrap_or(0) as u8;
                (By::Drag { button, pixels: pixels.into() }, view)
            }
            navigation::Input::Wheel { notches, view } => (By::Wheel { notches }, view),
            navigation::Input::Keys { direction, haste, dt_s, view } => {
                (By::Keys { direction: direction.into(), haste, dt_s }, view)
            }
        };
        let Frustum { left, right, bottom, top, near } = view.frustum;
        Motion {
            by,
            view_from_room: view.view_from_world.to_cols_array(),
            frustum: [left, right, bottom, top, near],
            size: view.size,
        }
    }
}

impl Motion {
    /// Has it done where the world is.
    pub fn with(&self, navigate: impl FnOnce(navigation::Input<'_>)) {
        let [left, right, bottom, top, near] = self.frustum;
        let view = &View {
            name: String::new(),
            view_from_world: Mat4::from_cols_array(&self.view_from_room),
            frustum: Frustum { left, right, bottom, top, near },
            size: self.size,
        };
        navigate(match self.by {
            By::Drag { button, pixels } => {
                let button = BUTTONS.get(usize::from(button)).copied().unwrap_or(Button::Left);
                navigation::Input::Drag { button, pixels: Vec2::from(pixels), view }
            }
            By::Wheel { notches } => navigation::Input::Wheel { notches, view },
            By::Keys { direction, haste, dt_s } => {
                navigation::Input::Keys { direction: Vec3::from(direction), haste, dt_s, view }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::message::{bytes_of, message_of};

    #[test]
    fn motions_arrive_as_they_were_made() {
        let frustum = Frustum::symmetric(1.0, 1.5, 0.1);
        let view = &View {
            name: String::new(),
            view_from_world: Mat4::from_rotation_y(0.3) * Mat4::from_translation(Vec3::X),
            frustum,
            size: [30, 20],
        };
        let rows = [
            navigation::Input::Drag { button: Button::Left, pixels: Vec2::new(3.0, -1.0), view },
            navigation::Input::Drag { button: Button::Middle, pixels: Vec2::ONE, view },
            navigation::Input::Drag { button: Button::Right, pixels: Vec2::ZERO, view },
            navigation::Input::Wheel { notches: -2.0, view },
            navigation::Input::Keys { direction: Vec3::NEG_Z, haste: 5.0, dt_s: 0.01, view },
        ];
        for input in rows {
            let there: Event = message_of(&bytes_of(&Event::Moved(input.into()))).unwrap();
            let Event::Moved(motion) = there else { panic!("{there:?}") };
            motion.with(|arrived| assert_eq!(arrived, input));
        }
    }
}
