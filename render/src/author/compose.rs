//! Joins an author's text with ours.

use super::Param;
use super::check::Checked;
use super::text::with_loops_counted;
use crate::shaders;

/// Operations that the loops of one call may take together; what runs longer ends early.
pub(crate) const LOOP_BUDGET: u64 = 1 << 18;

/// Our functions that an author's text may replace, as text.
fn hooks() -> impl Iterator<Item = (&'static str, &'static str)> {
    let parts = shaders::HOOKS.split("\n\n").filter_map(|part| part.strip_prefix("fn ").map(|rest| (part, rest)));
    parts.map(|(part, rest)| (rest.split('(').next().unwrap_or(rest), part))
}

/// The names of these functions.
pub(crate) fn hook_names() -> impl Iterator<Item = &'static str> {
    hooks().map(|(name, _)| name)
}

/// The standard functions, but those that a text brings itself, and what they need to be called.
pub(crate) fn standard_hooks(own: &[String], params: &[Param]) -> String {
    let is_own = |name: &str| own.iter().any(|o| o == name);
    let mut text: String = hooks().filter(|(name, _)| !is_own(name)).map(|(_, text)| format!("{text}\n")).collect();
    // What is added later was not there when `finish` was called: its share of the finished colour is the difference.
    let addition = match is_own("finish") {
        true => "finish(s, lit).rgb - finish(s, vec3<f32>(0.0)).rgb",
        false => "lit",
    };
    text += &format!("fn finished_addition(s: Surface, lit: vec3<f32>) -> vec3<f32> {{\n    return {addition};\n}}\n");
    text += &declared(params);
    text
}

/// `params`, and what fills it.
pub(crate) fn declared(params: &[Param]) -> String {
    let swizzle = |of_type: &str| match of_type {
        "f32" => ".x",
        "vec2<f32>" => ".xy",
        "vec3<f32>" => ".xyz",
        _ => "",
    };
    let members: String = params.iter().map(|(name, of_type)| format!("    {name}: {of_type},\n")).collect();
    let loads: String = params
        .iter()
        .enumerate()
        .map(|(i, (name, of_type))| format!("    params.{name} = material.params[{i}]{};\n", swizzle(of_type)))
        .collect();
    let declaration = match params.is_empty() {
        true => String::new(),
        false => format!("struct Params {{\n{members}}}\nvar<private> params: Params;\n"),
    };
    format!("{declaration}fn load_params() {{\n{loads}}}\n")
}

/// The whole shader. Loops of the author take turns from a budget, so that every picture ends.
pub(crate) fn whole(author: &str, params: &[Param], checked: &Checked) -> String {
    let before: String = shaders::SURFACE_BEFORE_HOOKS.concat();
    let counted = with_loops_counted(author, |function| {
        let weight = checked.weights.get(function).copied().unwrap_or(1).max(1);
        format!(" if loop_operations > {LOOP_BUDGET}u {{ break; }} loop_operations += {weight}u;")
    });
    let counter = "var<private> loop_operations: u32 = 0u;\n";
    let hooks = standard_hooks(&checked.hooks, params);
    [&before, &hooks, counter, &counted, "\n", shaders::SURFACE_BEHIND_HOOKS].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hooks_are_read_from_their_file() {
        assert_eq!(hook_names().collect::<Vec<_>>(), ["surface", "shade", "ambient", "finish"]);
        let text = standard_hooks(&["shade".into()], &[]);
        assert!(!text.contains("fn shade") && text.contains("fn ambient") && text.contains("return lit;"), "{text}");
        assert!(standard_hooks(&["finish".into()], &[]).contains("finish(s, lit).rgb - "));
    }
}
