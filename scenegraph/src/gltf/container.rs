//! A .glb or .gltf file as JSON and binary chunk (glTF 2.0 specification, section 4.4).

use super::error::Cause;
use gltf::json::{Root, Value, deserialize};
use std::ops::Range;

/// Where the two parts of a file are. A .gltf is all JSON.
#[derive(Debug, PartialEq)]
pub(crate) struct Parts {
    pub(crate) json: Range<usize>,
    pub(crate) binary: Option<Range<usize>>,
}

/// Finds the JSON and the binary chunk.
pub(crate) fn split(bytes: &[u8]) -> Result<Parts, Cause> {
    if bytes.starts_with(b"glTF") {
        return split_glb(bytes);
    }
    let byte_order_mark = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    let first = bytes[byte_order_mark..].iter().find(|b| !b.is_ascii_whitespace());
    match first {
        Some(b'{') => Ok(Parts { json: byte_order_mark..bytes.len(), binary: None }),
        None => Err(Cause::Container("the file is empty".into())),
        Some(_) => Err(Cause::Container("is no glTF: it starts neither with 'glTF' nor with '{'".into())),
    }
}

fn split_glb(bytes: &[u8]) -> Result<Parts, Cause> {
    let wrong = |message: String| Err(Cause::Container(message));
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return wrong(format!("the .glb ends after {} bytes, within its header", bytes.len()));
    };
    if version != 2 {
        return wrong(format!("the .glb has version {version}; version 2 is read"));
    }
    if length > bytes.len() {
        return wrong(format!("the .glb is cut off: it has {} of its {length} bytes", bytes.len()));
    }
    let (mut json, mut binary, mut at) = (None, None, 12);
    while at + 8 <= length {
        let (size, kind) = (word(at).unwrap_or(0), &bytes[at + 4..at + 8]);
        let body = at + 8..at + 8 + size;
        if body.end > length {
            return wrong(format!("the chunk at byte {at} says {size} bytes, but {} are left in the .glb", length - at - 8));
        }
        match kind {
            b"JSON" if json.is_none() => json = Some(body.clone()),
            b"BIN\0" if binary.is_none() => binary = Some(body.clone()),
            _ => {} // readers skip chunks they do not know
        }
        at = body.end;
    }
    match json {
        Some(json) => Ok(Parts { json, binary }),
        None => wrong("the .glb has no JSON chunk".into()),
    }
}

/// KHR_texture_transform of a normal or occlusion texture, which the `gltf` crate does not read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct UvTransform {
    pub(crate) offset: [f32; 2],
    pub(crate) rotation: f32,
    pub(crate) scale: [f32; 2],
    pub(crate) tex_coord: Option<u32>,
}

/// The JSON of a file.
#[derive(Debug)]
pub(crate) struct Parsed {
    pub(crate) root: Root,
    /// Of the normal texture of each material.
    pub(crate) normal_transforms: Vec<Option<UvTransform>>,
    /// Of the occlusion texture of each material.
    pub(crate) occlusion_transforms: Vec<Option<UvTransform>>,
}

/// Reads the JSON, with what is harmless but unreadable to the `gltf` crate put right.
pub(crate) fn parse(json: &[u8]) -> Result<Parsed, Cause> {
    let wrong = |e: &dyn std::fmt::Display| Cause::Json(e.to_string());
    let mut value: Value = deserialize::from_slice(json).map_err(|e| wrong(&e))?;
    check_numbers(&value, &mut String::new(), "").map_err(Cause::Json)?;
    drop_unreadable(&mut value);
    give_sources(&mut value);
    let normal_transforms = transforms(&value, "normalTexture");
    let occlusion_transforms = transforms(&value, "occlusionTexture");
    let root = deserialize::from_value(value).map_err(|e| match deserialize::from_slice::<Root>(json) {
        Err(with_line) => wrong(&with_line),
        Ok(_) => wrong(&e),
    })?;
    Ok(Parsed { root, normal_transforms, occlusion_transforms })
}

fn transforms(root: &Value, texture: &str) -> Vec<Option<UvTransform>> {
    let transform = |material: &Value| {
        let given = material.get(texture)?.get("extensions")?.get("KHR_texture_transform")?;
        let pair = |key: &str, spare: [f32; 2]| match given.get(key).and_then(Value::as_array).map(Vec::as_slice) {
            Some([a, b]) => [a.as_f64().unwrap_or(0.0) as f32, b.as_f64().unwrap_or(0.0) as f32],
            _ => spare,
        };
        Some(UvTransform {
            offset: pair("offset", [0.0; 2]),
            rotation: given.get("rotation").and_then(Value::as_f64).unwrap_or(0.0) as f32,
            scale: pair("scale", [1.0; 2]),
            tex_coord: given.get("texCoord").and_then(Value::as_u64).map(|set| set as u32),
        })
    };
    root.get("materials").and_then(Value::as_array).into_iter().flatten().map(transform).collect()
}

