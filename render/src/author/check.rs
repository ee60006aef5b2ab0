//! Checks an author's text before any driver sees it.

use super::compose::{self, LOOP_BUDGET};
use super::text::{place, too_much};
use super::{MAX_PARAMS, Param};
use crate::shaders;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{Block, Expression, Function, GlobalVariable, Handle, Module, Span, Statement, Type, TypeInner};
use std::collections::HashMap;
use std::error::Error;
use umbriel_scene::ShaderSource;

/// Most operations of a function with all that it calls, loops counted once.
const MAX_WEIGHT: u64 = 20_000;
/// Largest variable, bytes.
const MAX_TYPE_BYTES: u32 = 4096;

/// What is known of a text that is fine.
#[derive(Debug)]
pub(crate) struct Checked {
    /// Our functions that it replaces.
    pub(crate) hooks: Vec<String>,
    /// Operations of each of its functions, with all that they call.
    pub(crate) weights: HashMap<String, u64>,
}

/// An argument or a result of a function that replaces one of ours.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Named(&'static str),
    Floats(u8),
}

/// Name, signature as authors write it, arguments, result.
const SIGNATURES: [(&str, &str, &[Kind], Kind); 4] = [
    ("surface", "fn surface(s: Surface) -> Surface", &[Kind::Named("Surface")], Kind::Named("Surface")),
    (
        "shade",
        "fn shade(s: Surface, light: LightSample) -> vec3<f32>",
        &[Kind::Named("Surface"), Kind::Named("LightSample")],
        Kind::Floats(3),
    ),
    (
        "ambient",
        "fn ambient(s: Surface, light: vec3<f32>) -> vec3<f32>",
        &[Kind::Named("Surface"), Kind::Floats(3)],
        Kind::Floats(3),
    ),
    ("finish", "fn finish(s: Surface, lit: vec3<f32>) -> vec4<f32>", &[Kind::Named("Surface"), Kind::Floats(3)], Kind::Floats(4)),
];

/// Our functions that an author may call.
const OFFERED: [&str; 8] = [
    "standard_shade",
    "standard_ambient",
    "standard_finish",
    "place_in_world",
    "direction_in_world",
    "base_texture_at",
    "emissive_texture_at",
    "fog_share",
];

/// Checks a text. The message begins with file, line and column.
pub(crate) fn check(source: &ShaderSource, params: &[Param]) -> Result<Checked, String> {
    if let Some((at, why)) = too_much(&source.text) {
        let (line, column) = place(&source.text, at);
        return Err(format!("{}:{line}:{column}: {why}", source.name));
    }
    debug_assert!(params.len() <= MAX_PARAMS);
    let mut before = shaders::SURFACE_BEFORE_HOOKS.concat();
    before += &compose::declared(params);
    let joined = Joined { name: &source.name, own: &source.text, params, start: before.len(), text: before + &source.text };
    joined.check()
}

/// An author's text behind ours.
struct Joined<'a> {
    name: &'a str,
    own: &'a str,
    params: &'a [Param],
    start: usize,
    text: String,
}

