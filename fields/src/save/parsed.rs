//! A file that was read but not yet understood: what either form comes down to.

use std::sync::Arc;

use super::Report;
use crate::codec::{PlainField, Ref, from_bytes, from_ron};
use crate::{Field, Image, Value, converts};

/// A value in a file. What it is, the field's declaration says.
pub(super) enum Data<'a> {
    Text { text: &'a str, line: usize },
    Bytes { field_type: String, bytes: Vec<u8> },
}

impl Data<'_> {
    pub(super) fn line(&self) -> Option<usize> {
        match self {
            Data::Text { line, .. } => Some(*line),
            Data::Bytes { .. } => None,
        }
    }

    /// The value for a field; the error is a line and what is wrong.
    pub(super) fn value(&self, field: &Field, find: &mut dyn crate::codec::Find) -> Result<Value, (Option<usize>, String)> {
        match self {
            Data::Text { text, line } => from_ron(text, field, find).map_err(|(further, fault)| {
                let message = format!("is of type {}; this is none: {fault}", field.field_type);
                let is_choice = fault.starts_with("takes one of");
                (Some(line + further), if is_choice { fault } else { message })
            }),
            Data::Bytes { field_type, bytes } => {
                let plain = |message: String| (None, message);
                let expected = field.field_type;
                let Some(found) = crate::codec::field_type_named(field_type) else {
                    return Err(plain(format!("holds a value of the unknown type `{field_type}`")));
                };
                if !converts(found, expected) || found != expected && found.kind == crate::Kind::Enum {
                    return Err(plain(format!("is of type {expected}; {found} does not convert to it")));
                }
                let value = from_bytes(bytes, found, field, find).map_err(plain)?;
                value.convert(expected).ok_or_else(|| plain(format!("is of type {expected}; {found} does not convert to it")))
            }
        }
    }
}

pub(super) struct ParsedNode<'a> {
    pub(super) line: Option<usize>,
    /// What the file calls it.
    pub(super) id: String,
    pub(super) name: String,
    pub(super) type_name: String,
    pub(super) mode: Option<String>,
    pub(super) fields: Vec<(String, Data<'a>)>,
    pub(super) dynamic: Vec<ParsedField<'a>>,
}

pub(super) struct ParsedField<'a> {
    pub(super) line: Option<usize>,
    /// Its `default` is not used.
    pub(super) declaration: PlainField,
    pub(super) default: Option<Data<'a>>,
    pub(super) value: Option<Data<'a>>,
}

pub(super) struct ParsedRoute<'a> {
    pub(super) line: Option<usize>,
    pub(super) from: (Ref, String),
    pub(super) to: (Ref, String),
    pub(super) weak: bool,
    pub(super) carries: Option<Data<'a>>,
}

/// A node, or one of its fields, that waits for the next frame.
pub(super) struct ParsedWaiting {
    pub(super) line: Option<usize>,
    pub(super) node: Ref,
    pub(super) field: Option<String>,
}

#[derive(Default)]
pub(super) struct Parsed<'a> {
    pub(super) nodes: Vec<ParsedNode<'a>>,
    /// None where the picture was unfit, which is reported.
    pub(super) images: Vec<(String, Option<Arc<Image>>)>,
    pub(super) routes: Vec<ParsedRoute<'a>>,
    /// Without it all nodes are as new: the next frame hears of everything.
    pub(super) waiting: Option<Vec<ParsedWaiting>>,
    pub(super) reports: Vec<Report>,
}

impl Parsed<'_> {
    pub(super) fn report(&mut self, line: Option<usize>, node: &str, field: Option<&str>, message: impl Into<String>) {
        self.reports.push(Report { line, node: node.into(), field: field.map(String::from), message: message.into() });
    }

    /// Says that the file is of a later version, if it is.
    pub(super) fn check_minor(&mut self, minor: u16) {
        if minor > super::MINOR {
            let (major, known) = (super::MAJOR, super::MINOR);
            let message = format!("written as version {major}.{minor}; what version {major}.{known} does not know is kept out");
            self.report(None, "", None, message);
        }
    }
}

/// A picture from its parts; the error says why it is none.
pub(super) fn image(width: u32, height: u32, rgba: &[u8]) -> Result<Arc<Image>, String> {
    let expected = 4 * width as u128 * height as u128;
    if rgba.len() as u128 != expected {
        return Err(format!("a picture of {width} x {height} has {expected} bytes, not {}", rgba.len()));
    }
    Ok(Arc::new(Image { width, height, rgba: rgba.into() }))
}
