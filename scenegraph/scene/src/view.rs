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

impl Frustum {
    /// Conventional projection with its far plane at infinity: depth 0 at the near plane, `1 - epsilon` at infinity, so that
    /// rounding takes no point with w = 0 beyond 1, where it would be clipped. `epsilon` 2^-22 does.
    ///
    /// Equations 1 to 7 of 002, which its text lacks, for a camera that looks along -z, with n and f the near and far
    /// distance and P' the rows of depth and w:
    /// 1. With a far plane: `z_clip = -f / (f - n) z - f n / (f - n)`, `w_clip = -z`.
    /// 2. As f goes to infinity: `z_clip = -z - n`.
    /// 3. Depth D in 0..=1 shall become D' in 0..=1 - e: `D' = (1 - e) D`.
    /// 4. A point A is seen at `D = z_clip / w_clip = (-z - n w) / -z`; a direction (w = 0) at D = 1 exactly.
    /// 5. With `D = z_clip / w_clip` and `D' = z_clip' / w_clip`: `z_clip' = (1 - e) z_clip`.
    /// 6. By 2 and 4: `z_clip' = (e - 1) z + n (e - 1) w`, which at infinity is `(1 - e) w_clip`, below w_clip by more than
    ///    rounding takes away.
    ///    Once a view's matrix is multiplied in, terms as large as 1 cancel each other, and 2^-22 (for a lone projection) may be lost:
    ///    2^-12 is not, and takes a four-thousandth of the range of depths.
    /// 7. So the row of depth is `[0, 0, e - 1, n (e - 1)]`, and all others stay.
    pub fn clip_from_view_conventional(&self, epsilon: f32) -> Mat4 {
        let mut clip_from_view = self.clip_from_view();
        clip_from_view.z_axis.z = epsilon - 1.0;
        clip_from_view.w_axis.z = self.near * (epsilon - 1.0);
        clip_from_view
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3, Vec4};

    /// What is thrown to infinity in 300 random views: how many views clip something of it behind their far plane.
    #[test]
    fn nothing_at_infinity_is_clipped() {
        let mut seed = 5u64;
        let mut random = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 40) as f32 / (1u64 << 24) as f32 * 2.0 - 1.0
        };
        let mut clipped = [0; 3];
        for _ in 0..300 {
            let near = 10f32.powf(random() * 2.0 - 1.0);
            let (x, y) = (random() * near, random() * near);
            let (across, down) = ((1.2 + random()) * near, (1.2 + random()) * near);
            let frustum = Frustum { left: x - across, right: x + across, bottom: y - down, top: y + down, near };
            let turn = Quat::from_xyzw(random(), random(), random(), random()).normalize();
            let eye = 1000.0 * Vec3::new(random(), random(), random());
            let view_from_world = Mat4::from_quat(turn) * Mat4::from_translation(-eye);
            let epsilon = (-22f32).exp2();
            let projections = [
                frustum.clip_from_view(),
                frustum.clip_from_view_conventional(epsilon),
                frustum.clip_from_view_conventional(0.0),
            ];
            let mut is_clipped = [false; 3];
            for _ in 0..300 {
                let direction = Vec4::new(random(), random(), random(), 0.0);
                for (projection, is_clipped) in projections.iter().zip(&mut is_clipped) {
                    let p = (projection * view_from_world) * direction;
                    let is_in_sight = p.w > 0.0 && p.x.abs() <= p.w && p.y.abs() <= p.w;
                    *is_clipped |= is_in_sight && !(0.0..=p.w).contains(&p.z);
                }
            }
            clipped.iter_mut().zip(is_clipped).for_each(|(n, c)| *n += i32::from(c));
        }
        let [reversed, conventional, without_epsilon] = clipped;
        assert_eq!((reversed, conventional), (0, 0));
        let frustum = Frustum::symmetric(1.0, 1.0, 0.5);
        let depth = |p: Vec3| frustum.clip_from_view_conventional(0.25).project_point3(p).z;
        assert_eq!((depth(Vec3::NEG_Z * 0.5), depth(Vec3::NEG_Z), depth(Vec3::NEG_Z * 2e9)), (0.0, 0.375, 0.75));
        println!("{without_epsilon} of 300 views clip without epsilon");
    }
}