impl Joined<'_> {
    fn check(&self) -> Result<Checked, String> {
        let module = naga::front::wgsl::parse_str(&self.text).map_err(|error| {
            let labels: Vec<(Span, &str)> = error.labels().collect();
            let label = labels.iter().find(|(span, _)| self.is_own(*span)).or(labels.first());
            let mut message = error.message().replace("wgsl error: ", "");
            // Some labels say the same again.
            let says_more = |text: &str| !text.is_empty() && !text.starts_with("invalid") && !text.starts_with("unknown");
            if let Some((_, text)) = label.filter(|(_, text)| says_more(text) && !message.contains(text)) {
                message += &format!(" ({text})");
            }
            error.notes().for_each(|note| message += &format!("; {note}"));
            self.told(label.map(|(span, _)| *span), &message)
        })?;
        self.check_types(&module)?;
        Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).map_err(|error| {
            let mut message = error.as_inner().to_string();
            let mut source = error.as_inner().source();
            while let Some(inner) = source {
                message += &format!(": {inner}");
                source = inner.source();
            }
            let spans: Vec<Span> = error.spans().map(|(span, _)| *span).collect();
            let span = spans.iter().rev().find(|span| self.is_own(**span)).copied();
            self.told(span, &message)
        })?;
        self.check_globals(&module)?;
        let hooks = self.hooks(&module)?;
        let weights = self.weights(&module)?;
        Ok(Checked { hooks, weights })
    }

    fn is_own(&self, span: Span) -> bool {
        span.to_range().is_some_and(|range| range.start >= self.start)
    }

    /// The message with its place in the author's file.
    fn told(&self, span: Option<Span>, message: &str) -> String {
        let own = span.filter(|span| self.is_own(*span)).and_then(|span| span.to_range());
        let Some(start) = own.map(|range| range.start - self.start) else {
            return format!("{}: {message}", self.name);
        };
        let (line, column) = place(self.own, start);
        let of_params = self.own[..self.own.floor_char_boundary(start)].ends_with("params.");
        let hint = if of_params { self.names_of_params() } else { String::new() };
        format!("{}:{line}:{column}: {message}{hint}", self.name)
    }

    fn names_of_params(&self) -> String {
        let names: Vec<&str> = self.params.iter().map(|(name, _)| &**name).collect();
        format!("; `params` has {}", names.join(", "))
    }

    fn check_types(&self, module: &Module) -> Result<(), String> {
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).map_err(|e| format!("{}: {e}", self.name))?;
        for (handle, of_type) in module.types.iter() {
            let size = layouter[handle].size;
            if size > MAX_TYPE_BYTES && !is_unsized(module, of_type) {
                let span = module.types.get_span(handle);
                return Err(self.told(Some(span), &format!("a type of {size} bytes; at most {MAX_TYPE_BYTES} are allowed")));
            }
        }
        Ok(())
    }

    /// Nothing of ours but `params`, and nothing that is bound or shared.
    fn check_globals(&self, module: &Module) -> Result<(), String> {
        let refused = |span, what: &str| Err(self.told(Some(span), what));
        for (handle, global) in module.global_variables.iter() {
            let span = module.global_variables.get_span(handle);
            if self.is_own(span) && global.space != naga::AddressSpace::Private {
                return refused(
                    span,
                    "a shader brings no bindings; what it needs are fields of its FragmentShader, `params.name`",
                );
            }
        }
        let mut overrides = module.overrides.iter().map(|(handle, _)| module.overrides.get_span(handle));
        if let Some(span) = overrides.find(|span| self.is_own(*span)) {
            return refused(span, "`override` is not for shaders of shapes; use a field and `params`");
        }
        if let Some(entry) = module.entry_points.first() {
            let message = format!("`{}` is an entry point; a shader brings surface, shade, ambient or finish", entry.name);
            return Err(self.told(None, &message));
        }
        for (handle, function) in self.own_functions(module) {
            let span = module.functions.get_span(handle);
            for (expression, what) in function.expressions.iter() {
                let span = if self.is_own(function.expressions.get_span(expression)) {
                    function.expressions.get_span(expression)
                } else {
                    span
                };
                match what {
                    Expression::GlobalVariable(global) if !self.is_offered(module, *global) => {
                        let name = name_of_global(module, *global);
                        return refused(span, &format!("`{name}` is not for shaders of shapes"));
                    }
                    _ => {}
                }
            }
            let mut calls = Vec::new();
            called(&function.body, &mut calls);
            for callee in calls {
                let name = module.functions[callee].name.as_deref().unwrap_or_default();
                if !self.is_own(module.functions.get_span(callee)) && !OFFERED.contains(&name) {
                    return refused(
                        span,
                        &format!("`{name}` is not for shaders of shapes; they may call {}", OFFERED.join(", ")),
                    );
                }
            }
        }
        Ok(())
    }

    fn is_offered(&self, module: &Module, global: Handle<GlobalVariable>) -> bool {
        self.is_own(module.global_variables.get_span(global)) || name_of_global(module, global) == "params"
    }

    fn own_functions<'m>(&'m self, module: &'m Module) -> impl Iterator<Item = (Handle<Function>, &'m Function)> {
        module.functions.iter().filter(|(handle, _)| self.is_own(module.functions.get_span(*handle)))
    }

    /// The functions of ours that it replaces.
    fn hooks(&self, module: &Module) -> Result<Vec<String>, String> {
        let mut hooks = Vec::new();
        for (handle, function) in self.own_functions(module) {
            let name = function.name.as_deref().unwrap_or_default();
            let Some((_, signature, arguments, result)) = SIGNATURES.iter().find(|(known, ..)| *known == name) else { continue };
            let given: Vec<Option<Kind>> = function.arguments.iter().map(|a| kind_of(module, a.ty)).collect();
            let returned = function.result.as_ref().and_then(|r| kind_of(module, r.ty));
            if !given.iter().copied().eq(arguments.iter().map(|k| Some(*k))) || returned != Some(*result) {
                return Err(self.told(Some(module.functions.get_span(handle)), &format!("it must be `{signature}`")));
            }
            hooks.push(name.to_owned());
        }
        if hooks.is_empty() {
            let names: Vec<&str> = compose::hook_names().collect();
            return Err(format!("{}: it has none of the functions {}", self.name, names.join(", ")));
        }
        Ok(hooks)
    }

    /// Operations of every function with all that it calls: calls cannot multiply without end.
    fn weights(&self, module: &Module) -> Result<HashMap<String, u64>, String> {
        // A function stands behind all that it calls.
        let mut weights: HashMap<Handle<Function>, u64> = HashMap::new();
        let mut named = HashMap::new();
        for (handle, function) in module.functions.iter() {
            let mut calls = Vec::new();
            called(&function.body, &mut calls);
            let own = function.expressions.len() as u64;
            let weight = calls.iter().fold(own, |sum, callee| sum.saturating_add(weights.get(callee).copied().unwrap_or(0)));
            weights.insert(handle, weight);
            if weight > MAX_WEIGHT && self.is_own(module.functions.get_span(handle)) {
                let span = module.functions.get_span(handle);
                let message = format!("with all that it calls it takes {weight} operations; at most {MAX_WEIGHT} are allowed");
                return Err(self.told(Some(span), &message));
            }
            named.insert(function.name.clone().unwrap_or_default(), weight.min(LOOP_BUDGET));
        }
        Ok(named)
    }
}

