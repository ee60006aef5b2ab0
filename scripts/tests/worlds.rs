//! Every world in `worlds/` loads and runs without a problem.

use std::path::{Path, PathBuf};

use umbriel_scripts::{Settings, World};

/// Sample models lie beside the repository, or where UMBRIEL_SAMPLES says.
fn samples() -> PathBuf {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/samples");
    std::env::var_os("UMBRIEL_SAMPLES").map_or(beside, PathBuf::from)
}

#[test]
fn every_world_runs() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("worlds");
    let entries = std::fs::read_dir(&folder).expect("the folder of worlds");
    let mut worlds: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    worlds.retain(|path| path.extension().is_some_and(|extension| extension == "rhai"));
    worlds.sort();
    assert!(worlds.len() >= 2, "{worlds:?}");
    let wrong: Vec<String> = worlds.iter().flat_map(|path| problems_of(path)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn problems_of(path: &Path) -> Vec<String> {
    let settings = Settings { asset_folders: vec![samples()], ..Settings::default() };
    let mut world = match World::load_file_with(path, settings) {
        Ok(world) => world,
        Err(error) => return vec![format!("{}: {error}", path.display())],
    };
    (0..3).for_each(|frame| drop(world.step(f64::from(frame) / 60.0)));
    let mut wrong = crate::support::problems(&mut world);
    if world.graph().node_count() <= 5 {
        wrong.push(format!("{} is empty", path.display()));
    }
    wrong
}
