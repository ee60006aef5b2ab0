//! The project's own commands, run as `cargo xtask COMMAND`:
//!
//! - `demo`: sets up a Vulkan driver where there is none, builds, and draws the worlds in `scripts/worlds` to `target/demo`.
//! - `test`: the same set-up, then every check and test of the project.
//! - `models`: writes the models that the worlds use to `scripts/worlds/models`.
//! - `goldens`: draws every world again and replaces the pictures beside them.
//! - `peers fields`: measures the dataflow beside that of others.
//!
//! It knows nothing of Umbriel's crates: it runs commands and writes files.

mod apt;
mod commands;
mod models;
mod peers;
mod setup;

use std::process::ExitCode;

const USAGE: &str = "usage: cargo xtask COMMAND [--yes]

  demo      set up, build, and draw every world to target/demo
  test      set up, then run formatting, lints, documentation and all tests
  models    write the models of the worlds to scripts/worlds/models
  goldens   draw the pictures beside the worlds again
  peers fields   measure the dataflow beside bevy_ecs, and Coin3D where it is installed

  --yes     install missing system packages without asking (also when CI is set)";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let yes = args.iter().any(|a| a == "--yes") || std::env::var_os("CI").is_some();
    let mut words = args.iter().filter(|a| *a != "--yes");
    let result = match (words.next().map(String::as_str), words.next().map(String::as_str)) {
        (Some("demo"), None) => setup::ensure(setup::Need::Pictures, yes).and_then(|()| commands::demo()),
        (Some("test"), None) => setup::ensure(setup::Need::PicturesAndWindows, yes).and_then(|()| commands::test()),
        (Some("models"), None) => models::write_all(&commands::root().join("scripts/worlds/models")),
        (Some("peers"), Some("fields")) => peers::fields(),
        (Some("goldens"), None) => setup::ensure(setup::Need::Pictures, yes).and_then(|()| commands::goldens()),
        _ => Err(USAGE.to_string()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}
