//! From where a scene is seen, and how views make a picture.

use glam::Mat4;

/// One eye looking through one window.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Name, such as `front_wall.left`.
    pub name: String,
    /// Camera space has -z ahead, +y up.
    pub view_from_world: Mat4,
    /// What the window spans.
    pub frustum: Frustum,
    /// Pixels across and down.
    pub size: [u32; 2],
}

/// An off-axis frustum: the window at distance `near`, in camera space, metres (as `glFrustum`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frustum {
    /// Left edge.
    pub left: f32,
    /// Right edge.
    pub right: f32,
    /// Bottom edge.
    pub bottom: f32,
    /// Top edge.
    pub top: f32,
    /// Distance of the near plane.
    pub near: f32,
}

impl Frustum {
    /// The symmetric frustum of a camera. `fovy_rad` is the whole vertical angle; `aspect` is width over height.
    pub fn symmetric(fovy_rad: f32, aspect: f32, near: f32) -> Frustum {
        let top = near * (fovy_rad * 0.5).tan();
        Frustum { left: -top * aspect, right: top * aspect, bottom: -top, top, near }
    }

    /// Reversed-depth projection with its far plane at infinity: depth 1 at the near plane, 0 at infinity, so that
    /// points with w = 0 are never clipped (002, with the depth range reversed).
    pub fn clip_from_view(&self) -> Mat4 {
        let Frustum { left: l, right: r, bottom: b, top: t, near: n } = *self;
        Mat4::from_cols_array_2d(&[
            [2.0 * n / (r - l), 0.0, 0.0, 0.0],
            [0.0, 2.0 * n / (t - b), 0.0, 0.0],
            [(r + l) / (r - l), (t + b) / (t - b), 0.0, -1.0],
            [0.0, 0.0, n, 0.0],
        ])
    }
}

/// What is drawn into a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PictureKind {
    /// The world as it looks.
    #[default]
    Colour,
    /// White where the numbered light of the scene is not shadowed, black where it is; the background is black. Cone,
    /// distance and orientation do not count; shapes with alpha mode blend are left out, but still cast.
    LightVisibility(usize),
}

/// One rendered target: a window's content, a file, the layers of a headset.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Name, such as that of the display.
    pub name: String,
    /// Pixels across and down of the whole target (of each layer, for [`Layout::Layers`]).
    pub size: [u32; 2],
    /// Its views. Stereo layouts take the left eye first.
    pub views: Vec<View>,
    /// How the views are put together.
    pub layout: Layout,
    /// What is drawn.
    pub kind: PictureKind,
}

/// How the views of a picture are put together.
#[derive(Clone, Debug, PartialEq)]
pub enum Layout {
    /// Each view at its own place: one rectangle per view. Mono, side by side, top and bottom, rows of channels.
    Tiles(Vec<Rect>),
    /// Red from the left eye, green and blue from the right one. Both views have the picture's size.
    Anaglyph,
    /// Each view is a layer of an array of `size`.
    Layers,
}

/// A rectangle of pixels, from the top left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// From the left.
    pub x: u32,
    /// From the top.
    pub y: u32,
    /// Across.
    pub width: u32,
    /// Down.
    pub height: u32,
}

impl Picture {
    /// A picture of one view that fills it.
    pub fn mono(view: View) -> Picture {
        let [width, height] = view.size;
        Picture {
            name: view.name.clone(),
            size: view.size,
            views: vec![view],
            layout: Layout::Tiles(vec![Rect { x: 0, y: 0, width, height }]),
            kind: PictureKind::Colour,
        }
    }
}
