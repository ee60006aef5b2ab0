//! Loading glTF: sample models against their JSON, small models against what they must become, broken models.

mod broken;
mod mended;
mod motion;
mod nodes;
mod samples;
mod tiny;
