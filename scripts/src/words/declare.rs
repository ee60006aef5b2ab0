//! Fields that a world declares, with what authors, the inspector and the manual should know of them.

use std::sync::Arc;

use rhai::{Array, Dynamic, ImmutableString, Map};
use umbriel_fields::{Field, FieldType, Kind, SetRule, canonical};

use super::Words;
use crate::error::{Outcome, fail, hint};
use crate::values::{EmptyList, natural, number, show, to_value};

/// What `field` returns; its name comes from where it stands.
#[derive(Clone, Debug)]
pub(crate) struct Declared(Field);

pub(super) fn teach(words: &mut Words<'_>) {
    words.engine.register_type_with_name::<EmptyList>("List").register_type_with_name::<Declared>("Field");
    words.word(
        "field(value: any, about: map) -> Field",
        "The first value of a field, with what is known of the field: `doc`, `unit`, `range: [low, high]`, `type: \"f32\"`, \
         `choices: [\"red\", \"green\"]`, `aliases: [...]`, `event: true` where a write of the same value counts too, and `local: true` where \
         displays in other processes need not know of it.",
        |value: Dynamic, about: Map| field(&value, &about),
    );
    words.word(
        "list(kind: string) -> List",
        "An empty list of a kind, as first value of a field: `list(\"vec3\")`.",
        |name: &str| Ok(EmptyList(kind(name)?)) as Outcome<EmptyList>,
    );
}

/// The field of a name that a script gives by `field(...)`, by a value, or by `()` for a node.
pub(crate) fn declared(name: &str, given: &Dynamic) -> Result<Field, String> {
    let mut field = match given.read_lock::<Declared>() {
        Some(declared) => declared.0.clone(),
        None if given.is_unit() => Field::of_type("field", FieldType::one(Kind::Node)),
        None => Field::new("field", natural(given)?),
    };
    field.name = Arc::from(canonical(name).as_str());
    // Found before any field, so that one of this name could not be reached.
    match &*field.name {
        taken @ ("name" | "type") => Err(format!("every node has a `{taken}` already, which is no field")),
        _ => Ok(field),
    }
}

fn kind(name: &str) -> Outcome<Kind> {
    match Kind::ALL.iter().find(|known| known.name() == name) {
        Some(kind) => Ok(*kind),
        None => fail(format!("there is no kind of value `{name}`{}", hint(name, Kind::ALL.iter().map(|k| k.name())))),
    }
}

const ABOUT: [&str; 8] = ["doc", "unit", "range", "type", "choices", "aliases", "event", "local"];

fn field(value: &Dynamic, about: &Map) -> Outcome<Declared> {
    if let Some(unknown) = about.keys().find(|key| !ABOUT.contains(&key.as_str())) {
        return fail(format!("a field has no `{unknown}`{}; it takes {}", hint(unknown, ABOUT), ABOUT.join(", ")));
    }
    let mut field = first_value(value, about)?;
    if let Some(doc) = about.get("doc") {
        field = field.doc(text("doc", doc)?.as_str());
    }
    if let Some(unit) = about.get("unit") {
        field = field.unit(text("unit", unit)?.as_str());
    }
    if let Some(range) = about.get("range") {
        let ends: Vec<f64> = range.read_lock::<Array>().map(|ends| ends.iter().filter_map(number).collect()).unwrap_or_default();
        let [low, high] = ends[..] else { return fail(format!("`range` takes [low, high], not {}", show(range))) };
        field = field.range(low, high);
    }
    for alias in about.get("aliases").map(|aliases| texts("aliases", aliases)).transpose()?.unwrap_or_default() {
        field = field.alias(alias.as_str());
    }
    if about.get("event").is_some_and(|event| event.as_bool() == Ok(true)) {
        field = field.on_set(SetRule::Pulse);
    }
    if about.get("local").is_some_and(|local| local.as_bool() == Ok(true)) {
        field = field.local();
    }
    Ok(Declared(field))
}

fn first_value(value: &Dynamic, about: &Map) -> Outcome<Field> {
    if let Some(choices) = about.get("choices") {
        return Ok(Field::choice(
            "field",
            &texts("choices", choices)?,
            text("the value of a field with choices", value)?.as_str(),
        ));
    }
    let found = match about.get("type") {
        Some(name) => {
            let multiple = value.is_array() || value.is::<EmptyList>();
            to_value(value, FieldType { kind: kind(&text("type", name)?)?, multiple })
        }
        None if value.is_unit() => return Ok(Field::of_type("field", FieldType::one(Kind::Node))),
        None => natural(value),
    };
    found.map_or_else(fail, |value| Ok(Field::new("field", value)))
}

fn text(what: &str, given: &Dynamic) -> Outcome<ImmutableString> {
    match given.read_lock::<ImmutableString>() {
        Some(text) => Ok(text.clone()),
        None => fail(format!("{what} takes a text, not {}", show(given))),
    }
}

fn texts(what: &str, given: &Dynamic) -> Outcome<Vec<ImmutableString>> {
    match given.read_lock::<Array>() {
        Some(array) => array.iter().map(|one| text(what, one)).collect(),
        None => fail(format!("{what} takes an array of texts, not {}", show(given))),
    }
}
