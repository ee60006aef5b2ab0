//! Writes text: RON, laid out so that two saves can be compared line by line.

use std::fmt::Write;

use super::outline::{Outline, dynamic_fields, own_mode, routes, waiting, written_fields};
use crate::codec::{PlainField, to_ron};
use crate::{Field, Graph, NodeId, Value};

/// Lists are wrapped at this column.
const WIDTH: usize = 110;
/// Characters of a picture in a line; a multiple of four, so that each line is whole bytes.
const PICTURE_WIDTH: usize = 100;

pub(super) fn write(graph: &Graph) -> String {
    let mut outline = Outline::new(graph, true);
    let mut text =
        format!("(\n    format: \"umbriel-world\",\n    version: ({}, {}),\n    nodes: [\n", super::MAJOR, super::MINOR);
    for id in outline.nodes.clone() {
        write_node(&mut text, graph, id, &mut outline);
    }
    text += "    ],\n    routes: [\n";
    for (route, carried) in routes(graph) {
        let (Ok(from), Ok(to)) = (graph.declaration(route.from), graph.declaration(route.to)) else { continue };
        let ends = [(route.from.node, from), (route.to.node, to)].map(|(node, field)| endpoint(&outline, node, Some(field)));
        let _ = write!(text, "        (from: {}, to: {}", ends[0], ends[1]);
        if route.strength == crate::Strength::Weak {
            text += ", weak: true";
        }
        if let Some(value) = carried {
            text += ", carries: ";
            text += &laid_out(value, from, &mut outline, 12);
        }
        text += "),\n";
    }
    text += "    ],\n    waiting: [\n";
    for (node, field) in waiting(graph) {
        let _ = writeln!(text, "        {},", endpoint(&outline, node, field));
    }
    text += "    ],\n";
    write_images(&mut text, &outline);
    text += ")\n";
    text
}

fn quoted(text: &str) -> String {
    ron::to_string(text).unwrap_or_default()
}

/// `"node.field"`, or `"node."` for the node itself. Names of fields have no points.
fn endpoint(outline: &Outline, node: NodeId, field: Option<&Field>) -> String {
    quoted(&format!("{}.{}", outline.id(node), field.map_or("", |field| &field.name)))
}

fn write_node(text: &mut String, graph: &Graph, id: NodeId, outline: &mut Outline) {
    let name = quoted(outline.id(id));
    let _ = write!(text, "        (\n            id: {name}, type: {}", quoted(&graph.type_of(id).name));
    // A name that looks like a number of an unnamed node.
    if let Some(name) = graph.name(id).filter(|name| name.starts_with('#')) {
        let _ = write!(text, ", name: {}", quoted(name));
    }
    if let Some(mode) = own_mode(graph, id) {
        let _ = write!(text, ", mode: {}", quoted(mode));
    }
    text.push_str(",\n");
    let fields = written_fields(graph, id);
    if !fields.is_empty() {
        text.push_str("            fields: {\n");
        for (field, value) in fields {
            let _ = writeln!(text, "                {}: {},", quoted(&field.name), laid_out(&value, field, outline, 20));
        }
        text.push_str("            },\n");
    }
    let dynamic = dynamic_fields(graph, id);
    if !dynamic.is_empty() {
        text.push_str("            dynamic: [\n");
        for (field, value) in dynamic {
            write_declaration(text, field, &value, outline);
        }
        text.push_str("            ],\n");
    }
    text.push_str("        ),\n");
}

fn write_declaration(text: &mut String, field: &Field, value: &Value, outline: &mut Outline) {
    let plain = PlainField::without_default(field);
    let _ = write!(text, "                (name: {}, type: {}", quoted(&plain.name), quoted(&plain.field_type));
    let _ = write!(text, ", default: {}", laid_out(&field.default, field, outline, 20));
    let _ = write!(text, ", value: {}", laid_out(value, field, outline, 20));
    for (key, words) in [("doc", &plain.doc), ("unit", &plain.unit)].into_iter().filter(|(_, words)| !words.is_empty()) {
        let _ = write!(text, ", {key}: {}", quoted(words));
    }
    if let Some(range) = plain.range {
        let _ = write!(text, ", range: {}", ron::to_string(&range).unwrap_or_default());
    }
    for (key, list) in [("aliases", &plain.aliases), ("choices", &plain.choices)].into_iter().filter(|(_, list)| !list.is_empty())
    {
        let _ = write!(text, ", {key}: {}", ron::to_string(list).unwrap_or_default());
    }
    for (key, flag) in [("pulse", plain.pulse), ("output", plain.output)].into_iter().filter(|(_, flag)| *flag) {
        let _ = write!(text, ", {key}: {flag}");
    }
    text.push_str("),\n");
}

/// A value; a long list on lines of its own.
fn laid_out(value: &Value, field: &Field, outline: &mut Outline, indent: usize) -> String {
    let elements = to_ron(value, field, outline);
    if !value.field_type().multiple {
        return elements.into_iter().next().unwrap_or_default();
    }
    let length: usize = elements.iter().map(|element| element.len() + 2).sum();
    if length + indent < WIDTH {
        return format!("[{}]", elements.join(", "));
    }
    let mut text = String::from("[");
    let mut column = WIDTH;
    for element in elements {
        if column + element.len() + 2 > WIDTH {
            let _ = write!(text, "\n{:indent$}", "");
            column = indent;
        } else {
            text.push(' ');
        }
        column += element.len() + 2;
        text += &element;
        text.push(',');
    }
    let _ = write!(text, "\n{:1$}]", "", indent - 4);
    text
}

fn write_images(text: &mut String, outline: &Outline) {
    use base64::Engine;
    if outline.images.is_empty() {
        return;
    }
    text.push_str("    images: [\n");
    for (place, image) in outline.images.iter().enumerate() {
        let _ = writeln!(text, "        (id: \"image{}\", size: ({}, {}), rgba: [", place + 1, image.width, image.height);
        for bytes in image.rgba.chunks(PICTURE_WIDTH / 4 * 3) {
            let _ = writeln!(text, "            \"{}\",", base64::engine::general_purpose::STANDARD.encode(bytes));
        }
        text.push_str("        ]),\n");
    }
    text.push_str("    ],\n");
}
