//! What the tests share.

use umbriel_scripts::World;

/// Loads a text that must be right.
pub(crate) fn world(script: &str) -> World {
    World::load_source("test", script).unwrap_or_else(|error| panic!("{script}\n{error}"))
}

/// The value of an expression in the world of a script.
pub(crate) fn console(script: &str, expression: &str) -> String {
    world(script).console(expression).unwrap_or_else(|problem| panic!("{script}\n{expression}\n{problem}"))
}

/// Compares with the script in the message.
pub(crate) fn expect(value: &str, expected: &str, script: &str) {
    assert_eq!(value, expected, "after {script}");
}

/// The message about a text that must be wrong.
pub(crate) fn error_of(script: &str) -> String {
    match World::load_source("test", script) {
        Ok(_) => panic!("no error from {script}"),
        Err(error) => error.to_string(),
    }
}

/// Problems as texts.
pub(crate) fn problems(world: &mut World) -> Vec<String> {
    world.problems().iter().map(ToString::to_string).collect()
}
