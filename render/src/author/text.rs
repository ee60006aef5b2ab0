//! The text of a shader as words, for what is decided before and after parsing.

/// Longest text, bytes.
pub(crate) const MAX_BYTES: usize = 64 << 10;
/// Deepest nesting of brackets of all kinds.
pub(crate) const MAX_NESTING: usize = 64;
/// Most words between two of `, ; { }`: parsers walk a chain of operators by calling themselves.
pub(crate) const MAX_CHAIN: usize = 1_000;
/// Most `else` in a function, for the same reason.
pub(crate) const MAX_ELSE: usize = 200;

/// A word of the text: a name, a number, or one other character; with its place in bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Word<'a> {
    pub(crate) at: usize,
    pub(crate) text: &'a str,
}

/// All words without comments and spaces.
pub(crate) fn words(text: &str) -> Vec<Word<'_>> {
    let mut words = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            comment_length(rest)
        } else if c.is_alphanumeric() || c == '_' {
            rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len())
        } else {
            c.len_utf8()
        };
        if !c.is_whitespace() && !rest.starts_with("//") && !rest.starts_with("/*") {
            words.push(Word { at, text: &rest[..length] });
        }
        at += length;
    }
    words
}

/// Block comments nest in WGSL.
fn comment_length(rest: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        let here = &rest.as_bytes()[at..];
        let step = match here {
            [b'/', b'*', ..] => {
                depth += 1;
                2
            }
            [b'*', b'/', ..] => {
                depth -= 1;
                2
            }
            _ => 1,
        };
        at += step;
        if depth == 0 {
            break;
        }
    }
    at
}

/// Line and column of a place, from 1.
pub(crate) fn place(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..text.floor_char_boundary(at)];
    let line = before.matches('\n').count() + 1;
    (line, before.len() - before.rfind('\n').map_or(0, |n| n + 1) + 1)
}

/// What no parser should be given: place and reason.
pub(crate) fn too_much(text: &str) -> Option<(usize, String)> {
    if text.len() > MAX_BYTES {
        return Some((0, format!("it has {} bytes; a shader may have {MAX_BYTES}", text.len())));
    }
    let (mut depth, mut chain, mut elses) = (0usize, 0, 0);
    for word in words(text) {
        chain += 1;
        match word.text {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth = depth.saturating_sub(1),
            "else" => elses += 1,
            "fn" => elses = 0,
            _ => {}
        }
        if matches!(word.text, "," | ";" | "{" | "}") {
            chain = 0;
        }
        let problem = if depth > MAX_NESTING {
            format!("it is nested deeper than {MAX_NESTING}")
        } else if chain > MAX_CHAIN {
            format!("an expression has more than {MAX_CHAIN} words")
        } else if elses > MAX_ELSE {
            format!("a function has more than {MAX_ELSE} `else`")
        } else {
            continue;
        };
        return Some((word.at, problem));
    }
    None
}

/// The text with `step` at the start of every loop's body, on the line where it begins; `step` is given the name of the
/// function around it.
pub(crate) fn with_loops_counted(text: &str, step: impl Fn(&str) -> String) -> String {
    let mut counted = String::with_capacity(text.len());
    let (mut function, mut copied) = ("", 0);
    // Depth of round brackets behind `for`, `while` or `loop`, until its body begins.
    let mut head: Option<usize> = None;
    let words = words(text);
    for (i, word) in words.iter().enumerate() {
        match (word.text, &mut head) {
            ("fn", _) => function = words.get(i + 1).map_or("", |w| w.text),
            ("for" | "while" | "loop", _) => head = Some(0),
            ("(", Some(depth)) => *depth += 1,
            (")", Some(depth)) => *depth = depth.saturating_sub(1),
            ("{", Some(0)) => {
                counted.push_str(&text[copied..=word.at]);
                counted.push_str(&step(function));
                (head, copied) = (None, word.at + 1);
            }
            _ => {}
        }
    }
    counted.push_str(&text[copied..]);
    counted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_are_found() {
        let rows = [
            ("fn f() { loop { break; } }", "fn f() { loop {[f] break; } }"),
            ("fn g() {\n  for (var i = 0; i < 3; i++) { x(); }\n}", "fn g() {\n  for (var i = 0; i < 3; i++) {[g] x(); }\n}"),
            ("fn h() { while (a < (b)) { } }", "fn h() { while (a < (b)) {[h] } }"),
            ("fn i() { while a { loop { if b { break; } } } }", "fn i() { while a {[i] loop {[i] if b { break; } } } }"),
            (
                "// loop { /*\nfn j() { /* for { /* */ { */ let forest = 1; }",
                "// loop { /*\nfn j() { /* for { /* */ { */ let forest = 1; }",
            ),
        ];
        for (text, expected) in rows {
            assert_eq!(with_loops_counted(text, |f| format!("[{f}]")), expected);
        }
    }

    #[test]
    fn what_is_too_much() {
        let rows: [(String, &str); 7] = [
            ("fn a() {}".into(), ""),
            (format!("let p = array({});", "vec3f(0.1, 0.2, 0.3), ".repeat(500)), ""),
            (" ".repeat(MAX_BYTES + 1), "bytes"),
            ("(".repeat(100), "nested"),
            (format!("x = {}1;", "1 + ".repeat(1000)), "words"),
            (format!("if a {{}} {}", "else if b {} ".repeat(300)), "else"),
            (format!("fn f() {{{}}} fn g() {{{}}}", "if a {} else {} ".repeat(150), "if a {} else {} ".repeat(150)), ""),
        ];
        for (text, expected) in rows {
            let found = too_much(&text).map_or(String::new(), |(_, why)| why);
            assert!(found.contains(expected) && found.is_empty() == expected.is_empty(), "{found}, not {expected}");
        }
    }

    #[test]
    fn places_count_from_one() {
        for (at, expected) in [(0, (1, 1)), (2, (1, 3)), (3, (2, 1)), (5, (2, 3))] {
            assert_eq!(place("ab\ncde", at), expected);
        }
    }
}
