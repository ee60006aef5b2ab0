//! Reads bytes. Nothing is believed: lengths are checked against what is there before anything is made of them.

use serde::de::DeserializeOwned;

use super::SaveError;
use super::binary::{
    DataRecord, HEAD, IMAGES, ImageRecord, MAGIC, NODES, NodeRecord, ROUTES, RouteRecord, WAITING, WaitingRecord, checksum,
};
use super::parsed::{Data, Parsed, ParsedField, ParsedNode, ParsedRoute, ParsedWaiting, image};
use crate::codec::Ref;

fn damaged(fault: impl Into<String>) -> SaveError {
    SaveError::Damaged { fault: fault.into() }
}

pub(super) fn read(data: &[u8]) -> Result<Parsed<'static>, SaveError> {
    let Some((head, mut body)) = data.split_at_checked(HEAD) else {
        return Err(damaged(format!("it ends after {} bytes, within its head", data.len())));
    };
    if head[..8] != MAGIC {
        return Err(damaged("its first bytes were changed, as by a transfer as text"));
    }
    let (major, minor) = (u16::from_le_bytes([head[8], head[9]]), u16::from_le_bytes([head[10], head[11]]));
    if major != super::MAJOR {
        return Err(SaveError::WrongVersion { major, minor });
    }
    if checksum(major, minor, body).to_le_bytes() != head[12..] {
        return Err(damaged("the checksum does not fit; bytes are missing or changed"));
    }
    let mut parsed = Parsed::default();
    parsed.check_minor(minor);
    while let Some((tag, rest)) = body.split_first() {
        let (section, rest) = cut(rest)?;
        match *tag {
            NODES => each(section, &mut parsed, node)?,
            ROUTES => each(section, &mut parsed, |parsed, record| parsed.routes.push(route(record)))?,
            WAITING => {
                parsed.waiting.get_or_insert_default();
                each(section, &mut parsed, |parsed, record: WaitingRecord| {
                    let waiting = ParsedWaiting { line: None, node: Ref::Number(record.node), field: record.field };
                    parsed.waiting.get_or_insert_default().push(waiting);
                })?;
            }
            IMAGES => each(section, &mut parsed, picture)?,
            other => {
                parsed.report(None, "", None, format!("section {other} is unknown; its {} bytes are kept out", section.len()));
            }
        }
        body = rest;
    }
    Ok(parsed)
}

/// A length and as many bytes, and what follows.
fn cut(bytes: &[u8]) -> Result<(&[u8], &[u8]), SaveError> {
    let (length, rest) = bytes.split_first_chunk::<8>().ok_or_else(|| damaged("it ends within a length"))?;
    let length = u64::from_le_bytes(*length);
    let cut = usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length));
    cut.ok_or_else(|| damaged(format!("{length} bytes are announced, {} are there", rest.len())))
}

fn each<T: DeserializeOwned>(
    mut section: &[u8],
    parsed: &mut Parsed<'static>,
    mut take: impl FnMut(&mut Parsed<'static>, T),
) -> Result<(), SaveError> {
    let mut longer = 0;
    while !section.is_empty() {
        let (record, rest) = cut(section)?;
        let (record, unread) = postcard::take_from_bytes(record).map_err(|error| damaged(format!("a record: {error}")))?;
        longer += usize::from(!unread.is_empty());
        take(parsed, record);
        section = rest;
    }
    if longer > 0 {
        parsed.report(None, "", None, format!("{longer} records hold more than this version knows; that is kept out"));
    }
    Ok(())
}

fn data(record: DataRecord) -> Data<'static> {
    Data::Bytes { field_type: record.field_type, bytes: record.bytes }
}

fn node(parsed: &mut Parsed<'static>, record: NodeRecord) {
    let id = match record.name.as_str() {
        name if name.is_empty() || name.starts_with('#') => format!("#{}", parsed.nodes.len() + 1),
        name => name.into(),
    };
    parsed.nodes.push(ParsedNode {
        line: None,
        id,
        name: record.name,
        type_name: record.type_name,
        mode: record.mode,
        fields: record.fields.into_iter().map(|(name, record)| (name, data(record))).collect(),
        dynamic: record
            .dynamic
            .into_iter()
            .map(|record| ParsedField {
                line: None,
                declaration: record.declaration,
                default: Some(data(record.default)),
                value: Some(data(record.value)),
            })
            .collect(),
    });
}

fn route(record: RouteRecord) -> ParsedRoute<'static> {
    let end = |(node, field)| (Ref::Number(node), field);
    let (from, to) = (end(record.from), end(record.to));
    ParsedRoute { line: None, from, to, weak: record.weak, carries: record.carries.map(data) }
}

fn picture(parsed: &mut Parsed<'static>, record: ImageRecord) {
    let id = format!("image{}", parsed.images.len() + 1);
    let made = image(record.width, record.height, &record.rgba);
    if let Err(fault) = &made {
        parsed.report(None, &id, None, fault.clone());
    }
    parsed.images.push((id, made.ok()));
}
