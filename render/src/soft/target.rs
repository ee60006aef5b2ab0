//! The shadow texture of a view, shared by all views of its size and all their lights in turn.

use wgpu::TextureFormat;

/// Hard shadow and depth.
pub(super) const HARD_FORMAT: TextureFormat = TextureFormat::Rg32Float;
/// Share of the light that is hidden.
pub(super) const HIDDEN_FORMAT: TextureFormat = TextureFormat::R16Float;
/// Radius of the penumbra, metres.
pub(super) const RADIUS_FORMAT: TextureFormat = TextureFormat::R16Float;

/// Textures of one view.
pub(crate) struct SoftTarget {
    /// The view's depth and stencil, sample by sample, for reading.
    pub(super) depth: wgpu::TextureView,
    pub(super) stencil: wgpu::TextureView,
    pub(super) hard: wgpu::TextureView,
    pub(super) radius: wgpu::TextureView,
    pub(super) hidden: wgpu::TextureView,
}

impl SoftTarget {
    /// For a view that is drawn with this depth and stencil.
    pub(crate) fn new(device: &wgpu::Device, depth_stencil: &wgpu::Texture) -> SoftTarget {
        let size = wgpu::Extent3d { depth_or_array_layers: 1, ..depth_stencil.size() };
        let texture = |label, format| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let aspect = |aspect| depth_stencil.create_view(&wgpu::TextureViewDescriptor { aspect, ..Default::default() });
        SoftTarget {
            depth: aspect(wgpu::TextureAspect::DepthOnly),
            stencil: aspect(wgpu::TextureAspect::StencilOnly),
            hard: texture("hard shadow", HARD_FORMAT),
            radius: texture("penumbra radius", RADIUS_FORMAT),
            hidden: texture("soft shadow", HIDDEN_FORMAT),
        }
    }
}
