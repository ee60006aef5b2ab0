//! The surface that a picture with depth saw (004 section 4.2, figures 19 to 24).

use super::builder::Builder;
use glam::{Vec3, vec2};
use umbriel_scene::{Image, Mesh};

/// Vertices along the longer side; larger pictures are read at so many places.
const MOST_VERTICES: u32 = 512;

/// How a picture of depth was taken: by a camera at the origin that looked along -z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthCamera {
    /// Whole vertical angle, radians.
    pub fov_rad: f32,
    /// Distance along -z where the picture is black, metres.
    pub near: f32,
    /// The same where it is white.
    pub far: f32,
}

/// A grid of vertices, one for each pixel's middle, with the picture's texture coordinates. Depth is 256 times red plus green,
/// as a share of 65535, so that grey pictures of eight bits serve as well. At least 2 x 2 pixels.
pub fn depth_picture(depth: &Image, camera: DepthCamera) -> Mesh {
    let [width, height] = [depth.width, depth.height];
    let step = width.max(height).div_ceil(MOST_VERTICES).max(1);
    let [columns, rows] = [width, height].map(|n| n.div_ceil(step));
    let tangent = (camera.fov_rad * 0.5).tan();
    let aspect = width as f32 / height as f32;
    let point = |column: u32, row: u32| {
        // The last row and column are those of the picture, whatever the step.
        let (x, y) = ((column * step).min(width - 1), (row * step).min(height - 1));
        let at = 4 * (y as usize * width as usize + x as usize);
        let share = (f32::from(depth.rgba[at]) * 256.0 + f32::from(depth.rgba[at + 1])) / 65535.0;
        let distance = camera.near + (camera.far - camera.near) * share;
        let uv = vec2((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
        (Vec3::new((2.0 * uv.x - 1.0) * tangent * aspect, (1.0 - 2.0 * uv.y) * tangent, -1.0) * distance, uv)
    };
    let mut b = Builder::default();
    for row in 0..rows {
        for column in 0..columns {
            let (here, uv) = point(column, row);
            let across = point((column + 1).min(columns - 1), row).0 - point(column.max(1) - 1, row).0;
            let up = point(column, row.max(1) - 1).0 - point(column, (row + 1).min(rows - 1)).0;
            b.vertex(here, across.cross(up).normalize_or(Vec3::Z), uv);
        }
    }
    for row in 1..rows {
        for column in 1..columns {
            let corner = |c: u32, r: u32| r * columns + c;
            b.quad([corner(column - 1, row), corner(column, row), corner(column, row - 1), corner(column - 1, row - 1)]);
        }
    }
    b.finish("DepthPicture")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_stand_where_the_camera_saw_them() {
        let camera = DepthCamera { fov_rad: std::f32::consts::FRAC_PI_2, near: 2.0, far: 10.0 };
        // Grey: black, white; sixteen bits: a quarter, a half.
        let rgba = [[0, 0, 0, 255], [255, 255, 255, 255], [64, 0, 0, 255], [128, 0, 0, 255]].concat();
        let mesh = depth_picture(&Image { width: 2, height: 2, rgba: rgba.into() }, camera);
        let expected = [(-0.5, 0.5, 2.0), (0.5, 0.5, 10.0), (-0.5, -0.5, 4.0), (0.5, -0.5, 6.0)];
        for (found, (x, y, distance)) in mesh.positions.iter().zip(expected) {
            assert!(found.distance(Vec3::new(x, y, -1.0) * distance) < 2e-3, "{found} instead of {x} {y} at {distance}");
        }
        assert_eq!((mesh.triangle_count(), mesh.uv0[1]), (2, vec2(0.75, 0.25)));
        let flat = depth_picture(&Image { width: 1500, height: 4, rgba: vec![100; 24_000].into() }, camera);
        assert!(flat.positions.len() <= 2 * 512 && flat.clone().checked().is_ok());
        assert!(flat.normals.iter().all(|n| n.abs_diff_eq(Vec3::Z, 1e-4)));
    }
}
