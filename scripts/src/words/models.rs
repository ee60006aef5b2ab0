//! Models from files.

use std::path::PathBuf;
use std::rc::Rc;

use rhai::{Array, Dynamic, Map, NativeCallContext};
use umbriel_fields::NodeId;
use umbriel_scenegraph::gltf;

use super::Words;
use crate::engine::report;
use crate::error::{Fault, Outcome};
use crate::source::below;
use crate::stage::{Node, Stage};

pub(super) fn teach(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "load(file: string) -> Node",
        "The root of a glTF model from the world's folder. If it cannot be loaded, that is reported and the node is an empty Group.",
        move |context: NativeCallContext<'_>, file: &str| -> Outcome<Node> {
            match load(&stage, file) {
                Ok(model) => Ok(Node(model.root)),
                Err(message) => missing(&stage, &context, message),
            }
        },
    );
    let stage = words.stage.clone();
    words.word(
        "load_model(file: string) -> map",
        "A model with its parts: `root`, `scenes`, `viewpoints`, `lights`, and the `clocks` of its animations.",
        move |context: NativeCallContext<'_>, file: &str| -> Outcome<Map> {
            match load(&stage, file) {
                Ok(model) => Ok(parts(&model)),
                Err(message) => {
                    let root = missing(&stage, &context, message)?;
                    let lists = ["scenes", "viewpoints", "lights", "clocks"].map(|name| (name.into(), Array::new().into()));
                    Ok(lists.into_iter().chain([("root".into(), root.into())]).collect())
                }
            }
        },
    );
}

fn missing(stage: &Rc<Stage>, context: &NativeCallContext<'_>, message: String) -> Outcome<Node> {
    report(stage, Fault::new(message), context.call_position());
    stage.create("Group")
}

/// Looks in the world's folder first, then in the other folders that hold assets.
fn load(stage: &Stage, file: &str) -> Result<gltf::Model, String> {
    let mut candidates = Vec::new();
    for folder in &stage.folders {
        candidates.push((folder.clone(), below(folder, file)?));
    }
    let first = candidates.first().cloned().ok_or("there is no folder to load from")?;
    let (folder, path): (PathBuf, PathBuf) = candidates.into_iter().find(|(_, path)| path.is_file()).unwrap_or(first);
    stage.files.borrow_mut().insert(path.clone());
    let options = gltf::LoadOptions { asset_root: Some(folder), ..gltf::LoadOptions::default() };
    let loaded = stage.meter.uncounted(|| stage.write(|graph| gltf::load(graph, &path, &options)));
    let model = loaded.map_err(|error| format!("cannot load \"{file}\": {error}"))?;
    model.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    Ok(model)
}

fn parts(model: &gltf::Model) -> Map {
    let list = |ids: &[NodeId]| Dynamic::from(ids.iter().map(|id| Node(*id).into()).collect::<Array>());
    Map::from([
        ("root".into(), Node(model.root).into()),
        ("scenes".into(), list(&model.scenes)),
        ("viewpoints".into(), list(&model.viewpoints)),
        ("lights".into(), list(&model.lights)),
        ("clocks".into(), list(&model.clocks)),
    ])
}
