//! An application and its displays on one machine: faults, and pictures compared with a render in one process.

use super::faults::Plan;
use super::interrupt::Interrupt;
use super::maps_once::MapsOnce;
use super::netns::{Hub, Namespace};
use super::refusals::lines;
use super::screen::{channel, file_of};
use super::wire::Wire;
use super::{Failure, serve};
use crate::cli::{self, Fault, FaultKind};
use crate::headless::DESKTOP_SIZE;
use crate::png;
use crate::session::Session;
use std::collections::BTreeMap;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};
use umbriel_displays::WindowSizes;
use umbriel_displays::cluster::{Host, HostOptions, LEASE, Proxy, Security};
use umbriel_render::{Gpu, Renderer};
use umbriel_scene::Picture;

/// How long a process may be silent where nothing is broken.
const PATIENCE: Duration = Duration::from_secs(60);

/// A display process.
pub(super) struct Process {
    pub(super) show: String,
    pub(super) child: Child,
    pub(super) wire: Wire,
}

/// Runs everything; gives the number of pictures and values that differ.
pub(crate) fn run(args: &cli::Cluster) -> Result<usize, Failure> {
    let mut session = Session::open(&args.path)?;
    let shows = shows(&args.path, args.channels)?;
    if let Some(fault) = args.fault.iter().find(|fault| !shows.contains(&fault.display)) {
        return Err(format!("there is no display `{}` to break; there are: {}", fault.display, shows.join(", ")).into());
    }
    let hub = args.netns.then(Hub::make).transpose()?;
    let address = free_address(hub.as_ref().map_or(Ipv4Addr::LOCALHOST, Hub::address))?;
    let default_ms = if args.breaks() { 200 } else { 60_000 };
    let options = HostOptions {
        listen: format!("tcp/{address}"),
        security: if args.netns { Security::Plain } else { Security::Loopback },
        timeout: Duration::from_millis(args.timeout_ms.unwrap_or(default_ms)),
        lease: lease(args),
        // As `umbriel serve` does, unless each picture of each frame is to be there.
        ahead: args.breaks(),
        lines: Some(lines),
    };
    let mut host = Host::listen(&options)?;
    let folder = args.out.clone().unwrap_or_else(|| std::env::temp_dir().join(format!("umbriel-cluster-{}", std::process::id())));
    let launcher = Launcher { args, address, folder: folder.clone() };
    let mut processes: Vec<Process> =
        (0..).zip(&shows).map(|(place, show)| launcher.start(show, place)).collect::<Result<_, Failure>>()?;
    let count = processes.len();
    let mut once = MapsOnce::default();
    serve::begin(&mut session, &mut once, &mut host, count, &mut || all_run(&mut processes))?;
    let mut plan = Plan::new(args, &shows, |kind| processes.iter().all(|process| process.wire.can(kind)));
    let interrupt = Interrupt::watch()?;
    let started = Instant::now();
    let mut frame = 1;
    let mut is_last = false;
    while !is_last {
        host.wait_until(session.graph(), started + Duration::from_secs_f64(frame as f64 / args.fps));
        frame += 1;
        // Frames after the last one that was asked for give everybody the time to come back.
        is_last = frame >= args.frames() && plan.is_over() || interrupt.came() || args.windows && all_closed(&mut processes)?;
        // Nothing is broken before everybody is in the lock for the first time.
        if host.live().len() == count {
            plan.begin(frame, &host, &mut processes, &launcher)?;
        }
        serve::step(&mut session, &mut once, &mut host, (frame - 1) as f64 / args.fps, is_last);
        plan.watch(&host, &processes)?;
    }
    say!("{}", serve::summary(&host));
    let disagreed = host.report().disagreed as usize + plan.failures();
    drop(host);
    for process in processes {
        let output = process.child.wait_with_output()?;
        say!("{}: {}", process.show, String::from_utf8_lossy(&output.stdout).trim());
    }
    let different = if args.check { compare(args, &shows, &folder, frame)? } else { 0 };
    if args.out.is_none() {
        let _ = std::fs::remove_dir_all(&folder);
    }
    Ok(disagreed + different)
}

/// Where nothing is broken on purpose, a machine that all processes share may be slow.
fn lease(args: &cli::Cluster) -> Duration {
    if args.breaks() { LEASE } else { PATIENCE }
}

