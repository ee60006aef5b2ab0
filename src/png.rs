//! Pictures as files.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use umbriel_render::RgbaPixels;

/// Why a picture could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub(crate) struct WriteError {
    path: PathBuf,
    reason: String,
}

/// Writes a PNG with what made it; folders are made.
pub(crate) fn write(path: &Path, pixels: &RgbaPixels, device: &str) -> Result<(), WriteError> {
    let error = |reason: String| WriteError { path: path.to_path_buf(), reason };
    if let Some(folder) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|e| error(e.to_string()))?;
    }
    let file = File::create(path).map_err(|e| error(e.to_string()))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), pixels.width, pixels.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let software = format!("Umbriel {}", env!("CARGO_PKG_VERSION"));
    for (keyword, text) in [("Software", software), ("Source", device.to_string())] {
        encoder.add_itxt_chunk(keyword.to_string(), text).map_err(|e| error(e.to_string()))?;
    }
    let mut writer = encoder.write_header().map_err(|e| error(e.to_string()))?;
    writer.write_image_data(&pixels.rgba).map_err(|e| error(e.to_string()))?;
    writer.finish().map_err(|e| error(e.to_string()))
}

/// Puts layers of equal size side by side.
pub(crate) fn row(layers: &[RgbaPixels]) -> RgbaPixels {
    let (width, height) = layers.first().map_or((0, 0), |l| (l.width, l.height));
    let line = 4 * width as usize;
    let rows = (0..height as usize).flat_map(|y| layers.iter().flat_map(move |l| &l.rgba[y * line..(y + 1) * line]));
    RgbaPixels { rgba: rows.copied().collect(), width: width * layers.len() as u32, height }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_stand_in_a_row() {
        let layer = |v: u8| RgbaPixels { width: 1, height: 2, rgba: [[v; 4], [v + 1; 4]].concat() };
        let both = row(&[layer(10), layer(20)]);
        assert_eq!((both.width, both.height), (2, 2));
        assert_eq!(both.rgba, [[10; 4], [20; 4], [11; 4], [21; 4]].concat());
    }
}