fn is_unsized(module: &Module, of_type: &Type) -> bool {
    match &of_type.inner {
        TypeInner::Array { size, .. } => *size == naga::ArraySize::Dynamic,
        TypeInner::Struct { members, .. } => members.last().is_some_and(|m| is_unsized(module, &module.types[m.ty])),
        _ => false,
    }
}

fn kind_of(module: &Module, of_type: Handle<Type>) -> Option<Kind> {
    let of_type = &module.types[of_type];
    match (&of_type.inner, of_type.name.as_deref()) {
        (TypeInner::Struct { .. }, Some("Surface")) => Some(Kind::Named("Surface")),
        (TypeInner::Struct { .. }, Some("LightSample")) => Some(Kind::Named("LightSample")),
        (TypeInner::Vector { size, scalar }, _) if *scalar == naga::Scalar::F32 => Some(Kind::Floats(*size as u8)),
        _ => None,
    }
}

fn name_of_global(module: &Module, global: Handle<GlobalVariable>) -> &str {
    module.global_variables[global].name.as_deref().unwrap_or_default()
}

/// Functions that a block calls, each as often as it is written there.
fn called(block: &Block, calls: &mut Vec<Handle<Function>>) {
    for statement in block {
        match statement {
            Statement::Call { function, .. } => calls.push(*function),
            Statement::Block(block) => called(block, calls),
            Statement::If { accept, reject, .. } => {
                called(accept, calls);
                called(reject, calls);
            }
            Statement::Switch { cases, .. } => cases.iter().for_each(|case| called(&case.body, calls)),
            Statement::Loop { body, continuing, .. } => {
                called(body, calls);
                called(continuing, calls);
            }
            _ => {}
        }
    }
}
