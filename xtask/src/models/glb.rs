//! Writes binary glTF 2.0.

use super::surface::Surface;
use glam::{Mat4, Quat, Vec3};
use image::{ExtendedColorType, ImageEncoder, RgbaImage, codecs::png::PngEncoder};
use serde_json::{Value, json};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_BYTE: u32 = 5121;

/// A model while it is put together. Lists of the file are JSON arrays; methods return the place of what they added.
#[derive(Default)]
pub(crate) struct Glb {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    materials: Vec<Value>,
    textures: Vec<Value>,
    images: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    skins: Vec<Value>,
    animations: Vec<Value>,
    roots: Vec<usize>,
}

/// One run of values of an animation: node, `translation` or `rotation`, and one value per key.
pub(crate) struct Track {
    pub(crate) node: usize,
    pub(crate) path: &'static str,
    pub(crate) values: Vec<f32>,
}

impl Glb {
    fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.binary.len().is_multiple_of(4) {
            self.binary.push(0);
        }
        self.views.push(json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len()}));
        self.binary.extend_from_slice(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.accessors.push(json!({"bufferView": view, "componentType": component, "type": kind, "count": count}));
        self.accessors.len() - 1
    }

    /// An accessor of floats, `size` per element, in steps of 1/65536: the last bits of a sine differ between machines.
    pub(crate) fn floats(&mut self, values: &[f32], kind: &str, size: usize) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| ((v * 65536.0).round() / 65536.0).to_le_bytes()).collect();
        self.accessor(&bytes, FLOAT, kind, values.len() / size)
    }

    /// A texture from a picture.
    pub(crate) fn texture(&mut self, picture: &RgbaImage) -> usize {
        let mut png = Vec::new();
        PngEncoder::new(&mut png)
            .write_image(picture, picture.width(), picture.height(), ExtendedColorType::Rgba8)
            .expect("a picture in memory can be encoded");
        let view = self.view(&png);
        self.images.push(json!({"bufferView": view, "mimeType": "image/png"}));
        self.textures.push(json!({"source": self.images.len() - 1}));
        self.textures.len() - 1
    }

    /// A material as it stands in the file.
    pub(crate) fn material(&mut self, material: Value) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// A plain material: linear colour, roughness.
    pub(crate) fn plain(&mut self, name: &str, color: [f32; 3], roughness: f32) -> usize {
        let [r, g, b] = color;
        self.material(json!({"name": name,
            "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": roughness}}))
    }

    /// A mesh of one primitive per surface and material.
    pub(crate) fn mesh(&mut self, name: &str, parts: &[(usize, &Surface)]) -> usize {
        let primitives: Vec<Value> = parts.iter().map(|(material, surface)| self.primitive(*material, surface)).collect();
        self.meshes.push(json!({"name": name, "primitives": primitives}));
        self.meshes.len() - 1
    }

    fn primitive(&mut self, material: usize, surface: &Surface) -> Value {
        let flat3 = |v: &[Vec3]| v.iter().flat_map(|p| p.to_array()).collect::<Vec<f32>>();
        let position = self.floats(&flat3(&surface.positions), "VEC3", 3);
        let (min, max) = surface.positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)));
        self.accessors[position]["min"] = json!(min.to_array());
        self.accessors[position]["max"] = json!(max.to_array());
        let normal = self.floats(&flat3(&surface.normals), "VEC3", 3);
        let uv: Vec<f32> = surface.uvs.iter().flat_map(|v| v.to_array()).collect();
        let uv = self.floats(&uv, "VEC2", 2);
        let mut attributes = json!({"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv});
        if !surface.joints.is_empty() {
            let joints: Vec<u8> = surface.joints.iter().flatten().copied().collect();
            attributes["JOINTS_0"] = json!(self.accessor(&joints, UNSIGNED_BYTE, "VEC4", surface.joints.len()));
            let weights: Vec<f32> = surface.weights.iter().flatten().copied().collect();
            attributes["WEIGHTS_0"] = json!(self.floats(&weights, "VEC4", 4));
        }
        let bytes: Vec<u8> = surface.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let indices = self.accessor(&bytes, UNSIGNED_INT, "SCALAR", surface.indices.len());
        json!({"attributes": attributes, "indices": indices, "material": material})
    }

    /// A node below `parent`, or at the top.
    pub(crate) fn node(&mut self, name: &str, parent: Option<usize>, translation: Vec3, mesh: Option<usize>) -> usize {
        let mut node = json!({"name": name});
        if translation != Vec3::ZERO {
            node["translation"] = json!(translation.to_array());
        }
        if let Some(mesh) = mesh {
            node["mesh"] = json!(mesh);
        }
        let place = self.nodes.len();
        self.nodes.push(node);
        match parent {
            None => self.roots.push(place),
            Some(p) => match self.nodes[p]["children"].as_array_mut() {
                Some(children) => children.push(json!(place)),
                None => self.nodes[p]["children"] = json!([place]),
            },
        }
        place
    }

    /// Binds the mesh of `node` to `joints`, whose places in model space at rest are `rest`.
    pub(crate) fn skin(&mut self, node: usize, joints: &[usize], rest: &[Vec3]) {
        let inverse: Vec<f32> = rest.iter().flat_map(|p| Mat4::from_translation(-*p).to_cols_array()).collect();
        let inverse = self.floats(&inverse, "MAT4", 16);
        self.skins.push(json!({"joints": joints, "inverseBindMatrices": inverse, "skeleton": joints[0]}));
        self.nodes[node]["skin"] = json!(self.skins.len() - 1);
    }

    /// An animation with linear interpolation; every track has a value at each of `times_s`.
    pub(crate) fn animation(&mut self, name: &str, times_s: &[f32], tracks: &[Track]) {
        let input = self.floats(times_s, "SCALAR", 1);
        self.accessors[input]["min"] = json!([times_s[0]]);
        self.accessors[input]["max"] = json!([times_s[times_s.len() - 1]]);
        let (mut samplers, mut channels) = (Vec::new(), Vec::new());
        for track in tracks {
            let (kind, size) = if track.path == "rotation" { ("VEC4", 4) } else { ("VEC3", 3) };
            let output = self.floats(&track.values, kind, size);
            channels.push(json!({"sampler": samplers.len(), "target": {"node": track.node, "path": track.path}}));
            samplers.push(json!({"input": input, "output": output}));
        }
        self.animations.push(json!({"name": name, "samplers": samplers, "channels": channels}));
    }

    /// The bytes of the .glb file.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        let binary = std::mem::take(&mut self.binary);
        let mut file = json!({
            "asset": {"version": "2.0", "generator": "Umbriel xtask models", "copyright": "The Umbriel authors, MIT OR Apache-2.0"},
            "scene": 0, "scenes": [{"nodes": self.roots}], "nodes": self.nodes, "buffers": [{"byteLength": binary.len()}],
            "bufferViews": self.views, "accessors": self.accessors, "meshes": self.meshes, "materials": self.materials,
        });
        let optional =
            [("textures", self.textures), ("images", self.images), ("skins", self.skins), ("animations", self.animations)];
        for (key, list) in optional {
            if !list.is_empty() {
                file[key] = json!(list);
            }
        }
        let mut json = file.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut padded = binary;
        padded.resize(padded.len().next_multiple_of(4), 0);
        let total = 12 + 8 + json.len() + 8 + padded.len();
        let mut out = Vec::with_capacity(total);
        out.extend_from_slice(b"glTF");
        for word in [2, total as u32, json.len() as u32, 0x4E4F_534A] {
            out.extend_from_slice(&u32::to_le_bytes(word));
        }
        out.extend_from_slice(&json);
        for word in [padded.len() as u32, 0x004E_4942] {
            out.extend_from_slice(&u32::to_le_bytes(word));
        }
        out.extend_from_slice(&padded);
        out
    }
}

/// x, y, z, w of a rotation about x.
pub(crate) fn about_x(angle_rad: f32) -> [f32; 4] {
    Quat::from_rotation_x(angle_rad).to_array()
}
