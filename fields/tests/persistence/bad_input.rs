//! Files that are wrong: what is said, and that the rest loads.

use umbriel_fields::save::{self, SaveError};
use umbriel_fields::{Field, Graph, NodeType};

use crate::support::types;

/// What is wrong, the file's nodes and routes, what is said. Lines count from the first of `HEAD`.
const ROWS: &[(&str, &str, &str)] = &[
    (
        "type mismatch",
        "nodes: [\n(id: \"a\", type: \"All\", fields: {\n\"vec3_one\": (1.0, 2.0),\n\"i32_one\": 7,\n}),\n]",
        "line 4: `a.vec3_one`: is of type vec3; this is none: Expected an array of length 3 but found 2 elements instead",
    ),
    (
        "a number too large",
        "nodes: [\n(id: \"a\", type: \"All\", fields: {\"i32_one\": 3000000000}),\n]",
        "line 3: `a.i32_one`: is of type i32; this is none: Integer is out of bounds",
    ),
    (
        "outside of the range",
        "nodes: [\n(id: \"a\", type: \"Script\", fields: {\"in\": 1e10}),\n]",
        "line 3: `a.in`: `a.in` takes values from -1000000000 to 1000000000; 10000000000 is outside",
    ),
    (
        "duplicate name",
        "nodes: [\n(id: \"a\", type: \"All\"),\n(id: \"a\", type: \"Adder\"),\n]",
        "line 4: `a`: a node above has this name; this one loads without, and nothing refers to it",
    ),
    (
        "unknown type",
        "nodes: [\n(id: \"a\", type: \"Addr\"),\n]",
        "line 3: `a`: there is no node type `Addr`; did you mean `Adder`?; the node is kept out",
    ),
    (
        "unknown or removed field",
        "nodes: [\n(id: \"a\", type: \"All\", fields: {\n\"vec_one\": (1.0, 2.0, 3.0),\n}),\n]",
        "line 4: `a.vec_one`: `a` (All) has no field `vec_one`; did you mean `vec4_one`?; the value is kept out",
    ),
    (
        "unknown choice",
        "nodes: [\n(id: \"a\", type: \"All\", fields: {\"enum_one\": \"volum\"}),\n]",
        "line 3: `a.enum_one`: takes one of none, shadow map, Volume; there is no `volum`; did you mean `Volume`?",
    ),
    (
        "unknown reference",
        "nodes: [\n(id: \"apple\", type: \"All\", fields: {\"children\": [\"aple\", \"apple\"]}),\n]",
        "line 3: `apple.children`: there is no node `aple` in the file; did you mean `apple`?; nothing takes its place",
    ),
    (
        "unknown picture",
        "nodes: [\n(id: \"a\", type: \"All\", fields: {\"image_one\": \"image1\"}),\n]",
        "line 3: `a.image_one`: the file holds no usable picture `image1`; nothing takes its place",
    ),
    (
        "picture of another size",
        "images: [\n(id: \"image1\", size: (100000, 100000), rgba: [\"AAAA\"]),\n]",
        "line 3: `image1`: a picture of 100000 x 100000 has 40000000000 bytes, not 3",
    ),
    (
        "loop of strong routes",
        "nodes: [\n(id: \"a\", type: \"Adder\"), (id: \"b\", type: \"Adder\")],\nroutes: [\n(from: \"a.sum\", to: \"b.a\"),\n(from: \"b.sum\", to: \"a.a\"),\n]",
        "line 6: strong routes would form a loop: `b.sum` -> `a.a`, `a.sum` -> `b.a`; make one of them weak, such as `b.sum` -> `a.a`; \
         the route is kept out",
    ),
    (
        "types that do not convert",
        "nodes: [(id: \"a\", type: \"All\")],\nroutes: [\n(from: \"a.vec3_one\", to: \"a.string_one\", weak: true),\n]",
        "line 4: cannot connect `a.vec3_one` (vec3) to `a.string_one` (string): the types do not convert; the route is kept out",
    ),
    (
        "route from nowhere",
        "nodes: [(id: \"a\", type: \"All\")],\nroutes: [\n(from: \"b.f32_one\", to: \"a.f32_one\"),\n]",
        "line 4: `f32_one`: there is no node `b` in the file; the route is kept out",
    ),
    (
        "unknown key of a node",
        "nodes: [\n(id: \"a\", type: \"All\",\nfeilds: {\"i32_one\": 1}),\n]",
        "line 4: `a`: nothing here is called `feilds`; did you mean `fields`?; it is kept out",
    ),
    ("unknown section", "lights: [1, 2]", "line 2: nothing here is called `lights`; it is kept out"),
    (
        "unknown kind of a dynamic field",
        "nodes: [\n(id: \"a\", type: \"All\", dynamic: [\n(name: \"x\", type: \"vec9\", default: 1, value: 2),\n]),\n]",
        "line 4: `a.x`: there is no field type `vec9`; did you mean `vec4`?; the field is kept out",
    ),
    (
        "dynamic field that the type has",
        "nodes: [\n(id: \"a\", type: \"Adder\", dynamic: [(name: \"b\", type: \"f32\", default: 1.0, value: 2.0)]),\n]",
        "line 3: `a.b`: `a` (Adder) has a field `b` already",
    ),
    (
        "value that stands there twice",
        "nodes: [\n(id: \"a\", type: \"All\", fields: {\"i32_one\": 1,\n\"i32_one\": 2}),\n]",
        "line 4: `a`: `i32_one` stands here again; the last one counts",
    ),
];

