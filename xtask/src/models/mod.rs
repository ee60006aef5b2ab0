//! The models that the worlds show: made here, so that the repository holds only what we made.
//!
//! Some have open meshes (awnings, roofs, leaves, hulls), one is skinned and animated, most are textured: the cases that
//! real models bring.

mod figure;
mod glb;
mod harbour;
mod paint;
mod surface;
mod town;
mod trees;

use glb::Glb;
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

/// Writes every model as `NAME.glb` into `folder`.
pub(crate) fn write_all(folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for (name, build) in MODELS {
        let path = folder.join(format!("{name}.glb"));
        let bytes = build().finish();
        std::fs::write(&path, &bytes).map_err(|e| format!("{}: {e}", path.display()))?;
        println!("{name}.glb  {} bytes", bytes.len());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_models_in_the_repository_are_what_the_generator_writes() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/worlds/models");
        for (name, build) in MODELS {
            let path = folder.join(format!("{name}.glb"));
            let stored = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}; run `cargo xtask models`", path.display()));
            assert!(stored == build().finish(), "{name}.glb is stale: run `cargo xtask models`");
        }
    }
}
