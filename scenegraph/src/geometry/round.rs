//! X3D `Cylinder` and `Cone`.

use super::builder::{Builder, around_y};
use glam::{Vec3, vec2};
use umbriel_scene::Mesh;

/// Which parts of a cylinder there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CylinderParts {
    /// The round side.
    pub side: bool,
    /// The disc above.
    pub top: bool,
    /// The disc below.
    pub bottom: bool,
}

/// Which parts of a cone there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConeParts {
    /// The round side.
    pub side: bool,
    /// The disc below.
    pub bottom: bool,
}

/// A cylinder around the y axis, centred at the origin; `segments` around (at least 3). Closed if all parts are there.
pub fn cylinder(radius: f32, height: f32, segments: u32, parts: CylinderParts) -> Mesh {
    let n = segments.max(3);
    let half = Vec3::Y * (height * 0.5);
    let mut b = Builder::default();
    if parts.side {
        let columns: Vec<[u32; 2]> = (0..=n)
            .map(|s| {
                let (normal, u) = (around_y(s, n), s as f32 / n as f32);
                [half, -half].map(|y| b.vertex(normal * radius + y, normal, vec2(u, if y.y > 0.0 { 0.0 } else { 1.0 })))
            })
            .collect();
        for pair in columns.windows(2) {
            b.quad([pair[0][0], pair[0][1], pair[1][1], pair[1][0]]);
        }
    }
    if parts.top {
        disc(&mut b, radius, half, Vec3::Y, n);
    }
    if parts.bottom {
        disc(&mut b, radius, -half, Vec3::NEG_Y, n);
    }
    b.finish("Cylinder")
}

/// A cone around the y axis, its tip up, centred at half its height; `segments` around (at least 3). Closed if both parts
/// are there.
pub fn cone(bottom_radius: f32, height: f32, segments: u32, parts: ConeParts) -> Mesh {
    let n = segments.max(3);
    let half = Vec3::Y * (height * 0.5);
    let mut b = Builder::default();
    if parts.side {
        let slope = |around: Vec3| (around * height + Vec3::Y * bottom_radius).normalize_or(Vec3::Y);
        for s in 0..n {
            let (left, right) = (around_y(s, n), around_y(s + 1, n));
            let (u0, u1) = (s as f32 / n as f32, (s + 1) as f32 / n as f32);
            let tip = b.vertex(half, slope(left + right), vec2((u0 + u1) * 0.5, 0.0));
            let a = b.vertex(left * bottom_radius - half, slope(left), vec2(u0, 1.0));
            let c = b.vertex(right * bottom_radius - half, slope(right), vec2(u1, 1.0));
            b.triangle(tip, a, c);
        }
    }
    if parts.bottom {
        disc(&mut b, bottom_radius, -half, Vec3::NEG_Y, n);
    }
    b.finish("Cone")
}

/// A disc of `n` triangles around its centre, facing `normal` (+y or -y).
fn disc(b: &mut Builder, radius: f32, centre: Vec3, normal: Vec3, n: u32) {
    let middle = b.vertex(centre, normal, vec2(0.5, 0.5));
    let rim: Vec<u32> = (0..n)
        .map(|s| {
            let out = around_y(s, n);
            b.vertex(out * radius + centre, normal, vec2(0.5 + 0.5 * out.x, 0.5 + 0.5 * out.z * normal.y))
        })
        .collect();
    for s in 0..n as usize {
        let (a, c) = (rim[s], rim[(s + 1) % n as usize]);
        if normal.y > 0.0 { b.triangle(middle, a, c) } else { b.triangle(middle, c, a) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::check::{border_edges, closed, outward, volume};
    use std::f32::consts::PI;

    const WHOLE: CylinderParts = CylinderParts { side: true, top: true, bottom: true };

    #[test]
    fn whole_cylinders_and_cones_are_closed_and_face_outward() {
        for (radius, height, segments) in [(1.0, 2.0, 48), (0.1, 9.0, 3), (33.3, 0.2, 7), (1.0, 1.0, 0)] {
            for mesh in [
                cylinder(radius, height, segments, WHOLE),
                cone(radius, height, segments, ConeParts { side: true, bottom: true }),
            ] {
                closed(&mesh);
                outward(&mesh);
                assert_eq!(mesh.bounds.max.y, height * 0.5);
            }
        }
    }

    #[test]
    fn volumes_are_those_of_the_solids() {
        let rows = [
            (cylinder(2.0, 3.0, 256, WHOLE), PI * 4.0 * 3.0),
            (cone(2.0, 3.0, 256, ConeParts { side: true, bottom: true }), PI * 4.0),
        ];
        for (mesh, exact) in rows {
            assert!((volume(&mesh) / exact - 1.0).abs() < 1e-3, "{}", mesh.name);
        }
    }

    #[test]
    fn a_missing_part_leaves_its_rim_open() {
        let part = |side, top, bottom| CylinderParts { side, top, bottom };
        let rows = [
            (cylinder(1.0, 1.0, 8, part(true, false, true)), 8),
            (cylinder(1.0, 1.0, 8, part(true, false, false)), 16),
            (cylinder(1.0, 1.0, 8, part(false, true, false)), 8),
            (cone(1.0, 1.0, 8, ConeParts { side: true, bottom: false }), 8),
            (cone(1.0, 1.0, 8, ConeParts { side: false, bottom: false }), 0),
        ];
        for (mesh, expected) in rows {
            assert_eq!(border_edges(&mesh), expected, "{}", mesh.name);
        }
    }
}
