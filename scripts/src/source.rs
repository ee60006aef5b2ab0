//! The text of a world: its file with the files it includes, as one text that remembers where each line came from.

use std::path::{Component, Path, PathBuf};

use rhai::Position;

use crate::error::{Problem, ScriptError};

/// rhai counts lines in 16 bits.
const MAX_LINES: usize = 60_000;

/// One text for the parser, and the place of each of its lines.
#[derive(Clone, Debug, Default)]
pub(crate) struct Source {
    pub(crate) text: String,
    names: Vec<String>,
    lines: Vec<(usize, usize)>,
    /// The files that were read.
    pub(crate) files: Vec<PathBuf>,
}

impl Source {
    /// Reads a file and what it includes from its folder.
    pub(crate) fn read(path: &Path, max_len: usize) -> Result<Self, ScriptError> {
        let text = read_text(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let mut source = Self { files: vec![path.to_path_buf()], ..Self::default() };
        source.append(&name, &text, folder, max_len)?;
        Ok(source)
    }

    /// Takes a text; what it includes is read from `folder`.
    pub(crate) fn from_text(name: &str, text: &str, folder: &Path, max_len: usize) -> Result<Self, ScriptError> {
        let mut source = Self::default();
        source.append(name, text, folder, max_len)?;
        Ok(source)
    }

    fn append(&mut self, name: &str, text: &str, folder: &Path, max_len: usize) -> Result<(), ScriptError> {
        let file = self.names.len();
        self.names.push(name.to_string());
        for (index, line) in text.lines().enumerate() {
            if self.text.len() + line.len() > max_len || self.lines.len() >= MAX_LINES {
                let message = format!("the world has more than {max_len} bytes or {MAX_LINES} lines of script");
                return Err(self.problem(file, index + 1, 1, message));
            }
            match included(line) {
                None => {
                    self.text.push_str(line);
                    self.text.push('\n');
                    self.lines.push((file, index + 1));
                }
                Some(Err(message)) => return Err(self.problem(file, index + 1, 1, message.to_string())),
                Some(Ok(part)) => self.include(part, folder, max_len, (file, index + 1))?,
            }
        }
        Ok(())
    }

    /// Adds what was typed at a console, so that its places are known; the text goes to the parser by another way.
    pub(crate) fn append_console(&mut self, text: &str, max_len: usize) -> Result<(), Problem> {
        let included = text.lines().any(|line| included(line).is_some());
        let result = match included {
            true => Err(self.problem(0, 0, 0, "include works in files only".into())),
            false => self.append("console", text, Path::new(""), max_len),
        };
        result.map_err(|error| match error {
            ScriptError::Script(problem) => problem,
            ScriptError::Unreadable { .. } | ScriptError::Save { .. } => unreachable!("a console reads no files"),
        })
    }

    /// Each file once: what it defines is there from its first include on.
    fn include(&mut self, part: &str, folder: &Path, max_len: usize, place: (usize, usize)) -> Result<(), ScriptError> {
        let path = below(folder, part).map_err(|message| self.problem(place.0, place.1, 9, message))?;
        if self.files.contains(&path) || self.names[0] == part {
            return Ok(());
        }
        let text = read_text(&path).map_err(|e| self.problem(place.0, place.1, 9, e.to_string()))?;
        self.files.push(path);
        self.append(part, &text, folder, max_len)
    }

    fn problem(&self, file: usize, line: usize, column: usize, message: String) -> ScriptError {
        let file = self.names.get(file).cloned().unwrap_or_default();
        Problem { message, file, line, column, node: None, field: None, calls: Vec::new() }.into()
    }

    /// File, line and column of a place in the text; line 0 where there is none.
    pub(crate) fn place(&self, position: Position) -> (String, usize, usize) {
        let place = position.line().and_then(|line| self.lines.get(line.saturating_sub(1)));
        match place {
            Some((file, line)) => (self.names[*file].clone(), *line, self.name_after_dot(position)),
            None => (self.names.first().cloned().unwrap_or_default(), 0, 0),
        }
    }
}

impl Source {
    /// The column; that of the name where rhai tells that of the dot before it.
    fn name_after_dot(&self, position: Position) -> usize {
        let column = position.position().unwrap_or(0);
        let line = self.text.lines().nth(position.line().unwrap_or(0).saturating_sub(1)).unwrap_or("");
        let mut from_there = line.chars().skip(column.saturating_sub(1));
        let before_name = from_there.next() == Some('.') && from_there.next().is_some_and(char::is_alphabetic);
        column + usize::from(before_name)
    }
}

/// The file that a line includes: `include("part.rhai");` at the very start of a line.
fn included(line: &str) -> Option<Result<&str, &'static str>> {
    let rest = line.strip_prefix("include(")?.trim_start();
    let parts = rest.strip_prefix('"').and_then(|rest| rest.split_once('"'));
    let Some((path, rest)) = parts else { return Some(Err("include takes the name of a file in quotes")) };
    let rest = rest.trim_start().strip_prefix(')').map(|rest| rest.trim_start().trim_start_matches(';').trim_start());
    match rest {
        Some(rest) if rest.is_empty() || rest.starts_with("//") => Some(Ok(path)),
        _ => Some(Err("include stands on a line of its own: include(\"part.rhai\");")),
    }
}

fn read_text(path: &Path) -> Result<String, ScriptError> {
    let text = std::fs::read_to_string(path);
    let text = text.map_err(|e| ScriptError::Unreadable { path: path.to_path_buf(), reason: e.to_string() })?;
    // Some editors begin a file with a byte-order mark.
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// A file below a folder: no absolute paths, none that lead out of it, not even through links.
pub(crate) fn below(folder: &Path, path: &str) -> Result<PathBuf, String> {
    let relative = Path::new(path);
    if relative.components().any(|c| !matches!(c, Component::Normal(_) | Component::CurDir)) || path.is_empty() {
        return Err(format!("\"{path}\" leads out of the world's folder"));
    }
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let joined = folder.join(relative);
    if let (Ok(root), Ok(real)) = (folder.canonicalize(), joined.canonicalize())
        && !real.starts_with(&root)
    {
        return Err(format!("\"{path}\" leads out of the world's folder"));
    }
    Ok(joined)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn include_lines() {
        for (line, expected) in [
            ("include(\"part.rhai\");", Some(Ok("part.rhai"))),
            ("include( \"a b.rhai\" )  // all walls", Some(Ok("a b.rhai"))),
            ("include(part);", Some(Err("quotes"))),
            ("include(\"a\"); let x = 1;", Some(Err("line of its own"))),
            (" include(\"a\");", None),
            ("let x = include;", None),
        ] {
            match (included(line), expected) {
                (None, None) => {}
                (Some(Ok(a)), Some(Ok(b))) => assert_eq!(a, b, "{line}"),
                (Some(Err(a)), Some(Err(b))) => assert!(a.contains(b), "{line}: {a}"),
                (got, want) => panic!("{line}: {got:?}, not {want:?}"),
            }
        }
    }

    #[test]
    fn paths_stay_below() {
        for path in ["../x", "/etc/passwd", "a/../../x", ""] {
            assert!(below(Path::new("."), path).is_err(), "{path}");
        }
        assert!(below(Path::new("."), "models/./a.gltf").is_ok());
    }
}
