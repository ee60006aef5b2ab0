//! Node types that a world defines.

use rhai::{Dynamic, FnPtr, Map, NativeCallContext, Position};
use umbriel_fields::{Field, FieldType, Kind, NodeType};

use super::Words;
use crate::error::{Fault, Outcome, fail, hint};
use crate::stage::{Definition, Handler, Stage};
use crate::values::{EmptyList, natural, show};

pub(super) fn teach(words: &mut Words<'_>) {
    words.engine.register_type_with_name::<EmptyList>("List");
    let stage = words.stage.clone();
    words.word(
        "define(type: string, parts: map)",
        "A node type of your own. `fields` gives names and first values; `evaluate: |me, time|` runs in each frame in which one of \
         the fields was written, or in every frame with `always: true`; `changed: #{ field: |me, value| }` runs when a field changed.",
        move |context: NativeCallContext<'_>, name: &str, parts: Map| define(&stage, name, &parts, context.call_position()),
    );
    words.word(
        "list(kind: string) -> list",
        "An empty list of a kind, as first value of a field: `list(\"vec3\")`.",
        |kind: &str| -> Outcome<EmptyList> {
            match Kind::ALL.iter().find(|known| known.name() == kind) {
                Some(kind) => Ok(EmptyList(*kind)),
                None => fail(format!("there is no kind of value `{kind}`{}", hint(kind, Kind::ALL.iter().map(|k| k.name())))),
            }
        },
    );
}

const PARTS: [&str; 5] = ["fields", "evaluate", "changed", "always", "doc"];

fn define(stage: &Stage, name: &str, parts: &Map, place: Position) -> Outcome<()> {
    let handler = |part: &str, given: &Dynamic| function(name, part, given).map(|call| Handler { call, place });
    if let Some(unknown) = parts.keys().find(|key| !PARTS.contains(&key.as_str())) {
        return fail(format!("define has no part `{unknown}`; it takes {}", PARTS.join(", ")));
    }
    let fields = map_of(parts, "fields")?;
    let changed = map_of(parts, "changed")?;
    let evaluate = parts.get("evaluate").map(|f| handler("evaluate", f)).transpose()?;
    let doc = parts.get("doc").map(ToString::to_string).unwrap_or_default();
    let mut node_type = NodeType::new(name, doc);
    for (field, default) in &fields {
        node_type = node_type.field(declared(name, field, default)?);
    }
    if evaluate.is_some() {
        node_type = node_type.host_evaluated();
        if parts.get("always").is_some_and(|always| always.as_bool() == Ok(true)) {
            node_type = node_type.always_evaluate();
        }
    }
    let changed = changed.iter().map(|(field, f)| Ok((field.to_string(), handler(field, f)?))).collect::<Outcome<Vec<_>>>()?;
    if let Some((field, _)) = changed.iter().find(|(field, _)| node_type.field_index(field).is_none()) {
        return fail(format!("{name} has no field `{field}` to watch{}", hint(field, fields.keys().map(|k| k.as_str()))));
    }
    let registered = stage.read(|graph| graph.types().register(node_type)).map_err(|e| Fault::new(e.to_string()))?;
    stage.definitions.borrow_mut().insert(registered.name.to_string(), Definition { evaluate, changed });
    Ok(())
}

fn map_of(parts: &Map, name: &str) -> Outcome<Map> {
    match parts.get(name) {
        None => Ok(Map::new()),
        Some(given) => match given.read_lock::<Map>() {
            Some(map) => Ok(map.clone()),
            None => fail(format!("`{name}` takes a map such as #{{ speed: 1.0 }}, not {}", show(given))),
        },
    }
}

fn function(type_name: &str, part: &str, given: &Dynamic) -> Outcome<FnPtr> {
    match given.read_lock::<FnPtr>() {
        Some(function) => Ok(function.clone()),
        None => fail(format!("`{part}` of {type_name} takes a function, not {}", show(given))),
    }
}

fn declared(type_name: &str, field: &str, default: &Dynamic) -> Outcome<Field> {
    if default.is_unit() {
        return Ok(Field::of_type(field, FieldType::one(Kind::Node)));
    }
    match natural(default) {
        Ok(value) => Ok(Field::new(field, value)),
        Err(why) => fail(format!("field `{field}` of {type_name}: {why}")),
    }
}
