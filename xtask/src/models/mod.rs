//! The models that the worlds show: made here, so that the repository holds only what we made.
//!
//! Some have open meshes (awnings, roofs, leaves, hulls), one is skinned and animated, most are textured: the cases that
//! real models bring.

mod figure;
mod glb;
mod harbour;
mod paint;
mod slides;
mod surface;
mod town;
mod trees;

use glb::Glb;
use image::RgbaImage;
use std::path::Path;

type Build = fn() -> Glb;

const MODELS: [(&str, Build); 11] = [
    ("house", town::house),
    ("stall", town::stall),
    ("church", town::church),
    ("fountain", town::fountain),
    ("lamp", town::lamp),
    ("square", town::square),
    ("tree", trees::tree),
    ("figure", figure::figure),
    ("ferry", harbour::ferry),
    ("barge", harbour::barge),
    ("crane", harbour::crane),
];

type Paint = fn() -> RgbaImage;

/// Pictures that worlds project.
const SLIDES: [(&str, Paint); 2] = [("evening", slides::evening), ("rose", slides::rose)];

/// All files: name and content.
fn files() -> impl Iterator<Item = (String, Vec<u8>)> {
    let models = MODELS.into_iter().map(|(name, build)| (format!("{name}.glb"), build().finish()));
    models.chain(SLIDES.into_iter().map(|(name, paint)| (format!("{name}.png"), slides::png(&paint()))))
}

/// Writes every model as `NAME.glb` and every slide as `NAME.png` into `folder`.
pub(crate) fn write_all(folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for (name, bytes) in files() {
        let path = folder.join(&name);
        std::fs::write(&path, &bytes).map_err(|e| format!("{}: {e}", path.display()))?;
        println!("{name}  {} bytes", bytes.len());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_models_in_the_repository_are_what_the_generator_writes() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/worlds/models");
        for (name, bytes) in files() {
            let path = folder.join(&name);
            let stored = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}; run `cargo xtask models`", path.display()));
            assert!(stored == bytes, "{name} is stale: run `cargo xtask models`");
        }
    }
}
