//! The node that knows where sun and moon stand.

use super::illumination::moonlight_lx;
use super::place::{Observer, Seen, date_from_text, unit};
use glam::Vec3;
use std::sync::Arc;
use umbriel_fields::{Evaluation, Field, NodeType, SetRule};

const DATE: u16 = 0;
const HOUR: u16 = 1;
const UTC_OFFSET: u16 = 2;
const LATITUDE: u16 = 3;
const LONGITUDE: u16 = 4;
const ALTITUDE: u16 = 5;
const PRESSURE: u16 = 6;
const TEMPERATURE: u16 = 7;
const NORTH: u16 = 8;
const SUN: [u16; 3] = [9, 10, 11];
const MOON: [u16; 3] = [12, 13, 14];
const MOON_LIT: u16 = 15;
const MOON_ILLUMINANCE: u16 = 16;
const SOLAR_TIME: u16 = 17;

pub(super) fn node_type() -> NodeType {
    let number = |name: &'static str, value: f64, unit: &'static str, (low, high): (f64, f64), doc: &'static str| {
        Field::new(name, value).unit(unit).range(low, high).doc(doc)
    };
    let angle =
        |name: &'static str, doc: &'static str| Field::new(name, 0.0f32).unit("rad").on_set(SetRule::Pulse).output().doc(doc);
    let ray = |name: &'static str, doc: &'static str| Field::new(name, Vec3::NEG_Y).on_set(SetRule::Pulse).output().doc(doc);
    NodeType::new("Ephemeris", "Where sun and moon stand at a time and a place on earth; routes take them to lights.")
        .field(Field::new("date", "2026-06-21").doc("Day of the clock: year-month-day."))
        .field(number("hour", 12.0, "h", (-1e6, 1e6), "Time of the clock; more than 24 goes on to the next day."))
        .field(number("utc_offset", 0.0, "h", (-24.0, 24.0), "How much the clock is ahead of UTC, summer time included."))
        .field(number("latitude", 50.0, "degrees", (-90.0, 90.0), "North positive."))
        .field(number("longitude", 0.0, "degrees", (-180.0, 180.0), "East positive."))
        .field(number("altitude", 0.0, "m", (-500.0, 10_000.0), "Above sea level."))
        .field(number("pressure", 1013.25, "hPa", (1.0, 1500.0), "Of the air, which bends light."))
        .field(number("temperature", 15.0, "degrees Celsius", (-90.0, 60.0), "Of the air, which bends light."))
        .field(Field::new("north", Vec3::NEG_Z).doc("Where north is in the world; its height does not count."))
        .field(ray("sun_direction", "Where sunlight goes, for a DirectionalLight."))
        .field(angle("sun_elevation", "Of the sun above the horizon, as it is seen."))
        .field(angle("sun_azimuth", "Of the sun from north by east."))
        .field(ray("moon_direction", "Where moonlight goes."))
        .field(angle("moon_elevation", "Of the moon above the horizon, as it is seen."))
        .field(angle("moon_azimuth", "Of the moon from north by east."))
        .field(
            Field::new("moon_lit", 0.0f32)
                .on_set(SetRule::Pulse)
                .output()
                .doc("Share of the moon's disc that is lit: 0 is new, 1 is full."),
        )
        .field(
            Field::new("moon_illuminance", 0.0f32)
                .unit("lx")
                .on_set(SetRule::Pulse)
                .output()
                .doc("Of the moon at right angles, above the air."),
        )
        .field(
            Field::new("solar_time", 12.0f32).unit("h").on_set(SetRule::Pulse).output().doc("By the sun: 12 when it is highest."),
        )
        .evaluate(evaluate)
}

fn evaluate(evaluation: &mut Evaluation<'_>) {
    let date: Arc<str> = evaluation.get(DATE);
    let date = match date_from_text(&date) {
        Ok(date) => date,
        Err(message) => return evaluation.report_field(DATE, format!("{message}; sun and moon stay where they are")),
    };
    let observer = Observer {
        date,
        hour: evaluation.get(HOUR),
        utc_offset_h: evaluation.get(UTC_OFFSET),
        latitude_deg: evaluation.get(LATITUDE),
        longitude_deg: evaluation.get(LONGITUDE),
        altitude_m: evaluation.get(ALTITUDE),
        pressure_hpa: evaluation.get(PRESSURE),
        temperature_c: evaluation.get(TEMPERATURE),
    };
    let given: Vec3 = evaluation.get(NORTH);
    let Some(north) = (given * Vec3::new(1.0, 0.0, 1.0)).try_normalize() else {
        return evaluation.report_field(NORTH, format!("{given} has no part along the ground; sun and moon stay where they are"));
    };
    match observer.sun().and_then(|sun| Ok((sun, observer.moon()?))) {
        Ok((sun, moon)) => {
            write(evaluation, SUN, sun, north);
            write(evaluation, MOON, moon.seen, north);
            evaluation.set(MOON_LIT, (0.5 + 0.5 * moon.phase_rad.cos()) as f32);
            evaluation.set(MOON_ILLUMINANCE, moonlight_lx(moon.phase_rad, moon.distance_m) as f32);
            evaluation.set(SOLAR_TIME, observer.solar_time_h(sun) as f32);
        }
        Err(message) => evaluation.report_field(HOUR, format!("{message}; sun and moon stay where they are")),
    }
}

fn write(evaluation: &mut Evaluation<'_>, [direction, elevation, azimuth]: [u16; 3], seen: Seen, north: Vec3) {
    let [e, n, u] = unit(seen).map(|x| x as f32);
    evaluation.set(direction, -(north.cross(Vec3::Y) * e + north * n + Vec3::Y * u));
    evaluation.set(elevation, seen.elevation_rad as f32);
    evaluation.set(azimuth, seen.azimuth_rad as f32);
}
