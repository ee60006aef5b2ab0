//! Field containers, routes and their evaluation: what every world, rig and script of Umbriel is made of.
//!
//! A [`Graph`] holds nodes; a node has fields; a route carries the value of a field to another field; once per frame the nodes that
//! were written, or reached by a route, are evaluated, sources first.
//!
//! **The one idea:** every write takes the next [`Revision`]. "Is this node dirty?", "what must a display learn?", "is this GPU buffer
//! stale?", "what goes into the recording?" are one question, was it written after revision N?, and [`Graph::changes_since`] answers it.
//!
//! A node type is declared once ([`NodeType`], [`Field`]); scripts, importers, files and inspectors all read that declaration.
//!
//! This crate knows nothing of 3D, of scripts or of the clock: time comes in with each frame, and what it cannot do
//! itself (script types, callbacks) it asks of a [`Host`]. There is no push on set: a write is a value until the next frame. There are no
//! scans over all nodes: what did not change costs nothing.

mod access;
mod batch;
mod bits;
mod changes;
mod codec;
mod column;
mod convert;
mod copy;
mod costs;
mod dynamic;
mod error;
mod evaluation;
mod explain;
mod field;
mod frame;
mod graph;
mod invariants;
mod kind;
mod names;
mod naming;
mod node_type;
mod nodes;
mod observe;
mod order;
mod program;
mod propagate;
pub mod record;
mod registry;
pub mod replica;
mod route;
pub mod save;
mod schedule;
mod trail;
mod turn;
mod value;
mod why;

pub use changes::{Changes, Revision};
pub use convert::converts;
pub use costs::Cost;
pub use error::Error;
pub use evaluation::Evaluation;
pub use explain::By;
pub use field::{Field, SetRule};
pub use frame::{FrameReport, Host, NoHost, Problem};
pub use graph::{FieldId, Graph, NodeId};
pub use kind::{Color, ColorA, EnumValue, FieldType, Image, Kind, Rotation, Time};
pub use naming::{canonical, nearest};
pub use node_type::{Evaluator, Mode, NodeType};
pub use nodes::builtin_types;
pub use observe::ObserverId;
pub use registry::TypeRegistry;
pub use route::{Endpoint, Route, RouteId, Strength};
pub use value::{FieldValue, Same, Value};
pub use why::Cause;
