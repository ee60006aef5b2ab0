//! What several tests need.

#[cfg(feature = "cluster")]
pub(crate) mod foreign;
#[cfg(feature = "cluster")]
pub(crate) mod process;
#[cfg(target_os = "linux")]
pub(crate) mod screen;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

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
    assert!(
        std::env::var_os("UMBRIEL_REQUIRE_SAMPLES").is_none(),
        "the samples are required, but {} is absent",
        folder.display()
    );
    // Straight to the terminal: what a passing test prints is not shown.
    let _ = writeln!(std::io::stderr(), "not run: the samples are absent ({})", folder.display());
    None
}

/// What a run of the command gave.
pub(crate) struct Run {
    /// Its exit status was 0.
    pub(crate) ok: bool,
    /// What it printed.
    pub(crate) stdout: String,
    /// What it reported.
    pub(crate) stderr: String,
}

/// Runs the `umbriel` command to its end.
pub(crate) fn umbriel(args: &[&str]) -> Run {
    umbriel_told(args, "")
}

/// Runs the `umbriel` command to its end, with a short text to read.
pub(crate) fn umbriel_told(args: &[&str], input: &str) -> Run {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_umbriel"));
    command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the command can be started");
    let _ = child.stdin.take().expect("it has an input").write_all(input.as_bytes()); // who does not read it may be gone
    let output = child.wait_with_output().expect("the command ends");
    Run {
        ok: output.status.success(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

/// Tries again and again until something is found or patience ends.
pub(crate) fn until<T>(patience: Duration, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let started = Instant::now();
    loop {
        let found = look();
        if found.is_some() || started.elapsed() > patience {
            return found;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}
