//! Slides for projectors, painted by rule.

use image::{ImageFormat, Rgba, RgbaImage};
use std::io::Cursor;

/// The bytes of a PNG file.
pub(crate) fn png(picture: &RgbaImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    picture.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).expect("a picture can be written to memory");
    bytes
}

/// An evening at sea: a sun between dark hills, a boat, a white frame.
pub(crate) fn evening() -> RgbaImage {
    RgbaImage::from_fn(128, 96, |x, y| {
        let (u, v) = (x as f32 / 127.0, y as f32 / 95.0);
        let in_frame = !(3..125).contains(&x) || !(3..93).contains(&y);
        let sun = ((u - 0.62) * 1.33).hypot(v - 0.5) < 0.16 && v < 0.6;
        let hills = v < 0.6 && v > 0.52 - 0.14 * (u * 5.0).sin().max(0.0) - 0.05 * (u * 17.0).cos();
        let sail = u > 0.2 && u < 0.34 && v < 0.72 && v > 0.34 + 2.4 * (u - 0.2);
        let hull = (0.72..0.79).contains(&v) && (u - 0.26).abs() < 0.14 - (v - 0.72);
        let glitter = v > 0.6 && (u - 0.62).abs() < 0.05 + 0.25 * (v - 0.6) && (y / 2 + x / 9) % 3 == 0;
        let rgb = if in_frame {
            [255, 250, 235]
        } else if sail {
            [250, 240, 220]
        } else if hull {
            [70, 25, 30]
        } else if glitter || sun {
            [255, 214, 90]
        } else if v >= 0.6 {
            [20, 70 - (40.0 * (v - 0.6)) as u8, 120 - (120.0 * (v - 0.6)) as u8]
        } else if hills {
            [50, 24, 70]
        } else {
            [230, (60.0 + 150.0 * v) as u8, (110.0 - 60.0 * v) as u8]
        };
        Rgba([rgb[0], rgb[1], rgb[2], 255])
    })
}

/// A compass rose with a red north, on nothing: alpha is 0 around it.
pub(crate) fn rose() -> RgbaImage {
    RgbaImage::from_fn(128, 128, |x, y| {
        let (u, v) = (x as f32 - 63.5, 63.5 - y as f32);
        let (r, turn) = (u.hypot(v), u.atan2(v));
        let eighth = std::f32::consts::FRAC_PI_4;
        let number = (turn / eighth).round();
        let aside = turn - number * eighth;
        let is_main = number as i32 % 2 == 0;
        let length = if is_main { 58.0 } else { 40.0 };
        // A narrow rhombus along each of eight directions, its halves light and dark.
        let across = (r * aside.sin()).abs();
        let along = r * aside.cos();
        let width = if along < 12.0 { 9.0 * along / 12.0 } else { 9.0 * (length - along) / (length - 12.0) };
        let in_ring = (46.0..48.5).contains(&r);
        let rgb = match (across <= width && along <= length, number as i32, aside > 0.0) {
            (true, 0, false) => [220, 40, 40],
            (true, 0, true) => [130, 15, 20],
            (true, _, false) => [240, 230, 200],
            (true, _, true) => [40, 60, 110],
            _ if in_ring => [200, 160, 60],
            _ => return Rgba([0, 0, 0, 0]),
        };
        Rgba([rgb[0], rgb[1], rgb[2], 255])
    })
}