const HEAD: &str = "(format: \"umbriel-world\", version: (1, 0),\n";

#[test]
fn every_mistake_is_named_and_the_rest_loads() {
    println!("| mistake | message |\n|---|---|");
    let mut wrong = Vec::new();
    for (mistake, body, expected) in ROWS {
        let rest = if body.contains("nodes") { "" } else { ", nodes: [(id: \"a\", type: \"All\")]" };
        let (graph, reports) = save::load(format!("{HEAD}{body}{rest})"), types()).unwrap();
        let said: Vec<String> = reports.iter().map(|report| report.to_string()).collect();
        println!("| {mistake} | {} |", said.join("<br>"));
        if said.first().map(String::as_str) != Some(*expected) {
            wrong.push(format!("{mistake}:\n  said     {said:?}\n  expected {expected}"));
        }
        assert!(graph.node_count() >= (*mistake != "unknown type") as usize, "{mistake}: the rest loads");
        graph.verify_invariants().unwrap();
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn what_is_no_world_is_refused() {
    let later = HEAD.replace("(1, 0)", "(2, 3)") + ")";
    let nested = format!("{HEAD}nodes: {}", "[".repeat(100_000));
    for (data, expected) in [
        (&b"\xff\xfe"[..], "this is no saved world: byte 0 is neither text nor the start of a binary save"),
        (b"", "line 1, column 1: Unexpected end of RON"),
        (b"()", "this is no saved world: it does not say `format: \"umbriel-world\"`"),
        (b"(format: \"umbriel-world\")", "this is no saved world: it does not say `version: (major, minor)`"),
        (later.as_bytes(), "the file has format version 2.3; versions from 1.0 on up to the next major one can be read"),
        (b"\x89UMB", "the file is damaged: it ends after 4 bytes, within its head"),
        (b"(format: \"umbriel-world\",\n nodes: [(}])", "line 2, column 11: Unexpected char '}'"),
        (nested.as_bytes(), "line 2, column 71: the values are nested too deeply"),
    ] {
        let error = save::load(data, types()).unwrap_err().to_string();
        println!("| {} | {error} |", String::from_utf8_lossy(data).escape_default());
        assert_eq!(error, expected);
    }
}

#[test]
fn a_byte_order_mark_is_no_mistake() {
    let (graph, reports) = save::load(format!("\u{feff}{HEAD}nodes: [\n(id: \"a\", type: \"Addr\")])"), types()).unwrap();
    assert_eq!((graph.node_count(), reports.len(), reports[0].line), (0, 1, Some(3)));
}

#[test]
fn a_later_minor_version_opens() {
    let text = HEAD.replace("(1, 0)", "(1, 7)")
        + "nodes: [(id: \"a\", type: \"All\", layer: 3, fields: {\"i32_one\": 5}), (id: \"n\", type: \"Quantum\")], styles: {})";
    let (graph, reports) = save::load(text, types()).unwrap();
    let said: Vec<String> = reports.iter().map(|report| report.to_string()).collect();
    assert_eq!(
        said,
        [
            "written as version 1.7; what version 1.0 does not know is kept out",
            "line 2: `a`: nothing here is called `layer`; it is kept out",
            "line 2: nothing here is called `styles`; it is kept out",
            "line 2: `n`: there is no node type `Quantum`; the node is kept out",
        ]
    );
    assert_eq!(graph.get_named::<i32>(graph.find("a").unwrap(), "i32_one"), Ok(5));
}

/// A later minor version of the binary form: a section that is new, and records that are longer.
#[test]
fn a_later_minor_version_of_the_binary_form_opens() {
    let mut graph = Graph::new(types());
    let node = graph.create("Adder").unwrap();
    graph.set_name(node, "a").unwrap();
    graph.set_named(node, "a", 2.5).unwrap();
    let bytes = save::to_binary(&graph);
    let mut body = bytes[20..].to_vec();
    // The record of the one node gets two bytes more; tag, length of the section, length of the record.
    let section = u64::from_le_bytes(body[1..9].try_into().unwrap());
    let record = u64::from_le_bytes(body[9..17].try_into().unwrap());
    assert_eq!((body[0], section), (1, record + 8));
    body[1..9].copy_from_slice(&(section + 2).to_le_bytes());
    body[9..17].copy_from_slice(&(record + 2).to_le_bytes());
    body.splice(17 + record as usize..17 + record as usize, [7, 7]);
    body.extend([99, 3, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3]);
    let later = |major: u16, minor: u16| {
        let version = (major as u64) << 16 | minor as u64;
        let checksum = xxhash_rust::xxh3::xxh3_64_with_seed(&body, version).to_le_bytes();
        [&bytes[..8], &major.to_le_bytes(), &minor.to_le_bytes(), &checksum, &body].concat()
    };
    let (graph, reports) = save::load(later(1, 4), types()).unwrap();
    let said: Vec<String> = reports.iter().map(|report| report.to_string()).collect();
    assert_eq!(
        said,
        [
            "written as version 1.4; what version 1.0 does not know is kept out",
            "1 records hold more than this version knows; that is kept out",
            "section 99 is unknown; its 3 bytes are kept out",
        ]
    );
    assert_eq!(graph.get_named::<f64>(graph.find("a").unwrap(), "a"), Ok(2.5));
    assert_eq!(save::load(later(2, 0), types()).unwrap_err(), SaveError::WrongVersion { major: 2, minor: 0 });
}

#[test]
fn types_that_changed_since_are_reported_by_both_forms() {
    let old = NodeType::new("Lamp", "Lights.").field(Field::new("power", 1.0f64)).field(Field::new("colour", 0i32));
    let new = NodeType::new("Lamp", "Lights.").field(Field::new("power", "none")).field(Field::new("tint", 0i32));
    let mut graph = Graph::new(vec![old]);
    let lamp = graph.create("Lamp").unwrap();
    graph.set_name(lamp, "lamp").unwrap();
    graph.set_named(lamp, "power", 2.5).unwrap();
    graph.set_named(lamp, "colour", 3).unwrap();
    for (bytes, expected) in [
        (
            save::to_text(&graph).into_bytes(),
            [
                "line 8: `lamp.power`: is of type string; this is none: Expected string",
                "line 9: `lamp.colour`: `lamp` (Lamp) has no field `colour`; the value is kept out",
            ],
        ),
        (
            save::to_binary(&graph),
            [
                "`lamp.power`: is of type string; f64 does not convert to it",
                "`lamp.colour`: `lamp` (Lamp) has no field `colour`; the value is kept out",
            ],
        ),
    ] {
        let (loaded, reports) = save::load(bytes, vec![new.clone()]).unwrap();
        assert_eq!(reports.iter().map(|report| report.to_string()).collect::<Vec<_>>(), expected);
        assert!(loaded.find("lamp").is_some());
    }
    let (_, reports) = save::load(save::to_binary(&graph), types()).unwrap();
    assert!(reports[0].to_string().starts_with("`lamp`: there is no node type `Lamp`"), "{}", reports[0]);
}
