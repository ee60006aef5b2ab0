//! Aiming: a searchlight that angles turn, or that follows something.

use glam::{Quat, Vec3};
use umbriel_fields::{EnumValue, Evaluation, Field, NodeType, SetRule};

const BY: u16 = 0;
const AZIMUTH: u16 = 1;
const ELEVATION: u16 = 2;
const NORTH: u16 = 3;
const LOCATION: u16 = 4;
const TARGET: u16 = 5;
const DIRECTION: u16 = 6;
const ROTATION: u16 = 7;
const DISTANCE: u16 = 8;

pub(super) fn types() -> Vec<NodeType> {
    let angle = |name: &'static str, doc: &'static str| Field::new(name, 0.0f32).unit("rad").range(-1e3, 1e3).doc(doc);
    let place = |name: &'static str, value: Vec3, doc: &'static str| Field::new(name, value).unit("m").doc(doc);
    vec![
        NodeType::new(
            "Aim",
            "Aims a searchlight, or anything else, by angles or at a place. Routes take `direction` to a SpotLight.",
        )
        .field(Field::choice("by", &["angles", "target"], "angles").doc("What counts."))
        .field(angle("azimuth", "From north by east."))
        .field(angle("elevation", "Above the horizon; negative points down."))
        .field(Field::new("north", Vec3::NEG_Z).doc("Where azimuth 0 is; its height does not count."))
        .field(place("location", Vec3::ZERO, "Where it stands, in the same space as `target`."))
        .field(place("target", Vec3::NEG_Z, "What it points at: by a route from the translation of a Transform it follows."))
        .field(
            Field::new("direction", Vec3::NEG_Z)
                .on_set(SetRule::Pulse)
                .output()
                .doc("Unit vector; for the direction of a light."),
        )
        .field(
            Field::new("rotation", Quat::IDENTITY)
                .on_set(SetRule::Pulse)
                .output()
                .doc("Turns -z to `direction` and keeps it upright; for a Transform."),
        )
        .field(Field::new("distance", 1.0f32).unit("m").on_set(SetRule::Pulse).output().doc("To `target`."))
        .evaluate(evaluate),
    ]
}

fn evaluate(evaluation: &mut Evaluation<'_>) {
    let (location, target): (Vec3, Vec3) = (evaluation.get(LOCATION), evaluation.get(TARGET));
    let aimed = match evaluation.get::<EnumValue>(BY).0 {
        0 => by_angles(evaluation).ok_or((NORTH, "`north` has no part along the ground")),
        _ => (target - location).try_normalize().ok_or((TARGET, "the target is where the light is, or is not finite")),
    };
    match aimed {
        Ok(direction) => {
            evaluation.set(DIRECTION, direction);
            evaluation.set(ROTATION, upright(direction));
            evaluation.set(DISTANCE, location.distance(target));
        }
        Err((field, message)) => evaluation.report_field(field, format!("{message}; it points where it did")),
    }
}

fn by_angles(evaluation: &mut Evaluation<'_>) -> Option<Vec3> {
    let (azimuth, elevation): (f32, f32) = (evaluation.get(AZIMUTH), evaluation.get(ELEVATION));
    let north = (evaluation.get::<Vec3>(NORTH) * Vec3::new(1.0, 0.0, 1.0)).try_normalize()?;
    let level = north * azimuth.cos() + north.cross(Vec3::Y) * azimuth.sin();
    Some(level * elevation.cos() + Vec3::Y * elevation.sin())
}

/// Turns -z to a direction, y as far up as that allows.
fn upright(direction: Vec3) -> Quat {
    let azimuth = f32::atan2(-direction.x, -direction.z);
    let elevation = direction.y.clamp(-1.0, 1.0).asin();
    Quat::from_rotation_y(azimuth) * Quat::from_rotation_x(elevation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::new_graph;
    use std::f32::consts::FRAC_PI_2;
    use umbriel_fields::{NoHost, Value};

    #[test]
    fn it_points_where_it_is_told() {
        let rows: [(&[(&str, Value)], Vec3); 7] = [
            (&[], Vec3::NEG_Z),
            (&[("azimuth", FRAC_PI_2.into())], Vec3::X),
            (&[("azimuth", FRAC_PI_2.into()), ("north", Vec3::X.into())], Vec3::Z),
            (&[("elevation", (-FRAC_PI_2).into())], Vec3::NEG_Y),
            (&[("by", "target".into()), ("location", Vec3::Y.into()), ("target", Vec3::new(3.0, 1.0, 0.0).into())], Vec3::X),
            (&[("by", "target".into()), ("target", Vec3::ZERO.into())], Vec3::NEG_Z),
            (&[("by", "target".into()), ("target", Vec3::NAN.into())], Vec3::NEG_Z),
        ];
        for (fields, expected) in rows {
            let mut graph = new_graph();
            let aim = graph.create("Aim").unwrap();
            for (field, value) in fields {
                graph.set_named(aim, field, value.clone()).unwrap();
            }
            let report = graph.evaluate(0.0, &mut NoHost);
            let direction: Vec3 = graph.get_named(aim, "direction").unwrap();
            let rotation: Quat = graph.get_named(aim, "rotation").unwrap();
            assert!(direction.abs_diff_eq(expected, 1e-5), "{fields:?}: {direction}");
            assert!((rotation * Vec3::NEG_Z).abs_diff_eq(direction, 1e-5), "{fields:?}: {rotation}");
            let wrong = fields.iter().any(|(name, v)| *name == "target" && !matches!(v, Value::Vec3(v) if v.x == 3.0));
            assert_eq!(report.problems.len(), usize::from(wrong), "{fields:?}: {:?}", report.problems);
        }
    }
}
