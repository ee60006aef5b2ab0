//! Draws one display, or one channel of it, out of a replica: to files or in a window.

use crate::headless::{DESKTOP_SIZE, describe};
use crate::png;
use crate::session::bounds;
use std::path::{Path, PathBuf};
use umbriel_displays::WindowSizes;
use umbriel_displays::cluster::{ClusterError, Screen};
use umbriel_displays::rig::{Aim, DESKTOP, Pointed, Pointers, Rig, Wanted};
use umbriel_displays::window::Stage;
use umbriel_fields::Graph;
use umbriel_render::{Renderer, RgbaPixels, Starting};
use umbriel_scene::{Aabb, Picture, Scene};
use umbriel_scenegraph::Extractor;

/// Why a display ends.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ScreenError {
    /// Of the network.
    #[error(transparent)]
    Cluster(#[from] ClusterError),
    /// Of the rig, or of a window.
    #[error(transparent)]
    Display(#[from] umbriel_displays::Error),
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

/// Splits `wall/2` into the display and its channel.
fn channel_of(show: &str) -> (&str, Option<usize>) {
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

/// One display, or one channel of it, in a replica.
pub(super) struct Sight {
    show: String,
    /// There is something of this very name: a slash in it means nothing.
    is_whole: bool,
    /// It was there before.
    was_seen: bool,
    /// It was told that it is not there now.
    is_missed: bool,
    extractor: Extractor,
    scene: Scene,
    pointers: Pointers,
    rig: Rig,
    /// Of all displays.
    whole: Rig,
}

/// What a display shows, and what maps are fitted to: what all displays of the installation show.
pub(super) struct Seen {
    pub(super) pictures: Vec<Picture>,
    pub(super) all: Vec<Picture>,
}

impl Sight {
    pub(super) fn new(show: &str) -> Sight {
        Sight {
            show: show.into(),
            is_whole: false,
            was_seen: false,
            is_missed: false,
            extractor: Extractor::new(),
            scene: Scene::default(),
            pointers: Pointers::default(),
            rig: Rig::new(),
            whole: Rig::new(),
        }
    }

    /// Brings the scene up to date with a graph, which is another one where `is_new`. `windows` are sizes of windows that are open, by
    /// the names of their pictures. None while a display that was there is missing in the rig: its last picture stays.
    pub(super) fn look(&mut self, graph: &Graph, is_new: bool, windows: &WindowSizes) -> Result<Option<Seen>, ScreenError> {
        match self.see(graph, is_new, windows) {
            Ok(seen) => {
                (self.was_seen, self.is_missed) = (true, false);
                Ok(Some(seen))
            }
            Err(ScreenError::Display(error @ umbriel_displays::Error::UnknownView { .. })) if self.was_seen => {
                if !std::mem::replace(&mut self.is_missed, true) {
                    tracing::warn!("{error}; the last picture of `{}` stays until it is there again", self.show);
                }
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// The display, and its channel if only one is shown.
    fn name(&self) -> (&str, Option<usize>) {
        if self.is_whole { (&self.show, None) } else { channel_of(&self.show) }
    }

    fn see(&mut self, graph: &Graph, is_new: bool, windows: &WindowSizes) -> Result<Seen, ScreenError> {
        self.is_whole = graph.find(&self.show).is_some();
        if is_new {
            self.extractor = Extractor::new().with_ready_casters();
            self.scene = Scene::default();
            self.pointers = Pointers::default();
            self.rig.refit();
            self.whole.refit();
        }
        self.extractor.update(graph, &mut self.scene);
        for problem in self.extractor.problems() {
            tracing::error!("{problem}");
        }
        let bounds = bounds(&self.scene).transformed(&self.extractor.world_from_room());
        let mut pictures = self.shown(graph, &bounds, windows)?;
        if let (_, Some(place)) = self.name()
            && let [whole] = &pictures[..]
        {
            // What one window shows is a part of the picture that the rig makes.
            let part = channel_in(whole, place)?;
            pictures = match windows.get(&part.name) {
                None => vec![part],
                Some(window) => {
                    let scaled = [0, 1].map(|i| window[i] * (whole.size[i] / part.size[i].max(1)));
                    let windows = WindowSizes::from([(whole.name.clone(), scaled)]);
                    let whole = self.shown(graph, &bounds, &windows)?;
                    vec![channel_in(&whole[0], place)?]
                }
            };
        }
        let all = self.installation(graph, &bounds, &pictures)?;
        Ok(Seen { pictures, all })
    }

    /// What the mouse points at here, if the world wants to know.
    pub(super) fn point(&mut self, graph: &Graph, aim: &Aim) -> Option<Pointed> {
        let node_of = |drawable| self.extractor.node_of_drawable(drawable);
        let is_wanted = self.pointers.want(graph, &self.show);
        is_wanted.then(|| Pointed::find(aim, &self.scene, &self.extractor.world_from_room(), node_of))
    }

    /// The pictures of the display, whole.
    fn shown(&mut self, graph: &Graph, bounds: &Aabb, windows: &WindowSizes) -> Result<Vec<Picture>, ScreenError> {
        let (name, _) = if self.is_whole { (&*self.show, None) } else { channel_of(&self.show) };
        let wanted = Wanted { view: Some(name), size: DESKTOP_SIZE, windows };
        let found = self.rig.pictures(graph, self.extractor.viewpoints(), bounds, &wanted)?;
        for problem in &found.problems {
            tracing::error!("{problem}");
        }
        Ok(found.pictures)
    }

    /// What all displays show, here and elsewhere.
    fn installation(&mut self, graph: &Graph, bounds: &Aabb, shown: &[Picture]) -> Result<Vec<Picture>, ScreenError> {
        let wanted = Wanted { view: None, size: DESKTOP_SIZE, windows: &WindowSizes::new() };
        let mut all = self.whole.pictures(graph, self.extractor.viewpoints(), bounds, &wanted)?.pictures;
        // A viewpoint is shown by this process alone.
        all.retain(|picture| picture.name != DESKTOP);
        let (name, _) = self.name();
        if !all.iter().any(|picture| picture.name == name) {
            all.extend_from_slice(shown);
        }
        Ok(all)
    }
}

fn channel_in(picture: &Picture, place: usize) -> Result<Picture, ScreenError> {
    let missing = || ScreenError::Channel { display: picture.name.clone(), channel: place, count: picture.views.len() };
    channel(picture, place).ok_or_else(missing)
}

/// A display without a window.
pub(super) struct Canvas {
    sight: Sight,
    out: Option<PathBuf>,
    /// As long as the device is being looked for.
    starting: Option<Starting>,
    /// The name of the device, and what draws on it.
    drawing: Option<(String, Renderer)>,
    drawn: Vec<RgbaPixels>,
}

impl Canvas {
    pub(super) fn new(show: &str, out: Option<&Path>) -> Canvas {
        let out = out.map(Path::to_path_buf);
        Canvas { sight: Sight::new(show), out, starting: Some(Starting::begin()), drawing: None, drawn: Vec::new() }
    }

    /// Says what is wrong with the device as soon as it is known.
    pub(super) fn settle(&mut self) -> Result<(), umbriel_render::Error> {
        if self.starting.as_ref().is_some_and(Starting::is_done) { self.finish() } else { Ok(()) }
    }

    fn finish(&mut self) -> Result<(), umbriel_render::Error> {
        if let Some(starting) = self.starting.take() {
            let (gpu, renderer) = starting.finish()?;
            self.drawing = Some((describe(&gpu), renderer));
        }
        Ok(())
    }
}

impl Screen for Canvas {
    type Error = ScreenError;

    fn draw(&mut self, graph: &Graph, _frame: u64, is_new: bool) -> Result<(), ScreenError> {
        let Some(seen) = self.sight.look(graph, is_new, &WindowSizes::new())? else { return Ok(()) };
        self.finish()?;
        let Some((_, renderer)) = &mut self.drawing else { return Ok(()) };
        renderer.render_part(&self.sight.scene, &seen.pictures, &seen.all)?;
        for problem in renderer.problems() {
            tracing::error!("{problem}");
        }
        // Reading back waits for the GPU: ready means that the picture is there.
        self.drawn = renderer.read_back(0)?;
        Ok(())
    }

    fn show(&mut self, frame: u64) -> Result<(), ScreenError> {
        if let (Some(out), Some((device, _))) = (&self.out, &self.drawing) {
            png::write(&file_of(out, frame), &png::row(&self.drawn), device)?;
        }
        Ok(())
    }
}

/// A display in a window, for a turn of the window's loop.
pub(super) struct InWindow<'a, 's> {
    pub(super) sight: &'a mut Sight,
    pub(super) stage: &'a mut Stage<'s>,
}

impl Screen for InWindow<'_, '_> {
    type Error = ScreenError;

    fn draw(&mut self, graph: &Graph, _frame: u64, is_new: bool) -> Result<(), ScreenError> {
        let Some(seen) = self.sight.look(graph, is_new, &self.stage.sizes())? else { return Ok(()) };
        self.stage.draw(&self.sight.scene, seen.pictures, Some(&seen.all))?;
        self.stage.problems().iter().for_each(|problem| tracing::warn!("{problem}"));
        Ok(self.stage.wait()?)
    }

    fn show(&mut self, _frame: u64) -> Result<(), ScreenError> {
        Ok(self.stage.show()?)
    }
}

/// `out.0007.png`.
pub(super) fn file_of(out: &Path, frame: u64) -> PathBuf {
    let stem = out.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    out.with_file_name(format!("{stem}.{frame:04}.png"))
}
