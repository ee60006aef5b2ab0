//! A world: the graph, and the script that made it and that it calls.

pub(crate) mod saved;

use std::cell::RefMut;
use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use rhai::Dynamic;
use umbriel_fields::{FieldId, FrameReport, Graph, Host, NodeId, Revision};
use umbriel_scenegraph::new_graph;

use crate::definition::BEHAVIOUR;
use crate::engine::{Script, on_deep_stack};
use crate::error::{Problem, ScriptError};
use crate::expression::{self, EXPRESSION};
use crate::held;
use crate::limits::Limits;
use crate::sharing::Sharing;
use crate::source::Source;
use crate::stage::{Node, Stage};

/// What a world may use and where its assets lie.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Bounds on what its scripts may use.
    pub limits: Limits,
    /// Folders that models are read from, after the folder of the world's file.
    pub asset_folders: Vec<PathBuf>,
}

/// A running world.
pub struct World {
    graph: Graph,
    script: Script,
    settings: Settings,
    path: Option<PathBuf>,
    problems: Vec<Problem>,
    files: BTreeSet<PathBuf>,
    time_s: Option<f64>,
    generation: u64,
    /// What nodes reported already.
    told: HashSet<(NodeId, String)>,
    /// Writes up to this one were told to the script, where another process evaluates the world.
    told_until: Revision,
}

impl World {
    /// A world without script: the graph has the Group `world` and nothing else.
    pub fn new() -> Self {
        let (graph, script) = empty(&Settings::default(), None);
        Self::of(graph, script, Settings::default(), None)
    }

    /// Loads a world's file and runs it.
    pub fn load_file(path: impl AsRef<Path>) -> Result<Self, ScriptError> {
        Self::load_file_with(path, Settings::default())
    }

    /// Loads a world's file and runs it.
    pub fn load_file_with(path: impl AsRef<Path>, settings: Settings) -> Result<Self, ScriptError> {
        let path = path.as_ref();
        let (graph, script) = load(path, &settings)?;
        Ok(Self::of(graph, script, settings, Some(path.to_path_buf())))
    }

    /// Runs a world's file in a graph that holds nodes of other applications; see [`shared_graph`].
    pub fn join_file(path: impl AsRef<Path>, mut graph: Graph, sharing: Sharing) -> Result<Self, ScriptError> {
        let (path, settings) = (path.as_ref(), Settings::default());
        let source = Source::read(path, settings.limits.text)?;
        let world = graph.find(umbriel_scenegraph::WORLD).map(Node);
        let mut script = Script::new(Stage::new(settings.limits.clone(), folder_of(path).into_iter().collect()), world);
        *script.stage.sharing.borrow_mut() = Some(sharing);
        run(&mut graph, &mut script, source)?;
        Ok(Self::of(graph, script, settings, None))
    }

    /// Runs a text as a world; the name stands in its messages.
    pub fn load_source(name: &str, text: &str) -> Result<Self, ScriptError> {
        Self::load_source_with(name, text, Settings::default())
    }

    /// Runs a text as a world; what it includes and loads comes from the asset folders.
    pub fn load_source_with(name: &str, text: &str, settings: Settings) -> Result<Self, ScriptError> {
        let folder = settings.asset_folders.first().cloned().unwrap_or_default();
        let source = Source::from_text(name, text, &folder, settings.limits.text)?;
        let (mut graph, mut script) = empty(&settings, None);
        run(&mut graph, &mut script, source)?;
        Ok(Self::of(graph, script, settings, None))
    }

    fn of(graph: Graph, script: Script, settings: Settings, path: Option<PathBuf>) -> Self {
        let mut world = Self {
            graph,
            script,
            settings,
            path,
            problems: Vec::new(),
            files: BTreeSet::new(),
            time_s: None,
            generation: 0,
            told: HashSet::new(),
            told_until: 0,
        };
        world.collect();
        world
    }

    /// The graph.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The graph, to be changed between frames.
    pub fn graph_mut(&mut self) -> &mut Graph {
        &mut self.graph
    }

