//! A display process: in a window, or without one.

use super::interrupt::Interrupt;
use super::join::SILENCE;
use super::screen::{Canvas, InWindow, ScreenError, Sight};
use super::{Failure, security};
use crate::cli;
use crate::window::screenshot;
use std::io::Write;
use std::time::{Duration, Instant};
use umbriel_displays::cluster::{ClusterError, Event, Follower, FollowerOptions, Pointing, Progress, Screen};
use umbriel_displays::navigation::Input;
use umbriel_displays::rig::Aim;
use umbriel_displays::window::{self, App, Command, Options, Stage};
use umbriel_fields::{NodeType, TypeRegistry, builtin_types};
use umbriel_render::RgbaPixels;

/// How long a display that ends with its application waits for the first word of it.
const PATIENCE_S: u64 = 60;
/// How long messages are waited for between two looks at mouse and keys.
const TURN: Duration = Duration::from_millis(4);

/// Follows an application until it ends, until the window is closed or Ctrl-C, or for ever.
pub(crate) fn display(args: &cli::Display) -> Result<usize, Failure> {
    // What draws is made while the application is looked for.
    let canvas = args.headless.then(|| Canvas::new(&args.show, args.out.as_deref()));
    let mut process = Process::start(args)?;
    let ended = if let Some(mut canvas) = canvas {
        // What is corrupted shows in a frame that comes after it.
        let patience = Duration::from_millis(if args.corrupt.is_some() { 1 } else { 50 });
        loop {
            match canvas.settle().map_err(Failure::from).and_then(|()| process.turn(&mut canvas, patience)) {
                Ok(true) => {}
                other => break other.map(drop),
            }
        }
    } else {
        let options = Options { fullscreen: args.fullscreen, ..Options::default() };
        let mut windowed = Windowed { process, sight: Sight::new(&args.show), ended: false };
        let ended = window::run(&mut windowed, options);
        process = windowed.process;
        ended
    };
    // Whoever started it may not listen any more.
    let _ = writeln!(std::io::stdout(), "{}", summary(&process.follower));
    ended.map(|()| 0)
}

/// What both kinds of display do.
struct Process<'a> {
    args: &'a cli::Display,
    follower: Follower,
    interrupt: Interrupt,
    started: Instant,
    /// Silence was told of.
    is_told: bool,
    /// How long the start took was told of.
    is_up: bool,
    /// The frame after which the replica is still to be corrupted.
    corrupt_after: Option<u64>,
}

impl Process<'_> {
    fn start(args: &cli::Display) -> Result<Process<'_>, Failure> {
        let started = Instant::now();
        let types: Vec<NodeType> = umbriel_scenegraph::node_types().into_iter().chain(builtin_types()).collect();
        let options = FollowerOptions {
            endpoint: args.connect.clone(),
            security: security(&args.link),
            lease: args.link.lease(),
            ends_with_application: args.once,
            uses_memory: true,
            cache: args.kept.options(),
        };
        Ok(Process {
            args,
            follower: Follower::connect(options, &args.show, TypeRegistry::from(types))?,
            interrupt: Interrupt::watch()?,
            started,
            is_told: false,
            is_up: false,
            corrupt_after: args.corrupt,
        })
    }

    /// Follows for a while. False where the display ends.
    fn turn<S: Screen<Error = ScreenError>>(&mut self, screen: &mut S, patience: Duration) -> Result<bool, Failure> {
        self.follower.run(screen, patience)?;
        let is_alone = !self.follower.found_application();
        if is_alone && self.started.elapsed() > SILENCE && !std::mem::replace(&mut self.is_told, true) {
            tracing::warn!("no application answers at {} yet; waiting for it", self.args.connect);
        }
        if self.args.once && is_alone && self.started.elapsed() > Duration::from_secs(PATIENCE_S) {
            let has_certificates = self.args.link.certificates.is_some();
            return Err(ClusterError::silent(&self.args.connect, PATIENCE_S, has_certificates).into());
        }
        if !self.is_up && self.follower.progress().shown.is_some() {
            self.is_up = true;
            tracing::info!("{}", start_of(&self.args.show, self.started, self.follower.progress()));
        }
        if self.corrupt_after.is_some_and(|frame| corrupt(&mut self.follower, frame)) {
            self.corrupt_after = None;
        }
        Ok(!self.follower.is_over() && !self.interrupt.came())
    }
}

