//! The node that makes light of where sun and moon stand and of the weather.

use super::illumination::{direct_lx, luminance, optical_depth, sky_colors, sky_lx, sunlight_lx, through_clouds};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use umbriel_fields::{Color, Evaluation, Field, NodeType, SetRule};

const SUN_ELEVATION: u16 = 0;
const MOON_ELEVATION: u16 = 1;
const MOON_ILLUMINANCE: u16 = 2;
const SOLAR_TIME: u16 = 3;
const CLOUD_COVER: u16 = 4;
const VISIBILITY: u16 = 5;
const WHITE: u16 = 6;
const ADAPTATION: u16 = 7;
const LAMPLIGHT: u16 = 8;
const SUN_INTENSITY: u16 = 9;
const SUN_COLOR: u16 = 10;
const MOON_INTENSITY: u16 = 11;
const MOON_COLOR: u16 = 12;
const AMBIENT: u16 = 13;
const ZENITH: u16 = 14;
const HORIZON: u16 = 15;
const NADIR: u16 = 16;
const FOG_RANGE: u16 = 17;
const EXPOSURE: u16 = 18;
const SOFT_RANGE: u16 = 19;
const SHADOW_BRIGHTNESS: u16 = 20;
const IS_DARK: u16 = 21;
const PER_LUX: u16 = 22;
const SUN_SHINES: u16 = 23;
const MOON_SHINES: u16 = 24;

/// Street lamps are lit below this illuminance, lux.
const DUSK_LX: f64 = 35.0;

/// Hours by the sun, range and brightness of soft shadows (004 Table 2).
const SHADOWS: [[f32; 3]; 3] = [[9.333, 6.0, 110.0], [13.35, 5.0, 120.0], [16.35, 8.0, 180.0]];

pub(super) fn node_type() -> NodeType {
    let color =
        |name: &'static str, doc: &'static str| Field::new(name, Color(Vec3::ZERO)).on_set(SetRule::Pulse).output().doc(doc);
    let number = |name: &'static str, value: f32, unit: &'static str, doc: &'static str| {
        Field::new(name, value).unit(unit).on_set(SetRule::Pulse).output().doc(doc)
    };
    let half_turn = std::f64::consts::FRAC_PI_2;
    NodeType::new("Daylight", "What light sun, moon and weather make; routes take it to lights, sky, fog and shadows.")
        .field(Field::new("sun_elevation", 0.8f32).unit("rad").range(-half_turn, half_turn).doc("From an Ephemeris."))
        .field(Field::new("moon_elevation", -1.0f32).unit("rad").range(-half_turn, half_turn).doc("From an Ephemeris."))
        .field(Field::new("moon_illuminance", 0.0f32).unit("lx").range(0.0, 1.0).doc("From an Ephemeris."))
        .field(Field::new("solar_time", 12.0f32).unit("h").range(0.0, 24.0).doc("From an Ephemeris."))
        .field(Field::new("cloud_cover", 0.0f32).range(0.0, 1.0).doc("Share of the sky that is covered."))
        .field(
            Field::new("visibility", 30_000.0f32)
                .unit("m")
                .range(50.0, 300_000.0)
                .doc("How far one sees: 2000 is haze, 100 000 very clear."),
        )
        .field(
            Field::new("white", 100_000.0f32)
                .unit("lx")
                .range(1.0, 1e6)
                .doc("Illuminance that makes a white surface 1 at exposure 1."),
        )
        .field(
            Field::new("adaptation", 0.75f32)
                .range(0.0, 1.0)
                .doc("How far eyes get used to the dark: 0 not at all, 1: night is as bright as day."),
        )
        .field(
            Field::new("lamplight", 2.0f32)
                .unit("lx")
                .range(1e-4, 1e5)
                .doc("What lamps give where one looks: eyes adapt no further."),
        )
        .field(number("sun_intensity", 0.0, "", "For a DirectionalLight; 0 at night."))
        .field(color("sun_color", "For a DirectionalLight."))
        .field(number("moon_intensity", 0.0, "", "For a DirectionalLight."))
        .field(color("moon_color", "For a DirectionalLight."))
        .field(color("ambient", "Of the sky, for Environment."))
        .field(color("zenith_color", "For Background."))
        .field(color("horizon_color", "For Background and Fog."))
        .field(color("nadir_color", "For Background."))
        .field(number("fog_range", 0.0, "m", "For the visibility_range of Fog."))
        .field(number("exposure", 1.0, "", "For Environment."))
        .field(number(
            "soft_range",
            5.0,
            "cm/m",
            "For the soft_range of a light: 004 Table 2 by the sun's time, wider under clouds.",
        ))
        .field(number(
            "shadow_brightness",
            120.0,
            "",
            "For the shadow_brightness of a light: 004 Table 2, brighter under clouds.",
        ))
        .field(Field::new("is_dark", false).on_set(SetRule::Pulse).output().doc("Lamps are on: for their `on`."))
        .field(number("per_lux", 0.0, "", "Intensity of a light of this world per lux or candela."))
        .field(Field::new("sun_shines", true).on_set(SetRule::Pulse).output().doc("For the `on` of its light."))
        .field(Field::new("moon_shines", false).on_set(SetRule::Pulse).output().doc("For the `on` of its light."))
        .evaluate(evaluate)
}

