//! The node types that worlds' dataflow is made of.

use crate::NodeType;

/// Every node type of this crate, in the order of the manual.
pub fn builtin_types() -> Vec<NodeType> {
    Vec::new()
}
