//! Convex hulls of a few points, and whether two of them are apart.

use glam::{DVec3, DVec4};
use umbriel_scene::Aabb;

/// Is there a gap of more than `margin` metres between the hulls of `a` and of `b` across one of `axes`?
///
/// Points have w = 1; directions, towards which a hull goes on without end, have w = 0, and one of the hulls at most has some.
/// Two convex polytopes are apart exactly if they are so across a normal of one of their faces or a product of one edge of each
/// (Gottschalk 1996); with fewer axes the answer is still never a wrong yes.
pub(super) fn are_apart(a: &[DVec4], b: &[DVec4], axes: impl IntoIterator<Item = DVec3>, margin: f64) -> bool {
    axes.into_iter().filter_map(DVec3::try_normalize).any(|axis| {
        let (a, b) = (extent(a, axis), extent(b, axis));
        a.0 > b.1 + margin || b.0 > a.1 + margin
    })
}

/// Smallest and largest coordinate of a hull along a unit vector.
pub(super) fn extent(points: &[DVec4], axis: DVec3) -> (f64, f64) {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for p in points {
        let x = p.truncate().dot(axis);
        if p.w != 0.0 {
            (low, high) = (low.min(x), high.max(x));
        } else {
            // What runs along the axis' own plane stays where it is. Rounding takes it out of the plane by 1e-9 of its way at most,
            // and as far as the other hull goes, margins hold a thousand times that.
            let along = 1e-9 * p.truncate().length();
            if x > along {
                high = f64::INFINITY;
            } else if x < -along {
                low = f64::NEG_INFINITY;
            }
        }
    }
    (low, high)
}

/// The corners of a box.
pub(super) fn corners(b: &Aabb) -> [DVec4; 8] {
    b.corners().map(|c| c.as_dvec3().extend(1.0))
}

/// Is all of a hull behind a plane (unit normal in xyz, inward), by more than `margin` metres?
pub(super) fn is_behind(points: &[DVec4], plane: DVec4, margin: f64) -> bool {
    points.iter().all(|p| plane.dot(*p) < if p.w == 0.0 { -1e-6 * p.truncate().length() } else { -margin })
}

/// The edges of a box, by the places of their ends among its corners.
pub(super) fn edges() -> impl Iterator<Item = (usize, usize)> {
    (0..8).flat_map(|i| [1, 2, 4].map(|bit| (i, i | bit))).filter(|(i, j)| i != j)
}

/// How far a point is on the inner side of a plane (unit normal inward).
pub(super) fn height(plane: &DVec4, p: DVec3) -> f64 {
    plane.dot(p.extend(1.0))
}

/// The six planes around a box, normals inward.
pub(super) fn planes(b: &Aabb) -> [DVec4; 6] {
    let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
    std::array::from_fn(|i| {
        let axis = DVec3::AXES[i % 3];
        if i < 3 { axis.extend(-axis.dot(min)) } else { (-axis).extend(axis.dot(max)) }
    })
}

/// How far numbers of this size are from what they stand for, metres: the GPU places vertices in single precision.
pub(super) fn margin(points: &[DVec4]) -> f64 {
    let largest = points.iter().map(|p| p.truncate().abs().max_element() * p.w).fold(0.0, f64::max);
    1e-5 * largest + 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A window of 20 cm at the origin, and all of the way from it to a sun.
    #[test]
    fn what_goes_on_without_end_passes_beside_boxes() {
        let towards = DVec3::new(0.55, 0.62, 0.45);
        let window = [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)].map(|(x, y)| DVec4::new(x, y, -0.1, 1.0));
        let beam: Vec<DVec4> = window.into_iter().chain([towards.extend(0.0)]).collect();
        let axes = || DVec3::AXES.into_iter().chain(DVec3::AXES.map(|edge| towards.cross(edge)));
        let is_apart = |centre: DVec3, half: f64| {
            let (centre, half) = (centre.as_vec3(), Vec3::splat(half as f32));
            are_apart(&beam, &corners(&Aabb { min: centre - half, max: centre + half }), axes(), 1e-3)
        };
        for way in [1.0, 10.0, 1000.0] {
            let on_it = towards * way;
            assert!(!is_apart(on_it, 0.5), "on it, at {way}");
            for side in [DVec3::X, DVec3::NEG_Y, DVec3::new(1.0, -1.0, 1.0)] {
                assert!(is_apart(on_it + 2.0 * side, 0.5), "beside it by {side}, at {way}");
            }
            assert!(is_apart(-on_it, 0.5), "on the other side of the window, at {way}");
        }
    }
}
