//! Draws a world to files.

use crate::cli::Run;
use crate::console::Console;
use crate::png;
use crate::session::Session;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::time::Instant;
use umbriel_displays::WindowSizes;
use umbriel_render::{FrameStats, Gpu, MapShare, Renderer};
use umbriel_scene::{Picture, PictureKind};

type Failure = Box<dyn std::error::Error>;

/// Pixels of a picture whose size nobody says.
pub(crate) const DESKTOP_SIZE: [u32; 2] = [1280, 720];

/// Draws the frames that were asked for. Gives the number of problems that were reported meanwhile.
pub(crate) fn run(args: &Run) -> Result<usize, Failure> {
    let mut session = Session::open(&args.path)?.wait_for_casters().with_samples(args.samples);
    if args.measure {
        return measure(&mut session, args);
    }
    if let Some(file) = &args.record {
        session.record(file)?;
    }
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from(format!("{}.png", session.name())));
    let console = Console::open(args.console);
    if args.time > 0.0 {
        session.step(0.0); // what starts with the world starts before the jump
    }
    let time_s = |frame: u32| args.time + f64::from(frame) / args.fps;
    let drawn = draw(
        &mut session,
        0..args.frames,
        time_s,
        console.as_ref(),
        &Wanted { view: args.view.as_deref(), size: args.size, shadow_of: args.shadow_of.as_deref(), out: &out },
    )?;
    if let Some(frames) = session.finish_recording()? {
        say!("{frames} frames recorded");
    }
    say!("{} pictures, the last {}", drawn.pictures, drawn.last.display());
    Ok(drawn.problems)
}

/// Draws frames that nobody keeps, one being drawn while the next is made, as in a window, and tells how long they took. The first one,
/// which makes what all need, does not count where there are more.
fn measure(session: &mut Session, args: &Run) -> Result<usize, Failure> {
    let gpu = Gpu::new(None)?;
    let mut renderer = Renderer::new(&gpu)?;
    let (mut frames_s, mut parts_s, mut problems) = (Vec::new(), [0.0; 3], 0);
    let mut begin = Instant::now();
    for frame in 0..args.frames + u32::from(args.frames > 1) {
        let start = Instant::now();
        session.step(args.time + f64::from(frame) / args.fps);
        let pictures = pictures(session, args.view.as_deref(), args.size)?;
        let stepped = start.elapsed().as_secs_f64();
        let stats = renderer.render(session.scene(), &pictures)?;
        renderer.wait_for_room()?;
        if frame == 0 && args.frames > 1 {
            renderer.wait()?;
            begin = Instant::now();
        }
        if frame > 0 || args.frames == 1 {
            frames_s.push(start.elapsed().as_secs_f64());
            let parts = [stepped, stats.prepare_s, stats.encode_s];
            parts_s.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
        }
        for problem in session.problems_with(renderer.problems()) {
            tracing::error!("{problem}");
            problems += 1;
        }
    }
    renderer.wait()?;
    let (count, whole) = (frames_s.len() as f64, begin.elapsed().as_secs_f64());
    frames_s.sort_by(f64::total_cmp);
    let [step, prepare, record] = parts_s.map(|part| 1e3 * part / count);
    say!(
        "{:.1} frames per second on {}: {count} frames, fastest {:.2} ms, median {:.2}, slowest {:.2}",
        count / whole,
        describe(&gpu),
        1e3 * frames_s[0],
        1e3 * frames_s[frames_s.len() / 2],
        1e3 * frames_s[frames_s.len() - 1],
    );
    say!("of a frame: world and views {step:.2} ms, renderer's lists {prepare:.2}, recording {record:.2}, the rest drawing");
    Ok(problems)
}

/// What is drawn, and where to.
pub(crate) struct Wanted<'a> {
    /// The display or viewpoint, by name.
    pub(crate) view: Option<&'a str>,
    /// Pixels of each picture.
    pub(crate) size: Option<[u32; 2]>,
    /// The light whose shadow alone is shown, by name.
    pub(crate) shadow_of: Option<&'a str>,
    pub(crate) out: &'a Path,
}

/// What became of it.
#[derive(Default)]
pub(crate) struct Drawn {
    pub(crate) pictures: u32,
    pub(crate) last: PathBuf,
    pub(crate) problems: usize,
}

