//! How far volumes are thrown: to infinity (002), or until nothing is left that could receive.

use super::{TurnedBox, VolumeLight, hull};
use glam::{DVec3, DVec4};
use umbriel_scene::Aabb;

/// How far the volume of one caster is thrown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reach {
    /// Metres of parallel light; of a lamp the multiple of a vertex' distance from it. May be infinite. Beyond, nothing
    /// receives.
    pub(super) times: f64,
    /// How far it is drawn: parallel light that nothing else bounds goes on without end, where each side is one triangle
    /// instead of two, and no end needs a cap.
    pub(super) drawn: f64,
    /// The plane behind which all of the end lies and in front of which all receivers are; none where an end short of
    /// infinity may be in front of a receiver.
    pub(super) behind: Option<DVec4>,
}

impl Reach {
    pub(super) const INFINITE: Reach = Reach { times: f64::INFINITY, drawn: f64::INFINITY, behind: None };

    /// Does what is drawn end?
    pub(super) fn has_end(&self) -> bool {
        self.drawn != f64::INFINITY
    }

    /// For the shader; 0 is infinity.
    pub(super) fn w(&self) -> f32 {
        (1.0 / self.drawn) as f32
    }
}

/// Where the volume of a caster with these bounds ends; `None` where its shadow falls on nothing.
///
/// An end is behind a plane for all of the caster once the corner of its box that is last to cross has crossed. Ends lie
/// where that happens first: behind one of the planes around all receivers or the light's lower plane (sea level, 001
/// section 5.2), beyond the range of a lamp (against ghost shadows, 002), or at the length that the author set.
pub(super) fn reach(light: &VolumeLight, bounds: &TurnedBox, receivers: &Aabb) -> Option<Reach> {
    if bounds.in_world.is_empty() {
        return Some(Reach::INFINITE);
    }
    let corners = bounds.corners;
    let margin = hull::margin(&corners) + 1e-3 * f64::from(bounds.in_world.radius());
    let toward = light.toward_light.as_dvec4();
    let settings = &light.settings;
    let mut found = Reach::INFINITE;
    let mut end = |times: f64, behind: Option<DVec4>| {
        if times < found.times {
            let drawn = if toward.w == 0.0 && behind.is_some() { f64::INFINITY } else { times };
            found = Reach { times, drawn, behind };
        }
    };
    let fitted = settings.fitted && !receivers.is_empty();
    let around = if fitted { hull::planes(receivers).map(|p| (p, true)).to_vec() } else { Vec::new() };
    let floor = settings.lower_plane.map(|p| (p.as_dvec4(), false));
    for (plane, is_soft) in around.into_iter().chain(floor) {
        // Moved out a little, so that what lies in the plane is well in front of it.
        let plane = plane + DVec4::W * margin;
        let times = times_behind(&corners, plane, toward);
        if times <= 0.0 {
            return None;
        }
        end(times * (1.0 + 1e-5), is_soft.then_some(plane));
    }
    let nearest = distance(&bounds.in_world, toward.truncate());
    if toward.w != 0.0 && light.range.is_finite() {
        let range = f64::from(light.range);
        if nearest > range {
            return None;
        }
        end(1.001 * range / nearest, None);
    }
    if settings.length.is_finite() {
        let length = f64::from(settings.length);
        end(if toward.w == 0.0 { length } else { (nearest + length) / nearest }, None);
    }
    // Beyond this, w is lost in single precision next to the vertex.
    Some(if found.times < 1e7 { found } else { Reach::INFINITE })
}

/// How far all corners must be thrown to be behind a plane; infinite where they never all are, 0 where they are before
/// they are thrown and stay there.
fn times_behind(corners: &[DVec4], plane: DVec4, toward: DVec4) -> f64 {
    let heights = corners.iter().map(|c| plane.dot(*c));
    if toward.w == 0.0 {
        let sinks = plane.truncate().dot(toward.truncate());
        let highest = heights.fold(f64::NEG_INFINITY, f64::max);
        return match sinks > 1e-6 {
            true => (highest / sinks).max(0.0),
            false if highest < 0.0 && sinks >= 0.0 => 0.0,
            false => f64::INFINITY,
        };
    }
    // Height over the plane at `times` is `light + (corner - light) * times`.
    let light = plane.dot(toward);
    let slowest = heights.map(|h| light - h).fold(f64::INFINITY, f64::min);
    if slowest <= 0.0 {
        return f64::INFINITY;
    }
    let times = light / slowest;
    if times <= 1.0 { 0.0 } else { times }
}

/// Distance from a point to a box, metres.
fn distance(b: &Aabb, p: DVec3) -> f64 {
    p.distance(p.clamp(b.min.as_dvec3(), b.max.as_dvec3()))
}

