//! What the manual, editors and messages know of the functions.

use std::collections::BTreeMap;
use std::fmt::Write;

use rhai::Engine;
use umbriel_fields::{FieldType, Kind};

use crate::engine::Script;
use crate::limits::Limits;
use crate::stage::{Node, Stage};
use crate::words;

/// A function that worlds can call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FunctionDoc {
    /// The chapter of the manual.
    pub chapter: &'static str,
    /// `name(parameter: type, ...) -> type`
    pub signature: &'static str,
    /// What it does, in a sentence or two.
    pub doc: &'static str,
}

impl FunctionDoc {
    /// The name alone.
    pub fn name(&self) -> &'static str {
        self.signature.split('(').next().unwrap_or(self.signature)
    }

    fn editors_head(&self) -> String {
        format!("fn {}({})", self.name(), self.parameters().join(", "))
    }

    fn editors_result(&self) -> String {
        let result = self.signature.rsplit_once(") -> ").map_or("()", |(_, result)| result);
        editors_word(result).to_string()
    }

    /// The parameters as editors know them: `name: type`, with `?` for what takes several types.
    pub(crate) fn parameters(&self) -> Vec<String> {
        let inside = self.signature.split_once('(').map_or("", |(_, rest)| rest);
        let inside = inside.split_once(") ->").map_or(inside.trim_end_matches(')'), |(inside, _)| inside);
        let mut found: Vec<String> = Vec::new();
        for part in inside.split(", ").filter(|part| !part.is_empty()) {
            // A comma between the bars of `|time, dt|` parts nothing.
            match found.last_mut().filter(|last| last.matches('|').count() == 1) {
                Some(open) => *open += part,
                None => found.push(part.to_string()),
            }
        }
        found.iter().map(|parameter| editors_parameter(parameter)).collect()
    }
}

/// All functions of ours, in the order of the manual; rhai's own for numbers, strings, arrays and maps come on top.
pub fn functions() -> Vec<FunctionDoc> {
    words::teach(&mut Engine::new_raw(), &Stage::new(Limits::default(), Vec::new()))
}

fn editors_parameter(parameter: &str) -> String {
    let (name, type_name) = parameter.split_once(": ").unwrap_or((parameter, "any"));
    format!("{name}: {}", editors_word(type_name))
}

fn editors_word(type_name: &str) -> &str {
    match type_name {
        "any" | "number" | "vec" => "?",
        function if function.starts_with('|') => "Fn",
        known => known,
    }
}

/// Files for editors that know rhai, as name and text: all functions with their documentation, operators, and the fields of all node types
/// as properties of `Node`. They belong into one folder.
pub fn definitions() -> Vec<(String, String)> {
    let script = Script::new(Stage::new(Limits::default(), Vec::new()), Some(Node(umbriel_fields::NodeId::default())));
    let mut files = script.definitions();
    for (_, text) in &mut files {
        *text = with_results(text);
    }
    files.push(("__fields__.d.rhai".into(), field_definitions()));
    files
}

/// The engine knows no types of results; our signatures do.
fn with_results(text: &str) -> String {
    let known: BTreeMap<String, String> =
        functions().iter().map(|known| (known.editors_head(), known.editors_result())).collect();
    let line = |line: &str| match line.strip_suffix(" -> ;") {
        Some(head) => format!("{head} -> {};\n", known.get(head).map_or("?", String::as_str)),
        None => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

/// Each name of a field once, with the types that have it.
fn field_definitions() -> String {
    let graph = crate::world::empty_graph();
    let mut fields: BTreeMap<String, Vec<(String, FieldType)>> = BTreeMap::new();
    for node_type in graph.types().iter() {
        for field in &node_type.fields {
            let unit = if field.unit.is_empty() { String::new() } else { format!(" Unit: {}.", field.unit) };
            let about = format!("{}: {}{unit}", node_type.name, field.doc.replace('\n', " "));
            fields.entry(field.name.to_string()).or_default().push((about, field.field_type));
        }
    }
    let mut text = String::from("module static;\n");
    for (name, users) in &fields {
        text.push('\n');
        for (about, _) in users {
            let _ = writeln!(text, "/// {about}");
        }
        let first = users[0].1;
        let word = if users.iter().all(|(_, other)| *other == first) { editors_type(first) } else { "?" };
        let _ = writeln!(text, "fn get {name}(node: Node) -> {word};");
    }
    text
}

fn editors_type(field_type: FieldType) -> &'static str {
    match field_type.kind {
        _ if field_type.multiple => "Array",
        Kind::Bool => "bool",
        Kind::I32 | Kind::I64 => "int",
        Kind::F32 | Kind::F64 | Kind::Time => "float",
        Kind::String | Kind::Enum => "String",
        Kind::Node => "Node",
        Kind::Image => "?",
        kind => kind.name(),
    }
}
