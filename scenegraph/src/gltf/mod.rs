//! Loads glTF 2.0 models (.gltf and .glb) into the graph.
//!
//! The one idea: a file is first turned into plain, checked data, in which nothing can be wrong any more, and only then
//! into nodes. A file that fails leaves the graph as it was, and says which file, which object of it, and why.
//!
//! Read are buffers and pictures inside the file, in data uris and beside it; meshes of all topologies with sparse and
//! quantized accessors, skins, morph targets, animations, cameras, and the extensions KHR_lights_punctual,
//! KHR_materials_emissive_strength, KHR_materials_pbrSpecularGlossiness (approximated), KHR_materials_unlit,
//! KHR_mesh_quantization and KHR_texture_transform. A file that requires another extension is refused.
//!
//! Nothing is re-triangulated, welded or reordered. Animations become a `TimeSensor` and interpolators with routes;
//! they are named `<model>/<animation>` and lie below the model's root, the first one enabled.
//!
//! [`Objects`] are the primitives of a file as plain meshes, and the file again with some of them mended.
//!
//! This module knows nothing of drawing. It reads no file outside of the asset root, and nothing from the network.

mod accessor;
mod budget;
mod build;
mod build_look;
mod build_motion;
mod build_view;
mod check;
mod container;
mod content;
mod error;
mod objects;
mod read;
mod surface;
mod topology;
mod tracks;
mod uri;
mod write;

use content::Content;
use error::Fault;
pub use error::{Cause, Error};
pub use objects::{Object, Objects};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use umbriel_fields::{Graph, NodeId};

/// What a model may read and how large it may be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Files outside of this folder are not read. `None`: the folder of the model file.
    pub asset_root: Option<PathBuf>,
    /// Memory for the file, its buffers, vertices and pictures together, bytes.
    pub max_bytes: u64,
}

impl Default for LoadOptions {
    /// The model's own folder, 2 GiB.
    fn default() -> LoadOptions {
        LoadOptions { asset_root: None, max_bytes: 2 << 30 }
    }
}

/// The nodes of a loaded model.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// A Group named after the file; put it below the world to show the model.
    pub root: NodeId,
    /// A Group per scene of the file, below a Switch where there are several.
    pub scenes: Vec<NodeId>,
    /// A Viewpoint per node with a camera.
    pub viewpoints: Vec<NodeId>,
    /// A light per node with a light.
    pub lights: Vec<NodeId>,
    /// A TimeSensor per animation; only the first is enabled.
    pub clocks: Vec<NodeId>,
    /// What was left out or approximated: file, object, reason.
    pub warnings: Vec<String>,
}

/// Loads a .gltf or .glb file. On an error no node is left in the graph.
pub fn load(graph: &mut Graph, path: impl AsRef<Path>, options: &LoadOptions) -> Result<Model, Error> {
    let path = path.as_ref();
    // The checks leave the `gltf` and `image` crates nothing to panic about that we know of.
    let content = guard(|| Content::load(path, options)).map_err(|f| f.in_file(path))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let mut made = Vec::new();
    let built = guard(|| build::Builder::new(graph, &content, &mut made).build(&name));
    let mut model = built.map_err(|fault| {
        for node in made.into_iter().rev() {
            let _ = graph.delete(node); // it was made a moment ago, so it can be deleted
        }
        fault.in_file(path)
    })?;
    for warning in &mut model.warnings {
        *warning = format!("{}: {warning}", path.display());
    }
    Ok(model)
}

/// Turns a panic into a fault.
fn guard<T>(work: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let message = panic.downcast_ref::<String>().cloned().or_else(|| panic.downcast_ref::<&str>().map(|s| s.to_string()));
        Err(Fault::new("", Cause::Internal(message.unwrap_or_default())))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_become_errors() {
        let fault = guard(|| -> Result<(), Fault> { panic!("{} is missing", "wheel") }).unwrap_err();
        assert_eq!(fault.in_file(Path::new("car.glb")).to_string(), "car.glb: the importer failed: wheel is missing");
    }
}