/// A display whose window takes mouse and keys, which the application hears of.
struct Windowed<'a> {
    process: Process<'a>,
    sight: Sight,
    ended: bool,
}

impl App for Windowed<'_> {
    type Error = Failure;

    fn turn(&mut self, _time_s: f64, stage: &mut Stage<'_>) -> Result<(), Failure> {
        let goes_on = self.process.turn(&mut InWindow { sight: &mut self.sight, stage }, TURN)?;
        self.ended |= !goes_on;
        Ok(())
    }

    fn is_over(&self) -> bool {
        self.ended
    }

    fn waits(&self) -> bool {
        true
    }

    fn navigate(&mut self, input: Input<'_>) {
        self.process.follower.tell(Event::Moved(input.into()));
    }

    fn point(&mut self, _window: &str, aim: Aim) {
        let Some(replica) = self.process.follower.replica() else { return };
        if let Some(pointed) = self.sight.point(replica.graph(), &aim) {
            let pointing = Pointing::new(&pointed, |node| replica.number(node));
            self.process.follower.tell(Event::Pointed(pointing));
        }
    }

    fn command(&mut self, command: Command) {
        match command {
            Command::ResetNavigation => self.process.follower.tell(Event::Home),
            // Which viewpoint a display shows is said at its start, and files are the application's.
            Command::NextViewpoint | Command::PreviousViewpoint | Command::Reload => {}
        }
    }

    fn title(&self) -> String {
        "Umbriel".into()
    }

    fn screenshot(&mut self, name: &str, pixels: &RgbaPixels) {
        screenshot("display", name, pixels);
    }
}

/// Where the time went until the first picture was shown, in a line.
fn start_of(show: &str, started: Instant, progress: &Progress) -> String {
    let ms = |when: Option<Instant>| when.map_or(0, |when| when.saturating_duration_since(started).as_millis());
    format!(
        "display `{show}` is up after {} ms: application found after {} ms, its world here after {}, first drawing from {} to {}",
        ms(progress.shown),
        ms(progress.found),
        ms(progress.world),
        ms(progress.draws),
        ms(progress.drawn)
    )
}

fn summary(follower: &Follower) -> String {
    let report = follower.report();
    let differences: Vec<String> = report.differences.iter().map(|difference| format!("; differed: {difference}")).collect();
    format!(
        "shown={} snapshots={} longest_gap_ms={:.1} fetched_bytes={} kept_bytes={} differences={}{}",
        report.shown,
        report.snapshots,
        report.longest_gap_ms,
        report.fetched,
        report.kept,
        report.differences.len(),
        differences.concat()
    )
}

/// Changes a value behind the application's back, once a frame was drawn: the next one is the first that may be wrong.
fn corrupt(follower: &mut Follower, frame: u64) -> bool {
    let drawn = follower.drawn_frame();
    let Some(replica) = follower.replica_mut().filter(|replica| replica.frame() >= frame && replica.frame() == drawn) else {
        return false;
    };
    let graph = replica.graph_mut();
    // What the application writes in each frame is right again with the next one, so the one that was left alone for longest is taken.
    let fields = ["translation", "direction", "position", "lower_left"];
    let places = graph.nodes().flat_map(|node| fields.map(|field| (node, field)));
    let places = places.filter(|(node, field)| graph.get_named::<glam::Vec3>(*node, field).is_ok());
    let victim = places.min_by_key(|(node, _)| graph.node_revision(*node));
    victim.is_some_and(|(node, field)| graph.set_named(node, field, glam::Vec3::splat(0.25)).is_ok())
}
