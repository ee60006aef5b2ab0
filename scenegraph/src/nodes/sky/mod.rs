//! Where sun and moon stand, and what light they and the weather make.

mod daylight;
mod ephemeris;
mod illumination;
mod place;

#[cfg(test)]
mod tests;

use umbriel_fields::NodeType;

pub(super) fn types() -> Vec<NodeType> {
    vec![ephemeris::node_type(), daylight::node_type()]
}
