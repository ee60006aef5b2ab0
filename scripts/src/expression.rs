//! Expression nodes: one field computed from others by a text that is compiled once.
//!
//! An expression sees its inputs and nothing else of the world: no nodes, no handlers. What it depends on is what routes lead to, so its
//! value is never old.

use std::rc::Rc;
use std::sync::Arc;

use rhai::{AST, Dynamic, Engine, EvalAltResult, Map, Scope};
use umbriel_fields::{Field, Graph, NodeId, NodeType, canonical};

use crate::engine::Script;
use crate::error::{Fault, Outcome, hint, inner_of, text_without_place, thrown_text};
use crate::stage::{Node, Stage};
use crate::values::{show, to_value};

/// The name of the node type.
pub(crate) const EXPRESSION: &str = "Expression";
const CODE: &str = "code";
const VALUE: &str = "value";
/// Compiled texts that are kept.
const KEPT: usize = 10_000;

/// The declaration; inputs and value are fields of each node's own.
pub(crate) fn node_type() -> NodeType {
    let code = Field::new(CODE, "")
        .doc("An expression such as `a * 2 + p.x` over the node's other fields; the result goes into `value`.");
    NodeType::new(EXPRESSION, "Computes its field `value` from its other fields by a text, whenever one of them changed.")
        .field(code)
        .host_evaluated()
}

/// What was compiled, by its text.
pub(crate) type Compiled = std::collections::HashMap<Arc<str>, Rc<AST>>;

/// `make("Expression", #{ inputs: #{ a: 1.0 }, value: 0.0, code: "a * 2" })`. Without `value`, its type is that of the first result.
pub(crate) fn make(stage: &Stage, engine: &Engine, parts: &Map) -> Outcome<Node> {
    let node = stage.create(EXPRESSION)?;
    let result = fill(stage, engine, node, parts);
    if result.is_err() {
        stage.delete(node)?;
    }
    result.map(|()| node)
}

fn fill(stage: &Stage, engine: &Engine, node: Node, parts: &Map) -> Outcome<()> {
    let inputs = match parts.get("inputs").map(|inputs| (inputs, inputs.read_lock::<Map>())) {
        None => Map::new(),
        Some((_, Some(inputs))) => inputs.clone(),
        Some((wrong, None)) => {
            return stage
                .fault_at(node, "inputs", format!("`inputs` takes a map such as #{{ a: 1.0 }}, not {}", show(wrong)))
                .throw();
        }
    };
    for (name, value) in &inputs {
        let variable = canonical(name);
        let readable = variable.starts_with(char::is_alphabetic) && engine.compile_expression(&variable).is_ok();
        if !readable {
            return stage.fault_at(node, name, format!("the code cannot read an input that is called `{name}`")).throw();
        }
        stage.add_field(node, name, value)?;
    }
    let other = |name: &str| !["inputs", CODE, VALUE].contains(&name);
    parts.iter().filter(|(name, _)| other(name)).try_for_each(|(name, value)| crate::words::set(stage, node, name, value))?;
    let code = parts.get(CODE).map(ToString::to_string).unwrap_or_default();
    stage.set(node, CODE, &code.clone().into())?;
    let wrong = |error: Box<EvalAltResult>| -> Box<EvalAltResult> {
        let inputs = inputs.keys().map(|name| name.as_str());
        let message = format!("{} has the code `{code}`, {}", stage.label(node), told(&error, inputs));
        stage.fault_at(node, CODE, message).into()
    };
    if !code.trim().is_empty() {
        compiled(stage, engine, &code).map_err(wrong)?;
    }
    match parts.get(VALUE) {
        Some(value) => stage.add_field(node, VALUE, value)?,
        None if code.trim().is_empty() => {
            let message = format!("{} has no `code`, and no `value` that says what it computes", stage.label(node));
            return stage.fault_at(node, CODE, message).throw();
        }
        None => {
            let variables = stage.read(|graph| variables(stage, graph, node.0));
            let mut nothing = Graph::new(Vec::new());
            let first = stage.with(&mut nothing, || run(stage, engine, &code, variables)).map_err(wrong)?;
            stage.add_field(node, VALUE, &first)?;
        }
    }
    Ok(())
}

