//! Against published values.

use super::daylight::soft_shadow;
use super::illumination::*;
use super::place::*;
use crate::new_graph;
use glam::Vec3;
use std::f64::consts::PI;
use umbriel_fields::{Color, Graph, NoHost, NodeId, Strength, Value};

fn observer(date: &str, hour: f64, utc_offset_h: f64, latitude_deg: f64, longitude_deg: f64) -> Observer {
    let date = date_from_text(date).unwrap();
    Observer { date, hour, utc_offset_h, latitude_deg, longitude_deg, altitude_m: 0.0, pressure_hpa: 1010.0, temperature_c: 10.0 }
}

/// Reda and Andreas 2004, table A5.1.
#[test]
fn the_sun_stands_where_nrel_says() {
    let golden = observer("2003-10-17", 12.0 + 30.5 / 60.0, -7.0, 39.742476, -105.1786);
    let golden = Observer { altitude_m: 1830.14, pressure_hpa: 820.0, temperature_c: 11.0, ..golden };
    let sun = golden.sun().unwrap();
    assert!((90.0 - sun.elevation_rad.to_degrees() - 50.11162).abs() < 2e-4, "{}", sun.elevation_rad.to_degrees());
    assert!((sun.azimuth_rad.to_degrees() - 194.34024).abs() < 2e-4, "{}", sun.azimuth_rad.to_degrees());
    // Its hour angle is 11.105902 degrees.
    assert!((golden.solar_time_h(sun) - (12.0 + 11.105902 / 15.0)).abs() < 1e-3, "{}", golden.solar_time_h(sun));
}

/// Espenak and Meeus, Five millennium canon of solar eclipses: time and place of greatest eclipse, altitude of the sun. The
/// moon has to be in front of the sun there, and half a degree off from elsewhere.
#[test]
fn the_moon_is_before_the_sun_in_eclipses() {
    let apart_deg = |o: &Observer| {
        let ([a, b, c], [x, y, z]) = (unit(o.sun().unwrap()), unit(o.moon().unwrap().seen));
        (a * x + b * y + c * z).min(1.0).acos().to_degrees()
    };
    let hms = |h: f64, m: f64, s: f64| h + m / 60.0 + s / 3600.0;
    let rows = [
        ("1999-08-11", hms(11.0, 3.0, 4.0), 45.083, 24.3, 59.0),
        ("2017-08-21", hms(18.0, 25.0, 31.0), 36.967, -87.672, 63.9),
        ("2024-04-08", hms(18.0, 17.0, 20.0), 25.290, -104.138, 69.8),
    ];
    for (date, hour, latitude, longitude, altitude) in rows {
        let o = observer(date, hour, 0.0, latitude, longitude);
        let (sun, moon) = (o.sun().unwrap(), o.moon().unwrap());
        assert!((sun.elevation_rad.to_degrees() - altitude).abs() < 0.4, "{date}: {}", sun.elevation_rad.to_degrees());
        assert!(apart_deg(&o) < 0.03, "{date}: {} degrees apart", apart_deg(&o));
        assert!(0.5 + 0.5 * moon.phase_rad.cos() < 1e-4, "{date}: the moon is new");
        let elsewhere = observer(date, hour, 0.0, latitude - 30.0, longitude);
        assert!(apart_deg(&elsewhere) > 0.25, "{date}: {} degrees apart elsewhere", apart_deg(&elsewhere));
    }
    // The lunar eclipse of 27 July 2018, 20:22 UT: the moon stood over 19 S, 56 E, and was near its apogee.
    let moon = observer("2018-07-27", hms(20.0, 22.0, 0.0), 0.0, -19.0, 56.0).moon().unwrap();
    assert!(moon.seen.elevation_rad.to_degrees() > 88.5, "{}", moon.seen.elevation_rad.to_degrees());
    assert!(moon.phase_rad.to_degrees() < 2.0, "{}", moon.phase_rad.to_degrees());
    assert!((395e6..405e6).contains(&moon.distance_m), "{}", moon.distance_m);
}

