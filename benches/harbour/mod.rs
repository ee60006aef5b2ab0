//! The harbour with its bridge of seven channels, as the command opens it.

use glam::Vec2;
use std::path::Path;
use umbriel_scripts::World;

/// Pixels of a channel where an argument such as `1920x1080` says so.
pub(crate) fn size_in(argument: &str) -> Option<[u32; 2]> {
    let (width, height) = argument.split_once('x')?;
    Some([width.parse().ok()?, height.parse().ok()?])
}

/// The world after its first step, with so many pixels in a channel.
pub(crate) fn open(size: [u32; 2]) -> Result<World, Box<dyn std::error::Error>> {
    let mut world = World::load_file(Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/worlds/harbour.rhai"))?;
    world.step(0.0);
    let graph = world.graph_mut();
    let display = graph.find("bridge").ok_or("no bridge")?;
    graph.set_named(display, "size", Vec2::new(size[0] as f32, size[1] as f32))?;
    Ok(world)
}