    /// Runs one frame: the script's frame handlers, then the graph's evaluation with its handlers and node types.
    /// Problems that nodes report are among [`World::problems`], each once; the report has none.
    /// Time in seconds; one that is no number, or that runs backwards, is taken for the last one.
    pub fn step(&mut self, time_s: f64) -> FrameReport {
        let last = self.time_s.unwrap_or(if time_s.is_finite() { time_s } else { 0.0 });
        let time_s = if time_s.is_finite() { time_s.max(last) } else { last };
        self.time_s = Some(time_s);
        let mut report = on_deep_stack(|| {
            self.script.stage.time_s.set(time_s);
            self.script.stage.frame.set(self.script.stage.frame.get() + 1);
            grant_all(&mut self.graph, &self.script);
            call_on_frame(&mut self.graph, &self.script, time_s, time_s - last);
            self.graph.set_origin("");
            self.script.stage.wake_always(&mut self.graph, time_s);
            let report = self.graph.evaluate(time_s, &mut Callbacks { script: &self.script, time_s });
            held::bound(&self.script.stage);
            report
        });
        self.collect();
        self.take_over(std::mem::take(&mut report.problems));
        report
    }

    /// Runs one frame of a world that another process evaluates: the script's handlers, and the node types that it defines.
    pub fn step_shared(&mut self, time_s: f64) {
        let last = self.time_s.replace(time_s).unwrap_or(time_s);
        on_deep_stack(|| {
            let stage = &self.script.stage;
            stage.time_s.set(time_s);
            stage.frame.set(stage.frame.get() + 1);
            call_on_frame(&mut self.graph, &self.script, time_s, time_s - last);
            stage.wake_always(&mut self.graph, time_s);
            let since = std::mem::replace(&mut self.told_until, self.graph.revision());
            self.graph.tell(since, &mut Callbacks { script: &self.script, time_s });
            held::bound(stage);
        });
        self.collect();
    }

    /// What the script knows of other applications; none where it is alone.
    pub fn sharing_mut(&self) -> Option<RefMut<'_, Sharing>> {
        RefMut::filter_map(self.script.stage.sharing.borrow_mut(), Option::as_mut).ok()
    }

    /// The answer about a lock that the script asked for; an error says why it is refused.
    pub fn answer(&mut self, node: NodeId, answer: &Result<(), String>) {
        on_deep_stack(|| tell_lock(&mut self.graph, &self.script, Some(node), answer));
        self.collect();
    }

    /// Runs a text in the running world, as typed at a console, and gives the value as text. Top-level variables of the
    /// world's script are there.
    pub fn console(&mut self, text: &str) -> Result<String, Problem> {
        let stage = self.script.stage.clone();
        let result = on_deep_stack(|| stage.with(&mut self.graph, || self.script.console(text)));
        self.collect();
        result
    }

    /// The problems since the last call, each once, oldest first.
    pub fn problems(&mut self) -> Vec<Problem> {
        std::mem::take(&mut self.problems)
    }

    /// The files that the world depends on: its script, what that includes, and the models that it loads.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(PathBuf::as_path)
    }

    /// How often the world was reloaded. After a reload the graph is another one, and ids and revisions of the old one mean
    /// nothing any more.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Runs the world's file anew, in a fresh graph; where the visitor stands (Navigation, User) is kept. If the file is
    /// wrong, that becomes a problem, the old world stays, and the result is false. False too for a world without file.
    pub fn reload(&mut self) -> bool {
        let Some(path) = self.path.clone() else { return false };
        match load(&path, &self.settings) {
            Ok((mut graph, script)) => {
                keep_poses(&self.graph, &mut graph);
                self.graph = graph;
                self.script = script;
                self.generation += 1;
                self.files.clear();
                self.told.clear();
                self.collect();
                true
            }
            Err(error) => {
                self.problems.push(problem_of(error, &path));
                false
            }
        }
    }

    /// Where the script made a node: file relative to the world's folder, line and column, both from 1.
    pub fn made_at(&self, node: NodeId) -> Option<(String, usize, usize)> {
        let stage = &self.script.stage;
        Some(stage.source.borrow().place(stage.made_at(node)?))
    }

    /// Problems of nodes become problems of the world, each once, however often it is reported.
    fn take_over(&mut self, problems: Vec<umbriel_fields::Problem>) {
        const REMEMBERED: usize = 10_000;
        let (file, _, _) = self.script.stage.source.borrow().place(rhai::Position::NONE);
        for umbriel_fields::Problem { node, field, message } in problems {
            let label = self.graph.contains(node).then(|| self.graph.describe(node));
            let declared = field.and_then(|field| self.graph.declaration(field).ok()).map(|field| field.name.to_string());
            if self.told.len() < REMEMBERED && self.told.insert((node, message.clone())) {
                let (file, line, column) = self.made_at(node).unwrap_or((file.clone(), 0, 0));
                self.problems.push(Problem { message, file, line, column, node: label, field: declared, calls: Vec::new() });
            }
        }
    }

    fn collect(&mut self) {
        let stage = &self.script.stage;
        self.problems.append(&mut stage.problems.borrow_mut());
        self.files.extend(stage.source.borrow().files.iter().cloned());
        self.files.append(&mut stage.files.borrow_mut());
    }
}