/// An error if a process has ended.
fn all_run(processes: &mut [Process]) -> Result<(), Failure> {
    for process in processes {
        if let Some(status) = process.child.try_wait()? {
            return Err(format!("display `{}` ended: {status}", process.show).into());
        }
    }
    Ok(())
}

/// Has the user closed every window?
fn all_closed(processes: &mut [Process]) -> std::io::Result<bool> {
    let ended = processes.iter_mut().map(|process| Ok(process.child.try_wait()?.is_some()));
    ended.collect::<std::io::Result<Vec<bool>>>().map(|ended| ended.iter().all(|ended| *ended))
}

/// Starts display processes.
pub(super) struct Launcher<'a> {
    args: &'a cli::Cluster,
    address: SocketAddr,
    folder: PathBuf,
}

impl Launcher<'_> {
    fn start(&self, show: &str, place: u8) -> Result<Process, Failure> {
        let is_broken = |fault: &Fault| fault.display == show && !matches!(fault.kind, FaultKind::Kill | FaultKind::Freeze);
        let needs_proxy = self.args.random.is_some() || self.args.fault.iter().any(is_broken);
        let wire = match (self.args.netns, needs_proxy) {
            (true, _) => Wire::Namespace(Namespace::make(place)?, self.address),
            (false, true) => Wire::Proxy(Proxy::start(self.address)?),
            (false, false) => Wire::Direct(self.address),
        };
        Ok(Process { show: show.into(), child: self.spawn(show, &wire, place == 0)?, wire })
    }

    pub(super) fn spawn(&self, show: &str, wire: &Wire, is_first: bool) -> Result<Child, Failure> {
        let mut command = wire.command()?;
        command.args(["--once", "--show", show, "--connect", &wire.endpoint()]);
        command.args((!self.args.windows).then_some("--headless"));
        command.args(["--lease-ms", &lease(self.args).as_millis().to_string()]);
        let kept = &self.args.kept;
        if let Some(folder) = &kept.cache {
            command.arg("--cache").arg(folder);
        }
        command.args(["--cache-mib", &kept.cache_mib.to_string()]);
        if self.args.check {
            command.arg("--out").arg(self.folder.join(file_name(show)));
        }
        if let Some(frame) = self.args.corrupt.filter(|_| is_first) {
            command.args(["--corrupt", &frame.to_string()]);
        }
        Ok(command.stdout(Stdio::piped()).spawn()?)
    }
}

/// An address of this machine on which nobody listens.
fn free_address(of: Ipv4Addr) -> Result<SocketAddr, Failure> {
    Ok(TcpListener::bind((of, 0))?.local_addr()?)
}

/// The displays of a world, or their channels.
fn shows(path: &Path, channels: bool) -> Result<Vec<String>, Failure> {
    let mut session = Session::open(path)?;
    session.step(0.0);
    let pictures = session.pictures(None, DESKTOP_SIZE, &WindowSizes::new())?;
    if pictures.iter().any(|picture| picture.name == umbriel_displays::rig::DESKTOP) {
        return Err(format!("{}: the world has no Display node", path.display()).into());
    }
    let names = |picture: &Picture| match channels {
        true => (0..picture.views.len()).map(|place| format!("{}/{place}", picture.name)).collect(),
        false => vec![picture.name.clone()],
    };
    Ok(pictures.iter().flat_map(names).collect())
}

fn file_name(show: &str) -> String {
    format!("{}.png", show.replace('/', "-"))
}

/// What came of comparing the pictures of a display or of a channel.
#[derive(Clone, Copy, Default)]
struct Tally {
    compared: usize,
    different: usize,
    largest: u8,
    /// Of all channels drawn as one picture: pixels that are others there, of so many, and by how much at most. At its place in a larger
    /// target a view's edges are rounded in another way.
    beside: (usize, usize, u8),
}

