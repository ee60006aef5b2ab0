//! Shaders that authors write: WGSL that replaces parts of our shading (003 section 5 and future work).
//!
//! An author's text is joined with our own, checked before any driver sees it ([`check`]), and compiled once however many
//! shapes use it. What is wrong with it is told in the author's own lines, and its shapes look as if they had no shader.

mod check;
mod compose;
mod text;

#[cfg(test)]
mod tests;

use crate::cache::KEEP_FRAMES;
use crate::shaders;
use std::collections::HashMap;
use std::sync::Arc;
use umbriel_scene::{FragmentShader, Material, ShaderParam, ShaderSource};

/// Number of the shader of shapes that bring none of their own.
pub(crate) const STANDARD: u32 = 0;
/// Most values that a shader can be given.
pub(crate) const MAX_PARAMS: usize = 16;
/// Stack of the thread that compiles: parsers call themselves.
const STACK_BYTES: usize = 256 << 20;

/// Name and type of a value that a shader reads.
type Param = (Arc<str>, &'static str);

/// What one compilation depends on.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Key {
    source: Arc<ShaderSource>,
    params: Vec<Param>,
}

/// A shader that was compiled.
pub(crate) struct Author {
    pub(crate) module: wgpu::ShaderModule,
    /// It has a `shade` of its own, which is asked in the shadow, too.
    pub(crate) shades: bool,
}

struct Entry {
    number: u32,
    /// None where it is wrong.
    author: Option<Author>,
    last_used: u64,
}

/// Frames that a wrong shader outlives its last use: more than there are between two looks at what is in use.
const KEEP_WRONG_FRAMES: u64 = 40;

/// Shaders of authors, by text.
#[derive(Default)]
pub(crate) struct Authors {
    entries: HashMap<Key, Entry>,
    last: u32,
}

/// How a message about an author's shader ends. Whoever knows the shapes may name them instead.
pub const WITHOUT_SHADER: &str = "; its shapes are shown without it";

impl Authors {
    /// The number of a material's shader; [`STANDARD`] where it has none. What is wrong with it is told to `report` as long as it is new.
    pub(crate) fn number_of(
        &mut self,
        device: &wgpu::Device,
        material: &Material,
        frame: u64,
        report: impl FnOnce(String),
    ) -> u32 {
        let Some(shader) = &material.shader else { return STANDARD };
        let params = shader.params.iter().map(|(name, value)| (name.clone(), type_of(value))).collect();
        let key = Key { source: shader.source.clone(), params };
        let last = &mut self.last;
        let entry = self.entries.entry(key).or_insert_with_key(|key| {
            let author = within_limits(key).and_then(|()| compile(device, key)).map_err(report).ok();
            *last += 1;
            Entry { number: *last, author, last_used: frame }
        });
        entry.last_used = frame;
        entry.number
    }

    /// The shader of a number, if it is not [`STANDARD`].
    pub(crate) fn get(&self, number: u32) -> Option<&Author> {
        if number == STANDARD {
            return None;
        }
        self.entries.values().find(|e| e.number == number)?.author.as_ref()
    }

    /// A material with this shader is drawn.
    pub(crate) fn touch(&mut self, number: u32, frame: u64) {
        if number != STANDARD
            && let Some(entry) = self.entries.values_mut().find(|e| e.number == number)
        {
            entry.last_used = frame;
        }
    }

    /// Drops what was not used for longer than any material is kept; gives the numbers. What is wrong goes soon, so that it is told again if an
    /// author makes the same mistake again.
    pub(crate) fn drop_unused(&mut self, frame: u64) -> Vec<u32> {
        let kept = |e: &Entry| if e.author.is_some() { 2 * KEEP_FRAMES } else { KEEP_WRONG_FRAMES };
        let old = self.entries.extract_if(|_, e| e.last_used + kept(e) < frame);
        old.map(|(_, entry)| entry.number).collect()
    }
}

fn within_limits(key: &Key) -> Result<(), String> {
    let (name, count) = (&key.source.name, key.params.len());
    if count <= MAX_PARAMS {
        return Ok(());
    }
    Err(format!("{name}: a shader takes {MAX_PARAMS} parameters, it is given {count}{WITHOUT_SHADER}"))
}

/// Our own functions in place of an author's.
pub(crate) fn standard_hooks() -> String {
    compose::standard_hooks(&[], &[])
}

fn type_of(param: &ShaderParam) -> &'static str {
    match param {
        ShaderParam::Scalar(_) => "f32",
        ShaderParam::Vec2(_) => "vec2<f32>",
        ShaderParam::Vec3(_) => "vec3<f32>",
        ShaderParam::Vec4(_) => "vec4<f32>",
    }
}

/// The values as [`crate::uniforms::Material`] holds them.
pub(crate) fn values_of(shader: &FragmentShader) -> [[f32; 4]; MAX_PARAMS] {
    let mut values = [[0.0; 4]; MAX_PARAMS];
    for (place, (_, value)) in values.iter_mut().zip(&shader.params) {
        *place = match *value {
            ShaderParam::Scalar(x) => [x, 0.0, 0.0, 0.0],
            ShaderParam::Vec2(v) => [v.x, v.y, 0.0, 0.0],
            ShaderParam::Vec3(v) => v.extend(0.0).to_array(),
            ShaderParam::Vec4(v) => v.to_array(),
        };
    }
    values
}

/// Checks and compiles. The message names the author's file, line and column.
fn compile(device: &wgpu::Device, key: &Key) -> Result<Author, String> {
    let on_deep_stack = || -> Result<Author, String> {
        let checked = check::check(&key.source, &key.params)?;
        let text = compose::whole(&key.source.text, &key.params, &checked);
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = shaders::module(device, &key.source.name, &[&text]);
        let refused = pollster::block_on(scope.pop());
        let shades = checked.hooks.iter().any(|h| h == "shade");
        refused.map_or(Ok(Author { module, shades }), |error| Err(error.to_string()))
    };
    let broken = |what: &str| format!("{}: {what}", key.source.name);
    let result = std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(STACK_BYTES).spawn_scoped(scope, on_deep_stack);
        thread
            .map_err(|e| broken(&format!("cannot be compiled: {e}")))?
            .join()
            .unwrap_or_else(|_| Err(broken("the compiler gave up on it")))
    });
    result.map_err(|message| format!("{message}{WITHOUT_SHADER}"))
}
