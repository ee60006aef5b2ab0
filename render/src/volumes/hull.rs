//! Convex hulls of a few points, and whether two of them are apart.

use glam::{DVec3, DVec4};
use umbriel_scene::Aabb;

/// Is there a gap of more than `margin` metres between the hulls of `a` and of `b` across one of `axes`?
///
/// Points have w = 1; directions, towards which a hull goes on without end, have w = 0. Two convex polytopes are apart
/// exactly if they are so across a normal of one of their faces or a product of one edge of each (Gottschalk 1996); with
/// fewer axes the answer is still never a wrong yes.
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
            // A direction within rounding of the axis' own plane may go either way.
            let slack = 1e-9 * p.truncate().length();
            if x > -slack {
                high = f64::INFINITY;
            }
            if x < slack {
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