#[test]
fn brightness_follows_the_literature() {
    let rad = |deg: f64| deg.to_radians();
    // (what, found, published, relative tolerance)
    let rows = [
        ("air at the zenith", air_mass(rad(90.0)), 1.0, 0.001),
        ("air at 30 degrees", air_mass(rad(30.0)), 1.994, 0.002),
        ("air at the horizon", air_mass(0.0), 37.92, 0.01),
        ("clear sky, sun in the zenith", sky_lx(rad(90.0)), 16_300.0, 0.01),
        ("sunset", sky_lx(0.0), 759.0, 0.01),
        ("end of civil twilight", sky_lx(rad(-6.0)), 3.4, 0.05),
        ("end of nautical twilight", sky_lx(rad(-12.0)) - 1e-3, 0.008, 0.05),
        ("full moon above the air", moonlight_lx(0.0, 384.4e6), 0.31, 0.03),
        ("half moon, to full moon", moonlight_lx(PI / 2.0, 384.4e6) / moonlight_lx(0.0, 384.4e6), 0.091, 0.05),
        ("sun through air and haze", luminance(sunlight_lx(rad(90.0), optical_depth(23_000.0))), 92_000.0, 0.05),
        ("all under full clouds", through_clouds(1.0).1, 0.25, 0.001),
    ];
    for (what, found, published, tolerance) in rows {
        assert!((found / published - 1.0).abs() < tolerance, "{what}: {found}, not {published}");
    }
    assert_eq!(sunlight_lx(rad(-1.0), optical_depth(30_000.0)).length(), 0.0, "no sun at night");
    assert_eq!(through_clouds(1.0).0, 0.0, "no sun through full clouds");
    // Twilight has no steps.
    for tenth in -180..100 {
        let (a, b) = (sky_lx(rad(f64::from(tenth) / 10.0)), sky_lx(rad(f64::from(tenth + 1) / 10.0)));
        assert!(b / a > 0.97 && b / a < 2.0, "{} degrees: {a} to {b}", f64::from(tenth) / 10.0);
    }
    let ratio = |elevation| {
        let light = sunlight_lx(rad(elevation), optical_depth(30_000.0));
        light.z / light.x
    };
    assert!(ratio(60.0) > 0.65 && ratio(3.0) < 0.2, "the low sun is red: {} {}", ratio(60.0), ratio(3.0));
}

/// 004 Table 2.
#[test]
fn soft_shadows_follow_the_hours_of_the_table() {
    let rows = [
        (9.333, 0.0, 6.0, 110.0),
        (13.35, 0.0, 5.0, 120.0),
        (16.35, 0.0, 8.0, 180.0),
        (6.0, 0.0, 6.0, 110.0),
        (20.0, 0.0, 8.0, 180.0),
        (14.85, 0.0, 6.5, 150.0),
        (13.35, 1.0, 15.0, 255.0),
    ];
    for (hour, cover, range, brightness) in rows {
        let (r, b) = soft_shadow(hour, cover);
        assert!((r - range).abs() < 0.01 && (b - brightness).abs() < 0.1, "{hour}: {r} {b}");
    }
}

fn node(type_name: &str, fields: &[(&str, Value)]) -> (Graph, NodeId, Vec<String>) {
    let mut graph = new_graph();
    let node = graph.create(type_name).unwrap();
    for (field, value) in fields {
        graph.set_named(node, field, value.clone()).unwrap();
    }
    let report = graph.evaluate(0.0, &mut NoHost);
    let told = |p: &umbriel_fields::Problem| {
        let field = p.field.map(|f| graph.describe_field(f)).unwrap_or_default();
        format!("{field}: {}", p.message)
    };
    let problems = report.problems.iter().map(told).collect();
    (graph, node, problems)
}

#[test]
fn north_turns_the_sky() {
    // Noon on the equator in March: the sun is straight up; at 6 it is in the east.
    for (north, east) in [(Vec3::NEG_Z, Vec3::X), (Vec3::X, Vec3::Z), (Vec3::new(0.0, 5.0, 2.0), Vec3::NEG_X)] {
        let morning: [(&str, Value); 4] =
            [("date", "2026-03-20".into()), ("hour", 6.5.into()), ("latitude", 0.0.into()), ("north", north.into())];
        let (graph, sky, problems) = node("Ephemeris", &morning);
        assert_eq!(problems, Vec::<String>::new());
        let direction: Vec3 = graph.get_named(sky, "sun_direction").unwrap();
        assert!((-direction).dot(east) > 0.99, "{north}: {direction}");
    }
}

