//! The open windows and the device that draws into them.

use super::WindowSizes;
use super::pane::Pane;
use crate::Error;
use std::collections::BTreeSet;
use umbriel_render::{FrameStats, Gpu, Renderer, Starting};
use umbriel_scene::{Picture, Scene};
use winit::event_loop::ActiveEventLoop;

/// The windows that are open, from frame to frame.
pub(super) struct Panes {
    pub(super) open: Vec<Pane>,
    /// None until the first window is open.
    pub(super) drawing: Option<(Gpu, Renderer)>,
    /// Made before there is a window, as long as nobody knows what it shows.
    starting: Option<Starting>,
    /// Of the frame that was drawn last.
    pub(super) pictures: Vec<Picture>,
    /// How often a frame was shown.
    pub(super) shown: u64,
    /// The monitor that new windows fill.
    fullscreen: Option<usize>,
    /// Names of the windows that the user has closed.
    closed: BTreeSet<String>,
}

impl Panes {
    pub(super) fn new(fullscreen: Option<usize>) -> Panes {
        let starting = Some(Starting::begin());
        Panes { open: Vec::new(), drawing: None, starting, pictures: Vec::new(), shown: 0, fullscreen, closed: BTreeSet::new() }
    }

    /// Closes a window for good. True if it was the last one.
    pub(super) fn close(&mut self, name: &str) -> bool {
        self.open.retain(|pane| pane.name != name);
        self.closed.insert(name.to_owned());
        self.open.is_empty()
    }

    /// Opens a window for every picture that has none, and closes those whose picture is gone. The first one finds the device.
    fn fit(&mut self, pictures: &[Picture], target: &ActiveEventLoop) -> Result<(), Error> {
        if !pictures.is_empty() {
            self.open.retain(|pane| pictures.iter().any(|p| p.name == pane.name));
        }
        for picture in pictures {
            if self.closed.contains(&picture.name) || self.open.iter().any(|p| p.name == picture.name) {
                continue;
            }
            let mut pane = Pane::open(target, &picture.name, picture.size, self.fullscreen)?;
            let surface = match &self.drawing {
                Some((gpu, _)) => pane.make_surface(&gpu.instance)?,
                None => {
                    let (drawing, surface) = first(&pane, self.starting.take())?;
                    self.drawing = Some(drawing);
                    surface
                }
            };
            if let Some((gpu, _)) = &self.drawing {
                pane.attach(gpu, surface)?;
            }
            self.open.push(pane);
        }
        Ok(())
    }
}

/// The device for the first window, and the window's surface: the one that was begun, unless it cannot draw into windows.
fn first(pane: &Pane, starting: Option<Starting>) -> Result<((Gpu, Renderer), wgpu::Surface<'static>), Error> {
    if let Some(Ok((gpu, renderer))) = starting.map(Starting::finish) {
        let surface = pane.make_surface(&gpu.instance)?;
        if gpu.adapter.is_surface_supported(&surface) {
            return Ok(((gpu, renderer), surface));
        }
    }
    let instance = Gpu::instance();
    let surface = pane.make_surface(&instance)?;
    let gpu = Gpu::new(Some((instance, &surface)))?;
    let renderer = Renderer::new(&gpu)?;
    Ok(((gpu, renderer), surface))
}

/// Where an [`App`](super::App) draws and shows its pictures, a window each.
pub struct Stage<'a> {
    pub(super) panes: &'a mut Panes,
    pub(super) target: &'a ActiveEventLoop,
}

impl Stage<'_> {
    /// Sizes of the windows that can be seen.
    pub fn sizes(&self) -> WindowSizes {
        self.panes.open.iter().filter_map(|p| Some((p.name.clone(), p.size()?))).collect()
    }

    /// Draws pictures whose windows can be seen, and opens windows for those that have none. Pictures of the same name share a window from
    /// frame to frame. Shadow maps are fitted to the views of `all`, or of these pictures alone.
    ///
    /// # Errors
    /// A window cannot be opened, or the device failed.
    pub fn draw(&mut self, scene: &Scene, mut pictures: Vec<Picture>, all: Option<&[Picture]>) -> Result<FrameStats, Error> {
        self.panes.fit(&pictures, self.target)?;
        let Panes { open, drawing, .. } = &mut *self.panes;
        pictures.retain(|p| open.iter().any(|pane| pane.name == p.name && pane.size().is_some()));
        let mut stats = FrameStats::default();
        if let Some((_, renderer)) = drawing.as_mut().filter(|_| !pictures.is_empty()) {
            stats = renderer.render_part(scene, &pictures, all.unwrap_or(&pictures))?;
        }
        self.panes.pictures = pictures;
        Ok(stats)
    }

    /// What the renderer found wrong since this was last called.
    pub fn problems(&mut self) -> Vec<String> {
        self.panes.drawing.as_mut().map_or_else(Vec::new, |(_, renderer)| renderer.problems())
    }

    /// Waits until everything is drawn.
    ///
    /// # Errors
    /// The device failed.
    pub fn wait(&self) -> Result<(), Error> {
        self.panes.drawing.as_ref().map_or(Ok(()), |(_, renderer)| Ok(renderer.wait()?))
    }

    /// Shows what was drawn last. A window that is gone is closed.
    ///
    /// # Errors
    /// The device failed.
    pub fn show(&mut self) -> Result<(), Error> {
        let Panes { open, drawing, pictures, shown, .. } = &mut *self.panes;
        let Some((gpu, renderer)) = drawing.as_mut().filter(|_| !pictures.is_empty()) else { return Ok(()) };
        let mut lost = Vec::new();
        for (i, picture) in pictures.iter().enumerate() {
            let Some(pane) = open.iter_mut().find(|p| p.name == picture.name) else { continue };
            let result = pane.show(gpu, |encoder, view, format| match renderer.blit(i, encoder, view, format) {
                // A picture that could not be drawn is among the problems.
                Ok(()) | Err(umbriel_render::Error::NoPicture { .. }) => Ok(()),
                Err(error) => Err(error.into()),
            });
            match result {
                Err(Error::Window(reason)) => {
                    tracing::warn!("the window `{}` is gone: {reason}", picture.name);
                    lost.push(picture.name.clone());
                }
                other => other?,
            }
        }
        *shown += 1;
        if lost.iter().any(|name| self.panes.close(name)) {
            self.target.exit();
        }
        Ok(())
    }
}
