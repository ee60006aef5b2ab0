//! A world or a model that is shown: the loop that sees all crates, up to the renderer.

use crate::model;
use crate::source::{Recording, RecordingError, Replay, Source};
use glam::Vec3;
use std::path::{Path, PathBuf};
use umbriel_displays::WindowSizes;
use umbriel_displays::navigation::{Input, NavigationNode};
use umbriel_displays::rig::{Aim, Pointed, Pointers, Rig, Wanted};
use umbriel_fields::{Graph, NodeId};
use umbriel_scene::{Aabb, Drawable, Picture, Samples, Scene};
use umbriel_scenegraph::{Extractor, Viewpoint};
use umbriel_scripts::{SaveForm, World};

/// Why there is nothing to show.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OpenError {
    /// The file's name does not say what it is.
    #[error("{}: neither a world (.rhai), a saved one (.umbriel), nor a model (.gltf, .glb)", .0.display())]
    Kind(PathBuf),
    /// The script is wrong.
    #[error(transparent)]
    Script(#[from] umbriel_scripts::ScriptError),
    /// The model is wrong.
    #[error(transparent)]
    Model(#[from] model::Error),
    /// The recording is wrong, or cannot be written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recording would take the place of what is recorded.
    #[error("{}: the world is made of this file; record to another one", .0.display())]
    RecordsOver(PathBuf),
}

/// Extension of saved worlds.
pub(crate) const SAVED: &str = "umbriel";

/// A running world with its flat scene.
pub(crate) struct Session {
    path: PathBuf,
    source: Source,
    recording: Option<Recording>,
    extractor: Extractor,
    scene: Scene,
    rig: Rig,
    generation: u64,
    /// Frames wait until reduced casters are made.
    waits: bool,
    /// Instead of what the world says.
    samples: Option<Samples>,
    navigation: Option<NavigationNode>,
    pointers: Pointers,
    /// What was reported and not yet told.
    problems: Vec<String>,
    /// For replicas, which have no files.
    #[cfg(feature = "cluster")]
    embedder: umbriel_scenegraph::Embedder,
}

impl Session {
    /// Opens a world or a model.
    pub(crate) fn open(path: &Path) -> Result<Session, OpenError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let world = match extension.as_str() {
            "rhai" => World::load_file(path)?,
            SAVED => World::open_save(path)?,
            "gltf" | "glb" => {
                let mut world = World::new();
                model::show(world.graph_mut(), path)?;
                world
            }
            _ => return Err(OpenError::Kind(path.to_path_buf())),
        };
        Ok(Session::of(Source::World(Box::new(world)), path))
    }

    /// Shows a recording.
    pub(crate) fn replay(replay: Replay, path: &Path) -> Session {
        Session::of(Source::Replay(Box::new(replay)), path)
    }

    /// Pictures that nodes name lie beside `path`.
    fn of(source: Source, path: &Path) -> Session {
        Session {
            path: path.to_path_buf(),
            generation: source.generation(),
            waits: false,
            samples: None,
            source,
            recording: None,
            extractor: extractor_beside(path, false),
            scene: Scene::default(),
            rig: Rig::new(),
            navigation: None,
            pointers: Pointers::default(),
            problems: Vec::new(),
            #[cfg(feature = "cluster")]
            embedder: umbriel_scenegraph::Embedder::new(folder_of(path)),
        }
    }

    /// The same frames on every machine: reduced casters are made before they are wanted, not beside the frames. Before the
    /// first step.
    pub(crate) fn wait_for_casters(mut self) -> Session {
        self.waits = true;
        self.extractor = extractor_beside(&self.path, true);
        self
    }

    /// Draws with so many samples, whatever the world says.
    pub(crate) fn with_samples(self, samples: Option<Samples>) -> Session {
        Session { samples, ..self }
    }

    /// Records every frame from now on.
    pub(crate) fn record(&mut self, path: &Path) -> Result<(), OpenError> {
        let is_it = |file: &PathBuf| matches!((file.canonicalize(), path.canonicalize()), (Ok(file), Ok(path)) if file == path);
        if self.files().iter().any(is_it) {
            return Err(OpenError::RecordsOver(path.to_path_buf()));
        }
        self.recording = Some(Recording::start(self.source.graph_mut(), path)?);
        Ok(())
    }

    /// Ends the recording, if there is one; gives the number of its frames.
    pub(crate) fn finish_recording(&mut self) -> Result<Option<u64>, OpenError> {
        let Some(recording) = self.recording.take() else { return Ok(None) };
        Ok(Some(recording.finish(self.source.graph_mut())?))
    }

    /// Runs one frame of the world and brings the scene up to date.
    pub(crate) fn step(&mut self, time_s: f64) {
        if let Source::World(world) = &mut self.source {
            for light in self.extractor.maps_drawn_once() {
                // A light that was deleted since has no field to fall back.
                let _ = world.graph_mut().set_named(light, "shadow_update", "none");
            }
        }
        self.evaluate(time_s);
        self.extract();
    }

    /// Runs one frame of the world, for those who do not draw it.
    pub(crate) fn evaluate(&mut self, time_s: f64) {
        self.problems.extend(self.source.step(time_s));
        if let Some(Err(error)) = self.recording.as_mut().map(|r| r.frame(self.source.graph_mut())) {
            self.problems.push(format!("the recording ends here: {error}"));
            self.recording = None;
        }
    }

    /// Runs a text in the world, as part of its script; gives its value as text, or what is wrong with it.
    pub(crate) fn console(&mut self, text: &str) -> Result<String, String> {
        match &mut self.source {
            Source::World(world) => world.console(text).map_err(|problem| problem.to_string()),
            Source::Replay(_) => Err("a recording runs no scripts".to_owned()),
        }
    }

    /// The world as a file; None for a recording.
    pub(crate) fn save(&mut self, form: SaveForm) -> Result<Option<Vec<u8>>, umbriel_fields::Error> {
        match &mut self.source {
            Source::World(world) => world.save(form).map(Some),
            Source::Replay(_) => Ok(None),
        }
    }

    /// Puts files that nodes name into the nodes, for processes that have no files.
    #[cfg(feature = "cluster")]
    pub(crate) fn embed(&mut self) {
        self.embedder.update(self.source.graph_mut(), &|_| true);
    }

    /// Has a recording been played to its end?
    pub(crate) fn is_over(&self) -> bool {
        matches!(&self.source, Source::Replay(replay) if replay.is_over())
    }

    fn extract(&mut self) {
        if self.source.generation() != self.generation {
            self.generation = self.source.generation();
            self.extractor = extractor_beside(&self.path, self.waits);
            self.scene = Scene::default();
            self.navigation = None;
            self.pointers = Pointers::default();
            self.rig.refit();
        }
        self.extractor.update(self.source.graph(), &mut self.scene);
        self.scene.samples = self.samples.unwrap_or(self.scene.samples);
        let problems = self.extractor.problems();
        self.problems.extend(problems.iter().map(|problem| placed(&self.source, Some(problem.node), problem)));
    }

    /// What the displays show, or the named display or viewpoint. `size` is that of a desktop's picture, `windows` that of
    /// displays that do not have the size that they ask for.
    pub(crate) fn pictures(
        &mut self,
        view: Option<&str>,
        size: [u32; 2],
        windows: &WindowSizes,
    ) -> Result<Vec<Picture>, umbriel_displays::Error> {
        let bounds = bounds(&self.scene).transformed(&self.extractor.world_from_room());
        let wanted = Wanted { view, size, windows };
        let found = self.rig.pictures(self.source.graph(), self.extractor.viewpoints(), &bounds, &wanted)?;
        let node = |problem: &umbriel_displays::Error| match problem {
            umbriel_displays::Error::Rig { node, .. } => self.source.graph().find(node),
            _ => None,
        };
        self.problems.extend(found.problems.iter().map(|problem| placed(&self.source, node(problem), problem)));
        Ok(found.pictures)
    }

    /// The scene of the last step.
    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The scene of the last step, to be changed by whoever draws it once.
    pub(crate) fn scene_mut(&mut self) -> &mut Scene {
        &mut self.scene
    }

    /// The graph.
    pub(crate) fn graph(&self) -> &Graph {
        self.source.graph()
    }

    /// The graph, to be written between frames.
    #[cfg(feature = "cluster")]
    pub(crate) fn graph_mut(&mut self) -> &mut Graph {
        self.source.graph_mut()
    }

    /// The viewpoints of the world, in tree order.
    pub(crate) fn viewpoints(&self) -> &[Viewpoint] {
        self.extractor.viewpoints()
    }

    /// Place of a light of the scene, by the name of its node.
    pub(crate) fn light_named(&self, name: &str) -> Option<usize> {
        self.extractor.light_of(self.graph().find(name)?)
    }

    /// What to say where a name is no light's.
    pub(crate) fn no_light(&self, name: &str) -> String {
        let names: Vec<&str> =
            self.scene.lights.iter().filter(|l| l.shines).map(|l| l.name.as_str()).filter(|n| !n.is_empty()).collect();
        format!("no light '{name}' is on in this world; there are: {}", names.join(", "))
    }

    /// Moves the room through the world by mouse or keys.
    pub(crate) fn navigate(&mut self, input: Input<'_>) {
        if let Err(error) = self.try_navigate(input) {
            self.problems.push(error.to_string());
        }
    }

    fn try_navigate(&mut self, input: Input<'_>) -> Result<(), umbriel_displays::Error> {
        let centre = bounds(&self.scene).transformed(&self.extractor.world_from_room()).centre();
        let graph = self.source.graph_mut();
        let node = match self.navigation {
            Some(node) if graph.contains(node.node) => node,
            _ => NavigationNode::find_or_create(graph, centre)?,
        };
        self.navigation = Some(node);
        let mut navigator = node.read(graph)?;
        navigator.step(input);
        node.write(graph, &navigator)
    }

    /// Takes notice of where the mouse on a display points.
    pub(crate) fn point(&mut self, display: &str, aim: &Aim) {
        if self.pointers.want(self.source.graph(), display) {
            let node_of = |drawable| self.extractor.node_of_drawable(drawable);
            let pointed = Pointed::find(aim, &self.scene, &self.extractor.world_from_room(), node_of);
            self.pointed(display, &pointed);
        }
    }

    /// Takes notice of what the mouse on a display points at.
    pub(crate) fn pointed(&mut self, display: &str, pointed: &Pointed) {
        let result = self.pointers.write(self.source.graph_mut(), display, pointed);
        self.problems.extend(result.err().map(|e| e.to_string()));
    }

    /// Puts the room back to where it stands without navigation.
    pub(crate) fn reset_navigation(&mut self) {
        let Some(node) = self.navigation else { return };
        let graph = self.source.graph_mut();
        let result = node.read(graph).and_then(|mut navigator| {
            navigator.position = Vec3::ZERO;
            navigator.orientation = glam::Quat::IDENTITY;
            node.write(graph, &navigator)
        });
        self.problems.extend(result.err().map(|e| e.to_string()));
    }

    /// Reads the files again. Where they are wrong, that is reported and what was there stays. A reloaded graph is another
    /// one, so a recording ends.
    pub(crate) fn reload(&mut self) {
        match self.finish_recording() {
            Ok(Some(frames)) => self.problems.push(format!("reloaded: the recording ends after {frames} frames")),
            Ok(None) => {}
            Err(error) => self.problems.push(error.to_string()),
        }
        match &mut self.source {
            Source::World(world) if self.path.extension().is_some_and(|e| e == "rhai") => {
                let stood = self.navigation.and_then(|n| n.read(world.graph()).ok());
                if let (true, Some(navigator)) = (world.reload(), stood) {
                    let graph = world.graph_mut();
                    let kept = NavigationNode::find_or_create(graph, navigator.center).and_then(|n| n.write(graph, &navigator));
                    self.problems.extend(kept.err().map(|e| e.to_string()));
                }
                self.problems.extend(world.problems().iter().map(ToString::to_string));
            }
            Source::World(_) => match Session::open(&self.path) {
                Ok(fresh) => {
                    let problems = std::mem::take(&mut self.problems);
                    *self = Session { problems, ..fresh };
                }
                Err(error) => self.problems.push(error.to_string()),
            },
            Source::Replay(replay) => self.problems.extend(replay.seek(0).err().map(|e| e.to_string())),
        }
    }

    /// Files changed. Shaders are read again and the world goes on; any other file means to begin anew.
    pub(crate) fn files_changed(&mut self, files: &[PathBuf]) {
        let shaders: Vec<PathBuf> = self.extractor.shader_files().map(Path::to_path_buf).collect();
        self.extractor.forget_shaders(files);
        if files.iter().any(|file| !shaders.contains(file)) {
            self.reload();
        }
    }

    /// The files that were read.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        let mut files = vec![self.path.clone()];
        if let Source::World(world) = &self.source {
            files.extend(world.files().map(Path::to_path_buf).filter(|f| *f != self.path));
        }
        files.extend(self.extractor.shader_files().map(Path::to_path_buf));
        files
    }

    /// Name of the world: its file without folder and extension.
    pub(crate) fn name(&self) -> String {
        self.path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// Problems since this was last called.
    pub(crate) fn problems(&mut self) -> Vec<String> {
        std::mem::take(&mut self.problems)
    }

    /// The same, and those of the renderer. It names what they are about, as in `mesh 'dust' ...`, and does not know where in the
    /// script that was made, nor which shapes have a shader.
    pub(crate) fn problems_with(&mut self, of_renderer: Vec<String>) -> Vec<String> {
        let mut problems = self.problems();
        problems.extend(of_renderer.into_iter().map(|problem| {
            if let Some(problem) = self.of_shader(&problem) {
                return problem;
            }
            let node = problem.split('\'').nth(1).and_then(|name| self.source.graph().find(name));
            placed(&self.source, node, &problem)
        }));
        problems
    }

    /// A problem of a shader, with the shapes that it costs.
    fn of_shader(&self, problem: &str) -> Option<String> {
        let mistake = problem.strip_suffix(umbriel_render::WITHOUT_SHADER)?;
        let has_it = |d: &Drawable| {
            let shader = d.material.shader.as_ref().filter(|_| d.visible);
            shader.is_some_and(|s| mistake.strip_prefix(&*s.source.name).is_some_and(|rest| rest.starts_with(':')))
        };
        let mut shapes: Vec<(NodeId, &str)> = Vec::new();
        for (place, d) in self.scene.drawables.iter().enumerate().filter(|(_, d)| has_it(d)) {
            let node = self.extractor.node_of_drawable(place).filter(|node| shapes.iter().all(|(other, _)| other != node));
            shapes.extend(node.map(|node| (node, &*d.name)));
        }
        let name = |(node, name): &(NodeId, &str)| match self.source.made_at(*node) {
            Some((file, line, column)) => format!("'{name}' ({file}:{line}:{column})"),
            None => format!("'{name}'"),
        };
        let mut names: Vec<String> = shapes.iter().take(MOST_SHAPES).map(name).collect();
        if shapes.len() > MOST_SHAPES {
            names.push(format!("{} more", shapes.len() - MOST_SHAPES));
        }
        let last = names.pop()?;
        let (are, shapes) = if names.is_empty() { ("is", last) } else { ("are", format!("{} and {last}", names.join(", "))) };
        Some(format!("{mistake}; {shapes} {are} shown without it"))
    }
}

