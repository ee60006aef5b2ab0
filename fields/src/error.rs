//! What can go wrong, in words that a world's author can act on.

use crate::FieldType;

/// An error; the message names node, field, what was expected, and the nearest valid name.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The type's declaration contradicts itself.
    #[error("node type `{node_type}` cannot be used: {fault}")]
    BadType {
        /// Name of the type.
        node_type: String,
        /// What is wrong.
        fault: String,
    },
    /// Two types have one name.
    #[error("node type `{node_type}` cannot be registered: the name `{name}` belongs to `{other}`")]
    DuplicateType {
        /// Name of the new type.
        node_type: String,
        /// The name or alias that is taken.
        name: String,
        /// The type that has it.
        other: String,
    },
    /// No type of that name.
    #[error("there is no node type `{name}`{hint}")]
    UnknownType {
        /// The name asked for.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// The node was deleted, or belongs to another graph.
    #[error("the node does not exist any more")]
    DeadNode,
    /// The dynamic field was removed, or the index never existed.
    #[error("{node} has no field number {index}; it was removed or belongs to another node")]
    DeadField {
        /// Name and type of the node.
        node: String,
        /// The index asked for.
        index: u16,
    },
    /// No field of that name.
    #[error("{node} has no field `{name}`{hint}")]
    UnknownField {
        /// Name and type of the node.
        node: String,
        /// The name asked for.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// The node has such a field already.
    #[error("{node} has a field `{name}` already")]
    DuplicateField {
        /// Name and type of the node.
        node: String,
        /// The name.
        name: String,
    },
    /// A dynamic field cannot be declared like this.
    #[error("the field cannot be added to {node}: {fault}")]
    BadField {
        /// Name and type of the node.
        node: String,
        /// What is wrong.
        fault: String,
    },
    /// A declared field cannot be removed.
    #[error("{field} is declared by the node's type; only dynamic fields can be removed")]
    NotDynamic {
        /// Node and field.
        field: String,
    },
    /// The value has another type, and none that converts.
    #[error("{field} is of type {expected}; {found} does not convert to it")]
    WrongType {
        /// Node and field.
        field: String,
        /// The field's type.
        expected: FieldType,
        /// The type given or asked for.
        found: FieldType,
    },
    /// A number outside of the field's range.
    #[error("{field} takes values from {smallest} to {largest}; {found} is outside")]
    OutOfRange {
        /// Node and field.
        field: String,
        /// Smallest value allowed.
        smallest: f64,
        /// Largest value allowed.
        largest: f64,
        /// The value given.
        found: f64,
    },
    /// Not one of an enum's names.
    #[error("{field} takes one of {choices}; there is no `{found}`{hint}")]
    UnknownChoice {
        /// Node and field.
        field: String,
        /// All valid names.
        choices: String,
        /// The name or number given.
        found: String,
        /// The nearest name.
        hint: String,
    },
    /// The name is taken.
    #[error("{node} cannot be named `{name}`: that is {other}")]
    DuplicateName {
        /// The node to be named.
        node: String,
        /// The name.
        name: String,
        /// The node that has it.
        other: String,
    },
    /// A route between types of which one does not convert to the other.
    #[error("cannot connect {from} ({from_type}) to {to} ({to_type}){reason}")]
    Unroutable {
        /// Source node and field.
        from: String,
        /// Its type.
        from_type: FieldType,
        /// Target node and field.
        to: String,
        /// Its type.
        to_type: FieldType,
        /// Why, if there is more to say.
        reason: &'static str,
    },
    /// The route exists.
    #[error("{from} is connected to {to} already")]
    DuplicateRoute {
        /// Source node and field.
        from: String,
        /// Target node and field.
        to: String,
    },
    /// Strong routes would form a loop.
    #[error("strong routes would form a loop: {loop_text}; make one of them weak, such as {weak}")]
    Loop {
        /// The routes of the loop, in order.
        loop_text: String,
        /// The route that closes it.
        weak: String,
    },
    /// A dependency for one frame that contradicts routes or other dependencies.
    #[error("{node} cannot be evaluated after {on} in this frame: {on} comes after it already")]
    Dependency {
        /// The node to be evaluated later.
        node: String,
        /// The node to be evaluated earlier.
        on: String,
    },
    /// Asked for inside of an evaluation, where it cannot be done.
    #[error("the graph is being evaluated: {what} must wait until the frame is over")]
    Evaluating {
        /// What was asked for.
        what: &'static str,
    },
}
