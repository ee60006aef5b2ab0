//! X3D `Box`.

use super::builder::Builder;
use glam::{Vec3, vec2};
use umbriel_scene::Mesh;

/// A box around the origin with six flat faces. `size` is in metres along x, y, z.
pub fn cuboid(size: Vec3) -> Mesh {
    let half = size * 0.5;
    let mut b = Builder::default();
    // Normal, then the direction in which u grows, for each face; v grows along normal x u, negated (v is down).
    let faces = [
        (Vec3::X, Vec3::NEG_Z),
        (Vec3::NEG_X, Vec3::Z),
        (Vec3::Y, Vec3::X),
        (Vec3::NEG_Y, Vec3::X),
        (Vec3::Z, Vec3::X),
        (Vec3::NEG_Z, Vec3::NEG_X),
    ];
    for (normal, right) in faces {
        let up = normal.cross(right);
        let corner = |u: f32, v: f32| half * (normal + right * u + up * v);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(u, v)| b.vertex(corner(u, v), normal, vec2(0.5 + 0.5 * u, 0.5 - 0.5 * v)));
        b.quad(corners);
    }
    b.finish("Box")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::check::{closed, outward, volume};
    use glam::vec3;

    #[test]
    fn boxes_are_closed_and_face_outward() {
        for size in [Vec3::splat(2.0), vec3(0.1, 3.0, 77.7), vec3(1e-3, 1e3, 0.3)] {
            let mesh = cuboid(size);
            assert_eq!(mesh.triangle_count(), 12, "{size}");
            closed(&mesh);
            outward(&mesh);
            let expected = size.x * size.y * size.z;
            assert!((volume(&mesh) / expected - 1.0).abs() < 1e-5, "{size}");
            assert_eq!((mesh.bounds.min, mesh.bounds.max), (-size * 0.5, size * 0.5));
        }
    }
}
