//! Writes bytes: magic, version, checksum, then sections of records, each with its length, so that a later minor version may add to them.

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::outline::{Outline, dynamic_fields, own_mode, routes, waiting, written_fields};
use crate::codec::{PlainField, to_bytes};
use crate::{Field, Graph, Value};

/// No text starts like this, and a transfer that changes line ends spoils it.
pub(super) const MAGIC: [u8; 8] = *b"\x89UMBWLD\n";
/// Magic, two numbers of the version, checksum of what follows.
pub(super) const HEAD: usize = 8 + 2 + 2 + 8;

pub(super) const NODES: u8 = 1;
pub(super) const ROUTES: u8 = 2;
pub(super) const WAITING: u8 = 3;
pub(super) const IMAGES: u8 = 4;

#[derive(Serialize, Deserialize)]
pub(super) struct NodeRecord {
    /// Empty for a node without a name.
    pub(super) name: String,
    pub(super) type_name: String,
    pub(super) mode: Option<String>,
    pub(super) fields: Vec<(String, DataRecord)>,
    pub(super) dynamic: Vec<DynamicRecord>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct DataRecord {
    pub(super) field_type: String,
    pub(super) bytes: Vec<u8>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct DynamicRecord {
    pub(super) declaration: PlainField,
    pub(super) default: DataRecord,
    pub(super) value: DataRecord,
}

/// Nodes by their number, from one.
#[derive(Serialize, Deserialize)]
pub(super) struct RouteRecord {
    pub(super) from: (u64, String),
    pub(super) to: (u64, String),
    pub(super) weak: bool,
    pub(super) carries: Option<DataRecord>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct WaitingRecord {
    pub(super) node: u64,
    pub(super) field: Option<String>,
}

#[derive(Serialize, Deserialize)]
pub(super) struct ImageRecord {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) rgba: Vec<u8>,
}

/// Of the body, and of the version that it was written as.
pub(super) fn checksum(major: u16, minor: u16, body: &[u8]) -> u64 {
    xxh3_64_with_seed(body, (major as u64) << 16 | minor as u64)
}

pub(super) fn write(graph: &Graph) -> Vec<u8> {
    let mut outline = Outline::new(graph, false);
    let nodes: Vec<_> = outline.nodes.clone().into_iter().map(|id| node(graph, id, &mut outline)).collect();
    let mut made = Vec::new();
    for (route, carried) in routes(graph) {
        let (Ok(from), Ok(to)) = (graph.declaration(route.from), graph.declaration(route.to)) else { continue };
        let [from_node, to_node] = [route.from.node, route.to.node].map(|node| outline.number(node));
        made.push(RouteRecord {
            from: (from_node, from.name.to_string()),
            to: (to_node, to.name.to_string()),
            weak: route.strength == crate::Strength::Weak,
            carries: carried.map(|value| data(value, from, &mut outline)),
        });
    }
    let wait = |(node, field): (_, Option<&Field>)| WaitingRecord {
        node: outline.number(node),
        field: field.map(|field| field.name.to_string()),
    };
    let waiting: Vec<_> = waiting(graph).into_iter().map(wait).collect();
    let image = |image: &std::sync::Arc<crate::Image>| ImageRecord {
        width: image.width,
        height: image.height,
        rgba: image.rgba.to_vec(),
    };
    let images: Vec<_> = outline.images.iter().map(image).collect();
    let mut body = Vec::new();
    section(&mut body, NODES, &nodes);
    section(&mut body, ROUTES, &made);
    section(&mut body, WAITING, &waiting);
    section(&mut body, IMAGES, &images);
    let mut bytes = MAGIC.to_vec();
    bytes.extend(super::MAJOR.to_le_bytes());
    bytes.extend(super::MINOR.to_le_bytes());
    bytes.extend(checksum(super::MAJOR, super::MINOR, &body).to_le_bytes());
    bytes.extend(body);
    bytes
}

/// Tag, length, then each record with its length.
fn section(body: &mut Vec<u8>, tag: u8, records: &[impl Serialize]) {
    body.push(tag);
    let length_at = body.len();
    body.extend([0; 8]);
    for record in records {
        let bytes = postcard::to_stdvec(record).unwrap_or_default();
        body.extend((bytes.len() as u64).to_le_bytes());
        body.extend(bytes);
    }
    let length = (body.len() - length_at - 8) as u64;
    body[length_at..length_at + 8].copy_from_slice(&length.to_le_bytes());
}

fn data(value: &Value, field: &Field, outline: &mut Outline) -> DataRecord {
    DataRecord { field_type: value.field_type().to_string(), bytes: to_bytes(value, field, outline, Vec::new()) }
}

fn node(graph: &Graph, id: crate::NodeId, outline: &mut Outline) -> NodeRecord {
    let fields = written_fields(graph, id).into_iter();
    let dynamic = dynamic_fields(graph, id);
    NodeRecord {
        name: graph.name(id).unwrap_or_default().into(),
        type_name: graph.type_of(id).name.to_string(),
        mode: own_mode(graph, id).map(String::from),
        fields: fields.map(|(field, value)| (field.name.to_string(), data(&value, field, outline))).collect(),
        dynamic: dynamic
            .into_iter()
            .map(|(field, value)| DynamicRecord {
                declaration: PlainField::without_default(field),
                default: data(&field.default, field, outline),
                value: data(&value, field, outline),
            })
            .collect(),
    }
}
