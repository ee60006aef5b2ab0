//! Plays recordings, and explains them.

use crate::cli;
use crate::headless;
use crate::session::Session;
use crate::source::{Replay, overview};
use crate::window;
use std::path::Path;
use umbriel_fields::Graph;

type Failure = Box<dyn std::error::Error>;

/// Plays a recording; gives the number of problems: differences, and a recording that is cut off.
pub(crate) fn run(args: &cli::Replay) -> Result<usize, Failure> {
    let mut replay = Replay::open(&args.file)?;
    replay.seek(args.seek)?;
    let mut problems = 0;
    if let Some(reason) = replay.truncated() {
        tracing::error!("{}: {reason}", args.file.display());
        problems += 1;
    }
    match (&args.out, args.headless) {
        (_, false) => window::replay(Session::replay(replay, &args.file), args).map(|()| problems),
        (Some(out), true) => Ok(problems + draw(replay, args, out)?),
        (None, true) => Ok(problems + compare(replay)?),
    }
}

/// Plays to the end; the first difference ends it, since all that follows differs too.
fn compare(mut replay: Replay) -> Result<usize, Failure> {
    let first = replay.position();
    let bar = headless::progress((replay.frames() - first) as u32, "frames");
    while replay.position() < replay.frames() {
        if let Some(divergence) = replay.step()? {
            bar.finish_and_clear();
            tracing::error!("the replay differs: {divergence}");
            say!("{} of {} frames are the same", replay.position() - first - 1, replay.frames() - first);
            return Ok(1);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    say!("{} frames replayed, all values the same bit by bit", replay.frames() - first);
    Ok(0)
}

fn draw(replay: Replay, args: &cli::Replay, out: &Path) -> Result<usize, Failure> {
    let frames = replay.position() as u32..replay.frames() as u32;
    let mut session = Session::replay(replay, &args.file).wait_for_casters();
    let wanted = headless::Wanted { view: args.view.as_deref(), size: args.size, shadow_of: None, out };
    // A recording has its own times.
    Ok(headless::draw(&mut session, frames, |_| 0.0, None, &wanted)?.problems)
}

/// Tells why a field holds what it holds, what nodes cost, or what is in the recording.
pub(crate) fn explain(args: &cli::Explain) -> Result<String, Failure> {
    if args.node.is_none() && !args.costs && !args.dot {
        return Ok(format!("{}\n", overview(&args.file)?));
    }
    let mut replay = Replay::open(&args.file)?;
    replay.graph_mut().explain(true);
    let last = args.frame.unwrap_or(replay.frames());
    if last > replay.frames() {
        return Err(format!("{}: it has {} frames", args.file.display(), replay.frames()).into());
    }
    while replay.position() < last {
        if let Some(divergence) = replay.step()? {
            return Err(format!("the replay differs: {divergence}").into());
        }
    }
    let graph = replay.graph_mut();
    let mut text = String::new();
    if let (Some(node), Some(field)) = (&args.node, &args.field) {
        text += &why(graph, node, field)?;
    }
    if args.costs {
        let line = |c: umbriel_fields::Cost| {
            format!("{:>9} evaluations {:>10.3} ms  {}\n", c.evaluations, 1e3 * c.time.as_secs_f64(), c.name)
        };
        text.extend(graph.costs().into_iter().map(line));
    }
    if args.dot {
        text += &graph.dot();
    }
    Ok(text)
}

fn why(graph: &Graph, node: &str, field: &str) -> Result<String, Failure> {
    let found = if node.starts_with('/') { graph.find_path(node) } else { graph.find(node) };
    let found = found.ok_or_else(|| {
        let nearest = umbriel_fields::nearest(node, graph.names()).map(|n| format!("; did you mean '{n}'?"));
        format!("there is no node '{node}'{}", nearest.unwrap_or_default())
    })?;
    let causes = graph.why(graph.field(found, field)?);
    Ok(causes.iter().map(|cause| format!("{cause}\n")).collect())
}
