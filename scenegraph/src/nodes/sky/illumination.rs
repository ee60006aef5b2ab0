//! How bright and of which colour sun, moon and sky are: simple models from the literature, in lux.

use glam::{DVec3, dvec3};

/// Wavelengths that stand for red, green and blue, micrometres.
const WAVELENGTHS: DVec3 = dvec3(0.68, 0.55, 0.44);
/// Illuminance of the sun above the air, lux (IES 1984).
const SUN_LX: f64 = 127_500.0;
/// Of the night sky without moon, lux (Leinert et al. 1998: airglow, zodiacal light and stars).
const NIGHT_LX: f64 = 1e-3;
/// Mean distance of the moon, metres.
const MOON_M: f64 = 384_400_000.0;

/// Thickness of the air at an elevation in units of that at the zenith (Kasten and Young 1989); that at the horizon below it.
pub(super) fn air_mass(elevation_rad: f64) -> f64 {
    let h = elevation_rad.to_degrees().max(0.0);
    1.0 / (h.to_radians().sin() + 0.505_72 * (h + 6.079_95).powf(-1.636_4))
}

/// Optical depth of the whole air for red, green and blue: molecules (Rayleigh), and haze that follows from how far one sees
/// (McClatchey and Selby 1972, as in Iqbal 1983, chapter 6).
pub(super) fn optical_depth(visibility_m: f64) -> DVec3 {
    let km = (visibility_m / 1000.0).clamp(0.5, 300.0);
    let depth = |wavelength: f64| {
        let molecules = 0.008_735 * wavelength.powf(-4.08);
        let beta = 0.55f64.powf(1.3) * (3.912 / km - 0.011_62) * (0.024_72 * (km.max(5.0) - 5.0) + 1.132);
        molecules + beta.max(0.0) * wavelength.powf(-1.3)
    };
    dvec3(depth(WAVELENGTHS.x), depth(WAVELENGTHS.y), depth(WAVELENGTHS.z))
}

fn exp(v: DVec3) -> DVec3 {
    dvec3(v.x.exp(), v.y.exp(), v.z.exp())
}

/// Light from a source in the sky after its way through the air, lux at right angles; none from below the horizon.
pub(super) fn direct_lx(above_air_lx: f64, elevation_rad: f64, depth: DVec3) -> DVec3 {
    // The disc of sun or moon sinks within half a degree.
    let risen = (elevation_rad.to_degrees() / 0.53 + 0.5).clamp(0.0, 1.0);
    exp(-depth * air_mass(elevation_rad)) * above_air_lx * risen
}

/// The sun's.
pub(super) fn sunlight_lx(elevation_rad: f64, depth: DVec3) -> DVec3 {
    direct_lx(SUN_LX, elevation_rad, depth)
}

/// The moon's above the air, by its phase (0 is full; Krisciunas and Schaefer 1991, equation 20) and distance.
pub(super) fn moonlight_lx(phase_rad: f64, distance_m: f64) -> f64 {
    let phase = phase_rad.to_degrees().abs();
    let foot_candles = 10f64.powf(-0.4 * (3.84 + 0.026 * phase + 4e-9 * phase.powi(4)));
    foot_candles * 10.764 * (MOON_M / distance_m).powi(2)
}

/// Illuminance of the ground by a clear sky alone, lux: by day IES (1984), its value at the horizon being that of the
/// twilight; in twilight Janiczek and DeYoung (1987).
pub(super) fn sky_lx(sun_elevation_rad: f64) -> f64 {
    let h = sun_elevation_rad.to_degrees();
    let x = h / 90.0;
    let cubic = |a: f64, b: f64, c: f64, d: f64| 10f64.powf(a + b * x + c * x * x + d * x * x * x);
    let sun = match h {
        _ if h >= 0.0 => cubic(2.88, 0.0, 0.0, 0.0) + 15_500.0 * sun_elevation_rad.sin().sqrt(),
        _ if h >= -0.8 => cubic(2.88, 22.26, -207.64, 1034.30),
        _ if h >= -5.0 => cubic(2.88, 21.81, -258.11, -858.36),
        _ if h >= -12.0 => cubic(2.70, 12.17, -431.69, -1899.83),
        _ if h >= -18.0 => cubic(13.84, 262.72, 1447.42, 2797.93),
        _ => 0.0,
    };
    sun + NIGHT_LX
}

/// What clouds leave of the direct light and of direct and scattered light together (Kasten and Czeplak 1980): factors.
pub(super) fn through_clouds(cover: f64) -> (f64, f64) {
    let all = 1.0 - 0.75 * cover.powf(3.4);
    (all * (1.0 - cover * cover), all)
}

/// Colours of zenith and horizon as light is scattered once on its way to the eye. Their brightness is such that the ground
/// under the sky gets illuminance 1: two thirds from the zenith, one third from the horizon.
pub(super) fn sky_colors(source_elevation_rad: f64, depth: DVec3, cloud_cover: f64) -> [DVec3; 2] {
    // Light is reddened before it is scattered, until only the top of the air is lit.
    let lit = (source_elevation_rad.to_degrees() / 8.0 + 1.0).clamp(0.0, 1.0);
    let seen = |air: f64, reddening: f64| {
        (DVec3::ONE - exp(-depth * air)) * exp(-depth * air_mass(source_elevation_rad) * reddening * lit)
    };
    let (zenith, horizon) = (seen(1.0, 0.06), seen(8.0, 0.12));
    let share = 1.0 / luminance(zenith * (2.0 / 3.0) + horizon / 3.0);
    let grey = DVec3::splat(1.0);
    [zenith, horizon].map(|color| (color * share).lerp(grey, cloud_cover * cloud_cover))
}

/// Brightness of a linear colour.
pub(super) fn luminance(color: DVec3) -> f64 {
    color.dot(dvec3(0.2126, 0.7152, 0.0722))
}
