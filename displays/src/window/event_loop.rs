//! The loop of the windows: events in, frames out.

use super::controls::{Action, notches, view_ahead, view_at};
use super::frame_rate::FrameRate;
use super::pane::Pane;
use super::{App, Options, WindowSizes};
use crate::{Error, FileWatch, navigation};
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};
use umbriel_render::{Gpu, Renderer};
use umbriel_scene::Picture;
use winit::application::ApplicationHandler;
use winit::error::EventLoopError;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::WindowId;

/// How often the loop looks whether a window is to be seen again.
const NAP: Duration = Duration::from_millis(50);

/// Opens a window for each picture of `app` and runs until Escape, the last window is closed, or as `options` say.
///
/// # Errors
/// There is no window system or no usable graphics device, or the device failed.
pub fn run(app: &mut impl App, options: Options) -> Result<(), Error> {
    let event_loop = EventLoop::new().map_err(window_error)?;
    let now = Instant::now();
    let mut windows = Windows {
        app,
        options,
        watch: FileWatch::new().map_err(|e| tracing::warn!("{e}")).ok(),
        drawing: None,
        panes: Vec::new(),
        closed: BTreeSet::new(),
        pictures: Vec::new(),
        start: now,
        last_frame: now,
        frames: 0,
        rate: FrameRate::new(now),
        screenshot: false,
        failure: None,
    };
    // winit panics where the connection to the window system is lost; for us that is an error like others.
    match catch_unwind(AssertUnwindSafe(|| event_loop.run_app(&mut windows))) {
        Ok(ended) => ended.map_err(window_error)?,
        Err(panic) => {
            let reason = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
            // What is left of the windows talks to a window system that is gone.
            std::mem::forget(windows);
            return Err(Error::Window(format!("the window system is gone: {}", reason.unwrap_or("no reason given"))));
        }
    }
    windows.failure.map_or(Ok(()), Err)
}

/// The reason without the place in winit's source that its message begins with.
fn window_error(error: EventLoopError) -> Error {
    match error {
        EventLoopError::Os(os) => Error::Window(os.to_string().rsplit(": ").next().unwrap_or_default().to_owned()),
        other => Error::Window(other.to_string()),
    }
}

struct Windows<'a, A> {
    app: &'a mut A,
    options: Options,
    /// None where the system cannot watch files.
    watch: Option<FileWatch>,
    /// None until the first window is open.
    drawing: Option<(Gpu, Renderer)>,
    panes: Vec<Pane>,
    /// Names of the windows that the user has closed.
    closed: BTreeSet<String>,
    /// Of the last frame.
    pictures: Vec<Picture>,
    start: Instant,
    last_frame: Instant,
    frames: u64,
    rate: FrameRate,
    screenshot: bool,
    failure: Option<Error>,
}

impl<A: App> ApplicationHandler for Windows<'_, A> {
    fn resumed(&mut self, _: &ActiveEventLoop) {}

    fn window_event(&mut self, target: &ActiveEventLoop, id: WindowId, event: WindowEvent) {
        let Some(place) = self.panes.iter().position(|p| p.id() == id) else { return };
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => {
                let name = self.panes[place].name.clone();
                self.close(target, &name);
            }
            WindowEvent::Resized(size) => self.panes[place].size = [size.width, size.height],
            WindowEvent::Occluded(occluded) => self.panes[place].occluded = occluded,
            WindowEvent::Focused(false) => self.panes[place].controls.release_all(),
            WindowEvent::CursorMoved { position, .. } => {
                let cursor = glam::Vec2::new(position.x as f32, position.y as f32);
                if let Some((button, pixels)) = self.panes[place].controls.moved(cursor) {
                    self.navigate(place, |view, scale| navigation::Input::Drag { button, pixels: pixels * scale, view });
                }
            }
            WindowEvent::MouseInput { state, button, .. } => self.panes[place].controls.button(button, state),
            WindowEvent::MouseWheel { delta, .. } => {
                self.navigate(place, |view, _| navigation::Input::Wheel { notches: notches(delta), view });
            }
            WindowEvent::KeyboardInput { event, .. } => {
                match self.panes[place].controls.key(event.physical_key, event.state, event.repeat) {
                    Some(Action::Quit) => target.exit(),
                    Some(Action::Screenshot) => self.screenshot = true,
                    Some(Action::Command(command)) => self.app.command(command),
                    None => {}
                }
            }
            _ => {}
        }
    }

    /// Every event has been seen: time for a frame.
    fn about_to_wait(&mut self, target: &ActiveEventLoop) {
        if target.exiting() {
            return;
        }
        if let Err(error) = self.frame(target) {
            self.failure = Some(error);
            return target.exit();
        }
        self.frames += 1;
        if self.options.frames.is_some_and(|limit| self.frames >= limit) {
            return target.exit();
        }
        let seen = self.panes.iter().any(|p| p.size().is_some());
        target.set_control_flow(if seen { ControlFlow::Poll } else { ControlFlow::WaitUntil(Instant::now() + NAP) });
    }
}

