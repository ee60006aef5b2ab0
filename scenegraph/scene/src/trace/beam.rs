//! Where a light shines.

use super::TraceError;
use crate::{Light, LightKind};
use glam::DVec3;

/// A light as the tracer needs it, in double precision.
pub(super) struct Beam {
    /// Unit vector along which a directional or spot light travels.
    direction: DVec3,
    /// Position; `None` for a directional light.
    position: Option<DVec3>,
    /// Cosine of the cone's half angle, for a spot.
    cone: Option<f64>,
    /// How far it shines, metres.
    range: f64,
}

impl Beam {
    pub(super) fn new(light: &Light) -> Result<Beam, TraceError> {
        let bad = || TraceError::BadLight { light: light.name.clone(), direction: light.direction, position: light.position };
        let direction = light.direction.as_dvec3().try_normalize();
        let needs_direction = light.kind != LightKind::Point;
        let needs_position = light.kind != LightKind::Directional;
        if (needs_direction && direction.is_none()) || (needs_position && !light.position.is_finite()) {
            return Err(bad());
        }
        Ok(Beam {
            direction: direction.unwrap_or(DVec3::NEG_Z),
            position: needs_position.then(|| light.position.as_dvec3()),
            cone: match light.kind {
                LightKind::Spot { outer_rad, .. } => Some(f64::from(outer_rad).cos()),
                LightKind::Directional | LightKind::Point => None,
            },
            range: if needs_position { f64::from(light.range) } else { f64::INFINITY },
        })
    }

    /// Unit vector from `point` to the light, and its distance. At the light itself the surface counts as facing it.
    pub(super) fn to_light(&self, point: DVec3, facing: DVec3) -> (DVec3, f64) {
        let Some(position) = self.position else { return (-self.direction, f64::INFINITY) };
        let to_light = position - point;
        let far = to_light.length();
        if far > 0.0 { (to_light / far, far) } else { (facing, 0.0) }
    }

    /// Is a place out of its reach: outside of the cone, or beyond the range?
    pub(super) fn misses(&self, to_light: DVec3, far: f64) -> bool {
        far > self.range || self.cone.is_some_and(|cosine| -to_light.dot(self.direction) < cosine)
    }
}
