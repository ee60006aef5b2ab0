//! The node types that worlds' dataflow is made of, one declaration each. Names and behaviour follow X3D 4 where X3D has the node.

mod blend;
mod chaser;
mod clock;
mod damper;
mod filter;
mod followed;
mod interpolator;
mod interval;
mod keys;
mod logic;
mod scheduler;
mod sequencer;
mod spline;
mod trigger;

#[cfg(test)]
mod tests;

use crate::NodeType;

/// Every node type of this crate, in the order of the manual.
pub fn builtin_types() -> Vec<NodeType> {
    [
        vec![clock::time_sensor(), scheduler::scheduler()],
        interpolator::types(),
        spline::types(),
        sequencer::types(),
        trigger::types(),
        logic::types(),
        vec![interval::interval_map()],
        damper::types(),
        chaser::types(),
        filter::types(),
    ]
    .into_iter()
    .flatten()
    .collect()
}
