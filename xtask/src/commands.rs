//! What the sub-commands run.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// The root of the repository.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the repository").to_path_buf()
}

/// Builds the command and draws every world to `target/demo`.
pub(crate) fn demo() -> Result<(), String> {
    build()?;
    let out = root().join("target/demo");
    for world in worlds()? {
        let name = stem(&world);
        umbriel(&["run", &text(&world), "--headless", "--out", &text(&out.join(format!("{name}.png")))])?;
    }
    umbriel(&["shadow-error", &text(&root().join("scripts/worlds/hello.rhai"))])?;
    println!("\nThe pictures are in {}.", show(&out));
    println!("Open a world in a window: cargo run -- run scripts/worlds/market.rhai");
    Ok(())
}

/// Draws the small pictures beside the worlds again.
pub(crate) fn goldens() -> Result<(), String> {
    let args = ["test", "--package", "umbriel", "--test", "umbriel", "worlds::every_world"];
    run(cargo_command(&args).env("UMBRIEL_BLESS", "1"), "UMBRIEL_BLESS=1 cargo test worlds")
}

/// Formatting, lints, documentation and all tests.
pub(crate) fn test() -> Result<(), String> {
    let rows = [
        "fmt --all --check",
        "clippy --workspace --all-targets --features cluster -- --deny warnings",
        "doc --workspace --no-deps --document-private-items --features cluster",
        "test --workspace --no-fail-fast --features cluster",
    ];
    for row in rows {
        let started = Instant::now();
        let args: Vec<&str> = row.split(' ').collect();
        cargo(&args)?;
        println!("cargo {}: {:.0} s\n", args[0], started.elapsed().as_secs_f32());
    }
    Ok(())
}

fn build() -> Result<(), String> {
    cargo(&["build", "--package", "umbriel"])
}

fn cargo(args: &[&str]) -> Result<(), String> {
    run(&mut cargo_command(args), &format!("cargo {}", args.join(" ")))
}

fn cargo_command(args: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(args).env("RUSTDOCFLAGS", "--deny warnings");
    command
}

fn umbriel(args: &[&str]) -> Result<(), String> {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    run(
        Command::new(target.join("debug").join(format!("umbriel{}", std::env::consts::EXE_SUFFIX))).args(args),
        &format!("umbriel {}", args.join(" ")),
    )
}

fn run(command: &mut Command, what: &str) -> Result<(), String> {
    println!("$ {what}");
    let status = command.current_dir(root()).status().map_err(|e| format!("{what}: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("`{what}` failed: {status}")) }
}

/// The worlds, in the order of their names, as paths from the root of the repository.
fn worlds() -> Result<Vec<PathBuf>, String> {
    let folder = Path::new("scripts/worlds");
    let entries = std::fs::read_dir(root().join(folder)).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut worlds: Vec<PathBuf> = entries
        .filter_map(|e| Some(folder.join(e.ok()?.file_name())))
        .filter(|p| p.extension().is_some_and(|x| x == "rhai"))
        .collect();
    worlds.sort();
    Ok(worlds)
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

fn show(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).display().to_string()
}
