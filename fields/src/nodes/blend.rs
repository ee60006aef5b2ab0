//! Values between values.

use std::ops::{Add, Mul};

use glam::{Quat, Vec2, Vec3};

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

/// Between two values with a tangent each, from the first at 0 to the second at 1; tangents are per unit of `length`, which the span is long.
pub(super) fn hermite<T: Blend>([from, leaving, to, arriving]: [T; 4], t: f32, length: f32) -> T {
    let (t2, t3) = (t * t, t * t * t);
    T::weigh([
        (from, 2.0 * t3 - 3.0 * t2 + 1.0),
        (leaving, length * (t3 - 2.0 * t2 + t)),
        (to, -2.0 * t3 + 3.0 * t2),
        (arriving, length * (t3 - t2)),
    ])
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

impl Blend for Vec2 {
    fn blend(from: Vec2, to: Vec2, share: f32) -> Vec2 {
        from * (1.0 - share) + to * share
    }

    fn weigh(terms: [(Vec2, f32); 4]) -> Vec2 {
        terms.iter().map(|(value, weight)| *value * *weight).sum()
    }

    fn distance(self, other: Vec2) -> f32 {
        Vec2::distance(self, other)
    }
}

/// A direction: between two lies the shortest way on the sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Normal(pub(super) Vec3);

impl Blend for Normal {
    fn blend(from: Normal, to: Normal, share: f32) -> Normal {
        match share {
            0.0 => from,
            1.0 => to,
            _ => Normal(from.0.normalize_or(Vec3::Y).slerp(to.0.normalize_or(Vec3::Y), share)),
        }
    }

    fn weigh(terms: [(Normal, f32); 4]) -> Normal {
        Normal(Vec3::weigh(terms.map(|(value, weight)| (value.0, weight))).normalize_or(Vec3::Y))
    }

    fn distance(self, other: Normal) -> f32 {
        self.0.angle_between(other.0)
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
pub(super) fn unit(quat: Quat) -> Quat {
    let length = quat.length();
    if length > 0.0 && length.is_finite() { quat / length } else { Quat::IDENTITY }
}

/// A type with differences, which can be scaled and added; for rotations the axis times the angle of the shorter turn.
pub(super) trait Glide: Blend {
    /// A difference.
    type Step: Copy + Default + Add<Output = Self::Step> + Mul<f32, Output = Self::Step>;
    /// The step that leads from a value to this one.
    fn minus(self, from: Self) -> Self::Step;
    /// Where a step leads.
    fn plus(self, step: Self::Step) -> Self;
    /// Length of a step; radians for rotations.
    fn length(step: Self::Step) -> f32;
}

macro_rules! glide_by_arithmetic { ($($type:ty, $length:expr;)*) => { $(impl Glide for $type {
    type Step = $type;

    fn minus(self, from: $type) -> $type {
        self - from
    }

    fn plus(self, step: $type) -> $type {
        self + step
    }

    fn length(step: $type) -> f32 {
        $length(step)
    }
})* } }
glide_by_arithmetic! {
    f32, f32::abs;
    Vec2, Vec2::length;
    Vec3, Vec3::length;
}

impl Glide for Color {
    type Step = Vec3;

    fn minus(self, from: Color) -> Vec3 {
        self.0 - from.0
    }

    fn plus(self, step: Vec3) -> Color {
        Color(self.0 + step)
    }

    fn length(step: Vec3) -> f32 {
        step.length()
    }
}

impl Glide for Quat {
    type Step = Vec3;

    fn minus(self, from: Quat) -> Vec3 {
        let turn = unit(self) * unit(from).inverse();
        if turn.w < 0.0 { (-turn).to_scaled_axis() } else { turn.to_scaled_axis() }
    }

    fn plus(self, step: Vec3) -> Quat {
        unit(Quat::from_scaled_axis(step) * unit(self))
    }

    fn length(step: Vec3) -> f32 {
        step.length()
    }
}
