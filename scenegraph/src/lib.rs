//! Node types, importers and extraction into a flat scene.
