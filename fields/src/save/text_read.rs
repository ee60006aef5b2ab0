//! Reads text. Every value keeps the place where it stands, so that messages can name the line.

use std::fmt;

use ron::value::RawValue;
use serde::de::{DeserializeOwned, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::SaveError;
use super::parsed::{Data, Parsed, ParsedField, ParsedNode, ParsedRoute, ParsedWaiting, image};
use crate::codec::{PlainField, Ref};
use crate::naming::hint;

/// `(key: value, ...)` or `{"key": value, ...}`, the values not looked into.
struct Block<'a>(Vec<(String, &'a RawValue)>);

impl<'de> Deserialize<'de> for Block<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries;
        impl<'de> Visitor<'de> for Entries {
            type Value = Block<'de>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a block of `name: value`")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Block<'de>, A::Error> {
                let mut entries = Vec::new();
                while let Some(key) = map.next_key::<String>()? {
                    entries.push((key, map.next_value()?));
                }
                Ok(Block(entries))
            }
            fn visit_unit<E>(self) -> Result<Block<'de>, E> {
                Ok(Block(Vec::new()))
            }
        }
        deserializer.deserialize_any(Entries)
    }
}

/// Some editors begin a file with one.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// The text and what was said about it.
struct Reader<'a> {
    text: &'a str,
    /// Where each line starts.
    lines: Vec<usize>,
    parsed: Parsed<'a>,
}

type At<'a> = (&'a str, usize);

pub(super) fn read(text: &str) -> Result<Parsed<'_>, SaveError> {
    let syntax = |error: ron::error::SpannedError| {
        let (start, fault) = (error.span.start, fault_of(&error.code));
        SaveError::Syntax { line: start.line, column: start.col, fault }
    };
    let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(place, _)| place + 1));
    let mut reader = Reader { text, lines: starts.collect(), parsed: Parsed::default() };
    let Block(entries) = ron::from_str(text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text)).map_err(syntax)?;
    let minor = reader.check_head(&entries)?;
    reader.parsed.check_minor(minor);
    for (key, raw) in entries {
        let at = reader.at(raw);
        match key.as_str() {
            "format" | "version" => {}
            "nodes" => reader.list(at).into_iter().for_each(|at| reader.node(at)),
            "routes" => reader.list(at).into_iter().for_each(|at| reader.route(at)),
            "waiting" => {
                let waiting = reader.list(at).into_iter().filter_map(|at| reader.waiting(at)).collect();
                reader.parsed.waiting = Some(waiting);
            }
            "images" => reader.list(at).into_iter().for_each(|at| reader.image(at)),
            other => reader.unknown_key(at, "", other, &["nodes", "routes", "waiting", "images"]),
        }
    }
    Ok(reader.parsed)
}

/// The words of the library, but for those that are meant for programmers.
fn fault_of(error: &ron::Error) -> String {
    match error {
        ron::Error::ExceededRecursionLimit => "the values are nested too deeply".into(),
        error => error.to_string(),
    }
}

