//! Worlds that are saved and opened again: the graph as text or bytes, and the script that its node types come from.
//!
//! What a save holds goes on: values, routes, clocks, Expressions, and what node types of the script do. Handlers of the script itself
//! belong to a run of the script and are not saved.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rhai::Dynamic;
use umbriel_fields::save::{self, SaveError};
use umbriel_fields::{Field, Graph, NodeId, NodeType};
use umbriel_scenegraph::WORLD;

use super::{Script, Settings, World, empty, folder_of, load};
use crate::definition::{BEHAVIOUR, Behaviour, Definition, FRAME_TIME, SCRIPT_TYPE};
use crate::error::{Problem, ScriptError};
use crate::source::below;
use crate::stage::{Node, Stage};

/// The name of the node type.
const SCRIPT: &str = "Script";
const URL: &str = "url";

/// The declaration.
pub(crate) fn script_type() -> NodeType {
    NodeType::new(SCRIPT, "In a saved world: the script that its node types come from. Its handlers do not run.")
        .field(Field::new(URL, "").doc("The file, beside the saved world."))
}

/// How a world is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveForm {
    /// To read, compare and edit.
    Text,
    /// Small, and quick to read.
    Binary,
}

impl World {
    /// The world as a file, to lie beside the world's script: pictures and the script are found from there.
    pub fn save(&mut self, form: SaveForm) -> Result<Vec<u8>, umbriel_fields::Error> {
        let script = self.path.as_ref().and_then(|path| path.file_name()).map(|name| name.to_string_lossy().into_owned());
        let noted = match script {
            Some(url) if script_of(&self.graph).is_none() => {
                let node = self.graph.create(SCRIPT)?;
                self.graph.set_named(node, URL, url)?;
                Some(node)
            }
            _ => None,
        };
        let bytes = match form {
            SaveForm::Text => save::to_text(&self.graph).into_bytes(),
            SaveForm::Binary => save::to_binary(&self.graph),
        };
        noted.map_or(Ok(()), |node| self.graph.delete(node))?;
        Ok(bytes)
    }

    /// Opens a saved world. What cannot be understood is among the problems, the rest is there.
    pub fn open_save(path: impl AsRef<Path>) -> Result<Self, ScriptError> {
        let (path, settings) = (path.as_ref(), Settings::default());
        let unreadable = |reason: String| ScriptError::Save { path: path.to_path_buf(), reason };
        let data = std::fs::read(path).map_err(|error| unreadable(error.to_string()))?;
        let (graph, script, problems) = open(path, &data, &settings).map_err(|error| unreadable(error.to_string()))?;
        let mut world = Self::of(graph, script, settings, None);
        world.problems.extend(problems);
        world.files.insert(path.to_path_buf());
        Ok(world)
    }
}

/// The script that a graph names, and where it stands.
fn script_of(graph: &Graph) -> Option<String> {
    let node = graph.nodes().find(|id| &*graph.type_of(*id).name == SCRIPT)?;
    graph.get_named::<Arc<str>>(node, URL).ok().map(|url| url.to_string()).filter(|url| !url.is_empty())
}

fn open(path: &Path, data: &[u8], settings: &Settings) -> Result<(Graph, Script, Vec<Problem>), SaveError> {
    let folder = folder_of(path).unwrap_or_default();
    let (bare, script) = empty(settings, Some(&folder));
    let (graph, reports) = save::load(data, bare.types().clone())?;
    let mut problems = Vec::new();
    let file = script_of(&graph).and_then(|url| {
        let outside = |why| problems.push(problem(path, None, None, Some(URL.into()), why));
        below(&folder, &url).map_err(outside).ok()
    });
    let (graph, script, reports) = match file {
        None => (graph, script, reports),
        Some(file) => match load(&file, settings) {
            // The nodes that the script made here are not those of the save.
            Ok((made, script)) => {
                let (graph, reports) = save::load(data, made.types().clone())?;
                (graph, script, reports)
            }
            Err(error) => {
                problems.push(super::problem_of(error, &file));
                (graph, script, reports)
            }
        },
    };
    let mut graph = graph;
    let said = |report: save::Report| {
        problem(path, report.line, Some(report.node).filter(|name| !name.is_empty()), report.field, report.message)
    };
    problems.extend(reports.into_iter().map(said));
    if graph.find(WORLD).is_none() {
        let message = format!("there is no node `{WORLD}`, below which all stands that is shown");
        problems.push(problem(path, None, None, None, message));
    }
    problems.extend(wake(&mut graph, &script.stage).into_iter().map(|message| problem(path, None, None, None, message)));
    Ok((graph, script, problems))
}

