//! One `Display` node becomes one picture.

use super::nodes::RigNode;
use super::{Arrangement, Camera, Eye, Head, RigError, ScreenCorners, off_axis};
use crate::Error;
use glam::{Mat4, Quat, Vec2, Vec3, Vec4};
use std::sync::Arc;
use umbriel_scene::{Frustum, Picture, View};

/// Pixels across or down that a view may have; what every graphics device draws.
const SIZE_MAX: u32 = 8192;

/// What a display gets from around it.
pub(super) struct Surroundings<'a> {
    /// Who looks where the display does not say.
    pub(super) user: Option<RigNode<'a>>,
    /// Where the camera stands for a viewpoint, or for the first one if none is given.
    pub(super) camera: &'a dyn Fn(Option<umbriel_fields::NodeId>) -> Option<Camera>,
    /// Size of the whole picture, where a window already has one.
    pub(super) window: Option<[u32; 2]>,
}

/// What a display looks through.
enum Windows<'a> {
    Screens(Vec<(RigNode<'a>, ScreenCorners)>),
    /// Tangents left, right, bottom, top, fixed to the head.
    Headset(Arc<[Vec4]>),
    Camera(Camera),
}

/// The picture of a display, and a remark where it had to guess.
///
/// # Errors
/// A node of the rig cannot be used; the error names it and the field.
pub(super) fn picture(display: &RigNode<'_>, name: String, around: &Surroundings<'_>) -> Result<(Picture, Option<Error>), Error> {
    let arrangement = Arrangement::from_name(&display.choice("layout")?).unwrap_or(Arrangement::Mono);
    let near = display.finite("near", |v: &f32| v.is_finite())?;
    let windows = windows(display, around)?;
    let stereo = display.get::<bool>("stereo")?;
    let eyes = match &windows {
        Windows::Headset(frusta) => Eye::of(frusta.len() == 2),
        _ => Eye::of(arrangement.is_stereo() || (stereo && arrangement != Arrangement::Mono)),
    };
    let remark = (stereo && eyes.len() == 1).then(|| display.error("stereo", RigError::MonoStereo));
    let count = match &windows {
        Windows::Screens(screens) => screens.len(),
        _ => 1,
    };
    let size = size_of_view(display, around.window, arrangement.grid(count, eyes.len()))?;
    let head = head(display, around, &windows)?;
    let views = views(display, &name, &windows, &head, eyes, near, size)?;
    let picture = arrangement.picture(name, views, eyes.len()).map_err(|reason| display.error("layout", reason))?;
    Ok((picture, remark))
}

fn windows<'a>(display: &RigNode<'a>, around: &Surroundings<'_>) -> Result<Windows<'a>, Error> {
    let screens = display.nodes("screens", "Screen")?;
    if !screens.is_empty() {
        let with_corners = screens.into_iter().map(|s| corners(&s).map(|c| (s, c)));
        return Ok(Windows::Screens(with_corners.collect::<Result<_, _>>()?));
    }
    let frusta = display.get::<Arc<[Vec4]>>("frusta")?;
    match frusta.len() {
        0 => {}
        1 | 2 => return Ok(Windows::Headset(frusta)),
        count => return Err(display.error("frusta", RigError::FrustumCount { count })),
    }
    let viewpoint = display.node("viewpoint", "Viewpoint")?.map(|v| v.node);
    let missing = || match viewpoint {
        Some(_) => display.error("viewpoint", RigError::NotInWorld),
        None => display.error("screens", RigError::NoScreens),
    };
    (around.camera)(viewpoint).map(Windows::Camera).ok_or_else(missing)
}

fn corners(screen: &RigNode<'_>) -> Result<ScreenCorners, Error> {
    let corner = |field| screen.finite(field, |v: &Vec3| v.is_finite());
    Ok(ScreenCorners {
        lower_left: corner("lower_left")?,
        lower_right: corner("lower_right")?,
        upper_left: corner("upper_left")?,
    })
}

/// The user's head. A camera has its own place and takes only the distance of the eyes from the user, if there is one.
fn head(display: &RigNode<'_>, around: &Surroundings<'_>, windows: &Windows<'_>) -> Result<Head, Error> {
    let own = display.node("user", "User")?;
    let Some(user) = own.as_ref().or(around.user.as_ref()) else {
        return match windows {
            Windows::Camera(_) => Ok(Head::default()),
            _ => Err(display.error("user", RigError::NoUser)),
        };
    };
    let orientation = user.finite("orientation", |q: &Quat| q.is_finite() && q.length_squared() > 0.0)?;
    Ok(Head {
        position: user.finite("position", |v: &Vec3| v.is_finite())?,
        orientation: orientation.normalize(),
        eye_distance: user.finite("eye_distance", |v: &f32| v.is_finite())?,
    })
}

/// Pixels of each view: its share of the window, or what the display says.
fn size_of_view(display: &RigNode<'_>, window: Option<[u32; 2]>, grid: [u32; 2]) -> Result<[u32; 2], Error> {
    if let Some(window) = window {
        return Ok([0, 1].map(|i| (window[i] / grid[i].max(1)).clamp(1, SIZE_MAX)));
    }
    let size = display.get::<Vec2>("size")?;
    let fits = |s: f32| (1.0..=SIZE_MAX as f32).contains(&s);
    if fits(size.x) && fits(size.y) {
        Ok([size.x as u32, size.y as u32])
    } else {
        Err(display.error("size", RigError::Size { width: size.x, height: size.y, max: SIZE_MAX }))
    }
}

/// Views window after window, left eye first.
fn views(
    display: &RigNode<'_>,
    name: &str,
    windows: &Windows<'_>,
    head: &Head,
    eyes: &[Eye],
    near: f32,
    size: [u32; 2],
) -> Result<Vec<View>, Error> {
    let view = |eye: Eye, name: &str, (view_from_room, frustum): (Mat4, Frustum)| View {
        name: eye.name_of_view(name),
        view_from_world: view_from_room,
        frustum,
        size,
    };
    match windows {
        Windows::Screens(screens) => {
            let pairs = screens.iter().flat_map(|screen| eyes.iter().map(move |eye| (screen, *eye)));
            let one = |((screen, corners), eye): (&(RigNode<'_>, ScreenCorners), Eye)| {
                let seen = off_axis(head.eye(eye), corners, near).map_err(|reason| match reason {
                    RigError::Near { .. } => display.error("near", reason),
                    RigError::NoArea => screen.error("lower_right", reason),
                    RigError::NotRectangular { .. } => screen.error("upper_left", reason),
                    _ => screen.error("lower_left", reason),
                })?;
                Ok(view(eye, &screen.label(), seen))
            };
            pairs.map(one).collect()
        }
        Windows::Headset(frusta) => {
            let one = |(index, eye): (usize, &Eye)| {
                let frustum = from_tangents(index, frusta[index], near).map_err(|reason| match reason {
                    RigError::Near { .. } => display.error("near", reason),
                    _ => display.error("frusta", reason),
                })?;
                let room_from_view = Mat4::from_rotation_translation(head.orientation, head.eye(*eye));
                Ok(view(*eye, name, (room_from_view.inverse(), frustum)))
            };
            eyes.iter().enumerate().map(one).collect()
        }
        Windows::Camera(camera) => {
            let one = |eye: &Eye| {
                let seen = camera.eye(*eye, head.eye_distance, size).map_err(|reason| display.error("viewpoint", reason))?;
                Ok(view(*eye, name, seen))
            };
            eyes.iter().map(one).collect()
        }
    }
}

/// The frustum of tangents of the angles to the left, right, bottom and top edge, as OpenXR gives them: left and bottom are
/// negative as a rule.
fn from_tangents(index: usize, tangents: Vec4, near: f32) -> Result<Frustum, RigError> {
    if !(near.is_finite() && near > 0.0) {
        return Err(RigError::Near { near });
    }
    let [left, right, bottom, top] = (tangents * near).to_array();
    if !(tangents.is_finite() && left < right && bottom < top) {
        return Err(RigError::Frustum { index, value: tangents });
    }
    Ok(Frustum { left, right, bottom, top, near })
}
