//! Node types that a world defines, from nothing or on top of another type.

use rhai::{Dynamic, FnPtr, Map, NativeCallContext, Position};
use umbriel_fields::{Evaluator, Field, Mode, NodeType, Value};

use super::Words;
use super::declare::declared;
use crate::definition::Definition;
use crate::error::{Fault, Outcome, fail, hint};
use crate::stage::{Handler, Node, Stage};
use crate::values::{show, to_value};

pub(super) fn teach(words: &mut Words<'_>) {
    let stage = words.stage.clone();
    words.word(
        "define(type: string, parts: map)",
        "A node type of your own. `fields` gives names and first values; `evaluate: |me, time|` runs in each frame in which one of \
         the fields was written, or in every frame with `always: true`; `changed: #{ field: |me, value| }` runs when a field changed; \
         `extends: \"Transform\"` begins with the fields and the behaviour of another type; `doc` says what it is; with `local: true` its \
         nodes stay in this application.",
        move |context: NativeCallContext<'_>, name: &str, parts: Map| define(&stage, name, &parts, context.call_position()),
    );
    let stage = words.stage.clone();
    words.word(
        "evaluate_base(me: Node, time: number)",
        "Within an `evaluate`: does what `evaluate` of the type does that this one extends.",
        move |context: NativeCallContext<'_>, me: Node, time: Dynamic| evaluate_base(&stage, &context, me, time),
    );
}

const PARTS: [&str; 7] = ["fields", "evaluate", "changed", "always", "doc", "extends", "local"];

fn define(stage: &Stage, name: &str, parts: &Map, place: Position) -> Outcome<()> {
    stage.may_change()?;
    let handler = |part: &str, given: &Dynamic| function(name, part, given).map(|call| Handler { call, place });
    if let Some(unknown) = parts.keys().find(|key| !PARTS.contains(&key.as_str())) {
        return fail(format!("define has no part `{unknown}`; it takes {}", PARTS.join(", ")));
    }
    let base = parts.get("extends").map(|base| base_type(stage, name, base)).transpose()?;
    let mut definition = base.as_ref().map_or_else(Definition::default, |base| Definition::on(stage, base));
    definition.evaluate = parts.get("evaluate").map(|f| handler("evaluate", f)).transpose()?;
    if let Some(always) = parts.get("always") {
        definition.always = always.as_bool() == Ok(true);
    }
    if let Some(local) = parts.get("local") {
        definition.local = local.as_bool() == Ok(true);
    }
    let own = map_of(parts, "fields")?;
    let mut fields = base.as_ref().map(|base| base.fields.clone()).unwrap_or_default();
    for (field, given) in &own {
        add(&mut fields, &mut definition, name, field, given)?;
    }
    let doc = parts.get("doc").map(ToString::to_string).unwrap_or_default();
    let mut node_type = NodeType::new(name, doc).fields(fields);
    if definition.is_evaluated(stage) && definition.native.is_none() {
        node_type = node_type.host_evaluated();
        node_type.mode = if definition.always { Mode::Always } else { Mode::OnChange };
    }
    for (field, f) in &map_of(parts, "changed")? {
        let Some(known) = node_type.field_named(field) else {
            return fail(format!("{name} has no field `{field}` to watch{}", hint(field, own.keys().map(|k| k.as_str()))));
        };
        definition.changed.retain(|(other, _)| **other != *known.name);
        definition.changed.push((known.name.to_string(), handler(field, f)?));
    }
    let registered = stage.read(|graph| graph.types().register(node_type)).map_err(|e| Fault::new(e.to_string()))?;
    stage.definitions.borrow_mut().insert(registered.name.to_string(), definition);
    Ok(())
}

fn base_type(stage: &Stage, name: &str, given: &Dynamic) -> Outcome<std::sync::Arc<NodeType>> {
    let base = given.to_string();
    let base = stage.read(|graph| graph.types().get(&base)).map_err(|e| Fault::new(format!("{name} cannot extend it: {e}")))?;
    let of_a_script = stage.definitions.borrow().contains_key(&*base.name);
    match base.evaluator {
        Evaluator::Host if !of_a_script => fail(format!("{name} cannot extend {}: that is made by other means", base.name)),
        _ => Ok(base),
    }
}

/// A new field, or another first value for one of the base.
fn add(fields: &mut Vec<Field>, definition: &mut Definition, owner: &str, name: &str, given: &Dynamic) -> Outcome<()> {
    let wrong = |why: String| Fault::new(format!("field `{name}` of {owner}: {why}"));
    let canonical = umbriel_fields::canonical(name);
    let Some(place) = fields.iter().position(|field| field.is_named(&canonical)) else {
        let field = declared(name, given).map_err(wrong)?;
        definition.own_fields.push(field.clone());
        fields.push(field);
        return Ok(());
    };
    let known = &mut fields[place];
    let value = match declared(name, given) {
        Ok(field) if field.field_type == known.field_type && field.choices == known.choices => field.default,
        _ => to_value(given, known.field_type).map_err(wrong)?,
    };
    let value = match &value {
        Value::String(text) if !known.choices.is_empty() => {
            let choice = known.choice_value(text).map(Value::from);
            choice.ok_or_else(|| wrong(format!("\"{text}\" is none of {}", known.choices.join(", "))))?
        }
        _ => value,
    };
    known.default = value.clone();
    let (known, own) = (known.name.clone(), definition.own_fields.iter_mut().find(|field| field.is_named(&canonical)));
    match own {
        Some(own) => own.default = value,
        None => definition.defaults.push((known, value)),
    }
    Ok(())
}

/// Goes on with the next `evaluate` up the chain of types; which one runs now is known to the stage.
fn evaluate_base(stage: &Stage, context: &NativeCallContext<'_>, me: Node, time: Dynamic) -> Outcome<()> {
    let running = stage.evaluating.borrow().last().cloned();
    let Some((_, level)) = running.filter(|(node, _)| *node == me) else {
        return fail("evaluate_base works within the evaluate of a node type, with its own node");
    };
    let Some((base, handler)) = stage.evaluate_above(&level) else {
        return fail(format!("{level} extends no type with an evaluate of its own"));
    };
    stage.evaluating.borrow_mut().push((me, base));
    let result = handler.call.call_within_context::<Dynamic>(context, (me, time));
    stage.evaluating.borrow_mut().pop();
    result.map(drop)
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