/// The caster's box, and where it is thrown to: points, or directions (w = 0) where that is infinity. The volume lies in
/// the convex hull, since what a box is thrown to at any distance lies between its beginning and its end.
pub(super) fn swept(corners: &[DVec4; 8], toward: DVec4, reach: &Reach) -> [DVec4; 16] {
    let w = 1.0 / reach.times;
    let away = |c: DVec4| match (toward.w == 0.0, w == 0.0) {
        (true, true) => (-toward.truncate()).extend(0.0),
        (true, false) => (c.truncate() - toward.truncate() * reach.times).extend(1.0),
        (false, true) => (c.truncate() - toward.truncate()).extend(0.0),
        (false, false) => (toward.truncate() + (c.truncate() - toward.truncate()) * reach.times).extend(1.0),
    };
    std::array::from_fn(|i| if i < 8 { corners[i] } else { away(corners[i - 8]) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec3, Vec4};
    use umbriel_scene::VolumeSettings;

    /// A box of 2 m at a height of 5 m over receivers that span 20 m each way, down to -1.
    #[test]
    fn ends_are_where_nothing_receives_any_more() {
        let sun = |x: f32, y: f32| Vec3::new(x, y, 0.0).normalize().extend(0.0);
        let lamp = |y: f32| Vec4::new(0.0, y, 0.0, 1.0);
        let wide = VolumeSettings::default();
        let plain = VolumeSettings { fitted: false, ..wide };
        let sea = VolumeSettings { lower_plane: Some(Vec4::new(0.0, 1.0, 0.0, 0.0)), ..plain };
        let short = VolumeSettings { length: 3.0, ..plain };
        let inf = f32::INFINITY;
        /// Name, light, range, settings, how far, is an end in front of receivers ruled out.
        type Row = (&'static str, Vec4, f32, VolumeSettings, Option<f64>, bool);
        let rows: [Row; 16] = [
            ("sun above", sun(0.0, 1.0), inf, wide, Some(7.0), true),
            ("sun aslant", sun(1.0, 1.0), inf, wide, Some(7.0 * 2f64.sqrt()), true),
            ("low sun leaves at the side", sun(1.0, 0.1), inf, wide, Some(11.0 * 1.01f64.sqrt()), true),
            ("sun, not fitted", sun(0.0, 1.0), inf, plain, Some(f64::INFINITY), false),
            ("sun, sea level", sun(0.0, 1.0), inf, sea, Some(6.0), false),
            ("sun from below the sea", sun(0.0, -1.0), inf, sea, Some(f64::INFINITY), false),
            ("sun, three metres", sun(0.0, 1.0), inf, short, Some(3.0), false),
            ("lamp above", lamp(10.0), inf, wide, Some(11.0 / 4.0), true),
            ("lamp, not fitted", lamp(10.0), inf, plain, Some(f64::INFINITY), false),
            ("lamp of 8 m", lamp(10.0), 8.0, plain, Some(2.002), false),
            ("lamp of 3 m", lamp(10.0), 3.0, wide, None, false),
            ("lamp, three metres", lamp(10.0), inf, short, Some(7.0 / 4.0), false),
            ("lamp in the box", lamp(5.0), inf, wide, Some(f64::INFINITY), false),
            ("lamp in the box with a range", lamp(5.0), 8.0, wide, Some(f64::INFINITY), false),
            ("lamp below, up to the ceiling", lamp(0.0), inf, wide, Some(10.0 / 4.0), true),
            ("lamp under the sea", lamp(-1.0), inf, sea, Some(f64::INFINITY), false),
        ];
        let bounds = TurnedBox::straight(Aabb { min: Vec3::new(-1.0, 4.0, -1.0), max: Vec3::new(1.0, 6.0, 1.0) });
        let receivers = Aabb { min: Vec3::new(-10.0, -1.0, -10.0), max: Vec3::splat(10.0) };
        for (name, toward_light, range, settings, expected, is_soft) in rows {
            let light = VolumeLight { toward_light, range, cone: None, settings };
            let found = reach(&light, &bounds, &receivers);
            let times = found.map(|r| r.times);
            let near = times == expected || times.zip(expected).is_some_and(|(a, b)| (a - b).abs() < 0.01 * b);
            assert!(near, "{name}: {found:?}, not {expected:?}");
            assert_eq!(found.is_some_and(|r| r.behind.is_some()), is_soft, "{name}");
        }
        // Nothing receives what is thrown upward from the top of the world, or sideways out of it.
        for toward_light in [sun(0.0, -1.0), lamp(0.0), sun(-1.0, -1.0)] {
            let light = VolumeLight { toward_light, range: inf, cone: None, settings: wide };
            let above = TurnedBox::straight(Aabb { min: Vec3::new(-1.0, 14.0, -1.0), max: Vec3::new(1.0, 16.0, 1.0) });
            assert_eq!(reach(&light, &above, &receivers), None, "{toward_light}");
        }
        let light = VolumeLight { toward_light: sun(0.0, 1.0), range: inf, cone: None, settings: wide };
        assert_eq!(reach(&light, &TurnedBox::straight(Aabb::EMPTY), &receivers), Some(Reach::INFINITE), "unknown bounds");
        assert_eq!(reach(&light, &bounds, &Aabb::EMPTY), Some(Reach::INFINITE), "unknown receivers");
    }
}