impl<A: App> Windows<'_, A> {
    /// Files, keys, the world, the windows, the pictures: one frame.
    fn frame(&mut self, target: &ActiveEventLoop) -> Result<(), Error> {
        let now = Instant::now();
        self.look_at_files();
        self.panes.iter_mut().for_each(Pane::refresh);
        self.go(now);
        let sizes: WindowSizes = self.panes.iter().filter_map(|p| Some((p.name.clone(), p.size()?))).collect();
        let time_s = self.options.start_s + (now - self.start).as_secs_f64();
        let frame = self.app.frame(time_s, &sizes);

        let mut pictures = frame.pictures;
        open_and_close(&mut self.panes, &mut self.drawing, &pictures, &self.closed, target)?;
        pictures.retain(|p| self.panes.iter().any(|pane| pane.name == p.name && pane.size().is_some()));
        let Some((gpu, renderer)) = self.drawing.as_mut().filter(|_| !pictures.is_empty()) else { return Ok(()) };
        let stats = renderer.render(frame.scene, &pictures)?;
        renderer.problems().iter().for_each(|problem| tracing::warn!("{problem}"));
        let mut lost = Vec::new();
        for (i, picture) in pictures.iter().enumerate() {
            let Some(place) = self.panes.iter().position(|p| p.name == picture.name) else { continue };
            let shown = self.panes[place].show(gpu, |encoder, view, format| match renderer.blit(i, encoder, view, format) {
                // A picture that could not be drawn is among the problems.
                Ok(()) | Err(umbriel_render::Error::NoPicture { .. }) => Ok(()),
                Err(error) => Err(error.into()),
            });
            match shown {
                Err(Error::Window(reason)) => {
                    tracing::warn!("the window `{}` is gone: {reason}", picture.name);
                    lost.push(picture.name.clone());
                }
                other => other?,
            }
        }
        tracing::trace!(?stats, time_s, "frame");
        self.pictures = pictures;
        self.take_screenshots()?;
        lost.iter().for_each(|name| self.close(target, name));
        self.tell_rate(now);
        self.last_frame = now;
        Ok(())
    }

    fn look_at_files(&mut self) {
        let Some(watch) = &mut self.watch else { return };
        if let Some(files) = self.app.files() {
            watch.set(files).iter().for_each(|problem| tracing::warn!("{problem}"));
        }
        let changed = watch.changed();
        if !changed.is_empty() {
            self.app.files_changed(&changed);
        }
    }

    /// Held keys move the room.
    fn go(&mut self, now: Instant) {
        // After a stall, nobody wants to find himself on the other side of a wall.
        let dt_s = (now - self.last_frame).as_secs_f32().min(0.1);
        for pane in &self.panes {
            let Some((direction, haste)) = pane.controls.held() else { continue };
            let picture = self.pictures.iter().find(|p| p.name == pane.name);
            if let Some(view) = picture.and_then(view_ahead) {
                self.app.navigate(navigation::Input::Keys { direction, haste, dt_s, view });
            }
        }
    }

    /// Tells the app what was done over the view under the mouse; `input` gets the view and its pixels per pixel of the window.
    fn navigate<'v>(&'v mut self, place: usize, input: impl FnOnce(&'v umbriel_scene::View, f32) -> navigation::Input<'v>) {
        let pane = &self.panes[place];
        let Some(window) = pane.size() else { return };
        let Some(picture) = self.pictures.iter().find(|p| p.name == pane.name) else { return };
        if let Some(view) = view_at(picture, pane.controls.cursor, window) {
            let scale = picture.size[1] as f32 / window[1] as f32;
            self.app.navigate(input(view, scale));
        }
    }

    fn take_screenshots(&mut self) -> Result<(), Error> {
        let Some((_, renderer)) = self.drawing.as_ref().filter(|_| self.screenshot) else { return Ok(()) };
        self.screenshot = false;
        for (i, picture) in self.pictures.iter().enumerate() {
            for (layer, pixels) in renderer.read_back(i)?.iter().enumerate() {
                // Several layers are one for each view.
                let view = picture.views.get(layer).filter(|_| layer > 0);
                let name = view.map_or(&picture.name, |v| &v.name);
                self.app.screenshot(name, pixels);
            }
        }
        Ok(())
    }

    fn tell_rate(&mut self, now: Instant) {
        let Some(rate) = self.rate.frame(now) else { return };
        let title = self.app.title();
        for pane in &self.panes {
            pane.set_title(&format!("{title} - {} - {rate:.1} frames/s", pane.name));
        }
    }

    /// Closes a window for good; the last one ends the loop.
    fn close(&mut self, target: &ActiveEventLoop, name: &str) {
        self.panes.retain(|pane| pane.name != name);
        self.closed.insert(name.to_owned());
        if self.panes.is_empty() {
            target.exit();
        }
    }
}

/// Opens a window for every picture that has none, and closes those whose picture is gone. The first one finds the device.
fn open_and_close(
    panes: &mut Vec<Pane>,
    drawing: &mut Option<(Gpu, Renderer)>,
    pictures: &[Picture],
    closed: &BTreeSet<String>,
    target: &ActiveEventLoop,
) -> Result<(), Error> {
    if !pictures.is_empty() {
        panes.retain(|pane| pictures.iter().any(|p| p.name == pane.name));
    }
    for picture in pictures {
        if closed.contains(&picture.name) || panes.iter().any(|p| p.name == picture.name) {
            continue;
        }
        let mut pane = Pane::open(target, &picture.name, picture.size)?;
        let surface = match drawing {
            Some((gpu, _)) => pane.make_surface(&gpu.instance)?,
            None => {
                let instance = Gpu::instance();
                let surface = pane.make_surface(&instance)?;
                let gpu = Gpu::new(Some((instance, &surface)))?;
                let renderer = Renderer::new(&gpu)?;
                *drawing = Some((gpu, renderer));
                surface
            }
        };
        if let Some((gpu, _)) = drawing {
            pane.attach(gpu, surface)?;
        }
        panes.push(pane);
    }
    Ok(())
}