fn problem(path: &Path, line: Option<usize>, node: Option<String>, field: Option<String>, message: String) -> Problem {
    let file = PathBuf::from(path.file_name().unwrap_or_default()).to_string_lossy().into_owned();
    let node = node.map(|node| format!("`{node}`"));
    Problem { message, file, line: line.unwrap_or(0), column: usize::from(line.is_some()), node, field, calls: Vec::new() }
}

/// Takes away what the script's own run left, and gives the nodes of the save the behaviour of their types. Gives what does not work.
fn wake(graph: &mut Graph, stage: &Stage) -> Vec<String> {
    stage.forget_run();
    let mut messages: Vec<String> = Vec::new();
    stage.definitions.borrow_mut().iter_mut().for_each(|(name, definition)| messages.extend(cut_off(name, definition)));
    messages.sort();
    let nodes: Vec<NodeId> = graph.nodes().collect();
    for node in nodes {
        let noted = graph.get_named::<Arc<str>>(node, SCRIPT_TYPE).map(|name| name.to_string()).ok();
        let name = noted.clone().unwrap_or_else(|| graph.type_of(node).name.to_string());
        let Some(definition) = stage.definitions.borrow().get(&name).cloned() else {
            messages.extend(
                noted.map(|name| format!("there is no node type `{name}` in the script; {} rests", graph.describe(node))),
            );
            continue;
        };
        if noted.is_some() {
            let evaluated = definition.is_evaluated(stage);
            let fields: Vec<_> = graph.field_ids(node).map(|(field, _)| field).collect();
            for field in fields.into_iter().filter(|_| evaluated) {
                messages.extend(graph.observe(field, BEHAVIOUR).err().map(|error| error.to_string()));
            }
            if evaluated && graph.field(node, FRAME_TIME).is_ok() {
                stage.always.borrow_mut().push(node);
            }
            stage.behaviours.borrow_mut().insert(node, Behaviour { type_name: name, frame: 0 });
        }
        for (field, handler) in definition.changed {
            let observed = stage.with(graph, || stage.observe(Node(node), &field, handler, Some(Node(node))));
            messages.extend(observed.err().map(|error| error.to_string()));
        }
    }
    messages
}

/// A function that holds on to nodes of the script's run would work on nodes that are not there.
fn cut_off(name: &str, definition: &mut Definition) -> Vec<String> {
    let holds = |handler: &crate::stage::Handler| handler.call.curry().iter().any(holds_nodes);
    let mut messages = Vec::new();
    if definition.evaluate.as_ref().is_some_and(holds) {
        definition.evaluate = None;
        messages.push(format!(
            "evaluate of node type `{name}` uses variables of the script that hold nodes; in a saved world it rests"
        ));
    }
    definition.changed.retain(|(field, handler)| {
        let rests = holds(handler);
        if rests {
            messages.push(format!(
                "what node type `{name}` does on a change of `{field}` uses variables of the script that hold nodes; in a saved world it rests"
            ));
        }
        !rests
    });
    messages
}

