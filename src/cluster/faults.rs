//! What is broken on purpose, when, and what came of it.

use super::Failure;
use super::harness::{Launcher, Process};
use crate::cli::{self, Fault, FaultKind};
use clap::ValueEnum;
use std::collections::VecDeque;
use std::process::{Child, Command};
use std::time::{Duration, Instant};
use umbriel_displays::cluster::{Host, Waits};

/// How long a fault lasts, but for kill.
const LASTS: Duration = Duration::from_secs(1);
/// How long a display may take to come back.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long everybody is left alone between two random faults.
const REST: Duration = Duration::from_millis(300);
/// How often the memory of all processes is told while faults are random.
const TELLS_MEMORY: Duration = Duration::from_secs(30);

/// A fault that began.
struct Open {
    fault: Fault,
    /// Where dice chose it.
    seed: Option<u64>,
    heals: Instant,
    is_healed: bool,
    /// Was the display out of the lock at all?
    was_out: bool,
    /// Was its line given up, and how long did the new one take to come?
    was_given_up: bool,
    joined: Option<Duration>,
    /// Waits and disagreements before it.
    waits: Waits,
    disagreed: u64,
}

/// The faults that are still to come, and those that are not over.
pub(super) struct Plan {
    pending: VecDeque<Fault>,
    open: Vec<Open>,
    random: Option<Random>,
    failures: usize,
    /// When everybody was in the lock for the last time.
    whole: Instant,
}

/// Faults by dice, one after the other.
struct Random {
    next_seed: u64,
    end_seed: u64,
    ends: Option<Instant>,
    shows: Vec<String>,
    kinds: Vec<FaultKind>,
    rests_until: Instant,
    told_memory: Option<Instant>,
}

impl Plan {
    /// `can` says what can be broken here.
    pub(super) fn new(args: &cli::Cluster, shows: &[String], can: impl Fn(FaultKind) -> bool) -> Plan {
        let random = args.random.map(|count| Random {
            next_seed: args.seed,
            end_seed: args.seed.saturating_add(count),
            ends: args.minutes.map(|minutes| Instant::now() + Duration::from_secs_f64(minutes * 60.0)),
            shows: shows.to_vec(),
            kinds: FaultKind::value_variants().iter().copied().filter(|kind| can(*kind)).collect(),
            rests_until: Instant::now(),
            told_memory: None,
        });
        let mut pending = args.fault.clone();
        pending.sort_by_key(|fault| fault.frame);
        Plan { pending: pending.into(), open: Vec::new(), random, failures: 0, whole: Instant::now() }
    }

    /// Is everything broken that was to be, and back?
    pub(super) fn is_over(&self) -> bool {
        let is_done = self.pending.is_empty() && self.open.is_empty() && self.random.as_ref().is_none_or(Random::is_over);
        is_done || self.is_stuck()
    }

    /// With nothing else left to wait for: a display stays away.
    fn is_stuck(&self) -> bool {
        self.whole.elapsed() > 2 * PATIENCE
    }

    /// How often a display did not come back.
    pub(super) fn failures(&self) -> usize {
        self.failures + (self.is_stuck() && !self.pending.is_empty()) as usize
    }

    /// Begins what is due. Everybody is in the lock.
    pub(super) fn begin(
        &mut self,
        frame: u64,
        host: &Host,
        processes: &mut [Process],
        launcher: &Launcher<'_>,
    ) -> Result<(), Failure> {
        self.whole = Instant::now();
        while let Some(fault) = self.pending.pop_front_if(|fault| fault.frame <= frame) {
            self.open.push(begin(fault, None, host, processes, launcher)?);
        }
        let Some(random) = &mut self.random else { return Ok(()) };
        if random.told_memory.is_none_or(|told| told.elapsed() > TELLS_MEMORY) {
            random.told_memory = Some(Instant::now());
            say!("frame {frame}: resident {}", resident(processes));
        }
        if self.open.is_empty() && Instant::now() > random.rests_until && !random.is_over() {
            let (seed, fault) = random.next(frame);
            self.open.push(begin(fault, Some(seed), host, processes, launcher)?);
        }
        Ok(())
    }

    /// Mends what lasted long enough, and tells what came back.
    pub(super) fn watch(&mut self, host: &Host, processes: &[Process]) -> Result<(), Failure> {
        if self.open.is_empty() {
            return Ok(());
        }
        let live = host.live();
        for open in &mut self.open {
            heal(open, processes)?;
            let is_live = live.contains(&open.fault.display);
            open.was_out |= !is_live;
            let is_known = host.knows(&open.fault.display);
            open.was_given_up |= !is_known;
            if open.is_healed && open.was_given_up && is_known {
                open.joined.get_or_insert(open.heals.elapsed());
            }
        }
        let is_over = |open: &mut Open| {
            let is_live = live.contains(&open.fault.display);
            // Who was killed is out for certain, once the application has noticed: until then it is the old process that is live.
            let was_out = open.was_out || open.fault.kind != FaultKind::Kill && open.heals.elapsed() > LASTS;
            let is_back = open.is_healed && is_live && was_out;
            is_back || Instant::now() > open.heals + PATIENCE
        };
        for open in self.open.extract_if(.., is_over) {
            let is_back = live.contains(&open.fault.display);
            self.failures += !is_back as usize;
            say!("{}", outcome(&open, host, is_back));
            if let Some(random) = &mut self.random {
                random.rests_until = Instant::now() + REST;
            }
        }
        Ok(())
    }
}