impl Default for World {
    fn default() -> Self {
        Self::new()
    }
}

fn problem_of(error: ScriptError, path: &Path) -> Problem {
    match error {
        ScriptError::Script(problem) => problem,
        unreadable => Problem {
            message: unreadable.to_string(),
            file: path.to_string_lossy().into_owned(),
            line: 0,
            column: 0,
            node: None,
            field: None,
            calls: Vec::new(),
        },
    }
}

fn load(path: &Path, settings: &Settings) -> Result<(Graph, Script), ScriptError> {
    let source = Source::read(path, settings.limits.text)?;
    let (mut graph, mut script) = empty(settings, folder_of(path).as_deref());
    run(&mut graph, &mut script, source)?;
    Ok((graph, script))
}

/// The parent of a bare file name is empty, which no system call takes for the current folder.
fn folder_of(path: &Path) -> Option<PathBuf> {
    path.parent().map(|p| if p.as_os_str().is_empty() { PathBuf::from(".") } else { p.to_path_buf() })
}

fn empty(settings: &Settings, folder: Option<&Path>) -> (Graph, Script) {
    let folders = folder.map(Path::to_path_buf).into_iter().chain(settings.asset_folders.iter().cloned()).collect();
    let graph = empty_graph();
    let world = graph.find(umbriel_scenegraph::WORLD).map(Node);
    (graph, Script::new(Stage::new(settings.limits.clone(), folders), world))
}

/// A graph without script, which knows all node types.
pub(crate) fn empty_graph() -> Graph {
    let graph = new_graph();
    for node_type in [expression::node_type(), saved::script_type()] {
        if let Err(error) = graph.types().register(node_type) {
            tracing::error!("{error}");
        }
    }
    graph
}

/// A graph for [`World::join_file`]: it knows all node types of worlds, and holds the Group `world`.
pub fn shared_graph() -> Graph {
    empty_graph()
}

/// Nobody else is there to have locked anything.
fn grant_all(graph: &mut Graph, script: &Script) {
    if !script.stage.awaited.borrow().is_empty() {
        tell_lock(graph, script, None, &Ok(()));
    }
}

/// Calls the handlers that wait for the answer about a node, or about all.
fn tell_lock(graph: &mut Graph, script: &Script, node: Option<NodeId>, answer: &Result<(), String>) {
    let stage = &script.stage;
    let awaited = std::mem::take(&mut *stage.awaited.borrow_mut());
    let (due, rest): (Vec<_>, Vec<_>) = awaited.into_iter().partition(|(of, _)| node.is_none_or(|node| node == of.0));
    *stage.awaited.borrow_mut() = rest;
    for (of, handler) in due {
        stage.with(graph, || {
            let why = answer.as_ref().err().cloned().unwrap_or_default();
            if let Err(mut problem) = script.call(&handler, vec![answer.is_ok().into(), why.into()]) {
                problem.node = problem.node.or_else(|| Some(stage.label(of)));
                stage.problems.borrow_mut().push(problem);
            }
        });
    }
}

fn run(graph: &mut Graph, script: &mut Script, source: Source) -> Result<(), Problem> {
    let stage = script.stage.clone();
    on_deep_stack(|| stage.with(graph, || script.run(source)))
}

fn call_on_frame(graph: &mut Graph, script: &Script, time_s: f64, dt_s: f64) {
    let stage = &script.stage;
    let ids: Vec<u64> = stage.on_frame.borrow().keys().copied().collect();
    for id in ids {
        // One handler may have stopped another.
        let Some(handler) = stage.on_frame.borrow().get(&id).cloned() else { continue };
        stage.with(graph, || {
            if let Err(problem) = script.call(&handler, vec![time_s.into(), dt_s.into()]) {
                switch_off(stage, problem, "this on_frame handler is switched off");
                stage.stop(id);
            }
        });
    }
}

fn switch_off(stage: &Rc<Stage>, mut problem: Problem, consequence: &str) {
    problem.message = format!("{}; {consequence}", problem.message);
    stage.problems.borrow_mut().push(problem);
}