fn holds_nodes(value: &Dynamic) -> bool {
    if let Some(list) = value.read_lock::<rhai::Array>() {
        return list.iter().any(holds_nodes);
    }
    if let Some(map) = value.read_lock::<rhai::Map>() {
        return map.values().any(holds_nodes);
    }
    value.read_lock::<Node>().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORLD: &str = r#"
        define("Double", #{ fields: #{ input: 0.0, output: 0.0 }, evaluate: |me, time| { me.output = me.input * 2; } });
        define("Lift", #{ extends: "Transform", fields: #{ floor: 0 }, evaluate: |me, time| { me.translation.y = me.floor * 3; } });
        define("Spin", #{ extends: "Transform", always: true, evaluate: |me, time| { me.rotation = euler(0, time, 0); } });
        define("Door", #{ fields: #{ open: false, log: "" }, changed: #{ open: |me, open| { me.log += if open { "o" } else { "c" }; } } });
        let held = group([]);
        define("Bad", #{ fields: #{ x: 0.0 }, evaluate: |me, time| { held.name = "gone"; } });
        let d = make("Double", #{ name: "double", input: 4 });
        let lift = make("Lift", #{ name: "lift", floor: 1 });
        lift.add(shape(cuboid(vec3(1, 2, 1))));
        let spin = make("Spin", #{ name: "spin" });
        make("Door", #{ name: "door", open: true });
        make("Bad", #{ name: "bad" });
        let e = make("Expression", #{ name: "sum", inputs: #{ a: 1.0, b: 0.0 }, code: "plus(a, b)" });
        fn plus(x, y) { x + y }
        route(d, "output", e, "a");
        weak_route(e, "value", e, "b");
        world.add([lift, spin]);
        on_frame(|t| { if t < 4 { d.input = t; } });
    "#;

    #[test]
    fn a_saved_world_goes_on_where_it_was() {
        let folder = std::env::temp_dir().join(format!("umbriel-saved-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let script = folder.join("w.rhai");
        std::fs::write(&script, WORLD).unwrap();
        let mut world = World::load_file(&script).unwrap();
        (0..4).for_each(|frame| drop(world.step(f64::from(frame))));
        let file = folder.join("w.umbriel");
        let mut opened = [SaveForm::Text, SaveForm::Binary].map(|form| {
            std::fs::write(&file, world.save(form).unwrap()).unwrap();
            let mut again = World::open_save(&file).unwrap_or_else(|error| panic!("{error}"));
            let said: Vec<String> = again.problems().iter().map(ToString::to_string).collect();
            assert!(said.len() == 1 && said[0].contains("evaluate of node type `Bad`"), "{said:?}");
            again
        });
        for (expression, value) in [
            ("find(\"lift\").type", "Lift"),
            ("find_all(\"Lift\").len()", "1"),
            ("find(\"double\").output", "6.0"),
            ("find(\"lift\").translation", "vec3(0, 3, 0)"),
            ("find(\"door\").log", "o"),
            ("find(\"sum\").value", ""),
            ("let x = find(\"double\"); x.input = 5; x = find(\"lift\"); x.floor = 2; x = find(\"door\"); x.open = false;", ""),
            ("step", ""),
            ("find(\"double\").output", "10.0"),
            ("find(\"lift\").translation", "vec3(0, 6, 0)"),
            ("find(\"spin\").rotation == euler(0, 4, 0)", "true"),
            ("find(\"door\").log", "oc"),
            ("find(\"sum\").value", ""),
            ("make(\"Double\", #{ name: \"new\" }).type", "Double"),
        ] {
            let ask = |world: &mut World| match expression {
                "step" => String::from(if world.step(4.0).evaluated > 0 { "" } else { "nothing evaluated" }),
                _ => world.console(expression).unwrap_or_else(|problem| panic!("{problem}")),
            };
            let original = ask(&mut world);
            assert!(value.is_empty() || original == value, "{expression}: {original}");
            opened.iter_mut().for_each(|again| assert_eq!(ask(again), original, "{expression}"));
        }
        for again in &mut opened {
            assert_eq!(again.problems().iter().map(ToString::to_string).collect::<Vec<_>>(), Vec::<String>::new());
        }
        // A script outside of the folder is not read, and a world without its Group is told.
        for (right, wrong, words) in [
            ("w.rhai", "/etc/hostname", "\"/etc/hostname\" leads out of the world's folder"),
            ("id: \"world\"", "id: \"earth\"", "there is no node `world`"),
        ] {
            let text = String::from_utf8(world.save(SaveForm::Text).unwrap()).unwrap();
            std::fs::write(&file, text.replace(right, wrong)).unwrap();
            let said: Vec<String> = World::open_save(&file).unwrap().problems().iter().map(ToString::to_string).collect();
            assert!(said.iter().any(|said| said.contains(words)), "{said:?}");
        }
        std::fs::write(&file, world.save(SaveForm::Binary).unwrap()).unwrap();
        std::fs::remove_file(&script).unwrap();
        let mut alone = World::open_save(folder.join("w.umbriel")).unwrap();
        let said: Vec<String> = alone.problems().iter().map(ToString::to_string).collect();
        assert!(
            said.iter().any(|s| s.contains("w.rhai")) && said.iter().any(|s| s.contains("no node type `Double`")),
            "{said:?}"
        );
        assert_eq!(alone.console("find(\"lift\").translation").unwrap(), "vec3(0, 6, 0)", "what is native is there");
        std::fs::remove_dir_all(folder).unwrap();
    }
}