/// Steps a session through frames and writes the pictures of each.
pub(crate) fn draw(
    session: &mut Session,
    frames: std::ops::Range<u32>,
    time_s: impl Fn(u32) -> f64,
    console: Option<&Console>,
    wanted: &Wanted<'_>,
) -> Result<Drawn, Failure> {
    if wanted.out.extension().is_some_and(|e| !e.eq_ignore_ascii_case("png")) {
        return Err(format!("{}: pictures are written as .png", wanted.out.display()).into());
    }
    let gpu = Gpu::new(None)?;
    let mut renderer = Renderer::new(&gpu)?;
    let device = describe(&gpu);
    tracing::info!("drawing on {device}");
    let bar = progress(frames.len() as u32, "frames");
    let mut drawn = Drawn::default();
    let mut is_named = None;
    let is_sequence = frames.len() > 1;
    for frame in frames {
        if let Some(console) = console {
            drawn.problems += console.run_next(&mut |line| session.console(line));
        }
        session.step(time_s(frame));
        let mut pictures = pictures(session, wanted.view, wanted.size)?;
        if let Some(name) = wanted.shadow_of {
            let light = session.light_named(name).ok_or_else(|| session.no_light(name))?;
            pictures.iter_mut().for_each(|p| p.kind = PictureKind::LightVisibility(light));
        }
        let stats = renderer.render(session.scene(), &pictures)?;
        tracing::debug!("frame {frame}: {stats:?}");
        tell_maps(frame, &stats);
        for (place, picture) in pictures.iter().enumerate() {
            // Names stay the same through a sequence, even where displays fail on the way.
            let name = is_named.get_or_insert(pictures.len() > 1).then_some(picture.name.as_str());
            let path = numbered(wanted.out, name, is_sequence.then_some(frame));
            png::write(&path, &png::row(&renderer.read_back(place)?), &device)?;
            drawn.pictures += 1;
            bar.set_message(path.display().to_string());
            drawn.last = path;
        }
        for problem in session.problems_with(renderer.problems()) {
            bar.suspend(|| tracing::error!("{problem}"));
            drawn.problems += 1;
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(drawn)
}

/// What shadow maps cost in a frame, and what each light got.
fn tell_maps(frame: u32, stats: &FrameStats) {
    if stats.maps == 0 {
        return;
    }
    tracing::info!("frame {frame}: {} of {} shadow maps drawn, in {} draws", stats.map_redraws, stats.maps, stats.map_draws);
    for share in &stats.map_shares {
        let MapShare { light, maps, redrawn, asked, side } = share;
        tracing::info!("frame {frame}: '{light}': {redrawn} of {maps} maps drawn, {side} of {asked} texels wide");
    }
}

/// The pictures of the frame; `size` is that of each of them.
fn pictures(session: &mut Session, view: Option<&str>, size: Option<[u32; 2]>) -> Result<Vec<Picture>, umbriel_displays::Error> {
    let natural = session.pictures(view, size.unwrap_or(DESKTOP_SIZE), &WindowSizes::new())?;
    let Some(size) = size else { return Ok(natural) };
    let windows: WindowSizes = natural.into_iter().map(|p| (p.name, size)).collect();
    session.pictures(view, size, &windows)
}

/// Name and driver of a device.
pub(crate) fn describe(gpu: &Gpu) -> String {
    let info = &gpu.info;
    [&info.name, &info.driver, &info.driver_info]
        .iter()
        .filter(|s| !s.is_empty())
        .map(|s| s.as_str())
        .collect::<Vec<_>>()
        .join(", ")
}

/// A bar on the terminal; nothing where there is none.
pub(crate) fn progress(length: u32, unit: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(&format!("{{bar:30}} {{pos}}/{{len}} {unit}, {{eta}} left  {{msg}}"));
    ProgressBar::new(length.into()).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// `out.png`, `out.wall.png`, `out.0007.png`, `out.wall.0007.png`.
pub(crate) fn numbered(out: &Path, picture: Option<&str>, frame: Option<u32>) -> PathBuf {
    let mut name = out.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    for part in [picture.map(file_name), frame.map(|f| format!("{f:04}"))].into_iter().flatten() {
        name = format!("{name}.{part}");
    }
    out.with_file_name(format!("{name}.png"))
}

/// A name of a display as a part of a file's name.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-_ ".contains(c) { c } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files() {
        let rows = [
            ("a/b.png", None, None, "a/b.png"),
            ("b", None, None, "b.png"),
            ("a/b.png", Some("wall"), None, "a/b.wall.png"),
            ("a/b.png", None, Some(7), "a/b.0007.png"),
            ("a/b.png", Some("../x"), Some(12345), "a/b.___x.12345.png"),
        ];
        for (out, picture, frame, expected) in rows {
            assert_eq!(numbered(Path::new(out), picture, frame), Path::new(expected));
        }
    }
}