/// Calls into the script while the graph is evaluated.
struct Callbacks<'a> {
    script: &'a Script,
    time_s: f64,
}

impl Host for Callbacks<'_> {
    fn field_changed(&mut self, graph: &mut Graph, field: FieldId, token: u64) {
        let stage = &self.script.stage;
        if token == BEHAVIOUR {
            return self.behave(graph, field.node);
        }
        let Some(handler) = stage.on_change.borrow().get(&token).cloned() else { return };
        stage.with(graph, || {
            let me = handler.me.map(Dynamic::from);
            let values = me.into_iter().chain([stage.value(handler.field)]).collect();
            if let Err(mut problem) = self.script.call(&handler.handler, values) {
                let node = Node(handler.field.node);
                problem.node = problem.node.or_else(|| Some(stage.label(node)));
                switch_off(stage, problem, "this on_change handler is switched off");
                stage.stop(token);
            }
        });
    }

    fn evaluate(&mut self, graph: &mut Graph, node: NodeId) {
        let stage = &self.script.stage;
        if !graph.contains(node) || stage.switched_off.borrow().contains(&node) || !stage.evaluates(node) {
            return;
        }
        let type_name = graph.type_of(node).name.clone();
        if &*type_name == EXPRESSION {
            // It is evaluated where the world is.
            if stage.sharing.borrow().is_some() {
                return;
            }
            return expression::evaluate(self.script, graph, node);
        }
        self.run_evaluate(graph, node, &type_name);
    }
}

impl Callbacks<'_> {
    /// A node of a native type that a script extends: the first of its fields that was written in a frame has it evaluated.
    fn behave(&mut self, graph: &mut Graph, node: NodeId) {
        let stage = &self.script.stage;
        let mut behaviours = stage.behaviours.borrow_mut();
        let Some(behaviour) = behaviours.get_mut(&node).filter(|behaviour| behaviour.frame != stage.frame.get()) else { return };
        behaviour.frame = stage.frame.get();
        let type_name = behaviour.type_name.clone();
        drop(behaviours);
        if !stage.switched_off.borrow().contains(&node) {
            self.run_evaluate(graph, node, &type_name);
        }
    }

    fn run_evaluate(&mut self, graph: &mut Graph, node: NodeId, type_name: &str) {
        let stage = &self.script.stage;
        let Some((level, evaluate)) = stage.evaluate_from(type_name) else { return };
        stage.evaluating.borrow_mut().push((Node(node), level));
        stage.with(graph, || {
            if let Err(mut problem) = self.script.call(&evaluate, vec![Node(node).into(), self.time_s.into()]) {
                let gone = || format!("a deleted {type_name}");
                let label = if stage.read(|graph| graph.contains(node)) { stage.label(Node(node)) } else { gone() };
                problem.node = problem.node.or_else(|| Some(label.clone()));
                switch_off(stage, problem, &format!("evaluate of {label} is switched off"));
                stage.switched_off.borrow_mut().insert(node);
            }
        });
        stage.evaluating.borrow_mut().clear();
    }
}

/// Takes over where the visitor stands and how he moves.
fn keep_poses(old: &Graph, new: &mut Graph) {
    for node_type in ["Navigation", "User"] {
        let of_type = |graph: &Graph| graph.nodes().find(|id| &*graph.type_of(*id).name == node_type);
        let (Some(from), Some(to)) = (of_type(old), of_type(new)) else { continue };
        for field in ["position", "orientation", "scale"] {
            if let Ok(value) = old.value_named(from, field) {
                let _ = new.set_named(to, field, value); // the types are the same; a field that is not there is not kept
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_of_expressions_is_compiled_once() {
        let script = "let all = each(100, |i| make(\"Expression\", #{ inputs: #{ a: i }, code: \"a * 2\" }));
            on_frame(|time| { for e in all { e.a = time.to_int(); } });";
        let mut world = World::load_source("test", script).unwrap_or_else(|error| panic!("{error}"));
        let compiled = |world: &World| {
            let known = world.script.stage.compiled.borrow();
            known.iter().map(|(code, ast)| (code.to_string(), Rc::as_ptr(ast))).collect::<Vec<_>>()
        };
        let before = compiled(&world);
        let evaluated: usize = (1..5).map(|frame| world.step(f64::from(frame)).evaluated).sum();
        assert_eq!((evaluated, before.len(), compiled(&world)), (400, 1, before));
    }
}