impl Random {
    fn is_over(&self) -> bool {
        self.next_seed >= self.end_seed || self.ends.is_some_and(|ends| Instant::now() > ends)
    }

    /// The same seed breaks the same display in the same way.
    fn next(&mut self, frame: u64) -> (u64, Fault) {
        let seed = self.next_seed;
        self.next_seed += 1;
        let mut dice = fastrand::Rng::with_seed(seed);
        let kind = self.kinds[dice.usize(..self.kinds.len())];
        let display = self.shows[dice.usize(..self.shows.len())].clone();
        (seed, Fault { kind, frame, display })
    }
}

/// What a fault did, in a line.
fn outcome(open: &Open, host: &Host, is_back: bool) -> String {
    let Fault { kind, frame, display } = &open.fault;
    let seed = open.seed.map(|seed| format!("seed {seed}: ")).unwrap_or_default();
    let stall_ms = host.report().waits.since(&open.waits).longest().as_secs_f64() * 1e3;
    let took_ms = open.heals.elapsed().as_secs_f64() * 1e3;
    let back = match (is_back, open.was_out, open.joined) {
        (false, ..) => "did not come back".into(),
        (true, false, _) => "never out of the lock".into(),
        (true, true, None) => format!("back after {took_ms:.0} ms"),
        (true, true, Some(joined)) => {
            format!("back after {took_ms:.0} ms, of which {:.0} ms until it joined", joined.as_secs_f64() * 1e3)
        }
    };
    let disagreed = host.report().disagreed - open.disagreed;
    format!("{seed}{kind:?}@{frame}:{display}: longest stall {stall_ms:.1} ms, {back}, {disagreed} disagreed")
}

fn begin(
    fault: Fault,
    seed: Option<u64>,
    host: &Host,
    processes: &mut [Process],
    launcher: &Launcher<'_>,
) -> Result<Open, Failure> {
    let process = processes.iter_mut().find(|process| process.show == fault.display).ok_or("no such display")?;
    let mut heals = Instant::now() + LASTS;
    match fault.kind {
        FaultKind::Kill => {
            process.child.kill()?;
            process.child.wait()?;
            heals = Instant::now();
            process.child = launcher.spawn(&process.show, &process.wire, false)?;
        }
        FaultKind::Freeze => signal(&process.child, "-STOP")?,
        kind => process.wire.fail(kind)?,
    }
    tracing::info!("{:?} of `{}` at frame {}", fault.kind, fault.display, fault.frame);
    Ok(Open {
        was_out: false,
        fault,
        seed,
        heals,
        is_healed: false,
        was_given_up: false,
        joined: None,
        waits: host.report().waits,
        disagreed: host.report().disagreed,
    })
}

fn heal(open: &mut Open, processes: &[Process]) -> Result<(), Failure> {
    if open.is_healed || Instant::now() < open.heals {
        return Ok(());
    }
    let process = processes.iter().find(|process| process.show == open.fault.display).ok_or("no such display")?;
    match open.fault.kind {
        FaultKind::Kill => {}
        FaultKind::Freeze => signal(&process.child, "-CONT")?,
        FaultKind::Delay | FaultKind::Loss | FaultKind::Partition => process.wire.heal()?,
    }
    if open.fault.kind != FaultKind::Kill {
        open.heals = Instant::now();
    }
    open.is_healed = true;
    Ok(())
}

fn signal(child: &Child, signal: &str) -> Result<(), Failure> {
    let status = Command::new("kill").args([signal, &child.id().to_string()]).status()?;
    if status.success() { Ok(()) } else { Err(format!("kill {signal}: {status}").into()) }
}

/// Memory of this process and of all displays, mebibytes, where the system tells.
fn resident(processes: &[Process]) -> String {
    let of = |id: u32| {
        let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
        line.split_whitespace().next()?.parse::<u64>().ok()
    };
    let mib = |id: u32| of(id).map_or("?".into(), |kib| format!("{:.1}", kib as f64 / 1024.0));
    let displays: Vec<String> =
        processes.iter().map(|process| format!("{} {} MiB", process.show, mib(process.child.id()))).collect();
    format!("application {} MiB, {}", mib(std::process::id()), displays.join(", "))
}