fn evaluate(evaluation: &mut Evaluation<'_>) {
    let number = |evaluation: &mut Evaluation<'_>, field| f64::from(evaluation.get::<f32>(field));
    let sun_rad = number(evaluation, SUN_ELEVATION);
    let moon_rad = number(evaluation, MOON_ELEVATION);
    let moon_lx = number(evaluation, MOON_ILLUMINANCE);
    let cover = number(evaluation, CLOUD_COVER);
    let visibility_m = number(evaluation, VISIBILITY);
    let (white_lx, lamplight_lx) = (number(evaluation, WHITE), number(evaluation, LAMPLIGHT));
    let adaptation = number(evaluation, ADAPTATION);
    let depth = optical_depth(visibility_m);
    let (direct_share, all_share) = through_clouds(cover);

    let sun = sunlight_lx(sun_rad, depth);
    let moon = direct_lx(moon_lx, moon_rad, depth);
    let on_ground = |light: DVec3, elevation: f64| luminance(light) * elevation.sin().max(0.0);
    let direct_lx = on_ground(sun, sun_rad) + on_ground(moon, moon_rad);
    // A moonlit sky gives a tenth of what the moon gives itself.
    let clear_lx = sky_lx(sun_rad) + 0.1 * on_ground(moon, moon_rad);
    let sky_lx = (direct_lx + clear_lx) * all_share - direct_lx * direct_share;

    // A parallel light of intensity pi makes a white surface 1.
    let per_lux = PI / white_lx;
    light(evaluation, [SUN_INTENSITY, SUN_COLOR, SUN_SHINES], sun * direct_share * per_lux);
    light(evaluation, [MOON_INTENSITY, MOON_COLOR, MOON_SHINES], moon * direct_share * per_lux);
    let source_rad = if sun_rad.to_degrees() > -12.0 { sun_rad } else { moon_rad.max(0.2) };
    let [zenith, horizon] = sky_colors(source_rad, depth, cover).map(|c| c * sky_lx / white_lx);
    let ambient = zenith * (2.0 / 3.0) + horizon / 3.0;
    for (field, color) in [(AMBIENT, ambient), (ZENITH, zenith), (HORIZON, horizon), (NADIR, ambient * 0.2)] {
        evaluation.set(field, Color(color.as_vec3()));
    }
    evaluation.set(FOG_RANGE, visibility_m as f32);
    let ground_lx = sky_lx + direct_lx * direct_share;
    evaluation.set(EXPOSURE, (white_lx / ground_lx.max(lamplight_lx)).powf(adaptation) as f32);
    let solar_time_h = evaluation.get(SOLAR_TIME);
    let (range, brightness) = soft_shadow(solar_time_h, cover as f32);
    evaluation.set(SOFT_RANGE, range);
    evaluation.set(SHADOW_BRIGHTNESS, brightness);
    evaluation.set(IS_DARK, ground_lx < DUSK_LX);
    evaluation.set(PER_LUX, per_lux as f32);
}

/// The brightest channel goes into the intensity.
fn light(evaluation: &mut Evaluation<'_>, [intensity, color, shines]: [u16; 3], light: DVec3) {
    let brightest = light.max_element();
    evaluation.set(shines, brightest > 0.0);
    evaluation.set(intensity, brightest as f32);
    if brightest > 0.0 {
        evaluation.set(color, Color((light / brightest).as_vec3()));
    }
}

/// Range and brightness by the hour, straight between the hours of the table. Under clouds what is left of a shadow is wider and
/// fades to the brightness of its surroundings.
pub(super) fn soft_shadow(solar_time_h: f32, cover: f32) -> (f32, f32) {
    let next = SHADOWS.iter().position(|row| row[0] > solar_time_h).unwrap_or(SHADOWS.len()).clamp(1, SHADOWS.len() - 1);
    let (a, b) = (SHADOWS[next - 1], SHADOWS[next]);
    let t = ((solar_time_h - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0);
    let (range, brightness) = (a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2]));
    (range * (1.0 + 2.0 * cover), brightness + cover * cover * (255.0 - brightness))
}
