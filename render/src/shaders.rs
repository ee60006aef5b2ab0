//! The shaders: each is a pass's own WGSL behind the snippets that it uses.

/// Name and parts of every shader; [`module`] joins them.
pub(crate) const ALL: &[(&str, &[&str])] =
    &[("surface", SURFACE), ("background", BACKGROUND), ("film", FILM), ("compose", COMPOSE), ("maps", MAPS), ("deform", DEFORM)];

pub(crate) const SURFACE: &[&str] = &[
    include_str!("shaders/position.wgsl"),
    include_str!("shaders/view.wgsl"),
    include_str!("shaders/instance.wgsl"),
    include_str!("shaders/material.wgsl"),
    include_str!("shaders/light.wgsl"),
    include_str!("shaders/brdf.wgsl"),
    include_str!("shaders/shadow_map.wgsl"),
    include_str!("surface.wgsl"),
];

pub(crate) const BACKGROUND: &[&str] = &[
    include_str!("shaders/view.wgsl"),
    include_str!("shaders/light.wgsl"),
    include_str!("shaders/fullscreen.wgsl"),
    include_str!("background.wgsl"),
];

pub(crate) const FILM: &[&str] = &[include_str!("shaders/fullscreen.wgsl"), include_str!("film.wgsl")];

pub(crate) const COMPOSE: &[&str] =
    &[include_str!("shaders/view.wgsl"), include_str!("shaders/fullscreen.wgsl"), include_str!("compose.wgsl")];

pub(crate) const MAPS: &[&str] = &[
    include_str!("shaders/position.wgsl"),
    include_str!("shaders/view.wgsl"),
    include_str!("shaders/instance.wgsl"),
    include_str!("shaders/material.wgsl"),
    include_str!("maps.wgsl"),
];

pub(crate) const DEFORM: &[&str] = &[include_str!("deform.wgsl")];

/// Compiles the joined parts.
pub(crate) fn module(device: &wgpu::Device, name: &str, parts: &[&str]) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(parts.concat().into()),
    })
}
