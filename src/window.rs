//! Shows a world in windows.

use crate::cli::{Replay, Run};
use crate::console::Console;
use crate::headless::DESKTOP_SIZE;
use crate::png;
use crate::session::Session;
use std::path::PathBuf;
use umbriel_displays::WindowSizes;
use umbriel_displays::navigation::Input;
use umbriel_displays::rig::Aim;
use umbriel_displays::window::{self, App, Command, Options, Stage};
use umbriel_render::RgbaPixels;

/// Opens the windows and runs until they are closed.
pub(crate) fn run(args: &Run) -> Result<(), Box<dyn std::error::Error>> {
    let mut session = Session::open(&args.path)?.with_samples(args.samples);
    if let Some(file) = &args.record {
        session.record(file)?;
    }
    session.step(args.time);
    session.pictures(args.view.as_deref(), DESKTOP_SIZE, &WindowSizes::new())?; // a wrong --view ends here
    let console = Console::open(args.console);
    let mut viewer = Viewer { session, console, view: args.view.clone(), size: args.size, watched: Vec::new() };
    let shown = window::run(&mut viewer, Options { start_s: args.time, ..Options::default() });
    if let Some(frames) = viewer.session.finish_recording()? {
        say!("{frames} frames recorded");
    }
    Ok(shown?)
}

/// Shows a recording; it stays at its last frame.
pub(crate) fn replay(session: Session, args: &Replay) -> Result<(), Box<dyn std::error::Error>> {
    let mut viewer = Viewer { session, console: None, view: args.view.clone(), size: args.size, watched: Vec::new() };
    Ok(window::run(&mut viewer, Options::default())?)
}

struct Viewer {
    session: Session,
    console: Option<Console>,
    view: Option<String>,
    size: Option<[u32; 2]>,
    watched: Vec<PathBuf>,
}

impl Viewer {
    /// Shows the viewpoint `step` places on from the present one.
    fn turn_to(&mut self, step: isize) {
        let names: Vec<String> = self.session.viewpoints().iter().map(|v| v.name.clone()).collect();
        if names.is_empty() {
            return;
        }
        let now = self.view.as_ref().and_then(|v| names.iter().position(|n| n == v)).unwrap_or(0) as isize;
        self.view = Some(names[(now + step).rem_euclid(names.len() as isize) as usize].clone());
        self.session.reset_navigation();
    }

    fn tell(&mut self) {
        for problem in self.session.problems() {
            tracing::error!("{problem}");
        }
    }
}

impl App for Viewer {
    type Error = umbriel_displays::Error;

    fn turn(&mut self, time_s: f64, stage: &mut Stage<'_>) -> Result<(), umbriel_displays::Error> {
        if let Some(console) = &self.console {
            console.run_all(&mut |line| self.session.console(line));
        }
        if !self.session.is_over() {
            self.session.step(time_s);
        }
        let size = self.size.unwrap_or(DESKTOP_SIZE);
        let windows = stage.sizes();
        let pictures = self.session.pictures(self.view.as_deref(), size, &windows).or_else(|error| {
            // The named view went away with a reload.
            tracing::error!("{error}");
            self.view = None;
            self.session.pictures(None, size, &windows)
        });
        self.tell();
        let pictures = pictures.unwrap_or_else(|error| {
            tracing::error!("{error}");
            Vec::new()
        });
        let stats = stage.draw(self.session.scene(), pictures, None)?;
        for problem in self.session.problems_with(stage.problems()) {
            tracing::error!("{problem}");
        }
        tracing::trace!(?stats, time_s, "frame");
        stage.show()
    }

    fn navigate(&mut self, input: Input<'_>) {
        self.session.navigate(input);
    }

    fn point(&mut self, display: &str, aim: Aim) {
        self.session.point(display, &aim);
    }

    fn command(&mut self, command: Command) {
        match command {
            Command::NextViewpoint => self.turn_to(1),
            Command::PreviousViewpoint => self.turn_to(-1),
            Command::ResetNavigation => self.session.reset_navigation(),
            Command::Reload => self.session.reload(),
        }
    }

    fn files(&mut self) -> Option<Vec<PathBuf>> {
        let files = self.session.files();
        (files != self.watched).then(|| {
            self.watched.clone_from(&files);
            files
        })
    }

    fn files_changed(&mut self, files: &[PathBuf]) {
        tracing::info!("changed: {files:?}");
        self.session.files_changed(files);
        self.tell();
    }

    fn title(&self) -> String {
        format!("{} - Umbriel", self.session.name())
    }

    fn screenshot(&mut self, name: &str, pixels: &RgbaPixels) {
        screenshot(&self.session.name(), name, pixels);
    }
}

/// Writes what a window shows to the first free of `WORLD.NAME.001.png`, `WORLD.NAME.002.png` and so on.
pub(crate) fn screenshot(world: &str, name: &str, pixels: &RgbaPixels) {
    let name = name.replace('/', "-");
    let free = |n: u32| Some(PathBuf::from(format!("{world}.{name}.{n:03}.png"))).filter(|p| !p.exists());
    let Some(path) = (1..1000).find_map(free) else { return tracing::error!("a thousand screenshots are enough") };
    match png::write(&path, pixels, "window") {
        Ok(()) => tracing::info!("wrote {}", path.display()),
        Err(error) => tracing::error!("{error}"),
    }
}
