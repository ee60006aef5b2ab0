//! Draws one display, or one channel of it, out of a replica.

use super::Failure;
use crate::headless::{DESKTOP_SIZE, describe};
use crate::png;
use crate::session::bounds;
use std::path::{Path, PathBuf};
use umbriel_displays::WindowSizes;
use umbriel_displays::cluster::{ClusterError, Screen};
use umbriel_displays::rig::{DESKTOP, Rig, Wanted};
use umbriel_fields::Graph;
use umbriel_render::{Gpu, Renderer, RgbaPixels};
use umbriel_scene::{Aabb, Picture, Scene};
use umbriel_scenegraph::Extractor;

/// Why a display ends.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ScreenError {
    /// Of the network.
    #[error(transparent)]
    Cluster(#[from] ClusterError),
    /// Of the rig.
    #[error(transparent)]
    Rig(#[from] umbriel_displays::Error),
    /// A channel that the display does not have.
    #[error("display `{display}` has {count} channels: there is no `{display}/{channel}`")]
    Channel {
        /// Its name.
        display: String,
        /// What was asked for, from zero.
        channel: usize,
        /// How many there are.
        count: usize,
    },
    /// Of the GPU.
    #[error(transparent)]
    Render(#[from] umbriel_render::Error),
    /// Of a file.
    #[error(transparent)]
    Write(#[from] png::WriteError),
}

/// Splits `wall/2` into the display and its channel. A display whose own name has a slash is taken as it is.
pub(super) fn channel_of(show: &str) -> (&str, Option<usize>) {
    match show.rsplit_once('/').map(|(name, channel)| (name, channel.parse())) {
        Some((name, Ok(channel))) => (name, Some(channel)),
        _ => (show, None),
    }
}

/// One view of a picture as a picture of its own.
pub(super) fn channel(picture: &Picture, channel: usize) -> Option<Picture> {
    let view = picture.views.get(channel)?.clone();
    Some(Picture { name: format!("{}/{channel}", picture.name), kind: picture.kind, ..Picture::mono(view) })
}

/// A display without a window.
pub(super) struct Canvas {
    show: String,
    out: Option<PathBuf>,
    device: String,
    renderer: Renderer,
    extractor: Extractor,
    scene: Scene,
    rig: Rig,
    /// Of all displays.
    whole: Rig,
    drawn: Vec<RgbaPixels>,
}

impl Canvas {
    pub(super) fn new(show: &str, out: Option<&Path>) -> Result<Canvas, Failure> {
        let gpu = Gpu::new(None)?;
        Ok(Canvas {
            show: show.into(),
            out: out.map(Path::to_path_buf),
            device: describe(&gpu),
            renderer: Renderer::new(&gpu)?,
            extractor: Extractor::new(),
            scene: Scene::default(),
            rig: Rig::new(),
            whole: Rig::new(),
            drawn: Vec::new(),
        })
    }
}

impl Canvas {
    /// What all displays show, here and elsewhere.
    fn installation(&mut self, graph: &Graph, bounds: &Aabb, shown: &[Picture]) -> Result<Vec<Picture>, ScreenError> {
        let wanted = Wanted { view: None, size: DESKTOP_SIZE, windows: &WindowSizes::new() };
        let mut all = self.whole.pictures(graph, self.extractor.viewpoints(), bounds, &wanted)?.pictures;
        // A viewpoint is shown by this process alone.
        all.retain(|picture| picture.name != DESKTOP);
        let is_elsewhere = |one: &&Picture| !all.iter().any(|other| other.name == one.name);
        let alone: Vec<Picture> = shown.iter().filter(is_elsewhere).cloned().collect();
        all.extend(alone);
        Ok(all)
    }
}

impl Screen for Canvas {
    type Error = ScreenError;

    fn draw(&mut self, graph: &Graph, _frame: u64, is_new: bool) -> Result<(), ScreenError> {
        if is_new {
            self.extractor = Extractor::new().with_ready_casters();
            self.scene = Scene::default();
            self.rig.refit();
            self.whole.refit();
        }
        self.extractor.update(graph, &mut self.scene);
        for problem in self.extractor.problems() {
            tracing::error!("{problem}");
        }
        let show = self.show.clone();
        let (name, wanted_channel) = channel_of(&show);
        let bounds = bounds(&self.scene).transformed(&self.extractor.world_from_room());
        let wanted = Wanted { view: Some(name), size: DESKTOP_SIZE, windows: &WindowSizes::new() };
        let found = self.rig.pictures(graph, self.extractor.viewpoints(), &bounds, &wanted)?;
        for problem in &found.problems {
            tracing::error!("{problem}");
        }
        let mut pictures = found.pictures;
        let all = self.installation(graph, &bounds, &pictures)?;
        if let Some(wanted) = wanted_channel {
            let count = pictures.iter().map(|picture| picture.views.len()).sum();
            let one = pictures.iter().find_map(|picture| channel(picture, wanted));
            pictures = vec![one.ok_or_else(|| ScreenError::Channel { display: name.into(), channel: wanted, count })?];
        }
        self.renderer.render_part(&self.scene, &pictures, &all)?;
        for problem in self.renderer.problems() {
            tracing::error!("{problem}");
        }
        // Reading back waits for the GPU: ready means that the picture is there.
        self.drawn = self.renderer.read_back(0)?;
        Ok(())
    }

    fn show(&mut self, frame: u64) -> Result<(), ScreenError> {
        if let Some(out) = &self.out {
            png::write(&file_of(out, frame), &png::row(&self.drawn), &self.device)?;
        }
        Ok(())
    }
}

/// `out.0007.png`.
pub(super) fn file_of(out: &Path, frame: u64) -> PathBuf {
    let stem = out.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    out.with_file_name(format!("{stem}.{frame:04}.png"))
}
