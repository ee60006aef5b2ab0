//! Shaders of authors: from text, or from files below the asset root.

use super::files::below;
use super::problem::Problems;
use super::read::{Reader, label};
use glam::{Vec2, Vec3, Vec4};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use umbriel_fields::{Graph, NodeId, Value};
use umbriel_scene::{FragmentShader, ShaderParam, ShaderSource};

/// Longest file that is read, bytes; a renderer takes less.
const MAX_BYTES: u64 = 1 << 20;

/// Texts of files in use.
#[derive(Default)]
pub(super) struct Shaders {
    files: BTreeMap<PathBuf, Result<Arc<ShaderSource>, String>>,
}

impl Shaders {
    /// The files that were read, or could not be.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.keys().map(PathBuf::as_path)
    }

    /// These files are to be read again. True if any of them was in use.
    pub(super) fn forget(&mut self, files: &[PathBuf]) -> bool {
        let before = self.files.len();
        self.files.retain(|path, _| !files.contains(path));
        self.files.len() < before
    }

    fn of_file(&mut self, root: &Path, url: &str) -> Result<Arc<ShaderSource>, String> {
        let path = below(root, url)?;
        let read = || match read(&path) {
            Ok(text) => Ok(Arc::new(ShaderSource { name: url.to_owned(), text })),
            Err(reason) => Err(format!("file '{url}': {reason}")),
        };
        self.files.entry(path.clone()).or_insert_with(read).clone()
    }
}

fn read(path: &Path) -> Result<String, String> {
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(|e| e.to_string())?;
    file.take(MAX_BYTES + 1).read_to_string(&mut text).map_err(|e| e.to_string())?;
    if text.len() as u64 > MAX_BYTES {
        return Err(format!("it is longer than {MAX_BYTES} bytes"));
    }
    Ok(text)
}

/// The shader that an appearance names. A missing one is reported; the surface goes without.
pub(super) fn shader(
    graph: &Graph,
    node: NodeId,
    (root, shaders): (&Path, &mut Shaders),
    problems: &mut Problems,
) -> Option<FragmentShader> {
    let read = Reader::new(graph, node);
    let (source, url): (Arc<str>, Arc<str>) = (read.get("source"), read.get("url"));
    let found = match (&*source, &*url) {
        ("", "") => Err("neither source nor url is set".to_owned()),
        ("", url) => shaders.of_file(root, url),
        (text, _) => {
            Ok(Arc::new(ShaderSource { name: format!("FragmentShader '{}', source", label(graph, node)), text: text.to_owned() }))
        }
    };
    let told = |e: &String| format!("{e}; the surface is shown without it");
    problems.set(graph, node, "url", found.as_ref().err().map(told));
    let params = params(graph, node, problems);
    Some(FragmentShader { source: found.ok()?, params })
}

/// The fields that one node has and its type has not.
fn params(graph: &Graph, node: NodeId, problems: &mut Problems) -> Vec<(Arc<str>, ShaderParam)> {
    let declared = graph.type_of(node).fields.len();
    let mut wrong = Vec::new();
    let mut params = Vec::new();
    for (id, field) in graph.field_ids(node).filter(|(id, _)| usize::from(id.index) >= declared) {
        match graph.value(id).ok().as_ref().and_then(param) {
            Some(value) => params.push((field.name.clone(), value)),
            None => wrong.push(format!("`{}` is {}", field.name, field.field_type)),
        }
    }
    let finite = |p: &(Arc<str>, ShaderParam)| match p.1 {
        ShaderParam::Scalar(x) => x.is_finite(),
        ShaderParam::Vec2(v) => v.is_finite(),
        ShaderParam::Vec3(v) => v.is_finite(),
        ShaderParam::Vec4(v) => v.is_finite(),
    };
    for (name, value) in params.iter_mut().filter(|p| !finite(p)) {
        wrong.push(format!("`{name}` is not finite and taken as 0"));
        *value = match value {
            ShaderParam::Scalar(_) => ShaderParam::Scalar(0.0),
            ShaderParam::Vec2(_) => ShaderParam::Vec2(Vec2::ZERO),
            ShaderParam::Vec3(_) => ShaderParam::Vec3(Vec3::ZERO),
            ShaderParam::Vec4(_) => ShaderParam::Vec4(Vec4::ZERO),
        };
    }
    let problem =
        (!wrong.is_empty()).then(|| format!("{}; parameters are finite numbers, vec2, vec3, vec4 and colours", wrong.join(", ")));
    problems.set(graph, node, "params", problem);
    params
}

fn param(value: &Value) -> Option<ShaderParam> {
    Some(match value {
        Value::F32(x) => ShaderParam::Scalar(*x),
        Value::F64(x) => ShaderParam::Scalar(*x as f32),
        Value::I32(x) => ShaderParam::Scalar(*x as f32),
        Value::I64(x) => ShaderParam::Scalar(*x as f32),
        Value::Bool(x) => ShaderParam::Scalar(f32::from(*x)),
        Value::Time(t) => ShaderParam::Scalar(t.0 as f32),
        Value::Vec2(v) => ShaderParam::Vec2(*v),
        Value::Vec3(v) => ShaderParam::Vec3(*v),
        Value::Color(c) => ShaderParam::Vec3(c.0),
        Value::Vec4(v) => ShaderParam::Vec4(*v),
        Value::ColorA(c) => ShaderParam::Vec4(c.0),
        _ => return None,
    })
}
