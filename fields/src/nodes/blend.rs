//! Values between values.

use glam::{Quat, Vec3};

use crate::Color;

/// A type between whose values others lie.
pub(super) trait Blend: Copy {
    /// `from` at 0, `to` at 1, both exactly.
    fn blend(from: Self, to: Self, share: f32) -> Self;
    /// Weighted sum of two values and two tangents, as a cubic spline needs it.
    fn weigh(terms: [(Self, f32); 4]) -> Self;
    /// How far apart; for rotations in radians.
    fn distance(self, other: Self) -> f32;
}

impl Blend for f32 {
    fn blend(from: f32, to: f32, share: f32) -> f32 {
        from * (1.0 - share) + to * share
    }

    fn weigh(terms: [(f32, f32); 4]) -> f32 {
        terms.iter().map(|(value, weight)| value * weight).sum()
    }

    fn distance(self, other: f32) -> f32 {
        (self - other).abs()
    }
}

impl Blend for Vec3 {
    fn blend(from: Vec3, to: Vec3, share: f32) -> Vec3 {
        from * (1.0 - share) + to * share
    }

    fn weigh(terms: [(Vec3, f32); 4]) -> Vec3 {
        terms.iter().map(|(value, weight)| *value * *weight).sum()
    }

    fn distance(self, other: Vec3) -> f32 {
        Vec3::distance(self, other)
    }
}

impl Blend for Color {
    fn blend(from: Color, to: Color, share: f32) -> Color {
        Color(Vec3::blend(from.0, to.0, share))
    }

    fn weigh(terms: [(Color, f32); 4]) -> Color {
        Color(Vec3::weigh(terms.map(|(value, weight)| (value.0, weight))))
    }

    fn distance(self, other: Color) -> f32 {
        self.0.distance(other.0)
    }
}

impl Blend for Quat {
    /// Along the shorter arc at even speed.
    fn blend(from: Quat, to: Quat, share: f32) -> Quat {
        match share {
            0.0 => from,
            1.0 => to,
            _ => unit(from).slerp(unit(to), share),
        }
    }

    fn weigh(terms: [(Quat, f32); 4]) -> Quat {
        unit(
            terms
                .iter()
                .map(|(value, weight)| *value * *weight)
                .fold(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, term| sum + term),
        )
    }

    fn distance(self, other: Quat) -> f32 {
        unit(self).angle_between(unit(other))
    }
}

/// Length one; no turn for what has no direction.
fn unit(quat: Quat) -> Quat {
    let length = quat.length();
    if length > 0.0 && length.is_finite() { quat / length } else { Quat::IDENTITY }
}