#[test]
fn wrong_times_and_places_are_told() {
    let rows: [(&str, &str, Value, &str); 9] = [
        ("Ephemeris", "date", "2026-02-30".into(), "\"2026-02-30\": there is no such day; sun and moon stay where they are"),
        ("Ephemeris", "date", "1900-02-29".into(), "there is no such day"),
        ("Ephemeris", "date", "midsummer".into(), "is no date; one is written 2003-10-17"),
        ("Ephemeris", "date", "9999-01-01".into(), "years from 1600 to 2600 are known"),
        ("Ephemeris", "north", Vec3::Y.into(), "has no part along the ground"),
        ("Ephemeris", "latitude", 100.0.into(), "latitude"),
        ("Ephemeris", "hour", f64::NAN.into(), "hour"),
        ("Daylight", "cloud_cover", 1.5f32.into(), "cloud_cover"),
        ("Daylight", "visibility", 0.0f32.into(), "visibility"),
    ];
    for (type_name, field, value, expected) in rows {
        let mut graph = new_graph();
        let id = graph.create(type_name).unwrap();
        let message = match graph.set_named(id, field, value.clone()) {
            Err(error) => error.to_string(),
            Ok(()) => node(type_name, &[(field, value)]).2.join("; "),
        };
        assert!(message.contains(expected), "{field}: {message}\nwithout {expected}");
    }
}

#[test]
fn a_day_gets_brighter_and_darker() {
    let daylight = |elevation_deg: f32, cover: f32, moon_lx: f32| {
        let fields: [(&str, Value); 4] = [
            ("sun_elevation", elevation_deg.to_radians().into()),
            ("cloud_cover", cover.into()),
            ("moon_elevation", 0.7f32.into()),
            ("moon_illuminance", moon_lx.into()),
        ];
        let (graph, day, problems) = node("Daylight", &fields);
        assert_eq!(problems, Vec::<String>::new());
        let number = |name: &str| graph.get_named::<f32>(day, name).unwrap();
        let color = |name: &str| graph.get_named::<Color>(day, name).unwrap().0;
        let dark: bool = graph.get_named(day, "is_dark").unwrap();
        for name in ["ambient", "zenith_color", "horizon_color", "nadir_color"] {
            assert!(color(name).is_finite() && color(name).min_element() > 0.0, "{elevation_deg} {name} {}", color(name));
        }
        (number("sun_intensity"), color("ambient").y, number("exposure"), number("moon_intensity"), dark)
    };
    let (noon, evening, night) = (daylight(60.0, 0.0, 0.3), daylight(4.0, 0.0, 0.3), daylight(-20.0, 0.0, 0.3));
    let (overcast, moonless) = (daylight(60.0, 1.0, 0.3), daylight(-20.0, 0.0, 0.0));
    assert!(noon.0 > 2.3 && noon.0 < 3.5 && !noon.4, "{noon:?}");
    assert!(evening.0 > 0.1 && evening.0 < 1.0 && !evening.4, "{evening:?}");
    assert!(night.0 == 0.0 && night.4 && night.3 > 0.0, "{night:?}");
    assert!(overcast.0 == 0.0 && overcast.1 > noon.1 && overcast.2 > noon.2, "{overcast:?} {noon:?}");
    assert!(moonless.3 == 0.0 && moonless.1 < night.1, "{moonless:?}");
    assert!(noon.1 > evening.1 && evening.1 > night.1 && noon.2 < evening.2 && evening.2 < night.2);
}

/// Routes carry what is written: a light that is off by day must be told so, although the field was false before.
#[test]
fn what_did_not_change_is_told_at_first() {
    let mut graph = new_graph();
    let (day, moon) = (graph.create("Daylight").unwrap(), graph.create("DirectionalLight").unwrap());
    let (from, to) = (graph.field(day, "moon_shines").unwrap(), graph.field(moon, "on").unwrap());
    graph.connect(from, to, Strength::Strong).unwrap();
    graph.evaluate(0.0, &mut NoHost);
    assert!(!graph.get::<bool>(to).unwrap());
}