/// Compares what displays showed with what this process draws of the same frames; gives the number of pictures that differ or are missing.
fn compare(args: &cli::Cluster, shows: &[String], folder: &Path, frames: u64) -> Result<usize, Failure> {
    let mut session = Session::open(&args.path)?.wait_for_casters();
    let gpu = Gpu::new(None)?;
    let mut renderer = Renderer::new(&gpu)?;
    let mut tallies: BTreeMap<&str, Tally> = BTreeMap::new();
    for frame in 1..=frames {
        session.step((frame - 1) as f64 / args.fps);
        let shown: Vec<(&String, image::RgbaImage)> = shows
            .iter()
            .filter_map(|show| Some((show, image::open(file_of(&folder.join(file_name(show)), frame)).ok()?.to_rgba8())))
            .collect();
        if frame == 1 || shown.is_empty() {
            continue;
        }
        let pictures = session.pictures(None, DESKTOP_SIZE, &WindowSizes::new())?;
        for (show, shown) in &shown {
            let Some(alone) = pictures.iter().find_map(|picture| part(picture, show)) else { continue };
            renderer.render_part(session.scene(), &[alone], &pictures)?;
            let truth = png::row(&renderer.read_back(0)?);
            let tally = tallies.entry(show.as_str()).or_default();
            let (_, largest) = differences([truth.width, truth.height], &truth.rgba, shown);
            tally.compared += 1;
            tally.different += (largest > 0) as usize;
            tally.largest = tally.largest.max(largest);
        }
        if !args.channels {
            continue;
        }
        renderer.render(session.scene(), &pictures)?;
        for (place, picture) in pictures.iter().enumerate() {
            let whole = png::row(&renderer.read_back(place)?);
            for (show, shown) in &shown {
                let Some([x, y, width, height]) = tile(picture, show) else { continue };
                let line = |row: u32| ((y + row) * whole.width + x) as usize * 4;
                let lines = (0..height).flat_map(|row| &whole.rgba[line(row)..line(row) + width as usize * 4]);
                let (count, largest) = differences([width, height], &lines.copied().collect::<Vec<u8>>(), shown);
                let beside = &mut tallies.entry(show.as_str()).or_default().beside;
                *beside = (beside.0 + count, beside.1 + (width * height) as usize, beside.2.max(largest));
            }
        }
    }
    let mut wrong = 0;
    for show in shows {
        let Tally { compared, different, largest, beside } = tallies.get(show.as_str()).copied().unwrap_or_default();
        print!("{show}: {compared} pictures compared, {different} differ, largest difference {largest}/255");
        if args.channels {
            print!("; in one picture of all, {} of {} pixels by at most {}/255", beside.0, beside.1, beside.2);
        }
        say!("");
        wrong += different + (compared == 0) as usize;
        if !args.breaks() && compared as u64 + 1 != frames {
            tracing::error!("{show}: {} of {} pictures are missing", frames - 1 - compared as u64, frames - 1);
            wrong += 1;
        }
    }
    Ok(wrong)
}

/// How many pixels differ, and by how much at most; all of them, entirely, where the sizes are others.
fn differences([width, height]: [u32; 2], truth: &[u8], shown: &image::RgbaImage) -> (usize, u8) {
    if (shown.width(), shown.height()) != (width, height) {
        return (width as usize * height as usize, u8::MAX);
    }
    let of_pixel = |(a, b): (&[u8], &[u8])| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
    let each = truth.chunks_exact(4).zip(shown.as_raw().chunks_exact(4)).map(of_pixel);
    each.fold((0, 0), |(count, largest), by| (count + usize::from(by > 0), largest.max(by)))
}

/// A display or a channel of it as a picture of its own, as the process that shows it draws it.
fn part(picture: &Picture, show: &str) -> Option<Picture> {
    if picture.name == show {
        return Some(picture.clone());
    }
    (0..picture.views.len()).filter_map(|place| channel(picture, place)).find(|one| one.name == show)
}

/// Where a display or a channel lies in the picture of its display.
fn tile(picture: &Picture, show: &str) -> Option<[u32; 4]> {
    if picture.name == show {
        let [width, height] = picture.size;
        return Some([0, 0, width, height]);
    }
    let place = (0..picture.views.len()).find(|place| channel(picture, *place).is_some_and(|one| one.name == show))?;
    match &picture.layout {
        umbriel_scene::Layout::Tiles(tiles) => tiles.get(place).map(|tile| [tile.x, tile.y, tile.width, tile.height]),
        _ => None,
    }
}
