//! A small valid model with one of everything, to be edited by tests.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use umbriel_fields::{FieldValue, Graph, NodeId};
use umbriel_scenegraph::gltf::{Error, LoadOptions, Model, load};

/// JSON and binary chunk of a model.
#[derive(Clone)]
pub(crate) struct Tiny {
    pub(crate) json: Value,
    pub(crate) binary: Vec<u8>,
}

/// A folder that is deleted with the value.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new() -> Folder {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let n = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("umbriel-gltf-{}-{n}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A picture of 2 x 2 texels.
pub(crate) fn png() -> Vec<u8> {
    let mut out = Vec::new();
    let picture = image::RgbaImage::from_fn(2, 2, |x, y| image::Rgba([x as u8 * 255, y as u8 * 255, 7, 255]));
    picture.write_to(&mut std::io::Cursor::new(&mut out), image::ImageFormat::Png).unwrap();
    out
}

impl Tiny {
    /// A textured, skinned triangle that an animation moves, a camera and a light.
    pub(crate) fn new() -> Tiny {
        let mut tiny = Tiny {
            json: json!({
                "asset": {"version": "2.0"},
                "extensionsUsed": ["KHR_lights_punctual"],
                "extensions": {"KHR_lights_punctual": {"lights": [{"name": "lamp", "type": "spot", "color": [1, 0.5, 0], "intensity": 20,
                    "range": 9, "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}}]}},
                "scene": 0, "scenes": [{"nodes": [0]}],
                "nodes": [
                    {"name": "top", "children": [1, 2, 3], "translation": [0, 1, 0]},
                    {"name": "triangle", "mesh": 0, "skin": 0},
                    {"name": "eye", "camera": 0, "rotation": [0, 1, 0, 0]},
                    {"name": "spot", "extensions": {"KHR_lights_punctual": {"light": 0}}}],
                "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.2}}],
                "meshes": [{"name": "triangle mesh", "primitives": [{"material": 0, "indices": 1,
                    "attributes": {"POSITION": 0, "TEXCOORD_0": 2, "JOINTS_0": 5, "WEIGHTS_0": 6}}]}],
                "materials": [{"name": "wood", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 0.75], "roughnessFactor": 0.5,
                    "metallicFactor": 0, "baseColorTexture": {"index": 0}}}],
                "textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9729}],
                "images": [],
                "skins": [{"joints": [0, 2], "inverseBindMatrices": 7}],
                "animations": [{"name": "move", "samplers": [{"input": 3, "output": 4}],
                    "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}],
                "buffers": [{"byteLength": 0}], "bufferViews": [], "accessors": []
            }),
            binary: Vec::new(),
        };
        tiny.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        tiny.accessor(5123, "SCALAR", 3, &[0, 0, 1, 0, 2, 0]);
        tiny.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
        tiny.floats("SCALAR", &[0., 1., 4.]);
        tiny.floats("VEC3", &[0., 1., 0., 2., 1., 0., 2., 5., 0.]);
        tiny.accessor(5121, "VEC4", 3, &[0, 1, 99, 0, 0, 0, 0, 0, 1, 0, 0, 0]);
        tiny.floats("VEC4", &[0.5, 0.5, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0.]);
        let identity = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
        tiny.floats("MAT4", &[identity, identity].concat());
        let view = tiny.view(&png());
        tiny.json["images"] = json!([{"name": "planks", "bufferView": view, "mimeType": "image/png"}]);
        tiny
    }

    /// Adds a buffer view.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.binary.len().next_multiple_of(4);
        self.binary.resize(offset, 0);
        self.binary.extend(bytes);
        self.json["buffers"][0]["byteLength"] = self.binary.len().into();
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}));
        views.len() - 1
    }

    /// Adds an accessor with its own view.
    pub(crate) fn accessor(&mut self, component: u32, shape: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": shape}));
        accessors.len() - 1
    }

    pub(crate) fn floats(&mut self, shape: &str, values: &[f32]) -> usize {
        let lanes = match shape {
            "SCALAR" => 1,
            "MAT4" => 16,
            vector => usize::from(vector.as_bytes()[3] - b'0'),
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(5126, shape, values.len() / lanes, &bytes)
    }

    /// The place of an accessor's bytes in the binary chunk.
    pub(crate) fn offset(&self, accessor: usize) -> usize {
        let view = self.json["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
        self.json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize
    }

    pub(crate) fn glb(&self) -> Vec<u8> {
        glb(&self.json.to_string(), &self.binary)
    }

    /// Writes it as a .glb and loads it.
    pub(crate) fn load(&self) -> (Graph, Result<Model, Error>) {
        let folder = Folder::new();
        let file = folder.write("tiny.glb", self.glb());
        load_new(&file)
    }
}

pub(crate) fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let word = |n: usize| (n as u32).to_le_bytes();
    let header = [&b"glTF"[..], &word(2), &word(28 + json.len() + binary.len())].concat();
    [header, word(json.len()).to_vec(), b"JSON".to_vec(), json, word(binary.len()).to_vec(), b"BIN\0".to_vec(), binary].concat()
}

/// Loads into a new graph; an error must have left it as it was.
pub(crate) fn load_new(file: &Path) -> (Graph, Result<Model, Error>) {
    let mut graph = umbriel_scenegraph::new_graph();
    let (nodes, names) = (graph.node_count(), graph.names().count());
    let model = load(&mut graph, file, &LoadOptions::default());
    if model.is_err() {
        assert_eq!((graph.node_count(), graph.names().count()), (nodes, names), "{} left nodes behind", file.display());
    }
    (graph, model)
}

/// All nodes of a type.
pub(crate) fn of_type(graph: &Graph, kind: &str) -> Vec<NodeId> {
    graph.nodes().filter(|n| &*graph.type_of(*n).name == kind).collect()
}

pub(crate) fn get<T: FieldValue>(graph: &Graph, node: NodeId, field: &str) -> T {
    graph.get_named::<T>(node, field).unwrap_or_else(|e| panic!("{e}"))
}

/// The only element of a multiple or single node field.
pub(crate) fn node(graph: &Graph, of: NodeId, field: &str) -> NodeId {
    get::<Option<NodeId>>(graph, of, field).unwrap_or_else(|| panic!("{field} is empty"))
}
