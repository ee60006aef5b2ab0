//! Saves a world, for `run` to go on with.

use crate::cli::Save;
use crate::session::{SAVED, Session};
use std::path::PathBuf;
use umbriel_scripts::SaveForm;

/// Runs the frames that were asked for and writes the file. Gives the number of problems that were reported meanwhile.
pub(crate) fn run(args: &Save) -> Result<usize, Box<dyn std::error::Error>> {
    let out = args.out.clone().unwrap_or_else(|| args.path.with_extension(SAVED));
    if out.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case(SAVED)) {
        return Err(format!("{}: saved worlds are called .{SAVED}", out.display()).into());
    }
    let mut session = Session::open(&args.path)?;
    (0..args.frames).for_each(|frame| session.evaluate(f64::from(frame) / args.fps));
    let problems = session.problems();
    problems.iter().for_each(|problem| tracing::error!("{problem}"));
    let form = if args.binary { SaveForm::Binary } else { SaveForm::Text };
    let bytes = session.save(form)?.ok_or("a recording is no world")?;
    std::fs::write(&out, &bytes).map_err(|error| format!("{}: {error}", out.display()))?;
    let folder = |path: &PathBuf| path.parent().and_then(|folder| std::path::absolute(folder).ok());
    if folder(&out) != folder(&args.path) {
        tracing::warn!("{}: the script and pictures of the world will be looked for beside it", out.display());
    }
    say!("{} nodes, {} bytes: {}", session.graph().node_count(), bytes.len(), out.display());
    Ok(problems.len())
}
