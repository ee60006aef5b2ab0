//! A model file written again, with some of its primitives mended (glTF 2.0 specification, sections 3.6 and 4.4).
//!
//! The JSON is edited where a primitive changed and nowhere else, so that extensions and extras which nobody here knows
//! survive; old accessors and their bytes stay, as others may use them.

use super::accessor::Accessors;
use super::budget::Budget;
use super::error::{Cause, Fault};
use super::objects::{Object, Objects};
use glam::Vec3;
use gltf::accessor::{Accessor, DataType};
use serde_json::{Value, json};
use umbriel_scene::Mesh;
use umbriel_scene::doctor::{Added, Mended};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_SHORT: u32 = 5123;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// The file, and what stays outside of it.
pub(super) fn glb(objects: &Objects, mended: &[Option<Mended>]) -> Result<(Vec<u8>, Vec<String>), Fault> {
    let mut file = File::joined(objects);
    let left_outside = file.take_in_pictures(objects);
    for (object, mended) in objects.list.iter().zip(mended) {
        if let Some(mended) = mended.as_ref().filter(|m| !m.is_unchanged()) {
            file.replace(objects, object, mended)?;
        }
    }
    Ok((file.finish()?, left_outside))
}

/// A file under construction: its JSON and its one buffer.
struct File {
    json: Value,
    binary: Vec<u8>,
}

impl File {
    /// All buffers in a row in one.
    fn joined(objects: &Objects) -> File {
        let mut file = File { json: objects.json.clone(), binary: Vec::new() };
        let mut starts = Vec::new();
        for (i, buffer) in objects.source.buffers.iter().enumerate() {
            let declared = file.json["buffers"][i]["byteLength"].as_u64().unwrap_or(buffer.len() as u64) as usize;
            starts.push(file.append(&buffer[..declared.min(buffer.len())]));
        }
        for view in file.json.get_mut("bufferViews").and_then(Value::as_array_mut).into_iter().flatten() {
            let buffer = view["buffer"].as_u64().unwrap_or(0) as usize;
            let offset = view["byteOffset"].as_u64().unwrap_or(0) + starts.get(buffer).copied().unwrap_or(0) as u64;
            view["buffer"] = 0.into();
            view["byteOffset"] = offset.into();
        }
        file
    }

    /// Appends at a multiple of four; gives the place.
    fn append(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let at = self.binary.len();
        self.binary.extend_from_slice(bytes);
        at
    }

    fn push(&mut self, list: &str, entry: Value) -> usize {
        if !self.json[list].is_array() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().expect("it was made one");
        list.push(entry);
        list.len() - 1
    }