/// So many shapes are named where they share a wrong shader.
const MOST_SHAPES: usize = 3;

/// A problem with the place in the script where its node was made.
fn placed(source: &Source, node: Option<NodeId>, problem: &impl std::fmt::Display) -> String {
    match node.and_then(|node| source.made_at(node)) {
        Some((file, line, column)) => format!("{file}:{line}:{column}: {problem}"),
        None => problem.to_string(),
    }
}

/// Box around everything that is shown.
pub(crate) fn bounds(scene: &Scene) -> Aabb {
    scene.drawables.iter().filter(|d| d.visible).fold(Aabb::EMPTY, |b, d| b.union(d.bounds_in_world))
}

/// The folder that a file lies in; the parent of a bare name is empty, which no system call takes for the current folder.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn extractor_beside(path: &Path, waits: bool) -> Extractor {
    let extractor = Extractor::new().with_asset_root(folder_of(path));
    if waits { extractor.with_ready_casters() } else { extractor }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saved_shader_is_taken_over_and_the_world_goes_on() {
        let folder = std::env::temp_dir().join(format!("umbriel-session-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (world, shader) = (folder.join("w.rhai"), folder.join("own.wgsl"));
        let script = "let n = make(\"Group\", #{ name: \"n\" }); n.add_field(\"count\", 0); on_frame(|t, dt| { n.count += 1; });
            world.add(shape(cuboid(vec3(1, 1, 1)), appearance(#{ shader: shader(\"own.wgsl\", #{}) })));";
        std::fs::write(&world, script).unwrap();
        std::fs::write(&shader, "first").unwrap();
        let mut session = Session::open(&world).unwrap();
        let step = |session: &mut Session, time_s| {
            session.step(time_s);
            let text = session.scene().drawables[0].material.shader.as_ref().map(|s| s.source.text.clone());
            let graph = session.graph();
            (text.unwrap_or_default(), graph.get_named::<i64>(graph.find("n").unwrap(), "count").unwrap())
        };
        assert_eq!(step(&mut session, 0.0), ("first".into(), 1));
        assert!(session.files().contains(&shader), "{:?}", session.files());
        std::fs::write(&shader, "second").unwrap();
        session.files_changed(std::slice::from_ref(&shader));
        assert_eq!(step(&mut session, 1.0), ("second".into(), 2), "the world goes on");
        session.files_changed(&[world.clone(), shader]);
        assert_eq!(step(&mut session, 2.0), ("second".into(), 1), "the world begins anew");
        assert_eq!(session.problems(), Vec::<String>::new());
        std::fs::remove_dir_all(folder).unwrap();
    }
}