/// Numbers that do not fit turn into infinities and wrapped indices behind our back.
fn check_numbers(value: &Value, path: &mut String, key: &str) -> Result<(), String> {
    match value {
        Value::Number(n) => {
            let wide = matches!(key, "byteLength" | "byteOffset" | "count" | "min" | "max");
            if n.as_f64().is_none_or(|x| !(x as f32).is_finite()) || (!wide && n.as_u64().is_some_and(|i| i > u32::MAX.into())) {
                return Err(format!("the number {n} at {path} is too large"));
            }
        }
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                let length = path.len();
                path.push_str(&format!("[{i}]"));
                check_numbers(item, path, key)?;
                path.truncate(length);
            }
        }
        Value::Object(fields) => {
            for (name, item) in fields.iter().filter(|(name, _)| *name != "extras") {
                let length = path.len();
                path.push_str(if path.is_empty() { "" } else { "." });
                path.push_str(name);
                check_numbers(item, path, name)?;
                path.truncate(length);
            }
        }
        _ => {}
    }
    Ok(())
}

/// Takes out animation channels without a target node or with a path of an extension (KHR_animation_pointer), which
/// glTF tells readers to ignore.
fn drop_unreadable(root: &mut Value) {
    let Some(animations) = root.get_mut("animations").and_then(Value::as_array_mut) else { return };
    for animation in animations {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            channels
                .retain(|c| c.get("target").is_none_or(|t| t.get("node").is_some() && t.get("path") != Some(&"pointer".into())));
        }
    }
}

/// Gives textures whose only picture is in a format of an extension an image that cannot be had, which is warned about.
fn give_sources(root: &mut Value) {
    let Some(textures) = root.get("textures").and_then(Value::as_array) else { return };
    let without: Vec<usize> =
        (0..textures.len()).filter(|t| textures[*t].is_object() && textures[*t].get("source").is_none()).collect();
    let images = root.get("images").and_then(Value::as_array).map_or(0, Vec::len);
    if without.is_empty() {
        return;
    }
    for t in without {
        root["textures"][t]["source"] = images.into();
    }
    let nothing = Value::Object(Default::default());
    match root.get_mut("images").and_then(Value::as_array_mut) {
        Some(images) => images.push(nothing),
        None => root["images"] = Value::Array(vec![nothing]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(chunks: &[(&[u8], &[u8])]) -> Vec<u8> {
        let mut body = Vec::new();
        for (kind, data) in chunks {
            body.extend((data.len() as u32).to_le_bytes());
            body.extend(*kind);
            body.extend(*data);
        }
        let mut file = b"glTF\x02\0\0\0".to_vec();
        file.extend((12 + body.len() as u32).to_le_bytes());
        file.extend(body);
        file
    }

    #[test]
    fn parts_of_a_glb() {
        let whole = glb(&[(b"JSON", b"{}  "), (b"XYZ\0", b"skip"), (b"BIN\0", &[1, 2, 3, 4])]);
        assert_eq!(split(&whole), Ok(Parts { json: 20..24, binary: Some(44..48) }));
        for end in 0..whole.len() {
            assert!(split(&whole[..end]).is_err(), "cut at {end}");
        }
        assert_eq!(split(b"\xEF\xBB\xBF {}"), Ok(Parts { json: 3..6, binary: None }));
    }

    #[test]
    fn messages() {
        for (json, message) in [
            ("{", "line 1 column 1"),
            (r#"{"asset":{"version":"2.0"},"nodes":[{"translation":[0,1e39,0]}]}"#, "1e+39 at nodes[0].translation[1]"),
            (r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":4294967296}]}"#, "4294967296 at nodes[0].mesh"),
            (r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":"x"}]}"#, "line 1 column 47"),
        ] {
            let e = parse(json.as_bytes()).unwrap_err().to_string();
            assert!(e.contains(message), "{json}: {e}");
        }
        let ignored =
            r#"{"asset":{"version":"2.0"},"animations":[{"samplers":[],"channels":[{"sampler":0,"target":{"path":"scale"}}]}]}"#;
        assert!(parse(ignored.as_bytes()).unwrap().root.animations[0].channels.is_empty());
    }

    #[test]
    fn what_the_crate_does_not_read() {
        let json = r#"{"asset":{"version":"2.0"},"textures":[{"source":0},{"extensions":{"KHR_texture_basisu":{"source":0}}}],"images":[{"uri":"a.png"}],
            "materials":[{},{"normalTexture":{"index":0,"extensions":{"KHR_texture_transform":{"offset":[0.5,1],"rotation":2,"texCoord":1}}}}]}"#;
        let parsed = parse(json.as_bytes()).unwrap();
        let transform = UvTransform { offset: [0.5, 1.0], rotation: 2.0, scale: [1.0, 1.0], tex_coord: Some(1) };
        assert_eq!(parsed.normal_transforms, [None, Some(transform)]);
        assert_eq!(parsed.occlusion_transforms, [None, None]);
        assert_eq!(parsed.root.textures[1].source.value(), 1);
        assert_eq!(parsed.root.images.len(), 2);
    }
}