/// The turn of an Expression: reads inputs, computes, writes `value`.
pub(crate) fn evaluate(script: &Script, graph: &mut Graph, node: NodeId) {
    let stage = &script.stage;
    let Ok(code) = graph.get_named::<Arc<str>>(node, CODE) else { return };
    // A text that failed is tried no more; another one is.
    if code.trim().is_empty() || stage.failed_code.borrow().get(&node) == Some(&code) {
        return;
    }
    let variables = variables(stage, graph, node);
    let inputs: Vec<String> = variables.iter().map(|(name, _)| name.clone()).collect();
    let result = script.within_handler(|engine| run(stage, engine, &code, variables));
    let (field, message) = match result {
        Err(error) => {
            (CODE, format!("{} has the code `{code}`, {}", graph.describe(node), told(&error, inputs.iter().map(String::as_str))))
        }
        Ok(value) => match write(graph, node, &value) {
            Ok(()) => return,
            Err(why) => (VALUE, why),
        },
    };
    let fault = Fault { message: format!("{message}; it is switched off until its code changes"), node: None, field: None };
    let fault = Fault { node: Some(graph.describe(node)), field: Some(field.into()), ..fault };
    let place = stage.made_at(node).unwrap_or(rhai::Position::NONE);
    crate::engine::report(stage, fault, place);
    stage.failed_code.borrow_mut().insert(node, code);
}

fn write(graph: &mut Graph, node: NodeId, value: &Dynamic) -> Result<(), String> {
    let field = graph.field(node, VALUE).map_err(|e| e.to_string())?;
    let wanted = graph.declaration(field).map(|declared| declared.field_type).map_err(|e| e.to_string())?;
    let value = to_value(value, wanted).map_err(|why| format!("{}: {why}", graph.describe_field(field)))?;
    graph.set_value(field, value).map_err(|e| e.to_string())
}

/// The inputs with their values.
fn variables(stage: &Stage, graph: &Graph, node: NodeId) -> Vec<(String, Dynamic)> {
    let inputs = graph.field_ids(node).filter(|(_, declared)| ![CODE, VALUE].contains(&&*declared.name));
    inputs.map(|(field, declared)| (declared.name.to_string(), stage.value_in(graph, field))).collect()
}

fn run(stage: &Stage, engine: &Engine, code: &str, variables: Vec<(String, Dynamic)>) -> Outcome<Dynamic> {
    let ast = compiled(stage, engine, code)?;
    let mut scope = Scope::new();
    for (name, value) in variables {
        scope.push_dynamic(name, value);
    }
    stage.alone(|| engine.eval_ast_with_scope::<Dynamic>(&mut scope, &ast))
}

/// The text as the engine runs it, with the functions of the world; compiled when it is met for the first time.
fn compiled(stage: &Stage, engine: &Engine, code: &str) -> Outcome<Rc<AST>> {
    if let Some(ast) = stage.compiled.borrow().get(code) {
        return Ok(ast.clone());
    }
    stage.property_names.begin();
    let own = engine.compile_expression(code).map_err(Box::<EvalAltResult>::from)?;
    let ast = Rc::new(stage.functions.borrow().merge(&own));
    let mut known = stage.compiled.borrow_mut();
    if known.len() >= KEPT {
        known.clear();
    }
    known.insert(code.into(), ast.clone());
    Ok(ast)
}

/// What is wrong with a text, and in which column.
fn told<'a>(error: &EvalAltResult, inputs: impl IntoIterator<Item = &'a str>) -> String {
    let inner = inner_of(error);
    let message = match inner {
        EvalAltResult::ErrorVariableNotFound(name, _) => format!("there is no input `{name}`{}", hint(name, inputs)),
        EvalAltResult::ErrorFunctionNotFound(signature, _) => format!("there is no function `{}`", signature.replace(" (", "(")),
        EvalAltResult::ErrorRuntime(thrown, _) => thrown_text(thrown).message,
        EvalAltResult::ErrorTerminated(reason, _) => format!("it {reason}"),
        other => text_without_place(other),
    };
    let place = error.position();
    match (place.line(), place.position()) {
        (Some(1), Some(column)) => format!("column {column}: {message}"),
        (Some(line), Some(column)) => format!("line {line}, column {column}: {message}"),
        _ => message,
    }
}
