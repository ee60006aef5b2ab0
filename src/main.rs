//! The `umbriel` command.
fn main() {}
