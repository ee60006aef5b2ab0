//! X3D `Sphere`.

use super::builder::{Builder, around_y};
use glam::{Vec3, vec2};
use umbriel_scene::Mesh;

/// A sphere around the origin: `segments` around the y axis (at least 3), half as many from pole to pole. `radius` in metres.
pub fn sphere(radius: f32, segments: u32) -> Mesh {
    let segments = segments.max(3);
    let rings = (segments / 2).max(2);
    let mut b = Builder::default();
    let mut rows: Vec<Vec<u32>> = Vec::with_capacity(rings as usize + 1);
    for ring in 0..=rings {
        let from_top_rad = std::f32::consts::PI * ring as f32 / rings as f32;
        let (sin, cos) = match ring {
            0 => (0.0, 1.0),
            r if r == rings => (0.0, -1.0),
            _ => from_top_rad.sin_cos(),
        };
        let v = ring as f32 / rings as f32;
        // One vertex more than segments: the seam has u = 0 and u = 1 at the same place.
        let row = (0..=segments).map(|s| {
            let normal = around_y(s, segments) * sin + Vec3::Y * cos;
            b.vertex(normal * radius, normal, vec2(s as f32 / segments as f32, v))
        });
        rows.push(row.collect());
    }
    for ring in 0..rings as usize {
        let (above, below) = (&rows[ring], &rows[ring + 1]);
        for s in 0..segments as usize {
            if ring > 0 {
                b.triangle(above[s], below[s], above[s + 1]);
            }
            if ring + 1 < rings as usize {
                b.triangle(above[s + 1], below[s], below[s + 1]);
            }
        }
    }
    b.finish("Sphere")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::check::{closed, outward, volume};

    #[test]
    fn spheres_are_closed_and_face_outward() {
        for (radius, segments) in [(1.0, 48), (0.37, 3), (250.0, 7), (1.0, 4), (2.0, 0)] {
            let mesh = sphere(radius, segments);
            closed(&mesh);
            outward(&mesh);
            assert!(mesh.positions.iter().all(|p| (p.length() / radius - 1.0).abs() < 1e-5));
        }
        let exact = 4.0 / 3.0 * std::f32::consts::PI;
        let found = volume(&sphere(1.0, 96));
        assert!((found / exact - 1.0).abs() < 5e-3, "{found} against {exact}");
    }
}
