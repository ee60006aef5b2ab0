//! A flat rectangle.

use super::builder::Builder;
use glam::{Vec2, Vec3, vec2, vec3};
use umbriel_scene::Mesh;

/// A rectangle in the xz plane around the origin, facing +y, of `segments` x `segments` squares (at least 1). `size` in
/// metres along x and z.
pub fn plane(size: Vec2, segments: u32) -> Mesh {
    let n = segments.max(1);
    let mut b = Builder::default();
    let mut place = Vec::with_capacity((n as usize + 1).pow(2));
    for row in 0..=n {
        for column in 0..=n {
            let uv = vec2(column as f32, row as f32) / n as f32;
            let p = vec3((uv.x - 0.5) * size.x, 0.0, (uv.y - 0.5) * size.y);
            place.push(b.vertex(p, Vec3::Y, uv));
        }
    }
    let at = |column: u32, row: u32| place[(row * (n + 1) + column) as usize];
    for row in 0..n {
        for column in 0..n {
            b.quad([at(column, row), at(column, row + 1), at(column + 1, row + 1), at(column + 1, row)]);
        }
    }
    b.finish("Plane")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::check::{border_edges, outward_along, triangle_areas};

    #[test]
    fn planes_face_up_and_have_one_border() {
        for (size, segments) in [(vec2(2.0, 2.0), 1), (vec2(30.0, 0.5), 5), (vec2(1.0, 1.0), 0)] {
            let mesh = plane(size, segments);
            outward_along(&mesh, |_| Vec3::Y);
            assert_eq!(border_edges(&mesh), 4 * segments.max(1) as usize);
            let area: f32 = triangle_areas(&mesh).sum();
            assert!((area / (size.x * size.y) - 1.0).abs() < 1e-5);
            assert_eq!(mesh.bounds.max, vec3(size.x / 2.0, 0.0, size.y / 2.0));
        }
    }
}
