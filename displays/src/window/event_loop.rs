//! The loop of the windows: events in, frames out.

use super::controls::{Action, notches, view_ahead, view_at};
use super::frame_rate::FrameRate;
use super::pane::Pane;
use super::stage::Panes;
use super::{App, Options, Stage};
use crate::rig::Aim;
use crate::{Error, FileWatch, navigation};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};
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
/// There is no window system or no usable graphics device, the device failed, or the app gave up.
pub fn run<A: App>(app: &mut A, options: Options) -> Result<(), A::Error> {
    let event_loop = EventLoop::new().map_err(window_error)?;
    let now = Instant::now();
    let mut windows = Windows {
        app,
        options,
        watch: FileWatch::new().map_err(|e| tracing::warn!("{e}")).ok(),
        panes: Panes::new(options.fullscreen),
        start: now,
        went: now,
        turns: 0,
        told: 0,
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
            return Err(Error::Window(format!("the window system is gone: {}", reason.unwrap_or("no reason given"))).into());
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

struct Windows<'a, A: App> {
    app: &'a mut A,
    options: Options,
    /// None where the system cannot watch files.
    watch: Option<FileWatch>,
    panes: Panes,
    start: Instant,
    /// When held keys moved the room last.
    went: Instant,
    turns: u64,
    /// Frames that were shown up to the last look at them.
    told: u64,
    rate: FrameRate,
    screenshot: bool,
    failure: Option<A::Error>,
}

impl<A: App> ApplicationHandler for Windows<'_, A> {
    fn resumed(&mut self, _: &ActiveEventLoop) {}

    fn window_event(&mut self, target: &ActiveEventLoop, id: WindowId, event: WindowEvent) {
        let Some(place) = self.panes.open.iter().position(|p| p.id() == id) else { return };
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => {
                let name = self.panes.open[place].name.clone();
                self.close(target, &name);
            }
            WindowEvent::Resized(size) => self.panes.open[place].size = [size.width, size.height],
            WindowEvent::Occluded(occluded) => self.panes.open[place].occluded = occluded,
            WindowEvent::Focused(false) => self.panes.open[place].controls.release_all(),
            WindowEvent::CursorMoved { position, .. } => {
                let cursor = glam::Vec2::new(position.x as f32, position.y as f32);
                if let Some((button, pixels)) = self.panes.open[place].controls.moved(cursor) {
                    self.navigate(place, |view, scale| navigation::Input::Drag { button, pixels: pixels * scale, view });
                }
            }
            WindowEvent::MouseInput { state, button, .. } => {
                self.panes.open[place].controls.button(button, state);
                self.point(place);
            }
            WindowEvent::MouseWheel { delta, .. } => {
                self.navigate(place, |view, _| navigation::Input::Wheel { notches: notches(delta), view });
            }
            WindowEvent::KeyboardInput { event, .. } => {
                match self.panes.open[place].controls.key(event.physical_key, event.state, event.repeat) {
                    Some(Action::Quit) => target.exit(),
                    Some(Action::Screenshot) => self.screenshot = true,
                    Some(Action::Command(command)) => self.app.command(command),
                    None => {}
                }
            }
            _ => {}
        }
    }

    /// Every event has been seen: time for a turn.
    fn about_to_wait(&mut self, target: &ActiveEventLoop) {
        if target.exiting() {
            return;
        }
        if let Err(error) = self.turn(target) {
            self.failure = Some(error);
            return target.exit();
        }
        self.turns += 1;
        if self.app.is_over() || self.options.turns.is_some_and(|limit| self.turns >= limit) {
            return target.exit();
        }
        let polls = self.app.waits() || self.panes.open.iter().any(|p| p.size().is_some());
        target.set_control_flow(if polls { ControlFlow::Poll } else { ControlFlow::WaitUntil(Instant::now() + NAP) });
    }
}

impl<A: App> Windows<'_, A> {
    /// Files, the app with its pictures, and if it showed them, what belongs to a frame.
    fn turn(&mut self, target: &ActiveEventLoop) -> Result<(), A::Error> {
        let now = Instant::now();
        self.look_at_files();
        self.panes.open.iter_mut().for_each(Pane::refresh);
        let time_s = self.options.start_s + (now - self.start).as_secs_f64();
        self.app.turn(time_s, &mut Stage { panes: &mut self.panes, target })?;
        if std::mem::replace(&mut self.told, self.panes.shown) != self.panes.shown {
            self.go(now);
            for place in 0..self.panes.open.len() {
                if self.panes.open[place].controls.strayed {
                    self.point(place);
                }
            }
            self.take_screenshots()?;
            self.tell_rate(now);
        }
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
        let dt_s = (now - std::mem::replace(&mut self.went, now)).as_secs_f32().min(0.1);
        for pane in &self.panes.open {
            let Some((direction, haste)) = pane.controls.held() else { continue };
            let picture = self.panes.pictures.iter().find(|p| p.name == pane.name);
            if let Some(view) = picture.and_then(view_ahead) {
                self.app.navigate(navigation::Input::Keys { direction, haste, dt_s, view });
            }
        }
    }

    /// Tells the app what was done over the view under the mouse; `input` gets the view and its pixels per pixel of the window.
    fn navigate<'v>(&'v mut self, place: usize, input: impl FnOnce(&'v umbriel_scene::View, f32) -> navigation::Input<'v>) {
        let pane = &self.panes.open[place];
        let Some(window) = pane.size() else { return };
        let Some(picture) = self.panes.pictures.iter().find(|p| p.name == pane.name) else { return };
        if let Some((view, _)) = view_at(picture, pane.controls.cursor, window) {
            let scale = picture.size[1] as f32 / window[1] as f32;
            self.app.navigate(input(view, scale));
        }
    }

    /// Tells the app where the mouse is.
    fn point(&mut self, place: usize) {
        let pane = &mut self.panes.open[place];
        pane.controls.strayed = false;
        let Some(window) = pane.size() else { return };
        let Some(picture) = self.panes.pictures.iter().find(|p| p.name == pane.name) else { return };
        if let Some((view, at)) = view_at(picture, pane.controls.cursor, window) {
            self.app.point(&pane.name, Aim::through(view, at, pane.controls.presses()));
        }
    }

    fn take_screenshots(&mut self) -> Result<(), Error> {
        let Some((_, renderer)) = self.panes.drawing.as_ref().filter(|_| self.screenshot) else { return Ok(()) };
        self.screenshot = false;
        for (i, picture) in self.panes.pictures.iter().enumerate() {
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
        for pane in &self.panes.open {
            pane.set_title(&format!("{title} - {} - {rate:.1} frames/s", pane.name));
        }
    }

    /// Closes a window for good; the last one ends the loop.
    fn close(&mut self, target: &ActiveEventLoop, name: &str) {
        if self.panes.close(name) {
            target.exit();
        }
    }
}