    /// Takes pictures that lie beside the file or are written into its JSON into the buffer. Those that cannot be read keep
    /// their uri, and are told.
    fn take_in_pictures(&mut self, objects: &Objects) -> Vec<String> {
        let mut left = Vec::new();
        let count = self.json["images"].as_array().map_or(0, Vec::len);
        for i in 0..count {
            let Some(uri) = self.json["images"][i]["uri"].as_str().map(str::to_owned) else { continue };
            match objects.place.read(&uri, u64::MAX) {
                Ok(bytes) => {
                    let kind = if bytes.starts_with(b"\x89PNG") { "image/png" } else { "image/jpeg" };
                    let offset = self.append(&bytes);
                    let view = self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}));
                    let image = &mut self.json["images"][i];
                    image["bufferView"] = view.into();
                    image["mimeType"] = kind.into();
                    image.as_object_mut().map(|o| o.remove("uri"));
                }
                Err(why) => left.push(format!("image {i}: its uri {why}; it is not in the written file")),
            }
        }
        left
    }

    /// Elements of `size` bytes as an accessor; vertex attributes begin at multiples of four.
    fn accessor(&mut self, elements: &[u8], size: usize, target: u32, mut entry: Value) -> usize {
        let stride = if target == VERTICES { size.next_multiple_of(4) } else { size };
        let count = elements.len() / size.max(1);
        let mut bytes = Vec::with_capacity(count * stride);
        for element in elements.chunks_exact(size) {
            bytes.extend_from_slice(element);
            bytes.resize(bytes.len() + stride - size, 0);
        }
        let offset = self.append(&bytes);
        let mut view = json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len(), "target": target});
        if stride != size {
            view["byteStride"] = stride.into();
        }
        entry["bufferView"] = self.push("bufferViews", view).into();
        entry["count"] = count.into();
        self.push("accessors", entry)
    }

    /// Puts a mended primitive in place of the old one.
    fn replace(&mut self, objects: &Objects, object: &Object, mended: &Mended) -> Result<(), Fault> {
        let budget = Budget::new(u64::MAX);
        let accessors = Accessors { source: &objects.source, budget: &budget };
        let mesh = mended.apply(&object.mesh);
        let (m, p) = (object.mesh_index, object.primitive);
        let all: Vec<Accessor<'_>> = objects.source.document.accessors().collect();
        let old = objects.json["meshes"][m]["primitives"][p].clone();
        let attributes = self.attributes(&accessors, &all, &old["attributes"], &mesh, mended)?;
        let mut targets = Vec::new();
        for target in old["targets"].as_array().into_iter().flatten() {
            targets.push(self.offsets(&accessors, &all, target, mended)?);
        }
        let indices = self.indices(&mended.indices, mesh.positions.len());
        let primitive = &mut self.json["meshes"][m]["primitives"][p];
        primitive["attributes"] = attributes;
        if !targets.is_empty() {
            primitive["targets"] = targets.into();
        }
        primitive["indices"] = indices.into();
        // Strips and fans became a list.
        primitive.as_object_mut().map(|o| o.remove("mode"));
        Ok(())
    }

    fn indices(&mut self, indices: &[u32], vertices: usize) -> usize {
        if vertices < usize::from(u16::MAX) {
            let short: Vec<u16> = indices.iter().map(|i| *i as u16).collect();
            self.accessor(bytemuck::cast_slice(&short), 2, INDICES, json!({"componentType": UNSIGNED_SHORT, "type": "SCALAR"}))
        } else {
            self.accessor(bytemuck::cast_slice(indices), 4, INDICES, json!({"componentType": UNSIGNED_INT, "type": "SCALAR"}))
        }
    }

    /// The attributes of a primitive; those that did not change keep their accessors.
    fn attributes(
        &mut self,
        accessors: &Accessors<'_>,
        all: &[Accessor<'_>],
        old: &Value,
        mesh: &Mesh,
        mended: &Mended,
    ) -> Result<Value, Fault> {
        let mut out = old.clone();
        for (name, index) in old.as_object().into_iter().flatten() {
            let has_more = !mended.added.is_empty();
            let new = match name.as_str() {
                "POSITION" if has_more || !mended.moved.is_empty() => self.positions(&mesh.positions),
                "NORMAL" if has_more || !mended.turned.is_empty() => self.floats(bytemuck::cast_slice(&mesh.normals), 3),
                "TANGENT" if has_more || !mended.turned.is_empty() => self.floats(bytemuck::cast_slice(&mesh.tangents), 4),
                "POSITION" | "NORMAL" | "TANGENT" => continue,
                _ if has_more => {
                    let moves = name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_");
                    self.grown(accessors, accessor(all, index)?, &mended.added, moves)?
                }
                _ => continue,
            };
            out[name] = new.into();
        }
        Ok(out)
    }

    /// The attributes of a morph target.
    fn offsets(&mut self, accessors: &Accessors<'_>, all: &[Accessor<'_>], old: &Value, mended: &Mended) -> Result<Value, Fault> {
        let mut out = old.clone();
        if !mended.added.is_empty() {
            for (name, index) in old.as_object().into_iter().flatten() {
                out[name] = self.grown(accessors, accessor(all, index)?, &mended.added, true)?.into();
            }
        }
        Ok(out)
    }

    fn positions(&mut self, positions: &[Vec3]) -> usize {
        let min = positions.iter().fold(Vec3::INFINITY, |a, b| a.min(*b)).to_array();
        let max = positions.iter().fold(Vec3::NEG_INFINITY, |a, b| a.max(*b)).to_array();
        let entry = json!({"componentType": FLOAT, "type": "VEC3", "min": min, "max": max});
        self.accessor(bytemuck::cast_slice(positions), 12, VERTICES, entry)
    }

    fn floats(&mut self, values: &[f32], lanes: usize) -> usize {
        let entry = json!({"componentType": FLOAT, "type": format!("VEC{lanes}")});
        self.accessor(bytemuck::cast_slice(values), 4 * lanes, VERTICES, entry)
    }

    /// An attribute with elements for the added vertices: what `moves` is that of the vertex that they move like; of looks,
    /// floats lie between those of their neighbours, other numbers are like those of the nearer one.
    fn grown(&mut self, accessors: &Accessors<'_>, old: &Accessor<'_>, added: &[Added], moves: bool) -> Result<usize, Fault> {
        let packed = accessors.packed(old)?;
        let lanes = old.dimensions().multiplicity();
        let size = packed.kind.size() * lanes;
        let mut bytes = packed.bytes;
        for a in added {
            let at = |v: u32| v as usize * size..(v as usize + 1) * size;
            let element = if moves {
                bytes[at(a.moves_like)].to_vec()
            } else if packed.kind == DataType::F32 {
                let lane = |v: u32, i: usize| f32::from_le_bytes(std::array::from_fn(|b| bytes[at(v).start + 4 * i + b]));
                let mix = |i: usize| lane(a.from, i) + (lane(a.to, i) - lane(a.from, i)) * a.share;
                (0..lanes).flat_map(|i| mix(i).to_le_bytes()).collect::<Vec<u8>>()
            } else {
                bytes[at(if a.share > 0.5 { a.to } else { a.from })].to_vec()
            };
            bytes.extend(element);
        }
        let kind = format!("{:?}", old.dimensions()).to_uppercase();
        let mut entry = json!({"componentType": packed.kind.as_gl_enum(), "type": kind});
        if packed.normalized {
            entry["normalized"] = true.into();
        }
        // Offsets of positions must say their bounds, too.
        if packed.kind == DataType::F32 && old.min().is_some() {
            let lane = |element: &[u8], i: usize| f32::from_le_bytes(std::array::from_fn(|b| element[4 * i + b]));
            let fold = |start: f32, pick: fn(f32, f32) -> f32| {
                (0..lanes).map(|i| bytes.chunks_exact(size).fold(start, |x, e| pick(x, lane(e, i)))).collect::<Vec<f32>>()
            };
            entry["min"] = json!(fold(f32::INFINITY, f32::min));
            entry["max"] = json!(fold(f32::NEG_INFINITY, f32::max));
        }
        Ok(self.accessor(&bytes, size, VERTICES, entry))
    }

    fn finish(mut self) -> Result<Vec<u8>, Fault> {
        if self.binary.is_empty() {
            self.json.as_object_mut().map(|o| o.remove("buffers"));
        } else {
            self.json["buffers"] = json!([{"byteLength": self.binary.len()}]);
        }
        let mut text = serde_json::to_vec(&self.json).map_err(|e| Fault::new("", Cause::Json(e.to_string())))?;
        text.resize(text.len().next_multiple_of(4), b' ');
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let length = 12 + 8 + text.len() + if self.binary.is_empty() { 0 } else { 8 + self.binary.len() };
        let too_large = |_| Fault::new("", Cause::Limit(format!("{length} bytes are more than a .glb can hold")));
        let word = |n: usize| u32::try_from(n).map(u32::to_le_bytes).map_err(too_large);
        let mut out = Vec::with_capacity(length);
        out.extend(b"glTF");
        out.extend(2u32.to_le_bytes());
        out.extend(word(length)?);
        out.extend(word(text.len())?);
        out.extend(b"JSON");
        out.extend(text);
        if !self.binary.is_empty() {
            out.extend(word(self.binary.len())?);
            out.extend(b"BIN\0");
            out.extend(self.binary);
        }
        Ok(out)
    }
}

fn accessor<'a, 'b>(all: &'a [Accessor<'b>], index: &Value) -> Result<&'a Accessor<'b>, Fault> {
    let place = index.as_u64().and_then(|i| all.get(i as usize));
    place.ok_or_else(|| Fault::invalid("", format!("names accessor {index}, but there are {}", all.len())))
}
