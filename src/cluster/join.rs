//! A script in a world that another process evaluates.

use super::interrupt::Interrupt;
use super::{Failure, security};
use crate::cli::{self, OnLeave};
use crate::console::Console;
use crate::session::folder_of;
use std::time::{Duration, Instant};
use umbriel_displays::cluster::{ClusterError, Guest, News, Whose, Wish};
use umbriel_scenegraph::Embedder;
use umbriel_scripts::{Request, Sharing, World, shared_graph};

/// How long who ends with the other application waits for its first word.
const PATIENCE_S: u64 = 60;
/// After so long without an answer, that is told.
pub(super) const SILENCE: Duration = Duration::from_secs(2);

/// Runs until the last frame, until Ctrl-C, or for ever.
pub(crate) fn join(args: &cli::Join) -> Result<usize, Failure> {
    if !args.path.is_file() {
        return Err(format!("cannot read {}: there is no such file", args.path.display()).into());
    }
    let stem = || args.path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let name = args.name.clone().unwrap_or_else(stem);
    let keeps = args.on_leave == OnLeave::Keep;
    let mut guest = Guest::connect(&args.connect, &security(&args.link), args.link.lease(), &name, keeps, shared_graph)?;
    let interrupt = Interrupt::watch()?;
    let console = Console::open(args.console);
    let started = Instant::now();
    let mut embedder = Embedder::new(folder_of(&args.path));
    let (mut world, mut frames, mut problems, mut is_told): (Option<World>, u64, usize, bool) = (None, 0, 0, false);
    while !interrupt.came() && args.frames.is_none_or(|most| frames < most) {
        match guest.next(Duration::from_millis(50))? {
            News::None if guest.found_host() => {}
            News::None => {
                if started.elapsed() > SILENCE && !std::mem::replace(&mut is_told, true) {
                    tracing::warn!("no application answers at {} yet; waiting for it", args.connect);
                }
                if args.once && started.elapsed() > Duration::from_secs(PATIENCE_S) {
                    return Err(ClusterError::silent(&args.connect, PATIENCE_S, args.link.certificates.is_some()).into());
                }
            }
            News::HostGone if args.once => break,
            News::HostGone => {
                tracing::warn!("the application that evaluates the world is gone; waiting for it to come back");
                world = None;
            }
            News::Begins => {
                let (graph, whose) = guest.enter();
                let mut fresh = World::join_file(&args.path, graph, sharing(&name, whose))?;
                tracing::info!("`{name}` is in the world of `{}` from frame {} on", guest.host(), guest.frame());
                embedder = Embedder::new(folder_of(&args.path));
                tell(&mut guest, &mut fresh, &mut embedder);
                problems += report(&mut fresh);
                world = Some(fresh);
            }
            News::Frame(time_s) => {
                let Some(world) = &mut world else { continue };
                frames += 1;
                follow(&mut guest, world);
                if let Some(console) = &console {
                    problems += console.run_all(&mut |line| world.console(line).map_err(|problem| problem.to_string()));
                }
                world.step_shared(time_s);
                tell(&mut guest, world, &mut embedder);
                problems += report(world);
            }
        }
    }
    guest.leave();
    say!("frames={frames}");
    Ok(problems)
}

fn sharing(name: &str, whose: Whose) -> Sharing {
    Sharing { me: name.into(), owners: whose.owners, locks: whose.locks, requests: Vec::new() }
}

/// What is known of others, taken out of the world and put back, since the world's graph is written meanwhile.
fn whose(world: &World) -> Whose {
    world.sharing_mut().map_or_else(Whose::default, |mut sharing| Whose {
        owners: std::mem::take(&mut sharing.owners),
        locks: std::mem::take(&mut sharing.locks),
        answers: Vec::new(),
        refused: Vec::new(),
    })
}

fn put_back(world: &World, whose: Whose) {
    if let Some(mut sharing) = world.sharing_mut() {
        (sharing.owners, sharing.locks) = (whose.owners, whose.locks);
    }
}

/// Takes over the news, and answers what the script asked for.
fn follow(guest: &mut Guest, world: &mut World) {
    let mut whose = whose(world);
    guest.follow(world.graph_mut(), &mut whose);
    let answers = std::mem::take(&mut whose.answers);
    whose.refused.drain(..).for_each(|why| tracing::error!("not done: {why}"));
    put_back(world, whose);
    for (node, answer) in answers {
        world.answer(node, &answer);
    }
}

/// Tells what the script did and what it asks for.
fn tell(guest: &mut Guest, world: &mut World, embedder: &mut Embedder) {
    let requests = world.sharing_mut().map(|mut sharing| std::mem::take(&mut sharing.requests)).unwrap_or_default();
    let wishes: Vec<Wish> = requests
        .into_iter()
        .map(|request| match request {
            Request::Lock(node) => Wish::Lock(node),
            Request::Unlock(node) => Wish::Unlock(node),
            Request::Keeps(keeps) => Wish::Keeps(keeps),
        })
        .collect();
    let whose = whose(world);
    embedder.update(world.graph_mut(), &|node| !whose.owners.contains_key(&node));
    guest.tell(world.graph_mut(), &whose, &wishes);
    put_back(world, whose);
}

fn report(world: &mut World) -> usize {
    let problems = world.problems();
    problems.iter().for_each(|problem| tracing::error!("{problem}"));
    problems.len()
}
