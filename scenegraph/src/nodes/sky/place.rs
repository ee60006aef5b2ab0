//! Sun and moon as they are seen from a place on earth.

use sofars::{cal, consts, coords, eph, pnp, vm};
use solar_positioning::time::JulianDate;
use solar_positioning::{Location, RefractionCorrection, SolarPositions, delta_t};

/// A place and a time on earth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observer {
    /// Year, month, day (Gregorian) of the clock.
    pub(super) date: [i32; 3],
    /// Hours of the clock; more than 24 goes on to the next day.
    pub(super) hour: f64,
    /// Hours of the clock ahead of UTC.
    pub(super) utc_offset_h: f64,
    /// Degrees, north positive.
    pub(super) latitude_deg: f64,
    /// Degrees, east positive.
    pub(super) longitude_deg: f64,
    /// Above sea level, metres.
    pub(super) altitude_m: f64,
    /// Of the air, hectopascals.
    pub(super) pressure_hpa: f64,
    /// Of the air, degrees Celsius.
    pub(super) temperature_c: f64,
}

/// A direction as it is seen, refraction included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Above the horizon, radians.
    pub(super) elevation_rad: f64,
    /// From north by east, radians.
    pub(super) azimuth_rad: f64,
}

/// The moon as it is seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moon {
    pub(super) seen: Seen,
    /// From the observer, metres.
    pub(super) distance_m: f64,
    /// Angle between sun and observer as the moon sees them, radians: 0 is full.
    pub(super) phase_rad: f64,
}

/// The years for which clocks and the moon's motion are known well enough.
const YEARS: std::ops::RangeInclusive<i32> = 1600..=2600;

/// Year, month and day from `2003-10-17`, if there is such a day.
pub(super) fn date_from_text(text: &str) -> Result<[i32; 3], String> {
    let parts: Vec<&str> = text.trim().split('-').collect();
    let numbers: Option<Vec<i32>> = parts.iter().map(|p| p.parse().ok()).collect();
    let Some(&[year, month, day]) = numbers.as_deref() else {
        return Err(format!("\"{text}\" is no date; one is written 2003-10-17"));
    };
    if !YEARS.contains(&year) {
        return Err(format!("\"{text}\": years from {} to {} are known", YEARS.start(), YEARS.end()));
    }
    match cal::cal2jd(year, month, day) {
        Ok(_) if year % 4 != 0 || year % 100 != 0 || year % 400 == 0 || (month, day) != (2, 29) => Ok([year, month, day]),
        _ => Err(format!("\"{text}\": there is no such day")),
    }
}

impl Observer {
    /// Julian date in universal time, days, and how much terrestrial time is ahead of it, seconds.
    fn julian(&self) -> Result<(f64, f64), String> {
        let [year, month, day] = self.date;
        let (zero, days) = cal::cal2jd(year, month, day).map_err(|_| "there is no such day".to_owned())?;
        let delta_t_s = delta_t::estimate(f64::from(year) + (f64::from(month) - 0.5) / 12.0).map_err(|e| e.to_string())?;
        Ok((zero + days + (self.hour - self.utc_offset_h) / 24.0, delta_t_s))
    }

    /// The sun (NREL's solar position algorithm; Reda and Andreas 2004).
    pub(super) fn sun(&self) -> Result<Seen, String> {
        let (days, delta_t_s) = self.julian()?;
        let told = |e: solar_positioning::Error| e.to_string();
        let time = JulianDate::new(days, delta_t_s).map_err(told)?;
        let air = RefractionCorrection::new(self.pressure_hpa, self.temperature_c).map_err(told)?;
        let location = Location { latitude: self.latitude_deg, longitude: self.longitude_deg };
        let seen = SolarPositions::new().at_from_julian(time, location, self.altitude_m, Some(air)).map_err(told)?;
        Ok(Seen { elevation_rad: seen.elevation_angle().to_radians(), azimuth_rad: seen.azimuth().to_radians() })
    }

    /// The moon (Meeus 1998 chapter 47, brought to the observer by the IAU's models of the earth: SOFA's moon98, c2t00b).
    pub(super) fn moon(&self) -> Result<Moon, String> {
        let (days, delta_t_s) = self.julian()?;
        let (ut, tt) = ((consts::DJ00, days - consts::DJ00), (consts::DJ00, days - consts::DJ00 + delta_t_s / 86_400.0));
        let earth_from_stars = pnp::c2t00b(tt.0, tt.1, ut.0, ut.1, 0.0, 0.0);
        let mut moon = [0.0; 3];
        vm::rxp(&earth_from_stars, &eph::moon98(tt.0, tt.1)[0], &mut moon);
        let moon = moon.map(|x| x * consts::DAU);
        let (longitude, latitude) = (self.longitude_deg.to_radians(), self.latitude_deg.to_radians());
        let here = coords::gd2gc(1, longitude, latitude, self.altitude_m).map_err(|e| format!("no such place ({e})"))?;
        let offset = std::array::from_fn(|i| moon[i] - here[i]);
        let distance_m = length(offset);
        let geometric = seen_from(offset, longitude, latitude);
        let elevation_rad = geometric.elevation_rad + self.refraction_rad(geometric.elevation_rad);
        let seen = Seen { elevation_rad, ..geometric };
        // The sun is so far away that its direction is the same from the moon.
        let sun = self.sun()?;
        let (a, b) = (unit(sun), unit(seen));
        let elongation = (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).clamp(-1.0, 1.0).acos();
        Ok(Moon { seen, distance_m, phase_rad: std::f64::consts::PI - elongation })
    }

    /// Hours since the sun was lowest, by the sun itself.
    pub(super) fn solar_time_h(&self, sun: Seen) -> f64 {
        let [east, north, up] = unit(sun);
        let latitude = self.latitude_deg.to_radians();
        let towards_equator = up * latitude.cos() - north * latitude.sin();
        (12.0 + (-east).atan2(towards_equator).to_degrees() / 15.0).rem_euclid(24.0)
    }

    /// How much the air lifts what is seen (Meeus 1998, chapter 16, after Saemundsson).
    fn refraction_rad(&self, elevation_rad: f64) -> f64 {
        let h = elevation_rad.to_degrees();
        if h < -1.0 {
            return 0.0;
        }
        let minutes = 1.02 / (h + 10.3 / (h + 5.11)).to_radians().tan();
        let air = self.pressure_hpa / 1010.0 * 283.0 / (273.0 + self.temperature_c);
        (minutes * air / 60.0).to_radians()
    }
}

/// East, north, up.
pub(super) fn unit(seen: Seen) -> [f64; 3] {
    let (level, up) = (seen.elevation_rad.cos(), seen.elevation_rad.sin());
    [level * seen.azimuth_rad.sin(), level * seen.azimuth_rad.cos(), up]
}

/// An offset in the axes of the earth, seen from a place: without refraction.
fn seen_from([x, y, z]: [f64; 3], longitude: f64, latitude: f64) -> Seen {
    let (sin_lon, cos_lon) = longitude.sin_cos();
    let (sin_lat, cos_lat) = latitude.sin_cos();
    let east = -sin_lon * x + cos_lon * y;
    let outward = cos_lon * x + sin_lon * y;
    let north = cos_lat * z - sin_lat * outward;
    let up = sin_lat * z + cos_lat * outward;
    Seen { elevation_rad: up.atan2(east.hypot(north)), azimuth_rad: east.atan2(north).rem_euclid(std::f64::consts::TAU) }
}

fn length([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}
