//! Prints the reference of node types from their declarations.

use std::fmt::Write;
use std::path::Path;
use umbriel_fields::{Error, Field, NodeType, Value};
use umbriel_scenegraph::new_graph;

/// Writes the definitions that editors of scripts read; gives what was written.
pub(crate) fn write_definitions(folder: &Path) -> Result<String, std::io::Error> {
    std::fs::create_dir_all(folder)?;
    let mut text = String::new();
    for (name, definitions) in umbriel_scripts::definitions() {
        std::fs::write(folder.join(&name), definitions)?;
        let _ = writeln!(text, "{}", folder.join(&name).display());
    }
    Ok(text)
}

/// The reference of one type, or a line for each.
pub(crate) fn reference(name: Option<&str>) -> Result<String, Error> {
    let graph = new_graph();
    match name {
        Some(name) => Ok(one(&*graph.types().get(name)?)),
        None => {
            let mut types: Vec<_> = graph.types().iter().collect();
            types.sort_by(|a, b| a.name.cmp(&b.name));
            let width = types.iter().map(|t| t.name.len()).max().unwrap_or(0);
            let line = |t: &NodeType| format!("{:width$}  {}\n", t.name, t.doc.lines().next().unwrap_or_default());
            Ok(types.iter().map(|t| line(t)).collect())
        }
    }
}

fn one(node_type: &NodeType) -> String {
    let mut text = format!("{}\n{}\n", node_type.name, node_type.doc);
    if !node_type.aliases.is_empty() {
        let _ = writeln!(text, "Also called {}.", node_type.aliases.join(", "));
    }
    node_type.fields.iter().for_each(|field| describe(field, &mut text));
    text
}

fn describe(field: &Field, text: &mut String) {
    let _ = write!(text, "\n  {}: {}", field.name, field.field_type);
    if field.output {
        text.push_str(", output");
    } else if let Some(default) = default_text(field) {
        let _ = write!(text, " = {default}");
    }
    if !field.unit.is_empty() {
        let _ = write!(text, " [{}]", field.unit);
    }
    if let Some((smallest, largest)) = field.range {
        let _ = write!(text, ", {smallest} to {largest}");
    }
    if !field.choices.is_empty() {
        let _ = write!(text, ", one of {}", field.choices.join(" | "));
    }
    if !field.aliases.is_empty() {
        let _ = write!(text, ", also {}", field.aliases.join(", "));
    }
    let _ = writeln!(text, "\n      {}", field.doc);
}

/// The default as a script would write it; none where it is empty.
fn default_text(field: &Field) -> Option<String> {
    let call = |name: &str, values: &[f32]| {
        let values: Vec<String> = values.iter().map(|v| format!("{v:?}")).collect();
        Some(format!("{name}({})", values.join(", ")))
    };
    match &field.default {
        Value::Bool(v) => Some(v.to_string()),
        Value::I32(v) => Some(v.to_string()),
        Value::I64(v) => Some(v.to_string()),
        Value::F32(v) => Some(format!("{v:?}")),
        Value::F64(v) => Some(format!("{v:?}")),
        Value::Time(v) => Some(format!("{:?}", v.0)),
        Value::String(v) => Some(format!("{v:?}")),
        Value::Vec2(v) => call("vec2", &v.to_array()),
        Value::Vec3(v) => call("vec3", &v.to_array()),
        Value::Vec4(v) => call("vec4", &v.to_array()),
        Value::Quat(v) => call("quat", &v.to_array()),
        Value::Color(v) => call("color", &v.0.to_array()),
        Value::ColorA(v) => call("color", &v.0.to_array()),
        Value::Enum(v) => field.choice_name(*v).map(|name| format!("{name:?}")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_and_field_has_a_line_that_says_what_it_is() {
        let graph = new_graph();
        let all = reference(None).unwrap();
        for node_type in graph.types().iter() {
            assert!(all.contains(&*node_type.name), "{}", node_type.name);
            assert!(!node_type.doc.is_empty(), "{}", node_type.name);
            let text = reference(Some(&node_type.name)).unwrap();
            for field in &node_type.fields {
                assert!(text.contains(&format!("  {}: {}", field.name, field.field_type)), "{text}");
                assert!(!field.doc.is_empty(), "{}.{}", node_type.name, field.name);
            }
        }
    }

    #[test]
    fn a_wrong_name_names_the_nearest() {
        let error = reference(Some("SpotLihgt")).unwrap_err().to_string();
        assert!(error.contains("SpotLight"), "{error}");
    }
}
