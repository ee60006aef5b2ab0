//! What several tests need.

use std::path::{Path, PathBuf};

/// The root of the repository.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of other people's models: `UMBRIEL_SAMPLES`, or `shared/samples` beside the repository. Where it is
/// absent the caller's test is not run and says so, unless `UMBRIEL_REQUIRE_SAMPLES` makes that a failure.
pub(crate) fn samples() -> Option<PathBuf> {
    let folder = std::env::var_os("UMBRIEL_SAMPLES").map_or_else(|| root().join("../shared/samples"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(std::env::var_os("UMBRIEL_REQUIRE_SAMPLES").is_none(), "the samples are required, but {} is absent", folder.display());
    println!("not run: the samples are absent ({})", folder.display());
    None
}
