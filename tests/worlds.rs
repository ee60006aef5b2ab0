//! Every world is drawn and compared with the small picture beside it.
//!
//! `UMBRIEL_BLESS=1 cargo test --test umbriel worlds` draws the pictures again; look at them before you commit.

use crate::support::{root, umbriel};
use image::{RgbImage, imageops};
use std::path::{Path, PathBuf};

/// Limits of a picture in the repository.
const LARGEST_SIDE: u32 = 256;
const LARGEST_FILE: usize = 8192;
/// Mean difference over the picture, and over its worst block of 8 x 8 pixels, of 255 steps. The palette of the stored
/// picture alone costs 2 and 8.
const LARGEST_MEAN: f32 = 4.0;
const LARGEST_BLOCK: f32 = 24.0;

fn worlds() -> Vec<PathBuf> {
    let folder = root().join("scripts/worlds");
    let mut worlds: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("the worlds' folder can be read")
        .map(|e| e.expect("its entries can be read").path())
        .filter(|p| p.extension().is_some_and(|x| x == "rhai"))
        .collect();
    worlds.sort();
    worlds
}

fn draw(world: &Path) -> RgbImage {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(world.with_extension("png").file_name().expect("worlds have names"));
    let run =
        umbriel(&["run", world.to_str().expect("paths are text"), "--headless", "--out", out.to_str().expect("paths are text")]);
    assert!(run.ok, "{}: {}", world.display(), run.stderr);
    image::open(&out).unwrap_or_else(|e| panic!("{}: {e}", out.display())).to_rgb8()
}

fn fitted(picture: &RgbImage, side: u32) -> RgbImage {
    let scale = (side as f32 / picture.width().max(picture.height()) as f32).min(1.0);
    let across = |pixels: u32| ((pixels as f32 * scale).round() as u32).max(1);
    imageops::thumbnail(picture, across(picture.width()), across(picture.height()))
}

/// The picture in a palette, as PNG.
fn indexed(picture: &RgbImage, colors: usize) -> Vec<u8> {
    let rgba: Vec<u8> = picture.pixels().flat_map(|p| [p[0], p[1], p[2], 255]).collect();
    let palette = color_quant::NeuQuant::new(1, colors, &rgba);
    let indices: Vec<u8> = rgba.chunks_exact(4).map(|p| palette.index_of(p) as u8).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width(), picture.height());
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette.color_map_rgb());
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header().expect("a header can be written to memory");
    writer.write_image_data(&indices).expect("a picture can be written to memory");
    writer.finish().expect("a picture can be finished in memory");
    bytes
}

/// The largest picture, in the most colours, that the limits allow.
fn bless(picture: &RgbImage, golden: &Path) {
    for side in [256, 224, 192, 160, 144, 128, 112, 96] {
        for colors in [64, 48] {
            let bytes = indexed(&fitted(picture, side), colors);
            if bytes.len() <= LARGEST_FILE {
                std::fs::write(golden, bytes).unwrap_or_else(|e| panic!("{}: {e}", golden.display()));
                return;
            }
        }
    }
    panic!("{}: no picture of 8 kB can be made of it", golden.display());
}

/// Mean difference, and that of the worst block.
fn difference(a: &RgbImage, b: &RgbImage) -> (f32, f32) {
    let (width, height) = a.dimensions();
    let across = width.div_ceil(8);
    let mut blocks = vec![(0.0, 0.0); (across * height.div_ceil(8)) as usize];
    for (x, y, p) in a.enumerate_pixels() {
        let q = b.get_pixel(x, y);
        let d = (0..3).map(|c| f32::from(p[c].abs_diff(q[c]))).sum::<f32>() / 3.0;
        let block = &mut blocks[(y / 8 * across + x / 8) as usize];
        *block = (block.0 + d, block.1 + 1.0);
    }
    let (sum, count) = blocks.iter().fold((0.0, 0.0), |t, b| (t.0 + b.0, t.1 + b.1));
    (sum / count, blocks.iter().map(|b| b.0 / b.1).fold(0.0, f32::max))
}

#[test]
fn every_world_looks_like_its_picture() {
    let mut wrong = Vec::new();
    for world in worlds() {
        let (drawn, golden) = (draw(&world), world.with_extension("png"));
        if std::env::var_os("UMBRIEL_BLESS").is_some() {
            bless(&drawn, &golden);
            continue;
        }
        let Ok(stored) = image::open(&golden) else {
            wrong.push(format!("{}: there is no picture beside it", world.display()));
            continue;
        };
        let stored = stored.to_rgb8();
        let bytes = std::fs::metadata(&golden).map_or(0, |m| m.len());
        if stored.width().max(stored.height()) > LARGEST_SIDE || bytes > LARGEST_FILE as u64 {
            wrong.push(format!("{}: {}x{} and {bytes} bytes are too large", golden.display(), stored.width(), stored.height()));
        }
        let small = imageops::thumbnail(&drawn, stored.width(), stored.height());
        let (mean, block) = difference(&small, &stored);
        println!("{:24} mean {mean:4.1}  worst block {block:4.1}", world.file_stem().unwrap_or_default().display());
        if mean > LARGEST_MEAN || block > LARGEST_BLOCK {
            wrong.push(format!("{}: differs from its picture, mean {mean:.1}, worst block {block:.1}", world.display()));
        }
    }
    assert!(wrong.is_empty(), "\n{}\nUMBRIEL_BLESS=1 draws the pictures again.", wrong.join("\n"));
}

#[test]
fn the_comparison_sees_a_missing_shadow() {
    let lit = RgbImage::from_pixel(64, 48, image::Rgb([200, 200, 200]));
    let mut shadowed = lit.clone();
    for (x, y) in (0..12).flat_map(|x| (0..12).map(move |y| (x + 20, y + 20))) {
        shadowed.put_pixel(x, y, image::Rgb([120, 120, 120]));
    }
    let (_, block) = difference(&lit, &shadowed);
    assert!(block > LARGEST_BLOCK, "{block}");
}
