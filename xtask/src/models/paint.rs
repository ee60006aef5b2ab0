//! Small pictures for the models, painted by rule.

use image::{Rgba, RgbaImage};

/// A number in 0..1 that depends on nothing but the place.
fn grain(x: u32, y: u32) -> f32 {
    let mut h = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    ((h ^ (h >> 15)) & 0xFFFF) as f32 / 65536.0
}

fn shade(rgb: [u8; 3], factor: f32) -> Rgba<u8> {
    let [r, g, b] = rgb.map(|c| (f32::from(c) * factor).clamp(0.0, 255.0) as u8);
    Rgba([r, g, b, 255])
}

/// Plaster with a timber frame: beams at the border and a cross brace.
pub(crate) fn timber_wall() -> RgbaImage {
    RgbaImage::from_fn(64, 64, |x, y| {
        let (fx, fy) = (x as f32 / 64.0, y as f32 / 64.0);
        let beam = x < 5 || y < 5 || (fx - fy).abs() < 0.05 && fy > 0.5;
        let noise = grain(x, y) * 0.12;
        if beam { shade([92, 62, 40], 0.9 + noise) } else { shade([226, 214, 188], 0.92 + noise) }
    })
}

/// A window of four panes in plaster, with its frame and sill.
pub(crate) fn window_wall() -> RgbaImage {
    RgbaImage::from_fn(64, 64, |x, y| {
        let noise = grain(x, y) * 0.1;
        let inside = (18..46).contains(&x) && (14..50).contains(&y);
        let pane = (21..43).contains(&x) && (17..47).contains(&y) && !(31..33).contains(&x) && !(31..33).contains(&y);
        match (pane, inside, (50..54).contains(&y) && (15..49).contains(&x)) {
            (true, ..) => shade([70, 92, 112], 0.7 + 0.4 * (y as f32 / 64.0) + noise),
            (_, true, _) => shade([240, 236, 226], 0.95),
            (.., true) => shade([150, 140, 126], 0.95),
            _ => shade([222, 204, 170], 0.92 + noise),
        }
    })
}

/// Rows of curved roof tiles.
pub(crate) fn roof_tiles() -> RgbaImage {
    RgbaImage::from_fn(64, 64, |x, y| {
        let row = y / 8;
        let across = (x + if row % 2 == 0 { 4 } else { 0 }) % 8;
        let edge = if y % 8 == 7 { 0.6 } else { 0.85 + 0.02 * (y % 8) as f32 };
        let curve = 1.0 - 0.05 * (across as f32 - 3.5).abs();
        shade([172, 78, 52], edge * curve * (0.86 + 0.2 * grain(x / 8, row)))
    })
}

/// Blocks of stone with mortar.
pub(crate) fn stones() -> RgbaImage {
    RgbaImage::from_fn(64, 64, |x, y| {
        let row = y / 16;
        let shifted = x + if row % 2 == 0 { 0 } else { 12 };
        let mortar = y % 16 == 0 || shifted % 24 == 0;
        let tone = 0.82 + 0.22 * grain(shifted / 24, row) + 0.08 * grain(x, y);
        if mortar { shade([120, 114, 104], 0.8) } else { shade([176, 168, 152], tone) }
    })
}

/// Red and white stripes of an awning.
pub(crate) fn stripes() -> RgbaImage {
    RgbaImage::from_fn(64, 8, |x, y| {
        let cloth = 0.94 + 0.06 * grain(x, y);
        if (x / 8) % 2 == 0 { shade([190, 40, 44], cloth) } else { shade([238, 232, 220], cloth) }
    })
}

/// Planks along u.
pub(crate) fn planks() -> RgbaImage {
    RgbaImage::from_fn(64, 64, |x, y| {
        let plank = y / 16;
        let gap = if y % 16 == 0 { 0.5 } else { 1.0 };
        let fibre = 0.85 + 0.12 * grain(plank, 7) + 0.08 * grain(x / 6, y);
        shade([150, 108, 68], gap * fibre)
    })
}

/// Leaves with holes between them: alpha is 0 or 255.
pub(crate) fn leaves() -> RgbaImage {
    let size = 128i32;
    let mut picture = RgbaImage::from_pixel(size as u32, size as u32, Rgba([60, 92, 34, 0]));
    for leaf in 0..150u32 {
        let at = |k: u32| grain(leaf, k);
        let radius = 58.0 * at(3).sqrt();
        let around = at(4) * std::f32::consts::TAU;
        let (cx, cy) = (64.0 + radius * around.cos(), 64.0 + radius * around.sin());
        let (sin, cos) = (at(5) * std::f32::consts::TAU).sin_cos();
        let green = shade([86, 128, 46], 0.65 + 0.6 * at(6));
        for y in -8i32..=8 {
            for x in -8i32..=8 {
                let (u, v) = (x as f32 * cos + y as f32 * sin, -x as f32 * sin + y as f32 * cos);
                let inside = (u / 7.5).powi(2) + (v / 3.2).powi(2) < 1.0;
                let (px, py) = (cx as i32 + x, cy as i32 + y);
                if inside && (1..size - 1).contains(&px) && (1..size - 1).contains(&py) {
                    picture.put_pixel(px as u32, py as u32, green);
                }
            }
        }
    }
    picture
}

/// Cobbles in offset rows, rounded at their rims.
pub(crate) fn cobbles() -> RgbaImage {
    RgbaImage::from_fn(128, 128, |x, y| {
        let row = y / 16;
        let shifted = (x + if row % 2 == 0 { 0 } else { 8 }) % 128;
        let (u, v) = ((shifted % 16) as f32 - 7.5, (y % 16) as f32 - 7.5);
        let rim = ((u / 7.6).powi(4) + (v / 7.6).powi(4)).min(1.0);
        let tone = 0.8 + 0.25 * grain(shifted / 16, row) + 0.08 * grain(x, y);
        shade([150, 142, 130], tone * (1.0 - 0.45 * rim))
    })
}
