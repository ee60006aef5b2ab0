//! Bind group layouts that several passes share: 0 view, 1 instances, 2 material, 3 lighting.

use wgpu::{BindGroupLayout, BindGroupLayoutEntry, BindingType, ShaderStages};

/// The layouts, made once.
pub(crate) struct Layouts {
    pub(crate) view: BindGroupLayout,
    /// The view with the shadow texture of its one light.
    pub(crate) soft_view: BindGroupLayout,
    pub(crate) instances: BindGroupLayout,
    pub(crate) material: BindGroupLayout,
    pub(crate) lighting: BindGroupLayout,
    /// Group 1 of passes that read one picture.
    pub(crate) picture: BindGroupLayout,
    /// Group 1 of the film.
    pub(crate) film: BindGroupLayout,
}

impl Layouts {
    pub(crate) fn new(device: &wgpu::Device) -> Layouts {
        let fragment = ShaderStages::FRAGMENT;
        let mut material = vec![buffer(0, fragment, wgpu::BufferBindingType::Uniform)];
        for slot in 0..5 + umbriel_scene::Material::MOST_LAYERS as u32 {
            material.push(texture(1 + 2 * slot, wgpu::TextureSampleType::Float { filterable: true }));
            material.push(sampler(2 + 2 * slot, wgpu::SamplerBindingType::Filtering));
        }
        let read = wgpu::BufferBindingType::Storage { read_only: true };
        let mut maps = texture(3, wgpu::TextureSampleType::Depth);
        if let BindingType::Texture { view_dimension, .. } = &mut maps.ty {
            *view_dimension = wgpu::TextureViewDimension::D2Array;
        }
        let lighting = [
            buffer(0, ShaderStages::VERTEX_FRAGMENT, wgpu::BufferBindingType::Uniform),
            buffer(1, fragment, read),
            buffer(2, fragment, read),
            maps,
            sampler(4, wgpu::SamplerBindingType::NonFiltering),
            buffer(5, fragment, read),
            buffer(6, fragment, read),
            buffer(7, fragment, read),
        ];
        let unfiltered = wgpu::TextureSampleType::Float { filterable: false };
        let picture = BindGroupLayoutEntry { visibility: ShaderStages::VERTEX_FRAGMENT, ..texture(0, unfiltered) };
        let uniform = wgpu::BufferBindingType::Uniform;
        Layouts {
            view: layout(device, "view", &[buffer(0, ShaderStages::VERTEX_FRAGMENT, uniform)]),
            soft_view: layout(
                device,
                "view, soft shadow",
                &[buffer(0, ShaderStages::VERTEX_FRAGMENT, uniform), texture(1, unfiltered), texture(2, unfiltered)],
            ),
            instances: layout(device, "instances", &[buffer(0, ShaderStages::VERTEX, read)]),
            material: layout(device, "material", &material),
            lighting: layout(device, "lighting", &lighting),
            picture: layout(device, "picture", &[picture]),
            film: layout(device, "film", &[buffer(0, fragment, uniform)]),
        }
    }
}

fn layout(device: &wgpu::Device, label: &str, entries: &[BindGroupLayoutEntry]) -> BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
}

fn entry(binding: u32, visibility: ShaderStages, ty: BindingType) -> BindGroupLayoutEntry {
    BindGroupLayoutEntry { binding, visibility, ty, count: None }
}

fn buffer(binding: u32, visibility: ShaderStages, ty: wgpu::BufferBindingType) -> BindGroupLayoutEntry {
    entry(binding, visibility, BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None })
}

fn texture(binding: u32, sample_type: wgpu::TextureSampleType) -> BindGroupLayoutEntry {
    let view_dimension = wgpu::TextureViewDimension::D2;
    entry(binding, ShaderStages::FRAGMENT, BindingType::Texture { sample_type, view_dimension, multisampled: false })
}

fn sampler(binding: u32, kind: wgpu::SamplerBindingType) -> BindGroupLayoutEntry {
    entry(binding, ShaderStages::FRAGMENT, BindingType::Sampler(kind))
}
