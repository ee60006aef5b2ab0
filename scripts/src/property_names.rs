//! Words of the language as names of fields: `clock.loop = true`, `#{ loop: true }`.
//!
//! rhai's parser wants an identifier after a dot and before the colon of a map's entry. Words of the language cannot
//! stand there with their own meaning, so turning them into identifiers changes no correct script.

use std::cell::RefCell;

use rhai::{Identifier, Token};

/// Follows the tokens of one script; `begin` before each.
#[derive(Default)]
pub(crate) struct PropertyNames {
    state: RefCell<State>,
}

#[derive(Default)]
struct State {
    /// Brackets that are open; true for those of maps.
    open: Vec<bool>,
    before: Before,
}

#[derive(Default, Clone, Copy, PartialEq)]
enum Before {
    Dot,
    MapEntry,
    #[default]
    Other,
}

impl PropertyNames {
    pub(crate) fn begin(&self) {
        *self.state.borrow_mut() = State::default();
    }

    pub(crate) fn map(&self, token: Token) -> Token {
        let state = &mut *self.state.borrow_mut();
        let token = match (state.before, word(&token)) {
            (Before::Dot | Before::MapEntry, Some(word)) => Token::Identifier(Box::new(Identifier::from(word))),
            _ => token,
        };
        match &token {
            Token::MapStart => state.open.push(true),
            Token::LeftBrace | Token::LeftParen | Token::LeftBracket => state.open.push(false),
            Token::RightBrace | Token::RightParen | Token::RightBracket => drop(state.open.pop()),
            _ => {}
        }
        state.before = match &token {
            Token::Period | Token::Elvis => Before::Dot,
            Token::MapStart => Before::MapEntry,
            Token::Comma if state.open.last() == Some(&true) => Before::MapEntry,
            _ => Before::Other,
        };
        token
    }
}

/// The spelling of a word of the language that is no identifier, but could be a field's name. What can be called in
/// method style (`call`, `curry`, ...) keeps its meaning.
fn word(token: &Token) -> Option<String> {
    let spelling = match token {
        Token::Reserved(word) if !matches!(word.as_str(), "call" | "curry" | "is_shared" | "type_of") => word.to_string(),
        token if token.is_literal() => token.literal_syntax().to_string(),
        _ => return None,
    };
    spelling.chars().all(|c| c.is_ascii_alphanumeric() || c == '_').then_some(spelling)
}