impl<'a> Reader<'a> {
    /// Where a value starts, comments before it left out, and in which line.
    fn at(&self, raw: &'a RawValue) -> At<'a> {
        let mut text = raw.get_ron().trim_start();
        while text.starts_with("//") {
            text = text.split_once('\n').map_or("", |(_, rest)| rest).trim_start();
        }
        let place = (text.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        (text, self.lines.partition_point(|start| *start <= place))
    }

    fn check_head(&mut self, entries: &[(String, &'a RawValue)]) -> Result<u16, SaveError> {
        let entry = |key: &str| entries.iter().find(|(other, _)| other == key).map(|(_, raw)| raw.get_ron());
        match entry("format").map(ron::from_str::<String>) {
            Some(Ok(format)) if format == "umbriel-world" => {}
            _ => return Err(SaveError::NotASave { fault: "it does not say `format: \"umbriel-world\"`".into() }),
        }
        match entry("version").map(ron::from_str::<(u16, u16)>) {
            Some(Ok((super::MAJOR, minor))) => Ok(minor),
            Some(Ok((major, minor))) => Err(SaveError::WrongVersion { major, minor }),
            _ => Err(SaveError::NotASave { fault: "it does not say `version: (major, minor)`".into() }),
        }
    }

    fn unknown_key(&mut self, at: At<'_>, node: &str, key: &str, known: &[&str]) {
        let nearest = hint(key, known.iter().copied());
        self.parsed.report(Some(at.1), node, None, format!("nothing here is called `{key}`{nearest}; it is kept out"));
    }

    /// Of two entries of one name the later one counts.
    fn report_twice(&mut self, node: &str, entries: &[(String, At<'_>)]) {
        for (place, (key, (_, line))) in entries.iter().enumerate() {
            if entries[..place].iter().any(|(before, _)| before == key) {
                self.parsed.report(Some(*line), node, None, format!("`{key}` stands here again; the last one counts"));
            }
        }
    }

    /// Something of a known shape, or a report.
    fn read<T: DeserializeOwned>(&mut self, at: At<'a>, node: &str, what: &str) -> Option<T> {
        match ron::from_str(at.0) {
            Ok(value) => Some(value),
            Err(error) => {
                let line = at.1 + error.span.start.line.saturating_sub(1);
                self.parsed.report(Some(line), node, None, format!("`{what}` cannot be read: {}", error.code));
                None
            }
        }
    }

    fn list(&mut self, at: At<'a>) -> Vec<At<'a>> {
        match ron::from_str::<Vec<&'a RawValue>>(at.0) {
            Ok(items) => items.into_iter().map(|raw| self.at(raw)).collect(),
            Err(error) => {
                let line = at.1 + error.span.start.line.saturating_sub(1);
                self.parsed.report(Some(line), "", None, format!("a list `[...]` is expected here: {}", error.code));
                Vec::new()
            }
        }
    }

    fn block(&mut self, at: At<'a>, node: &str) -> Vec<(String, At<'a>)> {
        match ron::from_str::<Block<'a>>(at.0) {
            Ok(Block(entries)) => {
                let entries: Vec<_> = entries.into_iter().map(|(key, raw)| (key, self.at(raw))).collect();
                self.report_twice(node, &entries);
                entries
            }
            Err(error) => {
                let line = at.1 + error.span.start.line.saturating_sub(1);
                self.parsed.report(Some(line), node, None, format!("a block of `name: value` is expected here: {}", error.code));
                Vec::new()
            }
        }
    }

    fn node(&mut self, at: At<'a>) {
        let line = Some(at.1);
        let (id, name, type_name) = Default::default();
        let mut node = ParsedNode { line, id, name, type_name, mode: None, fields: Vec::new(), dynamic: Vec::new() };
        let mut name: Option<String> = None;
        for (key, at) in self.block(at, "") {
            match key.as_str() {
                "id" => node.id = self.read(at, "", "id").unwrap_or_default(),
                "name" => name = self.read(at, &node.id, "name"),
                "type" => node.type_name = self.read(at, &node.id, "type").unwrap_or_default(),
                "mode" => node.mode = self.read(at, &node.id, "mode"),
                "fields" => {
                    let fields = self.block(at, &node.id);
                    node.fields = fields.into_iter().map(|(name, (text, line))| (name, Data::Text { text, line })).collect();
                }
                "dynamic" => {
                    node.dynamic = self.list(at).into_iter().filter_map(|at| self.dynamic_field(at, &node.id)).collect();
                }
                other => self.unknown_key(at, &node.id, other, &["id", "name", "type", "mode", "fields", "dynamic"]),
            }
        }
        let own_name = if node.id.starts_with('#') { String::new() } else { node.id.clone() };
        node.name = name.unwrap_or(own_name);
        self.parsed.nodes.push(node);
    }

    fn dynamic_field(&mut self, at: At<'a>, node: &str) -> Option<ParsedField<'a>> {
        let line = Some(at.1);
        let mut field = ParsedField { line, declaration: PlainField::default(), default: None, value: None };
        for (key, at) in self.block(at, node) {
            let plain = &mut field.declaration;
            let data = Data::Text { text: at.0, line: at.1 };
            match key.as_str() {
                "name" => plain.name = self.read(at, node, "name")?,
                "type" => plain.field_type = self.read(at, node, "type")?,
                "default" => field.default = Some(data),
                "value" => field.value = Some(data),
                "doc" => plain.doc = self.read(at, node, "doc").unwrap_or_default(),
                "unit" => plain.unit = self.read(at, node, "unit").unwrap_or_default(),
                "range" => plain.range = self.read(at, node, "range"),
                "aliases" => plain.aliases = self.read(at, node, "aliases").unwrap_or_default(),
                "choices" => plain.choices = self.read(at, node, "choices").unwrap_or_default(),
                "pulse" => plain.pulse = self.read(at, node, "pulse").unwrap_or_default(),
                "output" => plain.output = self.read(at, node, "output").unwrap_or_default(),
                other => {
                    let known =
                        ["name", "type", "default", "value", "doc", "unit", "range", "aliases", "choices", "pulse", "output"];
                    self.unknown_key(at, node, other, &known);
                }
            }
        }
        Some(field)
    }

    /// `"node.field"`; names of fields have no points.
    fn endpoint(&mut self, at: At<'a>, what: &str) -> Option<(Ref, String)> {
        let text: String = self.read(at, "", what)?;
        match text.rsplit_once('.') {
            Some((node, field)) => Some((Ref::Name(node.into()), field.into())),
            None => {
                self.parsed.report(Some(at.1), "", None, format!("`{text}` is no `node.field`"));
                None
            }
        }
    }

    fn route(&mut self, at: At<'a>) {
        let line = Some(at.1);
        let (mut from, mut to, mut weak, mut carries) = (None, None, false, None);
        for (key, at) in self.block(at, "") {
            match key.as_str() {
                "from" => from = self.endpoint(at, "from"),
                "to" => to = self.endpoint(at, "to"),
                "weak" => weak = self.read(at, "", "weak").unwrap_or_default(),
                "carries" => carries = Some(Data::Text { text: at.0, line: at.1 }),
                other => self.unknown_key(at, "", other, &["from", "to", "weak", "carries"]),
            }
        }
        match (from, to) {
            (Some(from), Some(to)) => self.parsed.routes.push(ParsedRoute { line, from, to, weak, carries }),
            _ => self.parsed.report(line, "", None, "a route needs `from` and `to`; it is kept out"),
        }
    }

    fn waiting(&mut self, at: At<'a>) -> Option<ParsedWaiting> {
        let (node, field) = self.endpoint(at, "waiting")?;
        Some(ParsedWaiting { line: Some(at.1), node, field: Some(field).filter(|field| !field.is_empty()) })
    }

    fn image(&mut self, at: At<'a>) {
        use base64::Engine;
        let (mut id, mut size, mut lines) = (String::new(), (0, 0), Vec::<String>::new());
        for (key, at) in self.block(at, "") {
            match key.as_str() {
                "id" => id = self.read(at, "", "id").unwrap_or_default(),
                "size" => size = self.read(at, "", "size").unwrap_or_default(),
                "rgba" => lines = self.read(at, "", "rgba").unwrap_or_default(),
                other => self.unknown_key(at, "", other, &["id", "size", "rgba"]),
            }
        }
        let decode = |line: &String| base64::engine::general_purpose::STANDARD.decode(line);
        let bytes =
            lines.iter().map(decode).collect::<Result<Vec<_>, _>>().map_err(|error| format!("its base64 is damaged: {error}"));
        let made = bytes.and_then(|bytes| image(size.0, size.1, &bytes.concat()));
        if let Err(fault) = &made {
            self.parsed.report(Some(at.1), &id, None, fault.clone());
        }
        self.parsed.images.push((id, made.ok()));
    }
}
